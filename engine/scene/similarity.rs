//! The frame that training computes in, and the way back.

use super::{Pose, Splats};
use glam::DVec3;

/// A shift and a uniform scale of the world, in f64: `x' = scale (x - origin)`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Similarity {
    /// The point that becomes the origin, in the old units.
    pub origin: [f64; 3],
    /// New units per old unit, positive.
    pub scale: f64,
}

impl Default for Similarity {
    fn default() -> Self {
        Similarity { origin: [0.0; 3], scale: 1.0 }
    }
}

impl Similarity {
    /// The inverse: `x = x' / scale + origin`.
    pub fn inverse(&self) -> Self {
        Similarity { origin: self.origin.map(|x| -self.scale * x), scale: 1.0 / self.scale }
    }

    /// True if rounding positions of the old world to f32 stays below 1e-4 new units.
    #[doc(hidden)]
    pub fn is_exact_in_f32(&self) -> bool {
        let farthest = self.origin.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        0.5 * f64::from(f32::EPSILON) * farthest * self.scale < 1e-4
    }

    /// This, followed by `next`.
    pub fn then(&self, next: &Similarity) -> Self {
        let origin = std::array::from_fn(|k| self.origin[k] + next.origin[k] / self.scale);
        Similarity { origin, scale: self.scale * next.scale }
    }

    /// A point in the new world.
    pub fn point(&self, at: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| self.scale * (at[k] - self.origin[k]))
    }

    /// The pose in the new world, which shows the same picture.
    pub fn pose(&self, pose: &Pose) -> Pose {
        Pose { translation: self.scale * (pose.translation + pose.rotation * DVec3::from(self.origin)), ..*pose }
    }

    /// The Gaussians in the new world, rounded to f32 once.
    pub fn splats(&self, splats: &Splats) -> Splats {
        let mut moved = splats.clone();
        for position in &mut moved.position {
            *position = self.point(position.map(f64::from)).map(|x| x as f32);
        }
        let longer = self.scale.ln();
        moved.scale.as_flattened_mut().iter_mut().for_each(|s| *s = (f64::from(*s) + longer) as f32);
        for velocity in moved.motion.iter_mut().flat_map(|motion| &mut motion.velocity) {
            *velocity = (f64::from(*velocity) * self.scale) as f32;
        }
        moved
    }
}
