//! How large Gaussians begin on surfaces, and how near to lenses: one just before a lens veils its picture.

use super::chosen::evenly_chosen;
use super::points::{Found, Reach, spacings};
use crate::report::statistics::median_high;
use crate::scene::Pose;
use crate::scene::capture::{Capture, TRAINING_RADIUS};
use glam::DVec3;

/// Standard deviation of a Gaussian in units of the distance to its neighbours: they touch on a surface.
pub(super) const SIZE: f64 = 0.5;
/// Points that are this many times farther from their neighbours than half of all points are dropped.
const LONELY: f64 = 2.5;
const MOST_LENSES: usize = 512;
/// Nothing begins nearer before a lens, in training units.
const NEAREST: f64 = TRAINING_RADIUS / 6.0;
/// Cosine of the angle to the optical axis up to which a point is before a lens: 60 degrees, beyond most pictures.
const BEFORE: f64 = 0.5;
/// Nothing begins wider than this part of its distance to a lens.
const WIDEST: f64 = 1.0 / 6.0;

pub(super) struct Sizing {
    pub lenses: Lenses,
    reach: Reach,
}

impl Sizing {
    pub fn new(capture: &Capture) -> Self {
        Sizing { lenses: Lenses::new(capture), reach: Reach::new(capture) }
    }

    /// Drops the lonely points; gives the others with the standard deviations of their Gaussians.
    pub fn sized(&self, found: Vec<Found>) -> (Vec<Found>, Vec<f64>) {
        let spacings = spacings(&found, &self.reach);
        // Beyond the cameras points are farther apart.
        let scale = |found: &Found| DVec3::from(found.position).length().max(self.reach.radius);
        let relative = found.iter().zip(&spacings).map(|(found, spacing)| spacing / scale(found));
        let most = LONELY * median_high(relative).unwrap_or(0.0);
        let kept = found.into_iter().zip(spacings).filter(|(found, spacing)| *spacing <= most * scale(found));
        kept.map(|(found, spacing)| (found, (SIZE * spacing).min(self.lenses.widest(&found)))).unzip()
    }
}

/// Poses of training cameras, and [`Capture::viewpoints`]; of many an even choice.
pub(super) struct Lenses(Vec<Pose>);

impl Lenses {
    pub fn new(capture: &Capture) -> Self {
        Lenses(evenly_chosen(capture.lens_views(), MOST_LENSES).iter().map(|view| view.pose).collect())
    }

    pub fn are_veiled_by(&self, found: &Found) -> bool {
        self.0.iter().any(|pose| {
            let at = pose.to_camera(found.position.into());
            let distance = at.length();
            distance < NEAREST && at.z > BEFORE * distance
        })
    }

    pub fn widest(&self, found: &Found) -> f64 {
        let distance = |pose: &Pose| pose.to_camera(found.position.into()).length();
        WIDEST * self.0.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}
