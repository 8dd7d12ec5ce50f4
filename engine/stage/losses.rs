//! Losses of SPEC 4 with their cotangents: the photometric one, 0.8 L1 + 0.2 (1 - SSIM), and those against priors of depth and flow.
//! Each leaves sums by workgroup, which the totals add up.

use crate::error::Result;
use crate::gpu::generated::constants::ssim_filter::{RUN, TILE_COLUMNS};
use crate::gpu::generated::{self, Status, loss_sum, loss_sum_report, prior_loss, ssim, ssim_bwd};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Weight of 1 - SSIM; L1 has the rest.
pub const SSIM_WEIGHT: f32 = 0.2;

/// Pixels that each place of SSIM stands for, in the mean over a picture of this size.
fn pixels_per_place(stride: u32, [width, height]: [u32; 2]) -> f64 {
    let places = f64::from(width.div_ceil(stride)) * f64::from(height.div_ceil(stride));
    f64::from(width) * f64::from(height) / places
}

/// The pictures that are compared, `[height][width]`, and the place of the cotangent.
#[derive(Clone, Copy)]
pub struct Pictures<'a> {
    /// Colour in the first three channels.
    pub image: &'a Buf<[f32; 4]>,
    /// The training image: RGB and the mask in the top byte, 8 bits each.
    pub truth: &'a Buf<u32>,
    pub d_image: &'a Buf<[f32; 4]>,
    pub size: [u32; 2],
    /// Pixels that the mask does not hide, at least 1.
    pub n_visible: u32,
}

/// Scratch of the photometric loss, for pictures of up to `pixels` pixels.
pub struct Photometric {
    partials: Buf<f32>,
    group_sums: Buf<[f32; 4]>,
}

const PARTIALS: usize = 9;

impl Photometric {
    pub fn new(gpu: &Gpu, pixels: usize) -> Result<Self> {
        Ok(Photometric {
            partials: gpu.alloc("ssim partials", PARTIALS * pixels)?,
            // A column of pixels has the most tiles of all pictures of so many.
            group_sums: gpu.alloc("loss sums", pixels.div_ceil(RUN as usize))?,
        })
    }

    /// Appends the loss of a picture against the truth, and its cotangent, with SSIM at every pixel (`stride` 1), or at every second
    /// of every second row (2), each of which stands for four. Gives sums by workgroup: 1 - SSIM, absolute error, squared error.
    pub fn record(&self, rec: &mut Recording, pictures: &Pictures, stride: u32) -> Buf<[f32; 4]> {
        rec.section("loss");
        let Photometric { partials, group_sums } = self;
        let Pictures { image, truth, d_image, size, n_visible } = *pictures;
        let [width, height] = size;
        let n_values = 3.0 * n_visible as f32;
        let l1_weight = (1.0 - SSIM_WEIGHT) / n_values;
        let is_halved = stride != 1;
        let tiles = |rows: u32| width.div_ceil(TILE_COLUMNS) * height.div_ceil(rows);
        let args = ssim::Args { image, truth, partials, sums: group_sums };
        let n = tiles(RUN * stride);
        rec.pass_variant(generated::ssim(is_halved), args, ssim::Push { width, height }, Grid::Groups(n));
        let args = ssim_bwd::Args { partials, image, truth, d_image };
        let ssim_weight = pixels_per_place(stride, size) as f32 * SSIM_WEIGHT / n_values;
        let push = ssim_bwd::Push { width, height, l1_weight, ssim_weight };
        rec.pass_variant(generated::ssim_bwd(is_halved), args, push, Grid::Groups(tiles(RUN)));
        group_sums.range(0, n as usize)
    }

    /// SSIM, mean absolute and mean squared error over the visible pixels of a picture of this size, from the total of the sums.
    /// Hidden pixels equal the truth, so they add to 1 - SSIM only where a visible neighbour differs.
    pub fn values(sums: [f32; 4], n_visible: u32, size: [u32; 2], stride: u32) -> [f64; 3] {
        let [lost, absolute, squared, _] = sums.map(|sum| f64::from(sum) / (3.0 * f64::from(n_visible)));
        [1.0 - lost * pixels_per_place(stride, size), absolute, squared]
    }
}

/// Threads per workgroup of the kernel that leaves one sum each.
const LOCAL: u32 = 64;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthSpace {
    /// 1 / scene units: what monocular networks predict.
    #[default]
    Inverse,
    Metric,
}

/// Weights of a picture's terms, and over how many pixels their means are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PriorWeights {
    pub depth: f64,
    pub flow: f64,
    /// Pixels that count and have a prior.
    pub n_depth: u32,
    pub n_flow: u32,
}

/// Priors of a picture on the device: halves, see [`half_bits`](crate::scene::capture::half_bits); [`NO_PRIOR`] where it has none.
#[derive(Clone)]
pub struct PriorPlanes {
    /// Depths, two pixels a word.
    pub depths: Buf<u32>,
    /// Flow, a pixel a word: columns in the low half, rows in the high one.
    pub flows: Buf<u32>,
}

#[derive(Clone, Copy)]
pub struct PriorPicture<'a> {
    pub image: &'a Buf<[f32; 4]>,
    pub d_image: &'a Buf<[f32; 4]>,
    /// Its mask lets a pixel count.
    pub truth: &'a Buf<u32>,
    pub n_pixels: u32,
}

/// A word of halves that are not finite.
pub const NO_PRIOR: u32 = 0x7c00_7c00;

pub struct PriorLoss {
    group_sums: Buf<[f32; 4]>,
    space: DepthSpace,
}

impl PriorLoss {
    pub fn new(gpu: &Gpu, pixels: usize, space: DepthSpace) -> Result<Self> {
        Ok(PriorLoss { group_sums: gpu.alloc("prior loss sums", pixels.div_ceil(LOCAL as usize))?, space })
    }

    /// Appends the losses of `picture` against `priors`, and their cotangents. Gives sums by workgroup: error of the depth, end-point
    /// error of the flow.
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

/// Most terms whose sums one pass adds up.
pub const MOST_TERMS: usize = 4;

pub struct Report<'a> {
    /// Four sums for each term, [`MOST_TERMS`] terms in a buffer. One buffer at least.
    pub totals: &'a [Buf<[f32; 4]>],
    pub status: &'a Buf<Status>,
    pub n_bad: &'a Buf<u32>,
}

/// Appends the addition of what each of `terms` left, [`MOST_TERMS`] at most: its four sums become one of `totals`.
pub fn record_totals(rec: &mut Recording, terms: &[Buf<[f32; 4]>], totals: &Buf<[f32; 4]>) {
    let Some(first) = terms.first() else { return };
    let ([sums0, sums1, sums2, sums3], [n0, n1, n2, n3]) = padded(terms, first);
    let args = loss_sum::Args { sums0, sums1, sums2, sums3, loss: totals };
    rec.pass(args, loss_sum::Push { n0, n1, n2, n3 }, Grid::Groups(terms.len() as u32));
}

/// As [`record_totals`], with the step's status and bad gradients, `to` where the host can read them.
pub fn record_report(
    rec: &mut Recording,
    terms: &[Buf<[f32; 4]>],
    status: &Buf<Status>,
    n_bad: &Buf<u32>,
    to: &Report,
) {
    let none = n_bad.cast();
    let (terms, more) = terms.split_at(terms.len().min(MOST_TERMS));
    for (terms, totals) in more.chunks(MOST_TERMS).zip(&to.totals[1..]) {
        record_totals(rec, terms, totals);
    }
    let ([sums0, sums1, sums2, sums3], [n0, n1, n2, n3]) = padded(terms, terms.first().unwrap_or(&none));
    let args = loss_sum_report::Args {
        sums0,
        sums1,
        sums2,
        sums3,
        loss: &to.totals[0],
        frame_status: status,
        n_bad,
        left_status: to.status,
        left_bad: to.n_bad,
    };
    rec.pass(args, loss_sum_report::Push { n0, n1, n2, n3 }, Grid::Groups(terms.len().max(1) as u32));
}

/// The sums of each of four terms and how many there are; of one that is missing, 0 of `any`.
fn padded<'a>(terms: &'a [Buf<[f32; 4]>], any: &'a Buf<[f32; 4]>) -> ([&'a Buf<[f32; 4]>; 4], [u32; 4]) {
    assert!(terms.len() <= MOST_TERMS, "{} terms", terms.len());
    let four = std::array::from_fn(|term| terms.get(term));
    (four.map(|sums| sums.unwrap_or(any)), four.map(|sums| sums.map_or(0, |sums| sums.len() as u32)))
}
