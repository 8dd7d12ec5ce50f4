//! The lenses of a capture: what lies just before one veils its picture.

use super::points::Found;
use crate::scene::View;
use crate::scene::capture::{Capture, TRAINING_RADIUS};

/// Nothing begins nearer before a lens, in training units.
const NEAREST: f64 = TRAINING_RADIUS / 6.0;
/// Cosine of the angle to the optical axis up to which a point is before a lens: 60 degrees, beyond most pictures.
const BEFORE: f64 = 0.5;
/// Nothing begins wider than this part of its distance to a lens.
const WIDEST: f64 = 1.0 / 6.0;

/// Every pose of every training camera, and the views that somebody named ([`Capture::viewpoints`]).
pub(super) struct Lenses(Vec<View>);

impl Lenses {
    pub fn new(capture: &Capture) -> Self {
        Lenses(capture.lens_views())
    }

    /// Whether a Gaussian at a point would veil a picture.
    pub fn are_veiled_by(&self, found: &Found) -> bool {
        self.0.iter().any(|view| {
            let at = in_camera(view, found.position);
            let distance = length(at);
            distance < NEAREST && at[2] > BEFORE * distance
        })
    }

    /// The largest standard deviation of a Gaussian at a point.
    pub fn widest(&self, found: &Found) -> f64 {
        let distance = |view: &View| length(in_camera(view, found.position));
        WIDEST * self.0.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}

fn in_camera(view: &View, world: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| {
        let m = &view.world_to_camera[row];
        (0..3).map(|k| m[k] * world[k]).sum::<f64>() + m[3]
    })
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
