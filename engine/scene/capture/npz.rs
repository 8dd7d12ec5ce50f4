//! One array of NumPy's `.npz`: a zip archive (APPNOTE 6.3.10) of `.npy` files.

use std::io::Read;
use std::path::Path;

use flate2::read::DeflateDecoder;

use crate::error::{self, Error};
use crate::scene::file::read_bytes;
use crate::scene::npy::Header;

const REMEDY: &str = "save the array again with numpy.savez";
/// Most bytes of an array.
const MAX_BYTES: usize = 1 << 31;
/// Longest comment of an archive, bytes; the end record lies before it.
const MAX_COMMENT: usize = 65_535;

/// A floating-point array.
#[derive(Debug)]
pub(crate) struct Array {
    pub shape: Vec<usize>,
    /// Row-major; as many as the product of `shape`.
    pub values: Vec<f64>,
}

/// Reads the array `name` of little-endian floats in C order.
///
/// # Errors
/// [`Error::Data`] when the archive is damaged or encrypted, holds no such array or one of another type.
pub(super) fn read(path: &Path, name: &str) -> error::Result<Array> {
    let bytes = read_bytes(path)?;
    let array = entry(&bytes, &format!("{name}.npy")).and_then(|content| parse(&content));
    array.map_err(|reason| Error::data(path, format!("array `{name}`"), reason, REMEDY))
}

/// Reads a `.npy` file of little-endian f32 or f64 in C order.
///
/// # Errors
/// [`Error::Data`] when it is damaged or of another type.
pub(crate) fn read_npy(path: &Path) -> error::Result<Array> {
    parse(&read_bytes(path)?).map_err(|reason| Error::data(path, "", reason, "save the array again with numpy.save"))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?).into())
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?)).ok()
}

/// The content of a file of the archive, found through the central directory.
fn entry(bytes: &[u8], name: &str) -> Result<Vec<u8>, String> {
    let damaged = || "the archive is damaged".to_owned();
    let first = bytes.len().saturating_sub(22 + MAX_COMMENT);
    let end = (first..=bytes.len().saturating_sub(22)).rev().find(|&at| bytes[at..].starts_with(b"PK\x05\x06"));
    let end = end.ok_or_else(|| "is no zip archive".to_owned())?;
    let n = u16_at(bytes, end + 10).ok_or_else(damaged)?;
    let mut at = u32_at(bytes, end + 16).ok_or_else(damaged)?;
    for _ in 0..n {
        let field16 = |offset: usize| u16_at(bytes, at + offset).ok_or_else(damaged);
        let field32 = |offset: usize| u32_at(bytes, at + offset).ok_or_else(damaged);
        if !bytes.get(at..).is_some_and(|rest| rest.starts_with(b"PK\x01\x02")) {
            return Err(damaged());
        }
        let name_length = field16(28)?;
        let found = bytes.get(at + 46..at + 46 + name_length).ok_or_else(damaged)?;
        if found == name.as_bytes() {
            let (method, packed, size, local) = (field16(10)?, field32(20)?, field32(24)?, field32(42)?);
            let lengths = u16_at(bytes, local + 26).zip(u16_at(bytes, local + 28));
            let start = local + 30 + lengths.map(|(name, extra)| name + extra).ok_or_else(damaged)?;
            let content = bytes.get(start..).and_then(|rest| rest.get(..packed)).ok_or_else(damaged)?;
            return unpack(content, method, size);
        }
        at += 46 + name_length + field16(30)? + field16(32)?;
    }
    Err("is not in the archive".to_owned())
}

fn unpack(content: &[u8], method: usize, size: usize) -> Result<Vec<u8>, String> {
    if size > MAX_BYTES {
        return Err(format!("has {size} bytes, at most {MAX_BYTES} are allowed"));
    }
    match method {
        0 => Ok(content.to_vec()),
        8 => {
            let mut unpacked = Vec::new();
            let read = DeflateDecoder::new(content).take(size as u64 + 1).read_to_end(&mut unpacked);
            read.map_err(|fault| format!("does not inflate: {fault}"))?;
            if unpacked.len() == size {
                Ok(unpacked)
            } else {
                Err(format!("does not inflate to the {size} bytes that the archive says"))
            }
        }
        other => Err(format!("is compressed by the method {other}; only 0 and 8 are read")),
    }
}

fn parse(mut content: &[u8]) -> Result<Array, String> {
    let header = Header::read(&mut content)?;
    let shape = header.shape;
    let n_bytes = shape.iter().try_fold(header.float.size(), |n, side| n.checked_mul(*side));
    if n_bytes != Some(content.len()) {
        return Err(format!("has the shape {shape:?} and {} values", content.len() / header.float.size()));
    }
    Ok(Array { values: header.float.values(content).collect(), shape })
}
