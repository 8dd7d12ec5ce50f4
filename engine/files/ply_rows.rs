//! The rows of a PLY file, one element after another, whatever their encoding.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::file::{cannot_read, open_file};
use super::ply_header::{Element, Encoding, Header, Scalar};
use crate::error::{Error, Result};

/// Bytes read at once from a binary file, rounded up to whole rows.
const BLOCK_BYTES: usize = 1 << 16;
/// Longest word of an ascii file; the longest f64 with a fraction has fewer characters in every printer we know.
const MAX_WORD_BYTES: usize = 512;

/// Where one property lies in a row as [`Rows::read`] hands it out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    offset: usize,
    scalar: Scalar,
}

impl Column {
    /// The plain property `name` of `element`; lists are not in the rows. `None` when there is no such property.
    pub fn find(element: &Element, name: &str) -> Option<Self> {
        let mut offset = 0;
        for property in element.properties.iter().filter(|property| property.list_length.is_none()) {
            if property.name == name {
                return Some(Column { offset, scalar: property.scalar });
            }
            offset += property.scalar.size();
        }
        None
    }

    pub fn is(&self, scalar: Scalar) -> bool {
        self.scalar == scalar
    }

    /// The value in `row`, rounded to f32. An f32 keeps its bits, NaN payloads included.
    pub fn f32(&self, row: &[u8]) -> f32 {
        match self.scalar {
            Scalar::F32 => f32::from_le_bytes(self.bytes(row)),
            _ => self.f64(row) as f32,
        }
    }

    pub fn f64(&self, row: &[u8]) -> f64 {
        self.scalar.f64(&row[self.offset..])
    }

    /// The value of a column that [`Column::is`] `U32`.
    pub fn u32(&self, row: &[u8]) -> u32 {
        u32::from_le_bytes(self.bytes(row))
    }

    /// The value of a column that [`Column::is`] `U8`.
    pub fn u8(&self, row: &[u8]) -> u8 {
        row[self.offset]
    }

    fn bytes<const N: usize>(&self, row: &[u8]) -> [u8; N] {
        std::array::from_fn(|i| row[self.offset + i])
    }
}

/// A PLY file whose header has been read and whose length fits it.
pub(crate) struct Rows {
    path: PathBuf,
    source: BufReader<File>,
    encoding: Encoding,
}

impl Rows {
    pub fn open(path: &Path) -> Result<(Header, Self)> {
        let file = open_file(path).map_err(|fault| cannot_read(path, &fault))?;
        let length = file.metadata().map_err(|fault| cannot_read(path, &fault))?.len();
        let mut source = BufReader::with_capacity(BLOCK_BYTES, file);
        let header = Header::read(path, &mut source)?;
        check_length(path, &header, length)?;
        Ok((header.clone(), Rows { path: path.to_owned(), source, encoding: header.encoding }))
    }

    /// Hands every row of `element`, the next in the file, to `take` as (row number, little-endian packed bytes).
    pub fn read(&mut self, element: &Element, mut take: impl FnMut(u32, &[u8])) -> Result<()> {
        let Some(row_size) = element.row_size() else {
            let place = format!("element `{}`", element.name);
            return Err(Error::data(&self.path, place, "has list properties", "export it with plain properties only"));
        };
        if row_size == 0 {
            return Ok(());
        }
        let rows_at_once = BLOCK_BYTES.div_ceil(row_size) as u64;
        let mut block = Vec::new();
        let mut row = 0;
        while row < element.count {
            let n = rows_at_once.min(element.count - row);
            block.clear();
            if self.encoding == Encoding::LittleEndian {
                self.read_block(element, row, n as usize * row_size, &mut block)?;
            } else {
                for row in row..row + n {
                    for property in &element.properties {
                        self.value(element, row, &property.name, property.scalar, &mut block)?;
                    }
                }
            }
            for (i, bytes) in block.chunks_exact(row_size).enumerate() {
                take((row + i as u64) as u32, bytes);
            }
            row += n;
        }
        Ok(())
    }

    /// Goes to row `first` of the first element; all its rows have `row_size` bytes.
    pub fn seek(&mut self, header: &Header, row_size: usize, first: u64) -> Result<()> {
        let to = SeekFrom::Start(header.size + first * row_size as u64);
        self.source.seek(to).map(drop).map_err(|fault| cannot_read(&self.path, &fault))
    }

    /// As [`Rows::read`] for an element with lists: `take` gets the row without lists, and the items of the list `name`.
    pub fn read_with_list(
        &mut self,
        element: &Element,
        name: &str,
        mut take: impl FnMut(u32, &[u8], &[f64]) -> Result<()>,
    ) -> Result<()> {
        let (mut plain, mut bytes, mut items) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..element.count {
            plain.clear();
            items.clear();
            for property in &element.properties {
                let Some(length) = property.list_length else {
                    self.value(element, row, &property.name, property.scalar, &mut plain)?;
                    continue;
                };
                let n = self.list_length(element, row, &property.name, length)?;
                if property.name != name {
                    self.skip_values(element, row, n, property.scalar)?;
                    continue;
                }
                for _ in 0..n {
                    bytes.clear();
                    self.value(element, row, name, property.scalar, &mut bytes)?;
                    items.push(property.scalar.f64(&bytes));
                }
            }
            take(row as u32, &plain, &items)?;
        }
        Ok(())
    }

    pub fn skip(&mut self, element: &Element) -> Result<()> {
        match element.row_size() {
            Some(_) => self.read(element, |_, _| {}),
            None => self.read_with_list(element, "", |_, _, _| Ok(())),
        }
    }

    /// Requires that nothing follows the last element.
    pub fn finish(mut self) -> Result<()> {
        let surplus = match self.encoding {
            Encoding::Ascii => self.word()?.is_some(),
            _ => !self.source.fill_buf().map_err(|fault| cannot_read(&self.path, &fault))?.is_empty(),
        };
        if surplus {
            return Err(Error::data(&self.path, "end of the file", "more data than the header declares", REMEDY));
        }
        Ok(())
    }

    fn read_block(&mut self, element: &Element, row: u64, n_bytes: usize, block: &mut Vec<u8>) -> Result<()> {
        let read = (&mut self.source).take(n_bytes as u64).read_to_end(block);
        let read = read.map_err(|fault| cannot_read(&self.path, &fault))?;
        if read < n_bytes { Err(self.ends_in(element, row)) } else { Ok(()) }
    }

    /// Appends the next value of the file as little-endian bytes.
    fn value(&mut self, element: &Element, row: u64, name: &str, scalar: Scalar, to: &mut Vec<u8>) -> Result<()> {
        let start = to.len();
        if self.encoding == Encoding::Ascii {
            let word = self.word()?.ok_or_else(|| self.ends_in(element, row))?;
            return scalar.push(&word, to).ok_or_else(|| {
                let place = format!("element `{}`, row {row}, property `{name}`", element.name);
                Error::data(&self.path, place, format!("`{}` is no {scalar:?} value", word.escape_debug()), REMEDY)
            });
        }
        self.read_block(element, row, scalar.size(), to)?;
        if self.encoding == Encoding::BigEndian {
            to[start..].reverse();
        }
        Ok(())
    }

    fn list_length(&mut self, element: &Element, row: u64, name: &str, scalar: Scalar) -> Result<u64> {
        let mut bytes = Vec::new();
        self.value(element, row, name, scalar, &mut bytes)?;
        let length = scalar.f64(&bytes);
        if length < 0.0 {
            let place = format!("element `{}`, row {row}", element.name);
            return Err(Error::data(&self.path, place, "a list's length is negative", REMEDY));
        }
        // Exact: a length is an integer of at most 32 bits.
        Ok(length as u64)
    }

    fn skip_values(&mut self, element: &Element, row: u64, n: u64, scalar: Scalar) -> Result<()> {
        if self.encoding == Encoding::Ascii {
            for _ in 0..n {
                self.word()?.ok_or_else(|| self.ends_in(element, row))?;
            }
            return Ok(());
        }
        let n_bytes = n * scalar.size() as u64;
        let skipped = std::io::copy(&mut (&mut self.source).take(n_bytes), &mut std::io::sink());
        let skipped = skipped.map_err(|fault| cannot_read(&self.path, &fault))?;
        if skipped < n_bytes { Err(self.ends_in(element, row)) } else { Ok(()) }
    }

    /// The next word of an ascii file, `None` at its end.
    fn word(&mut self) -> Result<Option<String>> {
        let mut word = Vec::new();
        loop {
            let buffer = self.source.fill_buf().map_err(|fault| cannot_read(&self.path, &fault))?;
            let Some(&byte) = buffer.first() else { break };
            self.source.consume(1);
            if !byte.is_ascii_whitespace() {
                word.push(byte);
            } else if !word.is_empty() {
                break;
            }
            if word.len() > MAX_WORD_BYTES {
                let reason = format!("a word of more than {MAX_WORD_BYTES} characters");
                return Err(Error::data(&self.path, "data", reason, REMEDY));
            }
        }
        Ok(if word.is_empty() { None } else { Some(String::from_utf8_lossy(&word).into_owned()) })
    }

    fn ends_in(&self, element: &Element, row: u64) -> Error {
        let place = format!("element `{}`, row {row}", element.name);
        let reason = format!("the file ends here, before row {}", element.count);
        Error::data(&self.path, place, reason, REMEDY)
    }
}

const REMEDY: &str = "the file is damaged: copy or export it again";

/// Refuses a file that cannot hold what its header promises, before anything is allocated for it.
fn check_length(path: &Path, header: &Header, length: u64) -> Result<()> {
    let present = length.saturating_sub(header.size);
    let mut least: u128 = 0;
    let mut exact = header.encoding != Encoding::Ascii;
    for element in &header.elements {
        let row: usize = match (header.encoding, element.row_size()) {
            // A digit and a separator for each value.
            (Encoding::Ascii, _) => 2 * element.properties.len(),
            (_, Some(size)) => size,
            (_, None) => {
                exact = false;
                element.properties.iter().map(|p| p.list_length.unwrap_or(p.scalar).size()).sum()
            }
        };
        least += u128::from(element.count) * row as u128;
    }
    // The last value of an ascii file needs no separator.
    let least = if header.encoding == Encoding::Ascii { least.saturating_sub(1) } else { least };
    if u128::from(present) < least || (exact && u128::from(present) > least) {
        let relation = if exact { "" } else { "at least " };
        let reason = format!("the header declares {relation}{least} bytes of data, the file has {present}");
        return Err(Error::data(path, "header", reason, REMEDY));
    }
    Ok(())
}
