//! The photometric loss of SPEC 4: 0.8 L1 + 0.2 (1 - SSIM), value and cotangent.

use crate::error::Result;
use crate::gpu::generated::{loss_sum, ssim_bwd_columns, ssim_bwd_rows, ssim_columns, ssim_rows};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Outputs per thread along the filter's axis, `RUN` of the shaders.
const RUN: u32 = 4;
/// Threads per workgroup of the kernel that leaves one sum each.
const LOCAL: u32 = 64;

/// Weight of 1 - SSIM; L1 has the rest.
pub const SSIM_WEIGHT: f32 = 0.2;

/// Scratch and result of the photometric loss.
pub struct Photometric {
    /// The training image: RGB and the mask in the top byte, 8 bits each, row-major.
    pub truth: Buf<u32>,
    /// Sums over pixels and channels: 1 - SSIM, absolute error, squared error. See [`Photometric::values`].
    pub sums: Buf<[f32; 4]>,
    moments: Buf<[f32; 4]>,
    partials: Buf<[f32; 4]>,
    filtered: Buf<[f32; 4]>,
    group_sums: Buf<[f32; 4]>,
}

impl Photometric {
    /// Room for pictures of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize) -> Result<Self> {
        Ok(Photometric {
            truth: gpu.alloc("truth", pixels)?,
            sums: gpu.alloc("loss", 1)?,
            moments: gpu.alloc("ssim moments", 4 * pixels)?,
            partials: gpu.alloc("ssim partials", 3 * pixels)?,
            filtered: gpu.alloc("ssim filtered", 3 * pixels)?,
            // Every thread serves at least one pixel.
            group_sums: gpu.alloc("loss sums", pixels.div_ceil(LOCAL as usize))?,
        })
    }

    /// Appends the loss of `image` (colour in the first three channels, `[height][width]`) against the truth, and its
    /// cotangent to `d_image`; `n_visible` pixels are not hidden by the mask, at least one.
    pub fn record(
        &self,
        rec: &mut Recording,
        image: &Buf<[f32; 4]>,
        d_image: &Buf<[f32; 4]>,
        [width, height]: [u32; 2],
        n_visible: u32,
    ) {
        rec.stage("loss");
        let Photometric { truth, sums, moments, partials, filtered, group_sums } = self;
        let rows = Grid::Threads(width.div_ceil(RUN) * height);
        let n_columns = height.div_ceil(RUN) * width;
        let n_values = 3.0 * n_visible as f32;
        rec.pass(ssim_rows::Args { image, truth, moments }, ssim_rows::Push { width, height }, rows.clone());
        rec.pass(
            ssim_columns::Args { moments, image, truth, partials, sums: group_sums },
            ssim_columns::Push { width, height },
            Grid::Threads(n_columns),
        );
        rec.pass(ssim_bwd_rows::Args { partials, filtered }, ssim_bwd_rows::Push { width, height }, rows);
        rec.pass(
            ssim_bwd_columns::Args { filtered, image, truth, d_image },
            ssim_bwd_columns::Push {
                width,
                height,
                l1_weight: (1.0 - SSIM_WEIGHT) / n_values,
                ssim_weight: SSIM_WEIGHT / n_values,
            },
            Grid::Threads(n_columns),
        );
        let n = n_columns.div_ceil(LOCAL);
        rec.pass(loss_sum::Args { sums: group_sums, loss: sums }, loss_sum::Push { n }, Grid::Groups(1));
    }

    /// SSIM, mean absolute and mean squared error over the visible pixels, from the sums. Hidden pixels equal the truth, so
    /// they add to 1 - SSIM only where a visible neighbour differs.
    pub fn values(sums: [f32; 4], n_visible: u32) -> [f64; 3] {
        let [structure, absolute, squared, _] = sums.map(|sum| f64::from(sum) / (3.0 * f64::from(n_visible)));
        [1.0 - structure, absolute, squared]
    }
}
