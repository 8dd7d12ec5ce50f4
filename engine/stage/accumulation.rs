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

/// How a device adds gradients up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sums {
    /// A slot per intersection.
    Slots,
    /// Fixed point in 64 bits, in two atomic additions of 32 bits, the second with the carry of the first.
    Fixed32,
    /// Fixed point in one atomic addition of 64 bits: the same bits as [`Sums::Fixed32`].
    Fixed64,
}

impl Sums {
    /// All of them, in the order of the kernels.
    pub const ALL: [Sums; 3] = [Sums::Slots, Sums::Fixed32, Sums::Fixed64];

    /// True if a device with `caps` can.
    ///
    /// # Errors
    /// [`Error::NoDevice`] with the remedy.
    pub fn check(self, caps: &Caps) -> Result<()> {
        if self != Sums::Fixed64 || caps.int64_atomics {
            return Ok(());
        }
        Err(Error::NoDevice {
            reason: format!("{} has no 64-bit atomics, which fixed point in one addition needs", caps.name),
            remedy: "choose accumulation auto, slots or fixed_point".to_owned(),
        })
    }

    /// True if they are words of fixed point.
    pub(super) fn is_fixed(self) -> bool {
        matches!(self, Sums::Fixed32 | Sums::Fixed64)
    }

    /// Bytes of an active Gaussian's sums, in the longest of their bindings. Slots are of intersections.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Sums::Slots => 0,
            Sums::Fixed32 | Sums::Fixed64 => 4 * u64::from(FIXED_WORDS),
        }
    }

    /// Entries of a list that one round of the backward kernel walks.
    pub(super) fn segment(self) -> u32 {
        match self {
            Sums::Slots => SEGMENT,
            Sums::Fixed32 | Sums::Fixed64 => SUM_SEGMENT,
        }
    }

    /// The kernel of the blend's adjoint that adds up this way.
    pub(super) fn kernel(self, outputs: Outputs, pixels_per_lane: u32) -> &'static KernelInfo {
        generated::blend_bwd(self as usize, outputs == Outputs::Color, pixels_per_lane == 8)
    }
}
