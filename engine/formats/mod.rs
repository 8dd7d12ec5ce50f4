//! File formats of scenes: `READERS` and `WRITERS` list all; each has a file or folder of its own.

mod compressed_ply;
mod convert;
mod format;
mod four_dgs;
mod glb;
mod ply;
mod ply_known;
mod ply_layout;
mod ply_parts;
mod ply_time;
mod rendering;
mod scene;
mod sog;
mod splat;
mod splatv;
mod spz;
mod spz_write;

pub use format::{Keeps, WriteOptions, Writer, Written};
pub use four_dgs::{Contents, Ears, Encoded, FourDgs, FourDgsParts, Grades, Sound, Sounds, World};
pub use glb::write_glb;
pub use ply::{ply_own, read_ply, write_ftgs, write_ply, write_ply_with};
pub use ply_parts::{PlyParts, write_parts};
pub use rendering::{Own, Rendering, list, own, unusual};
pub use scene::{Clip, Clock, Scene};
pub use splat::write_splat;
pub use splatv::write_splatv;
pub use spz_write::{SpzVersion, write_spz};

use crate::error::{Error, Result};
use crate::scene::Splats;
use format::{Reader, Start, first_bytes};
use std::path::Path;

/// Those that are recognised by content come before those that are recognised by an ending.
const READERS: &[Reader] = &[ply::READER, four_dgs::READER, spz::READER, sog::READER, splat::READER];

/// The formats that scenes are written in.
pub const WRITERS: &[Writer] = &[
    four_dgs::WRITER,
    ply::WRITER,
    ply::FTGS_WRITER,
    splatv::WRITER,
    spz_write::VERSION_3,
    spz_write::VERSION_4,
    glb::WRITER,
    splat::WRITER,
];

/// Reads a scene in any supported format, by content where that identifies it, otherwise by its ending: `.4dgs`; `.ply` of 3DGS and
/// its relatives, plain or compressed; `.spz`; `.sog` or the folder of one; `.splat`.
///
/// # Errors
/// [`Error::Data`] of the format's reader; for an unknown format, one that lists all.
pub fn read(path: impl AsRef<Path>) -> Result<Scene> {
    let path = path.as_ref();
    let bytes = if path.is_dir() { Vec::new() } else { first_bytes(path)? };
    let start = Start { path, bytes: &bytes };
    let Some(reader) = READERS.iter().find(|reader| (reader.knows)(&start)) else {
        let supported: Vec<&str> = READERS.iter().map(|reader| reader.what).collect();
        let remedy = format!("give {}; splat-transform makes a PLY of many others", supported.join(", or "));
        return Err(Error::data(path, "", "not a recognised scene format", &remedy));
    };
    (reader.read)(path)
}

/// The Gaussians of [`read`].
pub fn read_scene(path: &Path) -> Result<Splats> {
    read(path).map(|scene| scene.splats)
}

/// Writes a scene, whole or not at all. The format follows from the file's ending, unless the options name one: `.4dgs`, `.ply`,
/// `.ftgs.ply`, `.splatv`, `.spz`, `.glb` or `.splat`.
///
/// # Errors
/// [`Error::Data`] when no format has this ending, when the format cannot hold the scene, such as dynamic
/// Gaussians in an `.spz` without [`WriteOptions::time`], or when the file cannot be written.
pub fn write(path: impl AsRef<Path>, scene: &Scene, options: &WriteOptions) -> Result<Written> {
    let path = path.as_ref();
    let writer = options.format.or_else(|| by_ending(path)).ok_or_else(|| {
        let remedy = format!("use {}, or give a format", endings().join(", "));
        Error::data(path, "", "unsupported scene format", remedy)
    })?;
    let splats = options.moment(&scene.splats);
    let mut notes = (writer.write)(path, &splats, &scene.clip, options)?;
    notes.extend(writer.lost(&scene.clip));
    let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    Ok(Written { bytes, ..Written::of(&splats, |i| writer.keeps.non_finite || splats.is_finite(i), notes) })
}

/// The format that the ending of `path` stands for, in any case.
pub fn by_ending(path: &Path) -> Option<&'static Writer> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let is_its = |writer: &&Writer| writer.ending.is_some_and(|ending| name.ends_with(ending));
    // `.ftgs.ply` is a `.ply` too.
    WRITERS.iter().filter(is_its).max_by_key(|writer| writer.ending.map_or(0, str::len))
}

/// The endings of all formats.
pub fn endings() -> Vec<&'static str> {
    WRITERS.iter().filter_map(|writer| writer.ending).collect()
}
