//! Scenes, views, pictures and captures on the host (SPEC 9).

mod at;
pub mod capture;
mod demo;
mod frame;
mod intrinsics;
mod navigator;
mod orbit;
mod parts;
mod playhead;
mod points;
mod pose;
pub mod prior;
mod similarity;
mod splats;
mod summary;
pub mod undistort;
mod view;

pub use demo::demo;
pub use frame::Frame;
pub(crate) use frame::write_exr;
pub use intrinsics::Intrinsics;
pub use navigator::{Navigator, Push};
pub use orbit::{Orbit, upright};
pub(crate) use parts::Resident;
pub use parts::{Mapped, Part, Parts};
pub use playhead::Playhead;
pub use points::{SeenPoint, write_points};
pub use pose::Pose;
pub(crate) use pose::{quaternion, rotation_of_rows};
pub use similarity::Similarity;
pub(crate) use splats::dc_of_color;
pub use splats::{ALWAYS, Motion, SH_C0, Splats};
pub use summary::{Bounds, DeviceBytes, Quantiles, Summary};
pub(crate) use view::parse_views;
pub use view::{Clearing, Cone, FlowModel, View, read_views, write_views};
