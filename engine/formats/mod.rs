//! File formats of scenes, in and out.

mod compressed_ply;
mod decode;
mod four_dgs;
mod glb;
mod import;
mod ply;
mod ply_time;
mod sog;
mod splat;
mod splatv;
mod spz;
mod spz_write;

pub use four_dgs::{Clock, Contents, Ears, Encoded, FourDgs, FourDgsSummary, Grades, Sound, Sounds, World};
pub use glb::write_glb;
pub use import::read_scene;
pub use ply::{read_ply, write_ftgs, write_ply};
pub use sog::read_sog;
pub use splat::{read_splat, write_splat};
pub use splatv::write_splatv;
pub use spz::read_spz;
pub use spz_write::{SpzVersion, write_spz};
