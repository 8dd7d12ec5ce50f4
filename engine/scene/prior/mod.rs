//! Estimates of other programs from the images (SPEC 8): optical flow and monocular depth.

mod layers;
mod levels;
mod packed;
mod write;

pub use write::{write_depth, write_depth_halves, write_flow, write_flow_halves};

use std::path::Path;

use crate::error::{Error, Result};

pub(super) const FLOW_EXTENSIONS: [&str; 4] = ["flo", "npy", "exr", "png"];
pub(super) const DEPTH_EXTENSIONS: [&str; 4] = ["png", "npy", "exr", "pfm"];

/// Reads the optical flow from a frame to the next, pixels, (x, y) with y down: row by row, top first. A pixel without a value is
/// (NaN, NaN).
///
/// By extension: `.flo` (Middlebury; beyond 1e9 is unknown), `.npy` (shape [H, W, 2], f16, f32 or f64), `.exr` (the first pair present of
/// `flow.X flow.Y`, `u v`, `U V`, `X Y`, `R G`), `.png` (KITTI: 16 bits, `(level - 2^15) / 64`, blue 0 where unknown).
pub fn read_flow(path: &Path, width: u32, height: u32) -> Result<Vec<[f32; 2]>> {
    read(path, width, height)
}

/// Reads a depth prior in the units of its file, row by row, top first. A pixel without a value is NaN.
///
/// By extension: `.png` (levels of 8 or 16 bits, grey; 0 is unknown), `.npy` (shape [H, W], f16, f32 or f64), `.exr` (the first channel
/// present of `depth.Z`, `Z`, `depth`, `Y`, `R`), `.pfm` (one channel, either byte order).
pub fn read_depth(path: &Path, width: u32, height: u32) -> Result<Vec<f32>> {
    Ok(read::<1>(path, width, height)?.into_flattened())
}

/// Width and height, from the header and the length of the file alone.
pub(super) fn flow_size(path: &Path) -> Result<(u32, u32)> {
    Ok(header::<2>(path)?.0)
}

pub(super) fn depth_size(path: &Path) -> Result<(u32, u32)> {
    Ok(header::<1>(path)?.0)
}

enum Body {
    Packed(packed::Layout),
    Layers(layers::Channels),
    Levels,
}

/// Size and body of a file of `N` channels.
fn header<const N: usize>(path: &Path) -> Result<((u32, u32), Body)> {
    let packed = |(size, layout)| (size, Body::Packed(layout));
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match (extension.as_deref(), N) {
        (Some("flo"), 2) => packed::flo(path).map(packed),
        (Some("pfm"), 1) => packed::pfm(path).map(packed),
        (Some("npy"), _) => packed::npy(path, N).map(packed),
        (Some("exr"), _) => layers::header(path, N).map(|(size, channels)| (size, Body::Layers(channels))),
        (Some("png"), _) => levels::header(path, N).map(|size| (size, Body::Levels)),
        _ => {
            let known = if N == 2 { FLOW_EXTENSIONS } else { DEPTH_EXTENSIONS };
            Err(Error::data(path, "", "has no known extension", format!("give one of {}", known.join(", "))))
        }
    }
}

fn read<const N: usize>(path: &Path, width: u32, height: u32) -> Result<Vec<[f32; N]>> {
    let (size, body) = header::<N>(path)?;
    // Before anything of the size that the file claims is allocated.
    if size != (width, height) {
        let reason = format!("is {} x {}, its camera is {width} x {height}", size.0, size.1);
        return Err(Error::data(path, "", reason, "give a prior of the size of the images"));
    }
    let mut pixels: Vec<[f32; N]> = match body {
        Body::Packed(layout) => packed::read(path, size, layout)?,
        Body::Layers(channels) => layers::read(path, size, channels)?,
        Body::Levels => levels::read(path)?,
    };
    // Middlebury's "unknown" is beyond 1e9 in either channel; infinity is PFM's.
    let unknown = |v: &f32| !v.is_finite() || N == 2 && v.abs() > 1e9;
    for pixel in pixels.iter_mut().filter(|pixel| pixel.iter().any(unknown)) {
        *pixel = [f32::NAN; N];
    }
    Ok(pixels)
}
