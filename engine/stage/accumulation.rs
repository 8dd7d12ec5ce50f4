//! How the backward pass adds up what the intersections give their splats.

use super::blend::SEGMENT;
use super::params::Outputs;
use crate::error::{Error, Result};
use crate::gpu::generated::{self, constants::blend_bwd::SWAP_SEGMENT};
use crate::gpu::{Gpu, KernelInfo};

/// vec2 per slot: the twelve sums that one intersection gives its splat.
pub const SLOT_PAIRS: usize = 6;

/// How the gradients of a splat's intersections are added up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accumulation {
    /// One slot per intersection, added in order: the same bits in every run. 48 bytes an intersection.
    #[default]
    Slots,
    /// Atomic additions of floats: the last bits vary from run to run. The device must have them.
    FloatAtomics,
    /// Atomic additions of 64-bit integers in two words: the same bits in every run, on every device.
    FixedPoint,
    /// Compare and exchange: as float atomics, for devices without them.
    CompareExchange,
}

impl Accumulation {
    /// All of them.
    pub const ALL: [Accumulation; 4] =
        [Accumulation::Slots, Accumulation::FloatAtomics, Accumulation::FixedPoint, Accumulation::CompareExchange];

    /// Whether `gpu` can.
    ///
    /// # Errors
    /// [`Error::NoDevice`] with the remedy.
    pub fn check(self, gpu: &Gpu) -> Result<()> {
        if self == Accumulation::FloatAtomics && !gpu.caps().float_atomics {
            return Err(Error::NoDevice {
                reason: format!("{} has no float atomics, which accumulation `float_atomics` needs", gpu.caps().name),
                remedy: "choose accumulation slots, fixed_point or compare_exchange".to_owned(),
            });
        }
        Ok(())
    }

    /// Entries of a list that one round of the backward kernel walks.
    pub(super) fn segment(self) -> u32 {
        if self == Accumulation::CompareExchange { SWAP_SEGMENT } else { SEGMENT }
    }

    /// The kernel of the blend's adjoint that adds up this way.
    pub(super) fn kernel(self, outputs: Outputs, pixels_per_lane: u32) -> &'static KernelInfo {
        let axis = match self {
            Accumulation::Slots => 0,
            Accumulation::FloatAtomics => 1,
            Accumulation::FixedPoint => 2,
            Accumulation::CompareExchange => 3,
        };
        generated::blend_bwd(axis, outputs == Outputs::Color, pixels_per_lane == 8)
    }
}
