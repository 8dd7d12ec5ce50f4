//! File formats of scenes, in and out.

mod clock;
mod compressed_ply;
mod decode;
mod format;
mod four_dgs;
mod glb;
mod import;
mod imported;
mod ply;
mod ply_known;
mod ply_layout;
mod ply_parts;
mod ply_time;
mod sog;
mod splat;
mod splatv;
mod spz;
mod spz_write;

pub use clock::Clock;
pub use format::{WriteScene, Writer};
pub use four_dgs::{
    Contents, Ears, Encoded, FourDgs, FourDgsParts, FourDgsSummary, Grades, Measure, Sound, Sounds, World,
};
pub use glb::write_glb;
pub use imported::{Imported, Own};
pub use ply::{ply_own, read_ply, write_ftgs, write_ply, write_ply_with};
pub use ply_parts::{PlyParts, write_parts};
pub use sog::read_sog;
pub use splat::{read_splat, write_splat};
pub use splatv::write_splatv;
pub use spz::read_spz;
pub use spz_write::{SpzVersion, write_spz};

use crate::error::Result;
use crate::scene::Splats;
use format::Reader;
use std::ops::Range;
use std::path::Path;

/// The formats that scenes are read from. What content tells comes before what an ending tells.
const READERS: &[Reader] = &[ply::READER, four_dgs::READER, spz::READER, sog::READER, splat::READER];

/// The formats that scenes are written in. A `.4dgs`, alone or with the player, is written by [`FourDgs`].
pub const WRITERS: &[Writer] = &[
    ply::WRITER,
    ply::FTGS_WRITER,
    splatv::WRITER,
    spz_write::VERSION_3,
    spz_write::VERSION_4,
    glb::WRITER,
    splat::WRITER,
];

/// How many static and how many dynamic Gaussians of `splats` are in a file of `writer`, or in a `.4dgs` where that is none: all formats
/// but 3DGS's PLY leave out those with a parameter that is not finite.
pub fn count_written(splats: &Splats, writer: Option<&Writer>) -> [usize; 2] {
    let keeps_all = writer.is_some_and(|writer| writer.name == ply::WRITER.name);
    let count = |among: Range<usize>| among.filter(|i| keeps_all || splats.is_finite(*i)).count();
    [count(0..splats.n_static), count(splats.n_static..splats.len())]
}

/// Reads a scene in any supported format: by content where that tells, else by its extension.
///
/// # Errors
/// [`crate::error::Error::Data`] of the format's reader; for another format, one that lists what is supported.
pub fn read_scene(path: &Path) -> Result<Splats> {
    import_scene(path).map(|imported| imported.splats)
}

/// As [`read_scene`], with what the file says beside its Gaussians, and what is to be said of what it holds.
///
/// # Errors
/// As [`read_scene`].
pub fn import_scene(path: &Path) -> Result<Imported> {
    import::read(path, READERS)
}
