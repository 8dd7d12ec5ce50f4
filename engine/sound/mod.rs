//! The sound field: where sources are, and how they sound along a path.

mod associate;
mod keypoints;
mod localize;
mod mouth;
mod path;
mod pose;
mod rig;
mod smooth;
mod source_track;
mod triangulate;

pub use associate::associate;
pub use keypoints::{KeypointSettings, Mouths, keypoints_of};
pub use localize::{LocalizeReport, LocalizeSettings, Localized, SourceReport, localize};
pub use mouth::Mouth;
pub use path::{Convention, HeadPath, PathCamera, read_path};
pub use pose::{Pose, PoseTrack};
pub use rig::{Rig, RigCamera};
pub use smooth::{Motion, State, smooth};
pub use source_track::{Flag, SourceSample, SourceTrack};
pub use triangulate::{Fix, Sight, triangulate, triangulate_all};
