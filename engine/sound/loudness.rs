//! How loud a sound is: EBU R 128, and the one gain that all of it gets.

use std::path::Path;

use ebur128::{EbuR128, Mode};

use super::FS;
use crate::error::{Error, Result};

/// True peaks are kept below this, dBTP (EBU R 128 for programmes).
pub const PEAK_LIMIT_DB: f64 = -1.0;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Loudness {
    /// Integrated loudness, LUFS; none for silence.
    pub lufs: Option<f64>,
    /// Highest true peak of all channels, dBTP; none for silence.
    pub true_peak_db: Option<f64>,
}

/// Measures frames at 48 kHz.
///
/// # Errors
/// [`Error::Data`] where the meter refuses the frames.
pub fn measure(frames: &[[f32; 2]]) -> Result<Loudness> {
    let meter = || -> std::result::Result<Loudness, ebur128::Error> {
        let mut meter = EbuR128::new(2, FS, Mode::I | Mode::TRUE_PEAK)?;
        meter.add_frames_f32(frames.as_flattened())?;
        let peak = meter.true_peak(0)?.max(meter.true_peak(1)?);
        Ok(Loudness {
            lufs: Some(meter.loudness_global()?).filter(|value| value.is_finite()),
            true_peak_db: Some(20.0 * peak.log10()).filter(|value| value.is_finite()),
        })
    };
    meter()
        .map_err(|e| Error::data(Path::new("rendered sound"), "", format!("loudness: {e}"), "check the input's level"))
}

/// The gain in decibels that brings a sound to `target` LUFS (none: leaves it), and no higher than its peaks allow.
pub fn gain_db(measured: &Loudness, target: Option<f64>) -> f64 {
    let wanted = target.zip(measured.lufs).map_or(0.0, |(target, lufs)| target - lufs);
    measured.true_peak_db.map_or(0.0, |peak| wanted.min(PEAK_LIMIT_DB - peak))
}
