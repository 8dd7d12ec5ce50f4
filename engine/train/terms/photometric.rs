//! The error of the colours: 0.8 of the mean absolute error and 0.2 of 1 - SSIM (SPEC 4). Always on.

use super::term::{LEAST_PIXELS, Left, Logged, Part, Rendered, Shown, Term, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording};
use crate::internals::train::psnr;
use crate::stage::{Photometric, Pictures, SSIM_WEIGHT};

pub(super) const TERM: TermKind = TermKind {
    logged: LOGGED,
    buffers: |_| &[("ssim partials", 36.0), ("loss sums", 2.0)],
    new: |gpu, config, _| {
        Ok(Some(Box::new(Colors { photometric: Photometric::new(gpu, 1)?, stride: config.loss.ssim_stride })))
    },
};

const LOGGED: &[Logged] = &[
    Logged { key: "l1", plot: "L1 of training images", from_zero: true },
    Logged { key: "ssim", plot: "SSIM of training images", from_zero: false },
    Logged { key: "psnr", plot: "", from_zero: false },
];

struct Colors {
    photometric: Photometric,
    stride: u32,
}

impl Term for Colors {
    fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.photometric = Photometric::new(gpu, pixels)?;
        Ok(())
    }

    fn record(&mut self, _: &Gpu, rec: &mut Recording, shown: &Shown, on: &Rendered) -> Result<Left> {
        let n = shown.size[0] * shown.size[1];
        // A picture smaller than that needs all of its pixels.
        if shown.n_visible < LEAST_PIXELS.min(n) {
            // Or values of an earlier step would count.
            rec.section("loss");
            rec.fill(on.colors.cotangent.range(0, n as usize).slice(), 0);
            return Ok(None);
        }
        let pictures = Pictures {
            image: on.colors.image,
            truth: on.truth,
            d_image: on.colors.cotangent,
            size: shown.size,
            n_visible: shown.n_visible,
        };
        Ok(Some(self.photometric.record(rec, &pictures, self.stride)))
    }

    fn parts(&self, shown: &Shown, sums: [f32; 4]) -> Vec<Part> {
        let [ssim, l1, mse] = Photometric::values(sums, shown.n_visible, shown.size, self.stride);
        let weight = f64::from(SSIM_WEIGHT);
        vec![
            Part::error("l1", l1, 1.0 - weight),
            Part { key: "ssim", value: ssim, error: 1.0 - ssim, weight },
            Part { key: "psnr", value: psnr(mse), error: 0.0, weight: 0.0 },
        ]
    }
}
