//! How the backward pass adds up what the intersections give their splats.

use super::blend::SEGMENT;
use super::params::Outputs;
use crate::error::{Error, Result};
use crate::gpu::generated as g;
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

    /// Entries of a list that one round of the backward kernel walks, `SEGMENT` of its variant.
    pub(super) fn segment(self) -> u32 {
        if self == Accumulation::CompareExchange { 8_192 } else { SEGMENT }
    }

    /// The kernel of the blend's adjoint that adds up this way.
    pub(super) fn kernel(self, outputs: Outputs, pixels_per_lane: u32) -> &'static KernelInfo {
        use Accumulation::{CompareExchange, FixedPoint, FloatAtomics, Slots};
        match (self, outputs, pixels_per_lane) {
            (Slots, Outputs::All, 4) => g::blend_bwd_p4::INFO,
            (Slots, Outputs::All, _) => g::blend_bwd_p8::INFO,
            (Slots, Outputs::Color, 4) => g::blend_bwd_color_p4::INFO,
            (Slots, Outputs::Color, _) => g::blend_bwd_color_p8::INFO,
            (FloatAtomics, Outputs::All, 4) => g::blend_bwd_float_p4::INFO,
            (FloatAtomics, Outputs::All, _) => g::blend_bwd_float_p8::INFO,
            (FloatAtomics, Outputs::Color, 4) => g::blend_bwd_float_color_p4::INFO,
            (FloatAtomics, Outputs::Color, _) => g::blend_bwd_float_color_p8::INFO,
            (FixedPoint, Outputs::All, 4) => g::blend_bwd_fixed_p4::INFO,
            (FixedPoint, Outputs::All, _) => g::blend_bwd_fixed_p8::INFO,
            (FixedPoint, Outputs::Color, 4) => g::blend_bwd_fixed_color_p4::INFO,
            (FixedPoint, Outputs::Color, _) => g::blend_bwd_fixed_color_p8::INFO,
            (CompareExchange, Outputs::All, 4) => g::blend_bwd_swap_p4::INFO,
            (CompareExchange, Outputs::All, _) => g::blend_bwd_swap_p8::INFO,
            (CompareExchange, Outputs::Color, 4) => g::blend_bwd_swap_color_p4::INFO,
            (CompareExchange, Outputs::Color, _) => g::blend_bwd_swap_color_p8::INFO,
        }
    }
}
