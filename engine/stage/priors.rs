//! The losses against priors of depth and flow (SPEC 4): values and cotangents.

use crate::error::Result;
use crate::gpu::generated::prior_loss;
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

/// Priors of a picture on the device: halves, see [`half_bits`](crate::scene::capture::half_bits). A picture without depths, or
/// without flows, has [`NO_PRIOR`] in their place.
#[derive(Clone)]
pub struct PriorPlanes {
    /// Of the depth, two pixels a word.
    pub depths: Buf<u32>,
    /// Of the flow, a pixel a word: columns in the low half, rows in the high one.
    pub flows: Buf<u32>,
}

/// A picture that priors judge.
#[derive(Clone, Copy)]
pub struct PriorPicture<'a> {
    /// Depth, inverse depth and flow.
    pub image: &'a Buf<[f32; 4]>,
    /// Their cotangents, which the loss sets.
    pub d_image: &'a Buf<[f32; 4]>,
    /// The training image, whose mask lets a pixel count.
    pub truth: &'a Buf<u32>,
    /// Pixels.
    pub n_pixels: u32,
}

/// A word of halves that are not finite.
pub const NO_PRIOR: u32 = 0x7c00_7c00;

/// Scratch of the losses against priors.
pub struct PriorLoss {
    group_sums: Buf<[f32; 4]>,
    space: DepthSpace,
}

impl PriorLoss {
    /// Room for pictures of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize, space: DepthSpace) -> Result<Self> {
        Ok(PriorLoss { group_sums: gpu.alloc("prior loss sums", pixels.div_ceil(LOCAL as usize))?, space })
    }

    /// Appends the losses of `picture` against `priors`, and their cotangents. Gives sums by workgroup, over pixels: error of the depth,
    /// end-point error of the flow.
    pub fn record(
        &self,
        rec: &mut Recording,
        picture: PriorPicture,
        priors: &PriorPlanes,
        weights: &PriorWeights,
    ) -> Buf<[f32; 4]> {
        rec.section("priors");
        let PriorLoss { group_sums, space } = self;
        let PriorPlanes { depths, flows } = priors;
        let PriorPicture { image: image1, d_image: d_image1, truth, n_pixels } = picture;
        let share = |weight: f64, n: u32| (weight / f64::from(n.max(1))) as f32;
        rec.pass(
            prior_loss::Args { image1, truth, depths, flows, d_image1, sums: group_sums },
            prior_loss::Push {
                n: n_pixels,
                is_metric: u32::from(*space == DepthSpace::Metric),
                depth_weight: share(weights.depth, weights.n_depth),
                flow_weight: share(weights.flow, weights.n_flow),
                last_depth: depths.len() as u32 - 1,
                last_flow: flows.len() as u32 - 1,
            },
            Grid::Threads(n_pixels),
        );
        group_sums.range(0, n_pixels.div_ceil(LOCAL) as usize)
    }

    /// Mean error of the depth and mean end-point error, from the total of the sums.
    pub fn values([depth, flow, ..]: [f32; 4], weights: &PriorWeights) -> [f64; 2] {
        [(depth, weights.n_depth), (flow, weights.n_flow)].map(|(sum, n)| f64::from(sum) / f64::from(n.max(1)))
    }
}
