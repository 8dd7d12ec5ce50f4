//! The header of a PLY file: what elements it holds and how their rows are laid out.

use std::collections::HashSet;
use std::io::{BufRead, Read};
use std::path::Path;

use super::file::cannot_read;
use crate::error::{Error, Result};

/// Of a header; those of 3DGS have about 1.5 KB, and some writers add comments.
const MAX_HEADER_BYTES: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Scalar::I8,
            "uchar" | "uint8" => Scalar::U8,
            "short" | "int16" => Scalar::I16,
            "ushort" | "uint16" => Scalar::U16,
            "int" | "int32" => Scalar::I32,
            "uint" | "uint32" => Scalar::U32,
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return None,
        })
    }

    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Property {
    pub name: String,
    /// Type of the value, or of a list's items.
    pub scalar: Scalar,
    /// Type of a list's length; `None` for a plain value.
    pub list_length: Option<Scalar>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary row, `None` when a list makes them vary.
    pub fn row_size(&self) -> Option<usize> {
        self.properties.iter().map(|p| if p.list_length.is_some() { None } else { Some(p.scalar.size()) }).sum()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// The `comment` lines that are UTF-8, single spaces between words.
    pub comments: Vec<String>,
    /// Bytes up to and including the line break after `end_header`.
    pub size: u64,
}

impl Header {
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// Reads a header and leaves `source` at the first byte of the data.
    pub fn read(path: &Path, source: &mut impl BufRead) -> Result<Self> {
        let mut lines = Lines { path, source: source.take(MAX_HEADER_BYTES), number: 0, size: 0 };
        if lines.next()? != ["ply"] {
            return Err(lines.fault("does not begin with `ply`", "give a PLY file"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut comments = Vec::new();
        loop {
            let words = lines.next()?;
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            match words[..] {
                ["comment", ref said @ ..] => comments.push(said.join(" ")),
                ["obj_info", ..] | [] => {}
                ["format", name, "1.0"] if encoding.is_none() => encoding = Some(lines.encoding(name)?),
                ["element", name, count] => elements.push(lines.element(&elements, name, count)?),
                ["property", "list", length, scalar, name] => {
                    let list_length = Some(lines.scalar(length)?);
                    lines.property(&mut elements, scalar, list_length, name)?;
                }
                ["property", scalar, name] => lines.property(&mut elements, scalar, None, name)?,
                ["end_header"] => break,
                _ => return Err(lines.fault("is not a line of a PLY 1.0 header", "export the file again")),
            }
        }
        let size = lines.size;
        let Some(encoding) = encoding else {
            return Err(Error::data(path, "header", "has no `format` line", "export the file again"));
        };
        for element in &elements {
            let mut seen = HashSet::new();
            if let Some(twice) = element.properties.iter().find(|p| !seen.insert(p.name.as_str())) {
                let place = format!("header, element `{}`, property `{}`", element.name, twice.name);
                return Err(Error::data(path, place, "is declared twice", "export the file again"));
            }
        }
        Ok(Header { encoding, elements, comments, size })
    }
}

struct Lines<'a, R> {
    path: &'a Path,
    source: R,
    number: usize,
    size: u64,
}

impl<R: BufRead> Lines<'_, R> {
    fn next(&mut self) -> Result<Vec<String>> {
        let mut line = Vec::new();
        let n = self.source.read_until(b'\n', &mut line).map_err(|fault| cannot_read(self.path, &fault))?;
        self.number += 1;
        self.size += n as u64;
        if line.last() != Some(&b'\n') {
            let reason =
                if self.size >= MAX_HEADER_BYTES { "the header is longer than 1 MiB" } else { "the file ends" };
            return Err(self.fault(&format!("{reason} before `end_header`"), "export the file again"));
        }
        match std::str::from_utf8(&line) {
            Ok(text) => Ok(text.split_ascii_whitespace().map(str::to_owned).collect()),
            // Comments may be in any encoding and carry no meaning.
            Err(_) if line.starts_with(b"comment") || line.starts_with(b"obj_info") => Ok(Vec::new()),
            Err(_) => Err(self.fault("is not text", "export the file again")),
        }
    }

    fn fault(&self, reason: &str, remedy: &str) -> Error {
        Error::data(self.path, format!("header line {}", self.number), reason, remedy)
    }

    fn encoding(&self, name: &str) -> Result<Encoding> {
        match name {
            "ascii" => Ok(Encoding::Ascii),
            "binary_little_endian" => Ok(Encoding::LittleEndian),
            "binary_big_endian" => Ok(Encoding::BigEndian),
            _ => Err(self.fault(&format!("`{name}` is no PLY encoding"), "use binary_little_endian")),
        }
    }

    fn scalar(&self, name: &str) -> Result<Scalar> {
        let unknown = || self.fault(&format!("`{name}` is no PLY type"), "use float, double or an integer type");
        Scalar::from_name(name).ok_or_else(unknown)
    }

    fn element(&self, before: &[Element], name: &str, count: &str) -> Result<Element> {
        if before.iter().any(|e| e.name == name) {
            return Err(self.fault(&format!("element `{name}` is declared twice"), "export the file again"));
        }
        match count.parse::<u64>() {
            Ok(count) if count <= u64::from(u32::MAX) => {
                Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
            }
            _ => Err(self.fault(&format!("`{count}` is no count from 0 to {}", u32::MAX), "export the file again")),
        }
    }

    fn property(&self, to: &mut [Element], scalar: &str, list_length: Option<Scalar>, name: &str) -> Result<()> {
        let scalar = self.scalar(scalar)?;
        if matches!(list_length, Some(Scalar::F32 | Scalar::F64)) {
            return Err(self.fault("a list's length must be an integer", "export the file again"));
        }
        match to.last_mut() {
            Some(element) => element.properties.push(Property { name: name.to_owned(), scalar, list_length }),
            None => return Err(self.fault("a property stands before any element", "export the file again")),
        }
        Ok(())
    }
}
