//! Direction, distances and gain from places.
//!
//! The paper takes the angle between facing and source as an arc cosine, which has no sign. Here it is the arc tangent of cross and
//! dot product, counter-clockwise, left positive, as SADIE and SOFA count.

use glam::{DVec2, DVec3};

use super::pose::HeadPose;

/// The horizontal plane of the sound field: x right, y forward, up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoundPlane {
    pub x: DVec3,
    pub y: DVec3,
    pub up: DVec3,
}

impl SoundPlane {
    /// The plane across `up` whose y axis is the level part of `forward`; `None` where the two are parallel or zero.
    pub fn new(up: DVec3, forward: DVec3) -> Option<Self> {
        let up = up.try_normalize()?;
        let level = forward - forward.dot(up) * up;
        let y = (level.length() > 1e-9 * forward.length()).then(|| level.try_normalize()).flatten()?;
        Some(SoundPlane { x: y.cross(up), y, up })
    }

    pub fn level(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.x), v.dot(self.y))
    }

    /// Yaw of a head from the y axis, counter-clockwise, radians; that of its sides where it looks straight up or down.
    pub fn yaw(&self, head: &HeadPose) -> f64 {
        let forward = self.level(head.forward());
        let forward = if forward.length() > 1e-6 { forward } else { self.level((head.q * DVec3::Y).cross(self.up)) };
        f64::atan2(-forward.x, forward.y)
    }
}

/// How directions, gains and delays are made from places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The paper's: all on the sound plane, gain relative to the recording, no delay.
    Paper2d,
    /// The same with elevation and distances in space.
    Paper3d,
    /// In space, with the delay of the way relative to the recording's (so with Doppler); needs a metric scale.
    Physical,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// Azimuth, radians in (-pi, pi], left positive.
    pub az: f64,
    /// Elevation, radians.
    pub el: f64,
    /// Distance of the listener from the source, scene units.
    pub r_l: f64,
    /// Distance of the microphone from the source, scene units.
    pub r_m: f64,
}

/// Unit vector of an azimuth and an elevation, x forward, y left, z up.
pub fn direction(az: f64, el: f64) -> DVec3 {
    DVec3::new(az.cos() * el.cos(), az.sin() * el.cos(), el.sin())
}

/// (azimuth, elevation) of a vector in the head's frame; straight ahead for the zero vector.
pub fn angles(v: DVec3) -> (f64, f64) {
    (f64::atan2(v.y, v.x), f64::atan2(v.z, v.truncate().length()))
}

/// Signed angle of a level source: from `facing`, which a yaw gives, to the source at `offset` from the listener.
pub fn signed_angle(yaw: f64, offset: DVec2) -> f64 {
    let facing = DVec2::new(-yaw.sin(), yaw.cos());
    let angle = f64::atan2(facing.perp_dot(offset), facing.dot(offset));
    // The rule is (-pi, pi]; atan2 keeps the sign of a zero.
    if angle == -std::f64::consts::PI { std::f64::consts::PI } else { angle }
}

/// The bearing of `source` for a head, with the microphone's distance.
pub fn bearing(mode: Mode, plane: &SoundPlane, head: &HeadPose, microphone: DVec3, source: DVec3) -> Bearing {
    let (to_source, from_microphone) = (source - head.p, source - microphone);
    match mode {
        Mode::Paper2d => {
            let offset = plane.level(to_source);
            let az = if offset == DVec2::ZERO { 0.0 } else { signed_angle(plane.yaw(head), offset) };
            Bearing { az, el: 0.0, r_l: offset.length(), r_m: plane.level(from_microphone).length() }
        }
        Mode::Paper3d | Mode::Physical => {
            let (az, el) = angles(head.q.inverse() * to_source);
            Bearing { az, el, r_l: to_source.length(), r_m: from_microphone.length() }
        }
    }
}

/// Amplitude relative to the recording, `r_m / r_l`, with both distances kept from zero by `r_min` (scene units). The physical mode
/// rounds that floor, so that the gain has no kink.
pub fn gain(mode: Mode, bearing: &Bearing, r_min: f64) -> f64 {
    let r_m = bearing.r_m.max(r_min);
    match mode {
        Mode::Paper2d | Mode::Paper3d => r_m / bearing.r_l.max(r_min),
        Mode::Physical => r_m / bearing.r_l.hypot(r_min),
    }
}

/// Unit vector of an azimuth and an elevation in degrees.
pub fn degrees(az: f64, el: f64) -> DVec3 {
    direction(az.to_radians(), el.to_radians())
}
