//! Points at random places.

use super::chosen::views;
use super::hull;
use crate::random::Keyed;
use crate::scene::capture::{Capture, Point};
use glam::DVec3;

/// `n` grey points, uniform in the space that the capture's cameras share if most look at the space between them; else
/// in the ball around them.
pub(crate) fn random_points(capture: &Capture, n: usize, seed: u64) -> Vec<Point> {
    let key = [seed, 0x0070_6f69_6e74];
    let shared = hull::shared_space(&views(capture), n, &key);
    if !shared.is_empty() {
        return shared.into_iter().map(|at| Point { position: at.as_dvec3().to_array(), color: [128; 3] }).collect();
    }
    let extent = capture.extent();
    let random = Keyed::new(&key);
    (0..n as u64)
        .map(|i| {
            let direction = DVec3::from_array(std::array::from_fn(|k| random.normal(4 * i + k as u64)));
            let r = extent.radius * random.uniform(8 * i + 6).cbrt() / direction.length().max(1e-9);
            let position = (DVec3::from(extent.center) + r * direction).to_array();
            Point { position, color: [128; 3] }
        })
        .collect()
}
