//! The photometric loss of a pair of pictures, on the device and in dual numbers.

use crate::extremes::random::Random;
use crate::gpu::{Gpu, Recording};
use crate::stage::{Photometric, Pictures, Structure};
use crate::twin::{Dual, Photometry, photometric};
use anyhow::{Result, ensure};

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];

/// A rendered picture and the training image that it is compared with.
#[derive(Clone)]
pub struct Pair {
    /// Width and height.
    pub size: [u32; 2],
    /// Colours.
    pub image: Vec<[f32; 3]>,
    /// Pixels of the training image, as [`word`] makes them.
    pub truth: Vec<u32>,
}

/// What the device makes of a pair.
#[derive(Debug, PartialEq)]
pub struct Found {
    /// Structural similarity.
    pub ssim: f64,
    /// Mean absolute error.
    pub l1: f64,
    /// As bits, so that -0 and 0 differ.
    d_image: Vec<[u32; 3]>,
}

/// A pixel of the training image.
pub fn word(rgb: [u8; 3], mask: u8) -> u32 {
    u32::from_le_bytes([rgb[0], rgb[1], rgb[2], mask])
}

impl Pair {
    /// Of functions of the place.
    pub fn new(size: [u32; 2], image: impl Fn(u32, u32) -> [f32; 3], truth: impl Fn(u32, u32) -> u32) -> Self {
        let places = || (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| (x, y)));
        Pair {
            size,
            image: places().map(|(x, y)| image(x, y)).collect(),
            truth: places().map(|(x, y)| truth(x, y)).collect(),
        }
    }

    /// Noise against noise; `mask` says what the mask holds at a pixel.
    pub fn random(seed: u64, size: [u32; 2], mask: impl Fn(usize) -> u8) -> Self {
        let mut random = Random::new(seed);
        let n = (size[0] * size[1]) as usize;
        let truth = |i| {
            let [r, g, b, _] = (random.bits() as u32).to_le_bytes();
            word([r, g, b], mask(i))
        };
        let truth = (0..n).map(truth).collect();
        Pair { size, image: (0..n).map(|_| random.vector(0.0, 1.0)).collect(), truth }
    }

    /// Pixels that the mask shows.
    pub fn n_visible(&self) -> usize {
        self.truth.iter().filter(|word| **word >> 24 != 0).count()
    }

    /// The loss with a derivative along `w`.
    pub fn dual(&self, w: &[[f32; 3]]) -> Photometry<Dual> {
        self.dual_at(w, 1)
    }

    /// The same with SSIM at every `stride`-th pixel of every `stride`-th row.
    pub fn dual_at(&self, w: &[[f32; 3]], stride: usize) -> Photometry<Dual> {
        let dual = |(x, w): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| Dual::new(x[k].into(), w[k].into()));
        let image: Vec<[Dual; 3]> = self.image.iter().zip(w).map(dual).collect();
        photometric(&image, &self.truth, self.size.map(|n| n as usize), self.n_visible(), stride)
    }

    /// The device's, in a scratch for a larger picture, with a guard behind the last pixel.
    ///
    /// # Errors
    /// Those of the device, and a pixel that was written and should not have been.
    pub fn on_device(&self, gpu: &Gpu) -> Result<Found> {
        self.on_device_with(gpu, Some(Structure::WHOLE))
    }

    /// The same with SSIM as `structure` says, or without it.
    ///
    /// # Errors
    /// As [`Pair::on_device`].
    pub fn on_device_with(&self, gpu: &Gpu, structure: Option<Structure>) -> Result<Found> {
        let n = self.image.len();
        let loss = Photometric::new(gpu, n + 3)?;
        let alpha = 0.25;
        let image: Vec<[f32; 4]> = self.image.iter().map(|[r, g, b]| [*r, *g, *b, alpha]).collect();
        let image = gpu.upload("image", &image)?;
        let d_image = gpu.upload("d image", &vec![GUARD; n + 1])?;
        let truth = gpu.upload("truth", &self.truth)?;
        let mut rec = Recording::new();
        let n_visible = self.n_visible() as u32;
        let pictures = Pictures { image: &image, truth: &truth, d_image: &d_image, size: self.size, n_visible };
        loss.record(&mut rec, &pictures, structure);
        gpu.run(&rec)?;
        let mut found = gpu.read(&d_image)?;
        ensure!(found.pop() == Some(GUARD), "the pixel past the end was overwritten");
        ensure!(found.iter().all(|d| d[3] == 0.0), "alpha has a part in the loss");
        let sums = gpu.read(&loss.sums)?[0];
        let [ssim, l1, _] =
            Photometric::values(sums, self.n_visible() as u32, self.size, structure.unwrap_or(Structure::WHOLE));
        Ok(Found { ssim, l1, d_image: found.into_iter().map(|[r, g, b, _]| [r, g, b].map(f32::to_bits)).collect() })
    }
}

impl Found {
    /// The cotangent of the picture.
    pub fn d_image(&self) -> Vec<[f64; 3]> {
        self.d_image.iter().map(|d| d.map(|x| f64::from(f32::from_bits(x)))).collect()
    }

    /// The cotangent's largest magnitude.
    pub fn largest(&self) -> f64 {
        self.d_image().as_flattened().iter().fold(0.0, |most, x| f64::max(most, x.abs()))
    }
}
