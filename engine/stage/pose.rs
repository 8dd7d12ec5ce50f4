//! Learnt corrections of the cameras' poses, which only the device knows during a run.

use crate::error::Result;
use crate::gpu::generated::constants::pose::POSE_ROWS;
use crate::gpu::generated::{Status, ViewParams, pose_apply, pose_step};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use glam::DVec3;

/// The rows of a camera: turn about the world's axes, radians, and shift along them, scene units, both with 1 - beta_1^steps in their
/// last number; then the first moments of the gradients by both. Behind those of all cameras are as many again, of which the first
/// holds what all share: second moments of the gradients by turn and by shift, and 1 - beta_2^steps.
pub type PoseRows = [[f32; 4]; POSE_ROWS as usize];

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseStep {
    pub camera: u32,
    /// Learning rates of the turn, radians, and of the shift, scene units.
    pub turn_rate: f64,
    pub shift_rate: f64,
    /// Longest shift, scene units.
    pub most_shift: f64,
}

pub struct Poses {
    /// By camera, [`PoseRows`]; then those of all.
    pub state: Buf<[f32; 4]>,
    /// By camera: from the mean of all centres to its own; 1 where its pose is learnt.
    arrangement: Buf<[f32; 4]>,
    n: u32,
    n_learnt: u32,
    spread: f64,
}

impl Poses {
    /// The corrections in `state`, by camera, then what all share. `centers`: those of the cameras whose poses are learnt.
    pub fn new(gpu: &Gpu, state: &[PoseRows], centers: &[Option<DVec3>]) -> Result<Self> {
        let learnt = || centers.iter().flatten();
        let n_learnt = learnt().count();
        let middle = learnt().sum::<DVec3>() / n_learnt.max(1) as f64;
        let place = |center: &Option<DVec3>| center.map_or([0.0; 4], |c| (c - middle).as_vec3().extend(1.0).to_array());
        Ok(Poses {
            state: gpu.upload("poses", state.as_flattened())?,
            arrangement: gpu.upload("arrangement of cameras", &centers.iter().map(place).collect::<Vec<_>>())?,
            n: centers.len() as u32,
            n_learnt: n_learnt as u32,
            spread: learnt().map(|c| (*c - middle).length_squared()).sum(),
        })
    }

    /// Appends the correction of `view`, which holds the camera's own pose, by that of `camera`.
    pub fn record_apply(&self, rec: &mut Recording, view: &Buf<ViewParams>, camera: u32) {
        rec.section("pose");
        rec.pass(pose_apply::Args { poses: &self.state, view }, pose_apply::Push { camera }, Grid::Groups(1));
    }

    /// Appends a step along the camera's gradient `total` (three vec4: turn and time, shift) of the picture seen from the corrected
    /// `view`; none if the frame failed.
    pub fn record_step(
        &self,
        rec: &mut Recording,
        total: &Buf<[f32; 4]>,
        view: &Buf<ViewParams>,
        frame_status: &Buf<Status>,
        at: &PoseStep,
    ) {
        rec.section("pose");
        rec.pass(
            pose_step::Args { total, arrangement: &self.arrangement, frame_status, view, poses: &self.state },
            pose_step::Push {
                camera: at.camera,
                n_cameras: self.n,
                inverse_n: 1.0 / self.n_learnt.max(1) as f32,
                inverse_spread: if self.spread > 0.0 { (1.0 / self.spread) as f32 } else { 0.0 },
                turn_rate: at.turn_rate as f32,
                shift_rate: at.shift_rate as f32,
                most_shift: at.most_shift as f32,
            },
            Grid::Groups(1),
        );
    }
}
