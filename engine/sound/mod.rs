//! The sound field: where sources are, and how they sound along a path.

pub mod associate;
pub mod keypoints;
pub mod localize;
pub mod mouth;
pub mod path;
pub mod pose;
pub mod rig;
pub mod smooth;
pub mod source_track;
pub mod speaker;
pub mod triangulate;
