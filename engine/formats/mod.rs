//! File formats of scenes, in and out.

mod clock;
mod compressed_ply;
mod decode;
mod format;
mod four_dgs;
mod glb;
mod import;
mod own;
mod ply;
mod ply_known;
mod ply_layout;
mod ply_parts;
mod ply_time;
mod scene;
mod sog;
mod splat;
mod splatv;
mod spz;
mod spz_write;
mod write;

pub use clock::Clock;
pub use format::{Keeps, WriteOptions, Writer, Written};
pub use four_dgs::{
    Contents, Ears, Encoded, FourDgs, FourDgsParts, FourDgsSummary, Grades, Losses, Measure, Sound, Sounds, World,
};
pub use glb::write_glb;
pub use own::{Own, Rendering, list, own, unusual};
pub use ply::{ply_own, read_ply, write_ftgs, write_ply, write_ply_with};
pub use ply_parts::{PlyParts, write_parts};
pub use scene::{Clip, Scene};
pub use sog::read_sog;
pub use splat::{read_splat, write_splat};
pub use splatv::write_splatv;
pub use spz::read_spz;
pub use spz_write::{SpzVersion, write_spz};

use crate::error::Result;
use crate::scene::Splats;
use format::Reader;
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
/// [`Error::Data`](crate::Error::Data) of the format's reader; for an unknown format, one that lists all.
pub fn read(path: impl AsRef<Path>) -> Result<Scene> {
    import::read(path.as_ref(), READERS)
}

/// The Gaussians of [`read`].
pub fn read_scene(path: &Path) -> Result<Splats> {
    read(path).map(|scene| scene.splats)
}

/// Writes a scene, whole or not at all. The format follows from the file's ending, unless the options name one: `.4dgs`, `.ply`,
/// `.ftgs.ply`, `.splatv`, `.spz`, `.glb` or `.splat`.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) when no format has this ending, when the format cannot hold the scene, such as dynamic
/// Gaussians in an `.spz` without [`WriteOptions::time`], or when the file cannot be written.
pub fn write(path: impl AsRef<Path>, scene: &Scene, options: &WriteOptions) -> Result<Written> {
    write::write(path.as_ref(), scene, options, WRITERS)
}

/// The format that the ending of `path` stands for, in any case.
pub fn by_ending(path: &Path) -> Option<&'static Writer> {
    write::by_ending(path, WRITERS)
}

/// The endings of all formats.
pub fn endings() -> Vec<&'static str> {
    WRITERS.iter().filter_map(|writer| writer.ending).collect()
}
