//! Where a head or a microphone is over time.

use std::path::Path;

use glam::{DQuat, DVec3};

use crate::error::{Error, Result};

/// Place and turn at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadPose {
    /// Seconds.
    pub t: f64,
    /// World position, scene units.
    pub p: DVec3,
    /// Turns the head's frame (x forward, y left, z up) into the world's.
    pub q: DQuat,
}

impl HeadPose {
    /// The head's forward axis in the world.
    pub fn forward(&self) -> DVec3 {
        self.q * DVec3::X
    }

    /// The turn of a head that looks along `forward` with its crown towards `up` as far as that allows, of any length; where they
    /// are parallel the sides are arbitrary but the same in every call.
    #[doc(hidden)]
    pub fn looking(forward: DVec3, up: DVec3) -> DQuat {
        let x = forward.normalize_or(DVec3::X);
        let y = up.cross(x).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
        DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y))).normalize()
    }
}

/// Poses in the order of time: at least one, all finite.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTrack {
    poses: Vec<HeadPose>,
}

impl PoseTrack {
    /// A track of poses whose times increase, seconds.
    ///
    /// # Errors
    /// [`Error::Data`] naming the pose that is out of order or not finite; a track has one at least.
    pub fn new(mut poses: Vec<HeadPose>) -> Result<Self> {
        let fault = |row: usize, reason: &str| {
            let remedy = "give poses with increasing times, finite places and unit quaternions";
            Error::data(Path::new("path of poses"), format!("pose {row}"), reason, remedy)
        };
        if poses.is_empty() {
            return Err(fault(0, "there is none"));
        }
        for (row, pose) in poses.iter_mut().enumerate() {
            if !(pose.t.is_finite() && pose.p.is_finite() && pose.q.is_finite()) {
                return Err(fault(row, "a number is not finite"));
            }
            if pose.q.length() < 1e-6 {
                return Err(fault(row, "the quaternion is zero"));
            }
            pose.q = pose.q.normalize();
        }
        if let Some(row) = (1..poses.len()).find(|row| poses[*row].t <= poses[row - 1].t) {
            return Err(fault(row, "its time is not after that of the pose before"));
        }
        Ok(PoseTrack { poses })
    }

    /// A head that stays.
    pub fn still(p: DVec3, q: DQuat) -> Self {
        PoseTrack { poses: vec![HeadPose { t: 0.0, p, q }] }
    }

    /// The pose at a time in seconds: places linearly, turns along the sphere, the ends held.
    pub fn at(&self, t: f64) -> HeadPose {
        let after = self.poses.partition_point(|pose| pose.t <= t);
        let clamped = |pose: &HeadPose| HeadPose { t, ..*pose };
        match (after.checked_sub(1).map(|before| &self.poses[before]), self.poses.get(after)) {
            (None, Some(first)) => clamped(first),
            (Some(last), None) => clamped(last),
            (Some(a), Some(b)) => {
                let s = (t - a.t) / (b.t - a.t);
                HeadPose { t, p: a.p.lerp(b.p, s), q: a.q.slerp(b.q, s) }
            }
            (None, None) => HeadPose { t, p: DVec3::ZERO, q: DQuat::IDENTITY },
        }
    }

    /// The poses, in the order of time.
    pub fn poses(&self) -> &[HeadPose] {
        &self.poses
    }
}
