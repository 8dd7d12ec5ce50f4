//! LPIPS (SPEC 4, L_perc), of the picture or of a square of it.

use super::term::{Left, Logged, Part, Rendered, Shown, Term, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording};
use crate::internals::train::Loss;
use crate::random::Keyed;
use crate::stage::{self, Cotangent, Lpips};
use std::path::Path;

pub(super) const TERM: TermKind = TermKind {
    logged: &[Logged { key: "lpips", plot: "LPIPS of training images", from_zero: true }],
    new: |gpu, config, _| {
        let Loss { lpips, lpips_crop, .. } = config.loss;
        let Some(file) = config.loss.lpips_file() else { return Ok(None) };
        let network = Lpips::load(gpu, file)?;
        Ok(Some(Box::new(Perceptual { network, weight: lpips, crop: lpips_crop, seed: config.seed })))
    },
    ..TermKind::NONE
};

/// Purpose of the random numbers that place the crop; density control has 1 and 2.
const CROP: u64 = 3;

impl Loss {
    fn lpips_file(&self) -> Option<&Path> {
        self.lpips_weights.as_deref().filter(|_| self.lpips > 0.0)
    }

    #[doc(hidden)]
    pub fn has_lpips(&self) -> bool {
        self.lpips_file().is_some()
    }

    /// True if LPIPS lacks nothing but the weights of its trunk.
    #[doc(hidden)]
    pub fn lacks_lpips_weights(&self) -> bool {
        self.lpips > 0.0 && self.lpips_weights.is_none()
    }
}

struct Perceptual {
    network: Lpips,
    weight: f64,
    /// Side of the square, pixels; 0 for all.
    crop: u32,
    seed: u64,
}

impl Perceptual {
    /// First column and row, and size, of the compared square.
    fn part(&self, shown: &Shown) -> [[u32; 2]; 2] {
        let Shown { step, size, .. } = *shown;
        let crop = size.map(|side| if self.crop == 0 { side } else { side.min(self.crop) });
        let random = Keyed::new(&[self.seed, step, CROP]);
        let place = |axis: usize| (random.bits(axis as u64) % u64::from(size[axis] - crop[axis] + 1)) as u32;
        [[place(0), place(1)], crop]
    }
}

impl Term for Perceptual {
    fn record(&mut self, gpu: &Gpu, rec: &mut Recording, shown: &Shown, on: &Rendered) -> Result<Left> {
        let [origin, crop] = self.part(shown);
        // A picture too small for the trunk has no loss, as it has no score.
        if self.network.scratch_bytes(crop, true).is_err() {
            return Ok(None);
        }
        let compared = stage::Compared { image: on.colors.image, truth: on.truth, size: shown.size, origin, crop };
        let weight = self.weight as f32;
        self.network.record(gpu, rec, &compared, Some(Cotangent { d_image: on.colors.cotangent, weight })).map(Some)
    }

    fn parts(&self, _: &Shown, [value, ..]: [f32; 4]) -> Vec<Part> {
        vec![Part::error("lpips", f64::from(value), self.weight)]
    }
}
