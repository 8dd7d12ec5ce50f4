//! Scenes, views and pictures on the host, and the files they come from and go to (SPEC 9).

mod at;
pub mod capture;
mod compressed_ply;
mod decode;
mod demo;
mod file;
mod frame;
mod import;
mod npy;
mod ply;
mod ply_header;
mod ply_rows;
pub mod prior;
mod similarity;
mod sog;
mod splat;
mod splats;
mod spz;
mod spz_write;
mod summary;
mod tensors;
mod view;

pub use demo::demo;
pub use file::write_atomic;
pub use frame::Frame;
pub use import::read_scene;
pub use ply::{read_ply, write_ply};
pub use similarity::Similarity;
pub use sog::read_sog;
pub use splat::{read_splat, write_splat};
pub use splats::{Motion, Splats};
pub use spz::read_spz;
pub use spz_write::write_spz;
pub use summary::{Bounds, DeviceBytes, Quantiles, Summary};
pub use tensors::{Tensor, read_tensors, write_tensors};
pub use view::{FlowModel, View, read_views, write_views};
