//! Priors as files.

use std::path::Path;

use exr::prelude::f16;

use crate::error::Result;
use crate::files::write_atomic;

/// What `.flo` holds where the flow is unknown.
const UNKNOWN: [f32; 2] = [1e10; 2];

/// Writes optical flow as Middlebury's `.flo`; what is not finite is unknown.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) when the file cannot be written.
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
///
/// # Errors
/// As [`write_flow`].
pub fn write_flow_halves(path: &Path, flow: &[[f32; 2]], width: u32, height: u32) -> Result<()> {
    let header = npy_header("<f2", &format!("{height}, {width}, 2"));
    write_atomic(path, |to| {
        to.write_all(&header)?;
        flow.iter().try_for_each(|v| {
            let halves = v.map(f16::from_f32);
            let known = if halves.iter().all(|half| half.is_finite()) { halves } else { [f16::NAN; 2] };
            known.iter().try_for_each(|half| to.write_all(&half.to_le_bytes()))
        })
    })
}

/// Writes depth as a NumPy array of shape (height, width), little-endian f32.
///
/// # Errors
/// As [`write_flow`].
pub fn write_depth(path: &Path, depth: &[f32], width: u32, height: u32) -> Result<()> {
    let header = npy_header("<f4", &format!("{height}, {width}"));
    write_atomic(path, |to| {
        to.write_all(&header)?;
        depth.iter().try_for_each(|v| to.write_all(&v.to_le_bytes()))
    })
}

/// Writes depth as a NumPy array of shape (height, width), little-endian f16, where halves hold every value with their 11 bits: half the
/// bytes, and right to a two-thousandth. Else as [`write_depth`] does. What is not finite is NaN.
///
/// # Errors
/// As [`write_flow`].
pub fn write_depth_halves(path: &Path, depth: &[f32], width: u32, height: u32) -> Result<()> {
    let is_held = |v: &f32| {
        let size = v.abs();
        !size.is_finite() || size == 0.0 || (f16::MIN_POSITIVE.to_f32()..=f16::MAX.to_f32()).contains(&size)
    };
    if !depth.iter().all(is_held) {
        return write_depth(path, depth, width, height);
    }
    let header = npy_header("<f2", &format!("{height}, {width}"));
    write_atomic(path, |to| {
        to.write_all(&header)?;
        depth.iter().try_for_each(|v| {
            let half = if v.is_finite() { f16::from_f32(*v) } else { f16::NAN };
            to.write_all(&half.to_le_bytes())
        })
    })
}

/// What stands before the values of a NumPy array (version 1.0).
fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // The data begin at a multiple of 64 bytes; magic, version and length take ten, the newline one.
    let padding = (64 - (header.len() + 11) % 64) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    // At most 128: the numbers of the shape are short.
    let length = (header.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes()].concat()
}
