//! How much a frame may hold, and what is to be done when it holds more.

use super::accumulation::{SLOT_PAIRS, Sums};
use super::blend::{Blend, SEGMENT};
use super::chunks;
use super::params::{Outputs, Purpose};
use super::project::SPLAT_PLANES;
use crate::gpu::Gpu;
use crate::gpu::generated::Status;
use crate::gpu::generated::constants::types::{FAILED_ACTIVE, FAILED_INTERSECTIONS, FAILED_LIST};

/// The size of a strip on its way through the stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Tiles.
    pub n_tiles: u32,
    /// Pixels.
    pub n_pixels: u32,
    /// Rounds of the blend, enough for lists of `rounds * SEGMENT` entries.
    pub rounds: u32,
}

/// Capacities; they only grow, but for the strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Active Gaussians.
    pub active: u32,
    /// Pairs of a Gaussian and a tile.
    pub intersections: u32,
    /// Tiles of a strip.
    pub tiles: u32,
    /// Pixels of a strip.
    pub pixels: usize,
    /// What the pictures need.
    pub outputs: Outputs,
    /// Whether a backward pass follows.
    pub purpose: Purpose,
    /// How gradients are added up.
    pub sums: Sums,
    /// Whether a step of the optimiser needs the camera's gradient too; [`Purpose::Gradient`] always has it.
    pub camera: bool,
    /// Whether the Gaussians out of view are listed, for the steps of dense Adam.
    pub idle: bool,
    /// Whether a step sees several images, so that their gradients are added up before it.
    pub is_batched: bool,
    /// Bits of the depth keys, see [`crate::settings::Knobs`].
    pub depth_bits: u32,
}

impl Room {
    /// Whether each intersection has a slot for its gradient.
    pub(super) fn has_slots(&self) -> bool {
        self.purpose != Purpose::Picture && self.sums == Sums::Slots
    }

    /// Intersections whose lists, and slots or chunks where there are any, fit one binding.
    pub(crate) fn max_intersections(&self, gpu: &Gpu) -> u32 {
        let of_chunks = if Blend::has_chunks(gpu) { chunks::BYTES } else { 4 };
        let bytes = if self.has_slots() { 8 * SLOT_PAIRS as u64 } else { of_chunks };
        (gpu.caps().max_binding_bytes / bytes).min(u64::from(u32::MAX - 1)) as u32
    }

    /// What became of a frame within this room, of `rounds` rounds, that ended with `status`.
    pub fn outcome(&self, gpu: &Gpu, status: &Status, rounds: u32) -> Outcome {
        let limit = self.max_intersections(gpu);
        if status.failed & FAILED_ACTIVE != 0 {
            let (needed, limit) = (status.n_active, status.capacity_active);
            Outcome::TooMuch { what: "active Gaussians", needed, limit }
        } else if status.failed & FAILED_INTERSECTIONS != 0 && status.n_intersections > limit {
            Outcome::TooMuch { what: "intersections", needed: status.n_intersections, limit }
        } else if status.failed & FAILED_INTERSECTIONS != 0 {
            let roomy = (u64::from(status.n_intersections) * 5 / 4).min(u64::from(limit)) as u32;
            Outcome::Replay(Room { intersections: roomy, ..*self }, rounds)
        } else if status.failed & FAILED_LIST != 0 {
            Outcome::Replay(*self, status.max_tile_list.div_ceil(SEGMENT))
        } else {
            Outcome::Complete
        }
    }
}

/// What became of a frame, and what has to be done before it can stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Nothing: the frame is complete.
    Complete,
    /// A replay with this much room and this many rounds.
    Replay(Room, u32),
    /// Fewer tile rows at a time, or an error: a binding cannot hold `needed` of `what`.
    TooMuch {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        needed: u32,
        /// How many fit.
        limit: u32,
    },
}

/// Active Gaussians whose splats fit one binding.
pub(crate) fn max_active(gpu: &Gpu) -> u32 {
    let limit = gpu.caps().max_binding_bytes / (16 * SPLAT_PLANES as u64);
    limit.min(u64::from(u32::MAX / 2)) as u32
}
