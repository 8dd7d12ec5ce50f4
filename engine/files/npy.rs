//! NumPy's `.npy` (NEP 1): arrays of little-endian floats in C order.

use std::io::{ErrorKind, Read};
use std::path::Path;

use exr::prelude::f16;

use super::archive::Archive;
use super::file::read_bytes;
use crate::error::{self, Error};

/// Longest header that is read; NumPy's own are a few hundred bytes.
const MAX_HEADER_BYTES: usize = 1 << 16;
const MAX_ARRAY_BYTES: u64 = 1 << 31;
const REMEDY: &str = "save the array again with numpy.savez";

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Float {
    F16,
    F32,
    F64,
}

impl Float {
    pub fn size(self) -> usize {
        match self {
            Float::F16 => 2,
            Float::F32 => 4,
            Float::F64 => 8,
        }
    }

    /// The entries of packed little-endian bytes; a rest that is shorter than an entry is ignored.
    pub fn values(self, bytes: &[u8]) -> impl Iterator<Item = f64> {
        bytes.chunks_exact(self.size()).map(move |entry| match self {
            Float::F16 => f16::from_le_bytes(fixed(entry)).into(),
            Float::F32 => f32::from_le_bytes(fixed(entry)).into(),
            Float::F64 => f64::from_le_bytes(fixed(entry)),
        })
    }
}

fn fixed<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes[i])
}

#[derive(Debug)]
pub(crate) struct Header {
    /// Extent along each axis, the slowest first.
    pub shape: Vec<usize>,
    pub float: Float,
    pub size: u64,
}

impl Header {
    /// Reads a header and leaves `from` at the first entry; or why it is refused.
    pub fn read(from: &mut impl Read) -> Result<Header, String> {
        let no_array = || "is no .npy array".to_owned();
        let mut start = [0; 8];
        read_exact(from, &mut start)?;
        if !start.starts_with(b"\x93NUMPY") {
            return Err(no_array());
        }
        let mut length = [0; 4];
        let n_length = match start[6] {
            1 => 2,
            2 | 3 => 4,
            _ => return Err(no_array()),
        };
        read_exact(from, &mut length[..n_length])?;
        let length = usize::try_from(u32::from_le_bytes(length)).map_err(|_| no_array())?;
        if length > MAX_HEADER_BYTES {
            return Err(format!("has a header of {length} bytes, at most {MAX_HEADER_BYTES} are allowed"));
        }
        let mut header = vec![0; length];
        read_exact(from, &mut header)?;
        let header = std::str::from_utf8(&header).map_err(|_| no_array())?;
        let field = |name: &str| header.split_once(name).map(|(_, rest)| rest.trim_start_matches([' ', ':', '\'']));
        if !field("'fortran_order'").is_some_and(|rest| rest.starts_with("False")) {
            return Err("is not in C order".to_owned());
        }
        let shape = field("'shape'").and_then(|rest| rest.strip_prefix('(')?.split_once(')')).ok_or_else(no_array)?.0;
        let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
        let shape: Vec<usize> = sides.map(|side| side.parse().map_err(|_| no_array())).collect::<Result<_, _>>()?;
        let float = match field("'descr'").map(|rest| rest.get(..3).unwrap_or_default()) {
            Some("<f2") => Float::F16,
            Some("<f4") => Float::F32,
            Some("<f8") => Float::F64,
            _ => return Err("is not of little-endian f16, f32 or f64".to_owned()),
        };
        Ok(Header { shape, float, size: (8 + n_length + length) as u64 })
    }
}

fn read_exact(from: &mut impl Read, to: &mut [u8]) -> Result<(), String> {
    from.read_exact(to).map_err(|fault| match fault.kind() {
        ErrorKind::UnexpectedEof => "is no .npy array".to_owned(),
        _ => format!("cannot be read: {fault}"),
    })
}

#[derive(Debug)]
pub(crate) struct Array {
    pub shape: Vec<usize>,
    /// Row-major; as many as the product of `shape`.
    pub values: Vec<f64>,
}

/// Reads the array `name` of an `.npz`, a zip archive of `.npy` files.
pub(crate) fn read_npz(path: &Path, name: &str) -> error::Result<Array> {
    let archive = Archive::open(path, REMEDY)?;
    let array = archive.read(&format!("{name}.npy"), MAX_ARRAY_BYTES).and_then(|content| Array::parse(&content));
    array.map_err(|reason| Error::data(path, format!("array `{name}`"), reason, REMEDY))
}

pub(crate) fn read_npy(path: &Path) -> error::Result<Array> {
    Array::parse(&read_bytes(path)?)
        .map_err(|reason| Error::data(path, "", reason, "save the array again with numpy.save"))
}

impl Array {
    fn parse(mut content: &[u8]) -> Result<Array, String> {
        let header = Header::read(&mut content)?;
        let shape = header.shape;
        let n_bytes = shape.iter().try_fold(header.float.size(), |n, side| n.checked_mul(*side));
        if n_bytes != Some(content.len()) {
            return Err(format!("has the shape {shape:?} and {} values", content.len() / header.float.size()));
        }
        Ok(Array { values: header.float.values(content).collect(), shape })
    }
}
