//! Priors as files.

use std::path::Path;

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

/// Writes depth as a NumPy array (version 1.0) of shape (height, width), little-endian f32.
///
/// # Errors
/// As [`write_flow`].
pub fn write_depth(path: &Path, depth: &[f32], width: u32, height: u32) -> Result<()> {
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    // The data begin at a multiple of 64 bytes; magic, version and length take ten, the newline one.
    let padding = (64 - (header.len() + 11) % 64) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    write_atomic(path, |to| {
        to.write_all(b"\x93NUMPY\x01\x00")?;
        // At most 128: the numbers of the shape are short.
        to.write_all(&(header.len() as u16).to_le_bytes())?;
        to.write_all(header.as_bytes())?;
        depth.iter().try_for_each(|v| to.write_all(&v.to_le_bytes()))
    })
}
