//! Priors as files.

use std::path::Path;

use exr::prelude::f16;

use crate::error::Result;
use crate::files::write_atomic;

/// What `.flo` holds where the flow is unknown.
const UNKNOWN: [f32; 2] = [1e10; 2];

/// Writes optical flow as Middlebury's `.flo`; what is not finite is unknown.
pub fn write_flow(path: &Path, flow: &[[f32; 2]], width: u32, height: u32) -> Result<()> {
    write_atomic(path, |to| {
        to.write_all(b"PIEH")?;
        to.write_all(&width.to_le_bytes())?;
        to.write_all(&height.to_le_bytes())?;
        flow.iter().try_for_each(|v| {
            let known = if v.iter().all(|v| v.is_finite()) { *v } else { UNKNOWN };
            known.iter().try_for_each(|v| to.write_all(&v.to_le_bytes()))
        })
    })
}

/// Writes optical flow as a NumPy array of shape (height, width, 2), little-endian f16: half the bytes, and right to a thirtieth of a
/// pixel below 64. What is not finite, or beyond what a half holds, is NaN.
pub fn write_flow_halves(path: &Path, flow: &[[f32; 2]], width: u32, height: u32) -> Result<()> {
    let known = |v: &[f32; 2]| {
        let halves = v.map(f16::from_f32);
        if halves.iter().all(|half| half.is_finite()) { halves } else { [f16::NAN; 2] }
    };
    write_npy(path, "<f2", &format!("{height}, {width}, 2"), flow.iter().flat_map(known).map(f16::to_le_bytes))
}

/// Writes depth as a NumPy array of shape (height, width), little-endian f32.
pub fn write_depth(path: &Path, depth: &[f32], width: u32, height: u32) -> Result<()> {
    write_npy(path, "<f4", &format!("{height}, {width}"), depth.iter().map(|v| v.to_le_bytes()))
}

/// Writes depth as a NumPy array of shape (height, width), little-endian f16, where halves hold every value with their 11 bits: half the
/// bytes, and right to a two-thousandth. Else as [`write_depth`]. What is not finite is NaN.
pub fn write_depth_halves(path: &Path, depth: &[f32], width: u32, height: u32) -> Result<()> {
    let is_held = |v: &f32| {
        let size = v.abs();
        !size.is_finite() || size == 0.0 || (f16::MIN_POSITIVE.to_f32()..=f16::MAX.to_f32()).contains(&size)
    };
    if !depth.iter().all(is_held) {
        return write_depth(path, depth, width, height);
    }
    let half = |v: &f32| if v.is_finite() { f16::from_f32(*v) } else { f16::NAN };
    write_npy(path, "<f2", &format!("{height}, {width}"), depth.iter().map(|v| half(v).to_le_bytes()))
}

fn write_npy<const N: usize>(
    path: &Path,
    kind: &str,
    shape: &str,
    mut values: impl Iterator<Item = [u8; N]>,
) -> Result<()> {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // The data begin at a multiple of 64 bytes; magic, version and length take ten, the newline one.
    let padding = (64 - (header.len() + 11) % 64) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    // At most 128: the numbers of the shape are short.
    let length = (header.len() as u16).to_le_bytes();
    write_atomic(path, |to| {
        to.write_all(b"\x93NUMPY\x01\x00")?;
        to.write_all(&length)?;
        to.write_all(header.as_bytes())?;
        values.try_for_each(|value| to.write_all(&value))
    })
}
