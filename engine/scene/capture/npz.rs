//! One array of NumPy's `.npz`: a zip archive of `.npy` files.

use std::path::Path;

use crate::error::{self, Error};
use crate::files::archive::Archive;
use crate::files::npy::Header;
use crate::files::read_bytes;

const REMEDY: &str = "save the array again with numpy.savez";
const MAX_BYTES: u64 = 1 << 31;

#[derive(Debug)]
pub(crate) struct Array {
    pub shape: Vec<usize>,
    /// Row-major; as many as the product of `shape`.
    pub values: Vec<f64>,
}

/// Reads the array `name` of little-endian floats in C order.
pub(super) fn read(path: &Path, name: &str) -> error::Result<Array> {
    let archive = Archive::open(path, REMEDY)?;
    let array = archive.read(&format!("{name}.npy"), MAX_BYTES).and_then(|content| parse(&content));
    array.map_err(|reason| Error::data(path, format!("array `{name}`"), reason, REMEDY))
}

/// Reads a `.npy` file of little-endian f32 or f64 in C order.
pub(crate) fn read_npy(path: &Path) -> error::Result<Array> {
    parse(&read_bytes(path)?).map_err(|reason| Error::data(path, "", reason, "save the array again with numpy.save"))
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
