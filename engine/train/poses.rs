//! Learnt corrections of the cameras' poses.

use crate::scene::{Pose, Similarity, View};
use crate::stage::PoseRows;
use glam::{DVec3, Vec3};

/// The difference of a camera's pose from the capture's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Turn about the world's axes, radians.
    pub turn: DVec3,
    /// Shift along the world's axes, scene units.
    pub shift: DVec3,
}

impl Correction {
    /// Reads a camera's rows on the device.
    pub fn of([turn, shift, ..]: &PoseRows) -> Self {
        let [turn, shift] = [turn, shift].map(|row| Vec3::from_slice(row).as_dvec3());
        Correction { turn, shift }
    }

    /// The view from the corrected pose.
    pub fn view(&self, view: &View) -> View {
        let corrected = |pose: &Pose| pose.corrected(self.turn, self.shift);
        View { pose: corrected(&view.pose), next_pose: view.next_pose.as_ref().map(corrected), ..view.clone() }
    }

    /// The same in the capture's own world; `world` leads from there to this one.
    pub fn in_capture(&self, world: &Similarity) -> Self {
        Correction { shift: self.shift / world.scale, ..*self }
    }
}
