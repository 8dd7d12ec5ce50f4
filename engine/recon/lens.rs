//! The lenses of a capture: a Gaussian just before one veils its picture.

use super::chosen::evenly_chosen;
use super::points::Found;
use crate::scene::Pose;
use crate::scene::capture::{Capture, TRAINING_RADIUS};

const MOST: usize = 512;
/// Nothing begins nearer before a lens, in training units.
const NEAREST: f64 = TRAINING_RADIUS / 6.0;
/// Cosine of the angle to the optical axis up to which a point is before a lens: 60 degrees, beyond most pictures.
const BEFORE: f64 = 0.5;
/// Nothing begins wider than this part of its distance to a lens.
const WIDEST: f64 = 1.0 / 6.0;

/// Every pose of every training camera, and [`Capture::viewpoints`]; of many an even choice, since each point is
/// tested against all.
pub(super) struct Lenses(Vec<Pose>);

impl Lenses {
    pub fn new(capture: &Capture) -> Self {
        Lenses(evenly_chosen(capture.lens_views(), MOST).iter().map(|view| view.pose).collect())
    }

    /// True if a Gaussian at a point would veil a picture.
    pub fn are_veiled_by(&self, found: &Found) -> bool {
        self.0.iter().any(|pose| {
            let at = pose.to_camera(found.position.into());
            let distance = at.length();
            distance < NEAREST && at.z > BEFORE * distance
        })
    }

    /// The largest standard deviation of a Gaussian at a point.
    pub fn widest(&self, found: &Found) -> f64 {
        let distance = |pose: &Pose| pose.to_camera(found.position.into()).length();
        WIDEST * self.0.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}
