//! What is learnt of the cameras' poses, after a run.

use crate::scene::capture::Capture;
use crate::scene::{Similarity, View};
use crate::stage::PoseRows;
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// By how much the pose of a camera is another one than the capture says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Turn about the world's axes, radians.
    pub turn: DVec3,
    /// Shift along the world's axes, scene units.
    pub shift: DVec3,
}

impl Correction {
    /// Of a camera's rows on the device.
    pub fn of([turn, shift, ..]: &PoseRows) -> Self {
        let [turn, shift] = [turn, shift].map(|row| Vec3::from_slice(row).as_dvec3());
        Correction { turn, shift }
    }

    /// The view from there.
    pub fn view(&self, view: &View) -> View {
        let corrected = |pose: &crate::scene::Pose| pose.corrected(self.turn, self.shift);
        View { pose: corrected(&view.pose), next_pose: view.next_pose.as_ref().map(corrected), ..view.clone() }
    }

    /// The same in the world that `world` leads out of.
    pub fn in_world(&self, world: &Similarity) -> Self {
        Correction { shift: self.shift / world.scale, ..*self }
    }
}

/// A camera whose pose is learnt, as train.json tells it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LearntPose {
    /// Its name.
    pub camera: String,
    /// Angle between the learnt pose and the capture's, degrees.
    pub turn_degrees: f64,
    /// Distance between the learnt centre and the capture's, in the capture's units.
    pub shift: f64,
}

/// The learnt poses of the cameras of `capture`, in order; `corrections` are in the capture's own world.
pub fn learnt_poses(capture: &Capture, corrections: &BTreeMap<usize, Correction>) -> Vec<LearntPose> {
    let tell = |(camera, correction): (&usize, &Correction)| LearntPose {
        camera: capture.cameras[*camera].name.clone(),
        turn_degrees: correction.turn.length().to_degrees(),
        shift: correction.shift.length(),
    };
    corrections.iter().map(tell).collect()
}
