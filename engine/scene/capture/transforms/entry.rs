//! An image of a `transforms.json`, until images of one place are one camera.

use std::path::PathBuf;

use crate::scene::capture::camera::{Camera, Shot};
use crate::scene::undistort::Distortion;

pub(super) const REMEDY: &str = "correct the file, or export the capture again";

/// One image.
pub(super) struct Entry {
    pub camera: Camera,
    pub distortion: Distortion,
    pub name: PathBuf,
    pub shot: Shot,
    pub time: Option<f64>,
}
