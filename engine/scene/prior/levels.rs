//! Priors as PNG: KITTI's flow, and depth in grey levels.

use std::path::Path;

use image::{ColorType, DynamicImage, ImageDecoder};

use crate::error::{Error, Result};
use crate::scene::capture::header::{BROKEN, DECODER_SLACK, decoder_of, guarded, read_size};

/// Bytes of the widest pixel, 16 bits of three channels.
const MAX_PIXEL_BYTES: u64 = 6;

pub(super) fn header(path: &Path, channels: usize) -> Result<(u32, u32)> {
    let size = read_size(path)?;
    let color = guarded(path, || Ok(decoder_of(path, DECODER_SLACK)?.color_type()))?;
    let (wanted, fits) = match channels {
        2 => ("16 bits of red, green and blue (KITTI)", color == ColorType::Rgb16),
        _ => ("8 or 16 bits of grey", [ColorType::L8, ColorType::L16].contains(&color)),
    };
    if !fits {
        let reason = format!("has pixels of the type {color:?}, not {wanted}");
        return Err(Error::data(path, "", reason, "write the values themselves, not a picture of them"));
    }
    Ok(size)
}

/// Decodes a PNG that [`header`] has accepted.
pub(super) fn read<const N: usize>(path: &Path) -> Result<Vec<[f32; N]>> {
    let (width, height) = read_size(path)?;
    let max_bytes = MAX_PIXEL_BYTES * u64::from(width) * u64::from(height) + DECODER_SLACK;
    let image = guarded(path, || Ok(DynamicImage::from_decoder(decoder_of(path, max_bytes)?)))?;
    let image = image.map_err(|cause| Error::data(path, "", format!("does not decode: {cause}"), BROKEN))?;
    let flow = |level: u16| (f32::from(level) - 32_768.0) / 64.0;
    let depth = |level: u16| if level == 0 { f32::NAN } else { level.into() };
    Ok(match image {
        DynamicImage::ImageRgb16(image) => {
            let known = |pixel: &[u16; 3]| pixel[2] != 0;
            let value =
                |pixel: &[u16; 3]| if known(pixel) { std::array::from_fn(|k| flow(pixel[k])) } else { [f32::NAN; N] };
            image.as_raw().as_chunks().0.iter().map(value).collect()
        }
        DynamicImage::ImageLuma8(image) => image.as_raw().iter().map(|&level| [depth(level.into()); N]).collect(),
        other => other.into_luma16().as_raw().iter().map(|&level| [depth(level); N]).collect(),
    })
}
