//! The sound field: from cameras and a microphone to the sound at a moving head; see `engine/sound/README.md`.

pub mod align;
pub mod clip;
mod course;
pub mod emitter;
pub mod fir;
pub mod geometry;
pub mod hrtf;
pub mod hull;
pub mod keypoints;
pub(crate) mod lag;
pub mod live;
pub mod localize;
pub mod loudness;
pub mod path;
pub mod pose;
pub mod render;
pub mod rig;
pub mod scene_file;
pub mod sinc;
pub mod smooth;
pub mod source_track;
pub mod speaker;
pub mod spectrum;
pub mod triangulate;
pub mod wav;
pub mod wola;

pub use hrtf::{HrtfSet, sphere};
pub use path::read_path;
pub use pose::PoseTrack;
pub use render::{RenderConfig, Rendered, render};
pub use scene_file::SoundScene;
pub use wav::{Depth, write as write_wav};

/// Samples per second of everything inside the sound field.
pub const FS: u32 = 48_000;
