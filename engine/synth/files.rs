//! The formats that the capture is written in, each file at once.

use crate::error::Result;
use crate::files::write_atomic;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
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

/// Writes an OpenEXR image of f32 channels, losslessly compressed.
pub(super) fn exr(path: &Path, channels: Vec<(&str, Vec<f32>)>, width: u32, height: u32) -> Result<()> {
    let channels = channels.into_iter().map(|(name, values)| AnyChannel::new(name, FlatSamples::F32(values)));
    let channels = AnyChannels::sort(channels.collect());
    let size = (width as usize, height as usize);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    // The encoder seeks back to fill in its offset table, which the destination cannot.
    let mut encoded = Cursor::new(Vec::new());
    let done = Image::from_layer(layer).write().non_parallel().to_buffered(&mut encoded);
    write_atomic(path, |to| {
        done.map_err(io::Error::other)?;
        to.write_all(encoded.get_ref())
    })
}

/// Writes a WAV file of one channel, 16 bits, from samples in [-1, 1]; what lies beyond is clipped.
pub(super) fn wav(path: &Path, samples: &[f64], rate: u32) -> Result<()> {
    let spec =
        hound::WavSpec { channels: 1, sample_rate: rate, bits_per_sample: 16, sample_format: hound::SampleFormat::Int };
    let mut encoded = Cursor::new(Vec::new());
    let encode = |to: &mut Cursor<Vec<u8>>| -> hound::Result<()> {
        let mut writer = hound::WavWriter::new(to, spec)?;
        let level = |sample: &f64| (sample.clamp(-1.0, 1.0) * 32_767.0).round() as i16;
        samples.iter().try_for_each(|sample| writer.write_sample(level(sample)))?;
        writer.finalize()
    };
    let done = encode(&mut encoded);
    write_atomic(path, |to| {
        done.map_err(io::Error::other)?;
        to.write_all(encoded.get_ref())
    })
}
