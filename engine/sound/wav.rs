//! WAV files: one channel in, at the engine's rate; several channels out.

use std::io::{BufReader, Cursor};
use std::path::Path;

use super::FS;
use super::sinc::Resampler;
use crate::error::{Error, Result};
use crate::files::{open_file, write_atomic};

/// Sample rates that are read, per second: those of sound. Far from them a change of rate needs weights without end.
const RATES: std::ops::RangeInclusive<u32> = 8_000..=400_000;

const REMEDY: &str = "give a WAV file of 16, 24 or 32 bits (ffmpeg -i IN -c:a pcm_s24le OUT.wav)";

/// Which channel of a recording is the microphone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The first one.
    #[default]
    Left,
    /// The second one.
    Right,
    /// The mean of the first two; capsules that stand apart comb.
    Mid,
}

/// A recording as it is in its file.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Samples per second.
    pub fs: u32,
    /// Samples by channel, full range 1.
    pub channels: Vec<Vec<f32>>,
}

/// Reads a WAV file of 8 to 32 bit integers or 32 bit floats, of 8,000 to 400,000 samples per second.
pub fn read(path: &Path) -> Result<Recording> {
    let file = open_file(path).map_err(|e| Error::data(path, "", format!("cannot be read: {e}"), REMEDY))?;
    decode(path, BufReader::new(file))
}

/// As [`read`], of a WAV file in memory; its errors name `path`.
pub fn decode(path: &Path, from: impl std::io::Read) -> Result<Recording> {
    let fault = |place: String, reason: String| Error::data(path, place, reason, REMEDY);
    let reader = hound::WavReader::new(from);
    let reader = reader.map_err(|e| fault(String::new(), format!("cannot be read: {e}")))?;
    let spec = reader.spec();
    let n_channels = usize::from(spec.channels);
    if n_channels == 0 {
        return Err(fault("header, field `channels`".into(), "it has no channel".into()));
    }
    if !RATES.contains(&spec.sample_rate) {
        let reason = format!("is {}, {} to {} is read", spec.sample_rate, RATES.start(), RATES.end());
        let remedy = "convert the file (ffmpeg -i IN -ar 48000 OUT.wav)";
        return Err(Error::data(path, "header, field `sample rate`", reason, remedy));
    }
    let full = 2f32.powi(i32::from(spec.bits_per_sample) - 1);
    let samples: std::result::Result<Vec<f32>, hound::Error> = match spec.sample_format {
        hound::SampleFormat::Float => reader.into_samples::<f32>().collect(),
        hound::SampleFormat::Int => reader.into_samples::<i32>().map(|value| Ok(value? as f32 / full)).collect(),
    };
    let samples = samples.map_err(|e| fault(String::new(), format!("its samples cannot be read: {e}")))?;
    if samples.len() < n_channels {
        return Err(fault(String::new(), "it holds no samples".into()));
    }
    if let Some(at) = samples.iter().position(|value| !value.is_finite()) {
        return Err(fault(format!("sample {}", at / n_channels), "its value is not finite".into()));
    }
    let channel = |k: usize| samples.iter().skip(k).step_by(n_channels).copied().collect();
    Ok(Recording { fs: spec.sample_rate, channels: (0..n_channels).map(channel).collect() })
}

/// One channel of a WAV file at 48 kHz, where sample 0 is the time 0 and the file begins at `offset` seconds.
pub fn read_channel(path: &Path, channel: Channel, offset: f64) -> Result<Vec<f32>> {
    let recording = read(path)?;
    let samples = match (channel, recording.channels.as_slice()) {
        (_, [only]) | (Channel::Left, [only, ..]) | (Channel::Right, [_, only, ..]) => only.clone(),
        (Channel::Mid, [left, right, ..]) => left.iter().zip(right).map(|(l, r)| 0.5 * (l + r)).collect(),
        (_, []) => Vec::new(),
    };
    Ok(Resampler::new(recording.fs, FS, offset).apply(&samples))
}

/// How samples are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// 24 bit integers, rounded to the nearest, clipped at the full range.
    #[default]
    Int24,
    /// 16 bit integers, the same.
    Int16,
    /// 32 bit floats.
    Float32,
}

/// Writes frames of `N` channels at 48 kHz, atomically.
pub fn write<const N: usize>(path: impl AsRef<Path>, frames: &[[f32; N]], depth: Depth) -> Result<()> {
    let path = path.as_ref();
    let count = frames.as_flattened().iter().filter(|value| !value.is_finite()).count() as u64;
    if count > 0 {
        let remedy = "look for them in the recordings and the ears' responses that it is made of";
        return Err(Error::NonFinite { what: format!("the sound of {}", path.display()), count, remedy });
    }
    let bytes = encode(frames, depth).map_err(|e| {
        Error::data(path, "", format!("cannot be encoded: {e}"), "a WAV file holds at most 4 GiB: render in parts")
    })?;
    write_atomic(path, |to| to.write_all(&bytes))
}

pub(super) fn encode<const N: usize>(frames: &[[f32; N]], depth: Depth) -> std::result::Result<Vec<u8>, hound::Error> {
    let (bits_per_sample, sample_format) = match depth {
        Depth::Int24 => (24, hound::SampleFormat::Int),
        Depth::Int16 => (16, hound::SampleFormat::Int),
        Depth::Float32 => (32, hound::SampleFormat::Float),
    };
    let spec = hound::WavSpec { channels: N as u16, sample_rate: FS, bits_per_sample, sample_format };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec)?;
    for value in frames.as_flattened() {
        match depth {
            Depth::Int24 => writer.write_sample(integer(*value, 24))?,
            Depth::Int16 => writer.write_sample(integer(*value, 16))?,
            Depth::Float32 => writer.write_sample(*value)?,
        }
    }
    writer.finalize()?;
    Ok(bytes.into_inner())
}

/// The nearest integer of so many bits; the full range is 1.
pub fn integer(value: f32, bits: u32) -> i32 {
    let full = f64::from(1 << (bits - 1));
    (f64::from(value) * full).round().clamp(-full, full - 1.0) as i32
}
