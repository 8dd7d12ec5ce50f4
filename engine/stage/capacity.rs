//! How much a frame may hold, and what is to be done when it holds more.

use super::accumulation::SLOT_PAIRS;
use super::blend::SEGMENT;
use super::chunks;
use super::project::SPLAT_PLANES;
use super::{Blend, Outputs, Purpose, Sums};
use crate::error::Error;
use crate::gpu::Gpu;
use crate::gpu::generated::Status;
use crate::gpu::generated::constants::types::{FAILED_ACTIVE, FAILED_INTERSECTIONS, FAILED_LIST};
use crate::vk::Caps;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub n_tiles: u32,
    pub n_pixels: u32,
    /// Rounds of the blend, enough for lists of `rounds * SEGMENT` entries.
    pub rounds: u32,
}

/// Capacities; they only grow, but for the strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    pub active: u32,
    pub intersections: u32,
    pub tiles: u32,
    pub pixels: usize,
    pub outputs: Outputs,
    pub purpose: Purpose,
    pub sums: Sums,
    /// True if a step of the optimiser needs the camera's gradient too; [`Purpose::Gradient`] always has it.
    pub camera: bool,
    /// True if the Gaussians out of view are listed, for the steps of dense Adam.
    pub idle: bool,
    /// True if a step sees several images, so that their gradients are added up before it.
    pub is_batched: bool,
    /// Bits of the depth keys, see [`crate::settings::Knobs`].
    pub depth_bits: u32,
}

impl Capacity {
    pub(super) fn has_slots(&self) -> bool {
        self.purpose != Purpose::Picture && self.sums == Sums::Slots
    }

    /// Active Gaussians of a scene of `n`: all, or as many as one binding holds the splats and sums of. A view that has more fails for
    /// them, see [`Capacity::outcome`].
    pub fn active_of(&self, n: u32, caps: &Caps) -> u32 {
        let sums = if self.purpose == Purpose::Picture { 0 } else { self.sums.bytes() };
        let most = caps.max_binding_bytes / sums.max(16 * SPLAT_PLANES as u64);
        n.clamp(1, most.min(u64::from(u32::MAX / 2)) as u32)
    }

    /// Intersections whose lists, and slots or chunks where there are any, fit one binding.
    pub(crate) fn max_intersections(&self, gpu: &Gpu) -> u32 {
        let of_chunks = if Blend::has_chunks(gpu) { chunks::BYTES } else { 4 };
        let bytes = if self.has_slots() { 8 * SLOT_PAIRS as u64 } else { of_chunks };
        (gpu.caps().max_binding_bytes / bytes).min(u64::from(u32::MAX - 1)) as u32
    }

    /// Rounds of the blend of a list that takes all the room.
    pub(crate) fn max_rounds(&self) -> u32 {
        self.intersections.div_ceil(SEGMENT).max(1)
    }

    pub fn outcome(&self, gpu: &Gpu, status: &Status, rounds: u32) -> Outcome {
        let limit = self.max_intersections(gpu);
        if status.failed & FAILED_ACTIVE != 0 {
            let (needed, limit) = (status.n_active, status.capacity_active);
            Outcome::TooMuch { what: "active Gaussians", needed, limit }
        } else if status.failed & FAILED_INTERSECTIONS != 0 && status.n_intersections > limit {
            Outcome::TooMuch { what: "intersections", needed: status.n_intersections, limit }
        } else if status.failed & FAILED_INTERSECTIONS != 0 {
            let roomy = (u64::from(status.n_intersections) * 5 / 4).min(u64::from(limit)) as u32;
            Outcome::Replay(Capacity { intersections: roomy, ..*self }, rounds)
        } else if status.failed & FAILED_LIST != 0 {
            Outcome::Replay(*self, status.max_tile_list.div_ceil(SEGMENT))
        } else {
            Outcome::Complete
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Complete,
    /// The same frame again, with this capacity and this many rounds.
    Replay(Capacity, u32),
    /// Fewer tile rows at a time, or an error: a binding cannot hold `needed` of `what`.
    TooMuch {
        what: &'static str,
        needed: u32,
        limit: u32,
    },
}

pub(super) fn too_large(what: impl Into<String>, needed: u64, limit: u64, remedy: &str) -> Error {
    Error::OutOfMemory { what: what.into(), needed, limit, remedy: remedy.to_owned() }
}
