//! The cameras' time offsets (SPEC 2, 4), which only the device knows during a run.

use super::adam::correction;
use super::{BETA1, BETA2};
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams, clock_apply, clock_step};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Largest offset, frames.
pub const OFFSET_BOUND: f64 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeOffsetStep {
    pub camera: u32,
    /// Normalised time between two frames.
    pub dt: f64,
    pub rate: f64,
    /// Weight of the squared offsets in the loss.
    pub regulariser: f64,
    /// Number of the image in the run, from 1, since all moments decay with each image.
    pub step: u64,
}

pub struct TimeOffsets {
    /// Per camera: offset in frames; first and second moment of its gradient; what rounding has lost of it.
    pub state: Buf<[f32; 4]>,
    is_learnt: Buf<u32>,
    n: u32,
}

impl TimeOffsets {
    /// The offsets in `state`; of cameras that are not `learnt` they stay.
    pub fn new(gpu: &Gpu, state: &[[f32; 4]], learnt: &[bool]) -> Result<Self> {
        let is_learnt: Vec<u32> = learnt.iter().map(|learnt| u32::from(*learnt)).collect();
        Ok(TimeOffsets {
            state: gpu.upload("time offsets", state)?,
            is_learnt: gpu.upload("cameras with learnt time offsets", &is_learnt)?,
            n: state.len() as u32,
        })
    }

    /// Appends the shift of `view`, which holds the time without offset, by that of `camera`.
    pub fn record_apply(&self, rec: &mut Recording, view: &Buf<ViewParams>, camera: u32) {
        rec.section("clock");
        rec.pass(clock_apply::Args { clocks: &self.state, view }, clock_apply::Push { camera }, Grid::Groups(1));
    }

    /// Appends a step along the camera's gradient `total` (three vec4, that by time in the first one's last number); none if the frame
    /// failed.
    pub fn record_step(
        &self,
        rec: &mut Recording,
        total: &Buf<[f32; 4]>,
        frame_status: &Buf<Status>,
        at: &TimeOffsetStep,
    ) {
        rec.section("clock");
        rec.pass(
            clock_step::Args { total, free: &self.is_learnt, frame_status, clocks: &self.state },
            clock_step::Push {
                camera: at.camera,
                n_cameras: self.n,
                dt: at.dt as f32,
                rate: (at.rate / correction(BETA1, at.step)) as f32,
                inverse_c2: (1.0 / correction(BETA2, at.step)) as f32,
                regulariser: (2.0 * at.regulariser) as f32,
                bound: OFFSET_BOUND as f32,
            },
            Grid::Groups(1),
        );
    }
}
