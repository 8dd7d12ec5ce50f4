//! The formats of a capture's files.

use crate::error::Result;
use crate::files::write_atomic;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use std::io::{self, Cursor};
use std::path::Path;

pub(super) fn bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic(path, |to| to.write_all(bytes))
}

pub(super) fn json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    write_atomic(path, |to| {
        serde_json::to_writer(&mut *to, value)?;
        writeln!(to)
    })
}

pub(super) fn png(path: &Path, pixels: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Result<()> {
    write_atomic(path, |to| PngEncoder::new(to).write_image(pixels, width, height, kind).map_err(io::Error::other))
}

/// Writes a WAV file of one channel, 16 bits, from samples in [-1, 1]; what lies beyond is clipped.
pub(super) fn wav(path: &Path, samples: &[f64], rate: u32) -> Result<()> {
    let spec =
        hound::WavSpec { channels: 1, sample_rate: rate, bits_per_sample: 16, sample_format: hound::SampleFormat::Int };
    let level = |sample: &f64| (sample.clamp(-1.0, 1.0) * 32_767.0).round() as i16;
    let encode = |to: &mut Cursor<Vec<u8>>| -> hound::Result<()> {
        let mut writer = hound::WavWriter::new(to, spec)?;
        samples.iter().try_for_each(|sample| writer.write_sample(level(sample)))?;
        writer.finalize()
    };
    write_atomic(path, |to| {
        let mut encoded = Cursor::new(Vec::new());
        encode(&mut encoded).map_err(io::Error::other)?;
        to.write_all(encoded.get_ref())
    })
}
