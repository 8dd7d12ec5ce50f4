//! First-order ambisonics, AmbiX: channels W, Y, Z, X (ACN), SN3D.

use glam::DVec3;

use super::geometry::{SoundPlane, angles};

/// Gains of the four channels for a direction in a frame of x forward, y left, z up.
pub fn encode(to: DVec3) -> [f64; 4] {
    let to = to.normalize_or(DVec3::X);
    [1.0, to.y, to.z, to.x]
}

/// The direction that a sound field comes from: of its mean energy flow.
pub fn decode(frames: &[[f32; 4]]) -> (f64, f64) {
    let flow: DVec3 =
        frames.iter().map(|[w, y, z, x]| f64::from(*w) * DVec3::new(f64::from(*x), f64::from(*y), f64::from(*z))).sum();
    angles(flow)
}

/// A vector of the world in the frame that players turn: x along the sound plane's forward, y left, z up.
pub fn of_world(plane: &SoundPlane, v: DVec3) -> DVec3 {
    DVec3::new(v.dot(plane.y), -v.dot(plane.x), v.dot(plane.up))
}
