//! The losses against priors of depth and flow (SPEC 4): values and cotangents.

use crate::error::Result;
use crate::gpu::generated::{loss_sum, prior_loss};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Threads per workgroup of the kernel that leaves one sum each.
const LOCAL: u32 = 64;

/// The space in which depths are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthSpace {
    /// 1 / scene units: what monocular networks predict.
    #[default]
    Inverse,
    /// Scene units.
    Metric,
}

/// Weights of a picture's terms, and over how many pixels their means are; a weight of 0 leaves a term out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PriorWeights {
    /// Of the depth.
    pub depth: f64,
    /// Of the flow.
    pub flow: f64,
    /// Pixels that count and have a prior of depth.
    pub n_depth: u32,
    /// The same of flow.
    pub n_flow: u32,
}

/// Scratch and result of the losses against priors.
pub struct PriorLoss {
    /// Priors, see [`prior_word`].
    pub priors: Buf<[u32; 2]>,
    /// Sums over pixels: error of the depth, end-point error of the flow.
    pub sums: Buf<[f32; 4]>,
    group_sums: Buf<[f32; 4]>,
    space: DepthSpace,
}

impl PriorLoss {
    /// Room for pictures of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize, space: DepthSpace) -> Result<Self> {
        Ok(PriorLoss {
            priors: gpu.alloc("priors", pixels)?,
            sums: gpu.alloc("prior losses", 1)?,
            group_sums: gpu.alloc("prior loss sums", pixels.div_ceil(LOCAL as usize))?,
            space,
        })
    }

    /// Appends the losses of `image1` (depth, inverse depth, flow) against the priors, where `truth`'s mask lets a pixel
    /// count, and their cotangents to `d_image1`; all of `n_pixels` pixels.
    pub fn record(
        &self,
        rec: &mut Recording,
        image1: &Buf<[f32; 4]>,
        truth: &Buf<u32>,
        d_image1: &Buf<[f32; 4]>,
        n_pixels: u32,
        weights: &PriorWeights,
    ) {
        rec.stage("priors");
        let PriorLoss { priors, sums, group_sums, space } = self;
        let share = |weight: f64, n: u32| (weight / f64::from(n.max(1))) as f32;
        rec.pass(
            prior_loss::Args { image1, truth, priors, d_image1, sums: group_sums },
            prior_loss::Push {
                n: n_pixels,
                is_metric: u32::from(*space == DepthSpace::Metric),
                depth_weight: share(weights.depth, weights.n_depth),
                flow_weight: share(weights.flow, weights.n_flow),
            },
            Grid::Threads(n_pixels),
        );
        let n = n_pixels.div_ceil(LOCAL);
        rec.pass(loss_sum::Args { sums: group_sums, loss: sums }, loss_sum::Push { n }, Grid::Groups(1));
    }

    /// Mean error of the depth and mean end-point error, from the sums.
    pub fn values([depth, flow, ..]: [f32; 4], weights: &PriorWeights) -> [f64; 2] {
        [(depth, weights.n_depth), (flow, weights.n_flow)].map(|(sum, n)| f64::from(sum) / f64::from(n.max(1)))
    }
}

/// A pixel's priors as the device takes them: the bits of the depth, the flow (pixels) as two halves, rounded to nearest.
/// What is not finite is no prior; nor is a flow beyond a half's range of 65,504 pixels.
pub fn prior_word(depth: f32, flow: [f32; 2]) -> [u32; 2] {
    let [x, y] = flow.map(|x| u32::from(half_bits(x)));
    [depth.to_bits(), x | y << 16]
}

/// The bits of the nearest half; infinity's where there is none.
fn half_bits(x: f32) -> u16 {
    let sign = (x.to_bits() >> 16 & 0x8000) as u16;
    let size = x.abs();
    if !(size < 65_520.0) {
        return sign | 0x7c00;
    }
    // Steps of a half below 2^-14 are 2^-24; above, 2^-10 of the power of two.
    let power = (size.to_bits() >> 23) as i32 - 127;
    let step = f32::exp2((power.max(-14) - 10) as f32);
    let steps = (size / step).round_ties_even() as u16;
    // 1,024 steps more than those of the exponent below: a carry moves on to the next exponent by itself.
    let exponent = (power.max(-14) + 14) as u16;
    sign | (exponent * 1024 + steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of a half.
    fn value(bits: u16) -> f64 {
        let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
        let size = if exponent == 0 { fraction * 2f64.powi(-14) } else { (1.0 + fraction) * 2f64.powi(exponent - 15) };
        if bits & 0x8000 != 0 { -size } else { size }
    }

    #[test]
    fn halves_are_the_nearest_ones() {
        // Every half is its own nearest.
        for bits in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(half_bits(value(bits) as f32), bits, "{bits:x}");
        }
        // Between two of them the nearer one; the middle goes to the even one.
        for bits in 0..0x7bff_u16 {
            let (low, high) = (value(bits), value(bits + 1));
            let middle = (low + high) / 2.0;
            assert_eq!(half_bits((middle * 0.9999 + low * 0.0001) as f32), bits, "{bits:x}");
            assert_eq!(half_bits((middle * 0.9999 + high * 0.0001) as f32), bits + 1, "{bits:x}");
            assert_eq!(half_bits(middle as f32), bits + bits % 2, "{bits:x}");
        }
        assert_eq!(half_bits(65_519.0), 0x7bff);
        for beyond in [65_520.0, 1e30, f32::INFINITY, f32::NAN] {
            assert_eq!(half_bits(beyond) & 0x7c00, 0x7c00, "{beyond}");
        }
        assert_eq!(half_bits(-1.0), 0xbc00);
    }
}
