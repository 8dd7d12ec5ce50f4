//! How large a Gaussian begins on a surface.

use super::lens::Lenses;
use super::points::{Found, Reach, spacings};
use crate::scene::capture::Capture;
use glam::DVec3;

/// Standard deviation of a Gaussian in units of the distance to its neighbours: they touch on a surface.
pub(super) const SIZE: f64 = 0.5;
/// Points that are this many times farther from their neighbours than half of all points are dropped: what many cameras
/// agree on does not come alone.
const LONELY: f64 = 2.5;

/// Bounds of the sizes in a capture.
pub(super) struct Sizing {
    pub lenses: Lenses,
    reach: Reach,
}

impl Sizing {
    pub fn new(capture: &Capture) -> Self {
        Sizing { lenses: Lenses::new(capture), reach: Reach::new(capture) }
    }

    /// Drops the lonely points, and gives the others the standard deviations of their Gaussians.
    pub fn sized(&self, found: Vec<Found>) -> (Vec<Found>, Vec<f64>) {
        let spacings = spacings(&found, &self.reach);
        // Beyond the cameras points are farther apart.
        let scale = |found: &Found| DVec3::from(found.position).length().max(self.reach.radius);
        let mut relative: Vec<f64> =
            found.iter().zip(&spacings).map(|(found, spacing)| spacing / scale(found)).collect();
        relative.sort_by(f64::total_cmp);
        let most = LONELY * relative.get(relative.len() / 2).copied().unwrap_or(0.0);
        let kept = found.into_iter().zip(spacings).filter(|(found, spacing)| *spacing <= most * scale(found));
        kept.map(|(found, spacing)| (found, (SIZE * spacing).min(self.lenses.widest(&found)))).unzip()
    }
}
