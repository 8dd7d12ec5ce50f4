//! One entry for every scene format.

use std::io::Read;
use std::path::Path;

use super::compressed_ply::{is_compressed, read_compressed};
use super::four_dgs::{self, FourDgs};
use super::ply::read_vertices;
use super::sog::{ZIP, read_sog};
use super::splat::read_splat;
use super::spz::{GZIP, MAGIC, read_spz};
use crate::error::{Error, Result};
use crate::files::ply_rows::Rows;
use crate::files::{cannot_read, open_file};
use crate::scene::Splats;

const SUPPORTED: &str = "give a 3DGS PLY, a PlayCanvas compressed PLY, a .4dgs, an SPZ (version 2 to 4), a .splat, or a \
                         SOG scene (version 2): a .sog, or its folder or meta.json";

/// Reads a scene in any supported format: PLY (3DGS, compressed), `.4dgs`, SPZ and SOG by content, `.splat` by its extension.
/// Only a 3DGS PLY and a `.4dgs` can hold dynamic Gaussians.
///
/// # Errors
/// [`Error::Data`] of the format's reader; for another format, one that lists what is supported.
pub fn read_scene(path: &Path) -> Result<Splats> {
    if path.is_dir() {
        return read_sog(&path.join("meta.json"));
    }
    let mut start = Vec::new();
    let opened = open_file(path).and_then(|file| file.take(4).read_to_end(&mut start));
    opened.map_err(|fault| cannot_read(path, &fault))?;
    if start == b"ply\n" || start == b"ply\r" {
        let (header, rows) = Rows::open(path)?;
        return if is_compressed(&header) {
            read_compressed(path, &header, rows)
        } else {
            read_vertices(path, &header, rows)
        };
    }
    if start == four_dgs::MAGIC {
        return FourDgs::read(path)?.splats();
    }
    if start == ZIP {
        return read_sog(path);
    }
    if start == MAGIC || start.starts_with(&GZIP) {
        return read_spz(path);
    }
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
    match extension.as_ref().and_then(|extension| extension.to_str()) {
        Some("splat") => read_splat(path),
        Some("json") => read_sog(path),
        _ => Err(Error::data(path, "", "not a recognised scene format", SUPPORTED)),
    }
}
