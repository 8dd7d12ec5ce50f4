//! The cameras of a rig, and where they are at a key frame.

use std::path::PathBuf;

use crate::prepare::colmap::Matched;
use crate::prepare::video::Video;
use crate::scene::Pose;
use crate::scene::undistort::Lens;

/// Cameras that are matched with each other within a frame.
pub(super) const MATCHED: Matched = Matched { all: 12, neighbours: 8 };

/// A camera of the rig.
pub(super) struct Tracked {
    /// Of its video, without ending.
    pub name: String,
    pub path: PathBuf,
    pub video: Video,
    /// Found at the first key frame.
    pub lens: Lens,
    /// At the first key frame.
    pub first: Pose,
    /// Frame of its video at the first frame of the clip, of those that it has at the clip's rate.
    pub start: u32,
}

/// A placed key frame, as its file holds it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Placed {
    /// In the order of the cameras.
    pub poses: Vec<Pose>,
    /// Which of them are the rig's word alone.
    pub predicted: Vec<bool>,
}

/// The name by which COLMAP knows a picture: one without spaces, which its lists of pairs cannot hold, and a video's name may have.
pub(super) fn picture(camera: usize, key: usize) -> String {
    format!("{camera:03}/{key:05}.jpg")
}
