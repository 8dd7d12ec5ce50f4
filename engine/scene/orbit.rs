//! A circle about what cameras look at, for a video of a scene that has no path of its own.

use glam::{DMat3, DVec3};

use super::view::View;
use crate::report::statistics::median_high;

/// Least eigenvalue of the axes' system over its largest at which the point nearest to them is well defined: a few degrees apart.
const LEAST_SPREAD: f64 = 1e-3;

/// The direction in which `views` are upright on average, world, of length 1; `None` where they have no common one.
pub fn upright(views: &[View]) -> Option<DVec3> {
    let sum: DVec3 = views.iter().map(|view| -view.pose.down()).sum();
    // What is left of views that cancel each other is rounding.
    if sum.length() < 1e-6 { None } else { sum.try_normalize() }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    pub middle: DVec3,
    pub up: DVec3,
    /// From the middle to where the circle begins, at right angles to `up`, of length 1.
    pub ahead: DVec3,
    pub radius: f64,
    /// Of the circle above the middle, along `up`; scene units.
    pub height: f64,
}

impl Orbit {
    /// The circle of `views`: about the point nearest to all of their optical axes, upright as they are on average, as far and as high as
    /// their lenses in the median. It begins beside the first view. `None` where the views do not look at one place.
    pub fn new(views: &[View]) -> Option<Orbit> {
        let poses = views.iter().map(|view| view.pose);
        let lenses: Vec<(DVec3, DVec3)> =
            poses.map(|pose| (pose.center(), pose.forward().normalize_or_zero())).collect();
        let mut system = DMat3::ZERO;
        let mut right = DVec3::ZERO;
        for (lens, forward) in &lenses {
            let across =
                DMat3::IDENTITY - DMat3::from_cols(forward.x * *forward, forward.y * *forward, forward.z * *forward);
            system += across;
            right += across * *lens;
        }
        // By n, the eigenvalues lie between 0 and 1 and have the sum 2: the least one is about the determinant.
        let spread = (system * (1.0 / lenses.len().max(1) as f64)).determinant();
        if spread.is_nan() || spread <= LEAST_SPREAD {
            return None;
        }
        let middle = system.inverse() * right;
        let n_towards = lenses.iter().filter(|(lens, forward)| forward.dot(middle - lens) > 0.0).count();
        let up = upright(views)?;
        if 2 * n_towards <= lenses.len() || !middle.is_finite() {
            return None;
        }
        let distance = median_high(lenses.iter().map(|(lens, _)| lens.distance(middle)))?;
        let height = median_high(lenses.iter().map(|(lens, _)| up.dot(lens - middle)))?;
        // Even for cameras that hang overhead the path is a circle around the scene.
        let radius = (distance * distance - height * height).max(0.01 * distance * distance).sqrt();
        let first = lenses[0].0 - middle;
        let ahead = first.reject_from_normalized(up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        (radius.is_finite() && radius > 0.0).then_some(Orbit { middle, up, ahead, radius, height })
    }

    /// Where the circle is after `turn` turns, world.
    pub fn at(&self, turn: f64) -> DVec3 {
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        let around = cos * self.ahead + sin * self.up.cross(self.ahead);
        self.middle + self.radius * around + self.height * self.up
    }
}
