//! The photometric loss of SPEC 4: 0.8 L1 + 0.2 (1 - SSIM), value and cotangent.

use crate::error::Result;
use crate::gpu::generated::constants::ssim_filter::{RUN, TILE_COLUMNS};
use crate::gpu::generated::{self, ssim, ssim_bwd};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Weight of 1 - SSIM; L1 has the rest.
pub const SSIM_WEIGHT: f32 = 0.2;

/// Pixels that each place of SSIM stands for, in the mean over a picture of this size.
fn pixels_per_place(stride: u32, [width, height]: [u32; 2]) -> f64 {
    let places = f64::from(width.div_ceil(stride)) * f64::from(height.div_ceil(stride));
    f64::from(width) * f64::from(height) / places
}

/// The pictures that are compared, `[height][width]` and row-major, and the place of the cotangent.
#[derive(Clone, Copy)]
pub struct Pictures<'a> {
    /// The picture: colour in the first three channels.
    pub image: &'a Buf<[f32; 4]>,
    /// The training image: RGB and the mask in the top byte, 8 bits each.
    pub truth: &'a Buf<u32>,
    /// The cotangent of `image`, which is overwritten.
    pub d_image: &'a Buf<[f32; 4]>,
    /// Width and height.
    pub size: [u32; 2],
    /// Pixels that the mask does not hide, at least 1.
    pub n_visible: u32,
}

/// Scratch of the photometric loss.
pub struct Photometric {
    partials: Buf<f32>,
    group_sums: Buf<[f32; 4]>,
}

/// Numbers of a place that the way back needs.
const PARTIALS: usize = 9;

impl Photometric {
    /// Room for pictures of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize) -> Result<Self> {
        Ok(Photometric {
            partials: gpu.alloc("ssim partials", PARTIALS * pixels)?,
            // A column of pixels has the most tiles of all pictures of so many.
            group_sums: gpu.alloc("loss sums", pixels.div_ceil(RUN as usize))?,
        })
    }

    /// Appends the loss of a picture against the truth, and its cotangent, with SSIM at every pixel (`stride` 1), or at every second
    /// of every second row (2), each of which stands for four. Gives sums by workgroup, over pixels and channels: 1 - SSIM, absolute
    /// error, squared error.
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
