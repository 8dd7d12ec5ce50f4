//! The photometric loss of SPEC 4: 0.8 L1 + 0.2 (1 - SSIM), value and cotangent.

use crate::error::Result;
use crate::gpu::generated::constants::ssim::RUN;
use crate::gpu::generated::{self, l1, loss_sum, ssim_bwd_columns, ssim_bwd_rows, ssim_columns, ssim_rows};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Threads per workgroup of the kernel that leaves one sum each.
const LOCAL: u32 = l1::INFO.local;

/// Weight of 1 - SSIM; L1 has the rest.
pub const SSIM_WEIGHT: f32 = 0.2;

/// Where SSIM is taken, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Structure {
    /// At every pixel (1), or at every second of every second row (2), each of which stands for four.
    pub stride: u32,
    /// Times [`SSIM_WEIGHT`].
    pub times: f32,
}

impl Structure {
    /// SPEC 4's.
    pub const WHOLE: Structure = Structure { stride: 1, times: 1.0 };

    /// Pixels that each place stands for, in the mean over a picture of this size.
    fn pixels_per_place(self, [width, height]: [u32; 2]) -> f64 {
        let places = f64::from(width.div_ceil(self.stride)) * f64::from(height.div_ceil(self.stride));
        f64::from(width) * f64::from(height) / places
    }
}

/// What is compared, `[height][width]` and row-major, and where the cotangent goes.
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

/// Scratch and result of the photometric loss.
pub struct Photometric {
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
            sums: gpu.alloc("loss", 1)?,
            moments: gpu.alloc("ssim moments", 3 * pixels)?,
            partials: gpu.alloc("ssim partials", 3 * pixels)?,
            filtered: gpu.alloc("ssim filtered", 3 * pixels)?,
            // Every thread serves at least one pixel.
            group_sums: gpu.alloc("loss sums", pixels.div_ceil(LOCAL as usize))?,
        })
    }

    /// Appends the loss of a picture against the truth, and its cotangent. Without a `structure` the absolute error is all
    /// there is.
    pub fn record(&self, rec: &mut Recording, pictures: &Pictures, structure: Option<Structure>) {
        rec.section("loss");
        let Photometric { sums, moments, partials, filtered, group_sums } = self;
        let Pictures { image, truth, d_image, size, n_visible } = *pictures;
        let [width, height] = size;
        let n_values = 3.0 * n_visible as f32;
        let l1_weight = (1.0 - SSIM_WEIGHT) / n_values;
        let Some(structure) = structure else {
            let n = width * height;
            let args = l1::Args { image, truth, d_image, sums: group_sums };
            rec.pass(args, l1::Push { n, l1_weight }, Grid::Threads(n));
            let n = n.div_ceil(LOCAL);
            rec.pass(loss_sum::Args { sums: group_sums, loss: sums }, loss_sum::Push { n }, Grid::Groups(1));
            return;
        };
        let stride = structure.stride;
        let (columns, rows) = (width.div_ceil(stride), height.div_ceil(stride));
        let of = [generated::ssim_rows, generated::ssim_columns, generated::ssim_bwd_rows, generated::ssim_bwd_columns];
        let [of_rows, of_columns, bwd_rows, bwd_columns] = of.map(|of| of(stride != 1));
        let args = ssim_rows::Args { image, truth, moments };
        let grid = Grid::Threads(columns.div_ceil(RUN) * height);
        rec.pass_variant(of_rows, args, ssim_rows::Push { width, height }, grid);
        let args = ssim_columns::Args { moments, image, truth, partials, sums: group_sums };
        let n_columns = rows.div_ceil(RUN) * columns;
        rec.pass_variant(of_columns, args, ssim_columns::Push { width, height }, Grid::Threads(n_columns));
        let args = ssim_bwd_rows::Args { partials, filtered };
        let grid = Grid::Threads(width.div_ceil(RUN) * rows);
        rec.pass_variant(bwd_rows, args, ssim_bwd_rows::Push { width, height }, grid);
        let args = ssim_bwd_columns::Args { filtered, image, truth, d_image };
        let ssim_weight = structure.times * structure.pixels_per_place(size) as f32 * SSIM_WEIGHT / n_values;
        let push = ssim_bwd_columns::Push { width, height, l1_weight, ssim_weight };
        rec.pass_variant(bwd_columns, args, push, Grid::Threads(height.div_ceil(RUN) * width));
        let n = n_columns.div_ceil(LOCAL);
        rec.pass(loss_sum::Args { sums: group_sums, loss: sums }, loss_sum::Push { n }, Grid::Groups(1));
    }

    /// SSIM, mean absolute and mean squared error over the visible pixels of a picture of this size, from the sums; without
    /// SSIM the first says nothing. Hidden pixels equal the truth, so
    /// they add to 1 - SSIM only where a visible neighbour differs.
    pub fn values(sums: [f32; 4], n_visible: u32, size: [u32; 2], structure: Structure) -> [f64; 3] {
        let [lost, absolute, squared, _] = sums.map(|sum| f64::from(sum) / (3.0 * f64::from(n_visible)));
        [1.0 - lost * structure.pixels_per_place(size), absolute, squared]
    }
}
