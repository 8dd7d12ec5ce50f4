//! Scenes, views and pictures on the host, and the files they come from and go to (SPEC 9).

mod file;
mod frame;
mod ply;
mod ply_header;
mod ply_rows;
mod splats;
mod view;

pub use file::write_atomic;
pub use frame::Frame;
pub use ply::{read_ply, write_ply};
pub use splats::{Motion, Splats};
pub use view::View;
