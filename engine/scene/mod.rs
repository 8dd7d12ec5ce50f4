//! Scenes, views and pictures on the host, and the files they come from and go to (SPEC 9).

mod frame;
mod splats;
mod view;

pub use frame::Frame;
pub use splats::{Motion, Splats};
pub use view::View;
