//! What other programs estimated from the images (SPEC 8): optical flow and monocular depth.

mod layers;
mod levels;
mod packed;
mod write;

pub use write::{write_depth, write_depth_halves, write_flow, write_flow_halves};

use std::path::Path;

use crate::error::{Error, Result};

/// Extensions of flow files, as they are looked for.
pub(super) const FLOW_EXTENSIONS: [&str; 4] = ["flo", "npy", "exr", "png"];
/// Extensions of depth files, as they are looked for.
pub(super) const DEPTH_EXTENSIONS: [&str; 4] = ["png", "npy", "exr", "pfm"];

/// Reads the optical flow from a frame to the next, pixels, (x, y) with y down: row by row, top first. A pixel without a
/// value is (NaN, NaN).
///
/// By extension: `.flo` (Middlebury; beyond 1e9 is unknown), `.npy` (shape [H, W, 2], f16, f32 or f64), `.exr` (the first
/// pair present of `flow.X flow.Y`, `u v`, `U V`, `X Y`, `R G`), `.png` (KITTI: 16 bits, `(level - 2^15) / 64`, blue 0
/// where unknown).
///
/// # Errors
/// [`Error::Data`] when the file cannot be read, is damaged, of another kind, or not of `width` x `height` pixels.
pub fn read_flow(path: &Path, width: u32, height: u32) -> Result<Vec<[f32; 2]>> {
    read(path, width, height)
}

/// Reads a depth prior in the units of its file, row by row, top first. A pixel without a value is NaN.
///
/// By extension: `.png` (levels of 8 or 16 bits, grey; 0 is unknown), `.npy` (shape [H, W], f16, f32 or f64), `.exr` (the
/// first channel present of `depth.Z`, `Z`, `depth`, `Y`, `R`), `.pfm` (one channel, either byte order).
///
/// # Errors
/// As [`read_flow`].
pub fn read_depth(path: &Path, width: u32, height: u32) -> Result<Vec<f32>> {
    Ok(read::<1>(path, width, height)?.into_flattened())
}

/// Width and height of a flow file, from its header and its length alone.
pub(super) fn flow_size(path: &Path) -> Result<(u32, u32)> {
    Ok(Header::read::<2>(path)?.size)
}

/// Width and height of a depth file, likewise.
pub(super) fn depth_size(path: &Path) -> Result<(u32, u32)> {
    Ok(Header::read::<1>(path)?.size)
}

/// A file whose header has been read and believed.
struct Header {
    size: (u32, u32),
    body: Body,
}

enum Body {
    Packed(packed::Layout),
    Layers(layers::Channels),
    Levels,
}

impl Header {
    /// Reads the header of a prior of `N` channels.
    fn read<const N: usize>(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        let (size, body) = match (extension.as_deref(), N) {
            (Some("flo"), 2) => packed::flo(path).map(|(size, layout)| (size, Body::Packed(layout))),
            (Some("pfm"), 1) => packed::pfm(path).map(|(size, layout)| (size, Body::Packed(layout))),
            (Some("npy"), _) => packed::npy(path, N).map(|(size, layout)| (size, Body::Packed(layout))),
            (Some("exr"), _) => layers::header(path, N).map(|(size, channels)| (size, Body::Layers(channels))),
            (Some("png"), _) => levels::header(path, N).map(|size| (size, Body::Levels)),
            _ => {
                let known = if N == 2 { FLOW_EXTENSIONS } else { DEPTH_EXTENSIONS };
                Err(Error::data(path, "", "has no known extension", format!("give one of {}", known.join(", "))))
            }
        }?;
        Ok(Header { size, body })
    }
}

fn read<const N: usize>(path: &Path, width: u32, height: u32) -> Result<Vec<[f32; N]>> {
    let Header { size, body } = Header::read::<N>(path)?;
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
