//! The header of a PLY file: what elements it holds and how their rows are laid out.

use std::collections::HashSet;
use std::io::{BufRead, Read};
use std::path::Path;

use super::file::cannot_read;
use crate::error::{Error, Result};

/// Longest header. 3DGS writes about 1.5 KB, and some writers add comments.
const MAX_HEADER_BYTES: u64 = 1 << 20;
const EXPORT: &str = "export the file again";

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The scalar types of PLY: in Rust, and by their two names.
macro_rules! scalars {
    ($($scalar:ident $of:ty: $name:literal $sized:literal;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub(crate) enum Scalar {
            $($scalar,)*
        }

        impl Scalar {
            fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name | $sized => Some(Scalar::$scalar),)*
                    _ => None,
                }
            }

            /// Bytes in the binary encodings.
            pub fn size(self) -> usize {
                match self {
                    $(Scalar::$scalar => size_of::<$of>(),)*
                }
            }

            /// The value at the beginning of little-endian bytes; every type fits.
            pub fn f64(self, bytes: &[u8]) -> f64 {
                match self {
                    $(Scalar::$scalar => <$of>::from_le_bytes(std::array::from_fn(|i| bytes[i])).into(),)*
                }
            }

            /// Appends the value that `word` spells as little-endian bytes; `None` when it spells none of this type.
            pub fn push(self, word: &str, to: &mut Vec<u8>) -> Option<()> {
                match self {
                    $(Scalar::$scalar => to.extend(word.parse::<$of>().ok()?.to_le_bytes()),)*
                }
                Some(())
            }
        }
    };
}

scalars! {
    I8 i8: "char" "int8";
    U8 u8: "uchar" "uint8";
    I16 i16: "short" "int16";
    U16 u16: "ushort" "uint16";
    I32 i32: "int" "int32";
    U32 u32: "uint" "uint32";
    F32 f32: "float" "float32";
    F64 f64: "double" "float64";
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
        self.properties.iter().map(|p| p.list_length.is_none().then(|| p.scalar.size())).sum()
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
            return Err(lines.fault_with("does not begin with `ply`", "give a PLY file"));
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
                _ => return Err(lines.fault("is not a line of a PLY 1.0 header")),
            }
        }
        let size = lines.size;
        let Some(encoding) = encoding else {
            return Err(Error::data(path, "header", "has no `format` line", EXPORT));
        };
        for element in &elements {
            let mut seen = HashSet::new();
            if let Some(twice) = element.properties.iter().find(|p| !seen.insert(p.name.as_str())) {
                let place = format!("header, element `{}`, property `{}`", element.name, twice.name);
                return Err(Error::data(path, place, "is declared twice", EXPORT));
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
            return Err(self.fault(&format!("{reason} before `end_header`")));
        }
        match std::str::from_utf8(&line) {
            Ok(text) => Ok(text.split_ascii_whitespace().map(str::to_owned).collect()),
            // Comments may be in any encoding and carry no meaning.
            Err(_) if line.starts_with(b"comment") || line.starts_with(b"obj_info") => Ok(Vec::new()),
            Err(_) => Err(self.fault("is not text")),
        }
    }

    fn fault(&self, reason: &str) -> Error {
        self.fault_with(reason, EXPORT)
    }

    fn fault_with(&self, reason: &str, remedy: &str) -> Error {
        Error::data(self.path, format!("header line {}", self.number), reason, remedy)
    }

    fn encoding(&self, name: &str) -> Result<Encoding> {
        match name {
            "ascii" => Ok(Encoding::Ascii),
            "binary_little_endian" => Ok(Encoding::LittleEndian),
            "binary_big_endian" => Ok(Encoding::BigEndian),
            _ => Err(self.fault_with(&format!("`{name}` is no PLY encoding"), "use binary_little_endian")),
        }
    }

    fn scalar(&self, name: &str) -> Result<Scalar> {
        let unknown = || self.fault_with(&format!("`{name}` is no PLY type"), "use float, double or an integer type");
        Scalar::from_name(name).ok_or_else(unknown)
    }

    fn element(&self, before: &[Element], name: &str, count: &str) -> Result<Element> {
        if before.iter().any(|e| e.name == name) {
            return Err(self.fault(&format!("element `{name}` is declared twice")));
        }
        let no_count = |_| self.fault(&format!("`{count}` is no count from 0 to {}", u32::MAX));
        let count = count.parse::<u32>().map_err(no_count)?.into();
        Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
    }

    fn property(&self, to: &mut [Element], scalar: &str, list_length: Option<Scalar>, name: &str) -> Result<()> {
        let scalar = self.scalar(scalar)?;
        if matches!(list_length, Some(Scalar::F32 | Scalar::F64)) {
            return Err(self.fault("a list's length must be an integer"));
        }
        let element = to.last_mut().ok_or_else(|| self.fault("a property stands before any element"))?;
        element.properties.push(Property { name: name.to_owned(), scalar, list_length });
        Ok(())
    }
}
