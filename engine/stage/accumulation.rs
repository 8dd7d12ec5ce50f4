//! How the backward pass adds up what the intersections give their splats.

use super::blend::SEGMENT;
use super::params::Outputs;
use crate::error::{Error, Result};
use crate::gpu::KernelInfo;
use crate::gpu::generated::{
    self,
    constants::{blend_bwd::SUM_SEGMENT, fixed::FIXED_WORDS},
};
use crate::vk::{Caps, DeviceKind};

/// vec2 per slot: the twelve sums that one intersection gives its splat.
pub const SLOT_PAIRS: usize = 6;

/// How the gradients of a splat's intersections are added up, as a setting: see [`Accumulation::on`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accumulation {
    /// The fastest on the device that gives the same bits in every run.
    #[default]
    Auto,
    /// One slot per intersection, added in order: the same bits in every run. 48 bytes an intersection.
    Slots,
    /// Atomic additions of 64-bit integers: the same bits in every run, on every device. Sums have a range; a Gaussian beyond it
    /// counts as one whose gradient is not finite.
    FixedPoint,
}

impl Accumulation {
    /// The way that a device takes. `Auto`: slots on a CPU, where an atomic addition costs more than a slot; fixed point on a
    /// GPU, where slots cost their fill, a dispatch for each block of a tile, and memory that is read again.
    pub fn on(self, caps: &Caps) -> Sums {
        match self {
            Accumulation::Auto if caps.kind == DeviceKind::Cpu => Sums::Slots,
            Accumulation::Auto | Accumulation::FixedPoint if caps.int64_atomics => Sums::Fixed64,
            Accumulation::Auto | Accumulation::FixedPoint => Sums::Fixed32,
            Accumulation::Slots => Sums::Slots,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sums {
    Slots,
    /// Fixed point in 64 bits, in two atomic additions of 32 bits, the second with the carry of the first.
    Fixed32,
    /// Fixed point in one atomic addition of 64 bits: the same bits as [`Sums::Fixed32`].
    Fixed64,
}

impl Sums {
    pub const ALL: [Sums; 3] = [Sums::Slots, Sums::Fixed32, Sums::Fixed64];

    pub fn check(self, caps: &Caps) -> Result<()> {
        if self != Sums::Fixed64 || caps.int64_atomics {
            return Ok(());
        }
        Err(Error::NoDevice {
            reason: format!("{} has no 64-bit atomics, which fixed point in one addition needs", caps.name),
            remedy: "choose accumulation auto, slots or fixed_point".to_owned(),
        })
    }

    pub(super) fn is_fixed(self) -> bool {
        self != Sums::Slots
    }

    /// Bytes of an active Gaussian's sums in their longest binding. Slots are of intersections.
    pub(super) fn bytes(self) -> u64 {
        if self.is_fixed() { 4 * u64::from(FIXED_WORDS) } else { 0 }
    }

    /// Entries of a list that one round of the backward kernel walks.
    pub(super) fn segment(self) -> u32 {
        if self.is_fixed() { SUM_SEGMENT } else { SEGMENT }
    }

    pub(super) fn kernel(self, outputs: Outputs, pixels_per_lane: u32) -> &'static KernelInfo {
        generated::blend_bwd(self as usize, outputs == Outputs::Color, pixels_per_lane == 8)
    }
}
