//! How loud a sound is: EBU R 128, and the one gain that all of it gets.

use std::path::Path;

use ebur128::{EbuR128, Mode};

use super::FS;
use crate::error::{Error, Result};

/// True peaks are kept below this, dBTP (EBU R 128 for programmes).
pub const PEAK_LIMIT_DB: f64 = -1.0;

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Loudness {
    /// Integrated loudness, LUFS; none for silence.
    pub lufs: Option<f64>,
    /// Highest true peak of all channels, dBTP; none for silence.
    pub true_peak_db: Option<f64>,
}

/// Measures frames at 48 kHz.
pub fn measure(frames: &[[f32; 2]]) -> Result<Loudness> {
    let lufs = || {
        let mut meter = EbuR128::new(2, FS, Mode::I)?;
        meter.add_frames_f32(frames.as_flattened())?;
        meter.loudness_global()
    };
    let lufs = Some(lufs().map_err(refused)?).filter(|value| value.is_finite());
    Ok(Loudness { lufs, true_peak_db: true_peak_db(frames)? })
}

/// The highest true peak of all channels, dBTP; none for silence. Frames are at 48 kHz.
pub fn true_peak_db<const N: usize>(frames: &[[f32; N]]) -> Result<Option<f64>> {
    let peak = || {
        let mut meter = EbuR128::new(N as u32, FS, Mode::TRUE_PEAK)?;
        meter.add_frames_f32(frames.as_flattened())?;
        (0..N as u32).try_fold(0.0, |peak: f64, channel| Ok(peak.max(meter.true_peak(channel)?)))
    };
    Ok(Some(20.0 * peak().map_err(refused)?.log10()).filter(|value| value.is_finite()))
}

fn refused(fault: ebur128::Error) -> Error {
    Error::data(Path::new("rendered sound"), "", format!("loudness: {fault}"), "check the input's level")
}

pub fn amplify<const N: usize>(frames: &mut [[f32; N]], gain_db: f64) {
    let scale = 10f64.powf(gain_db / 20.0) as f32;
    frames.as_flattened_mut().iter_mut().for_each(|value| *value *= scale);
}

/// The gain in decibels that brings a sound to `target` LUFS (none: leaves it), and no higher than its peaks allow.
pub fn gain_db(measured: &Loudness, target: Option<f64>) -> f64 {
    let wanted = target.zip(measured.lufs).map_or(0.0, |(target, lufs)| target - lufs);
    measured.true_peak_db.map_or(0.0, |peak| wanted.min(PEAK_LIMIT_DB - peak))
}
