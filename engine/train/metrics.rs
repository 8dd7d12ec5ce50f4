//! How well a picture matches its truth.

use crate::error::Result;
use crate::gpu::{Gpu, Recording};
use crate::scene::Frame;
use crate::scene::capture::Picture;
use crate::stage::Photometric;

/// Scores of one view.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Scores {
    /// Peak signal-to-noise ratio of the clamped colour, dB, over visible pixels.
    pub psnr: f64,
    /// Structural similarity of the clamped colour (SPEC 4's window, zero padding).
    pub ssim: f64,
    /// Mean absolute error.
    pub l1: f64,
}

/// Peak signal-to-noise ratio of a mean squared error of colours in [0, 1], dB.
pub fn psnr(mse: f64) -> f64 {
    -10.0 * mse.max(1e-12).log10()
}

/// Scores of `frame` against `picture`, of the same size.
pub fn scores(gpu: &Gpu, frame: &Frame, picture: &Picture) -> Result<Scores> {
    let clamped: Vec<[f32; 3]> = frame.color.iter().map(|c| c.map(|x| x.clamp(0.0, 1.0))).collect();
    let (mut squares, mut n_visible) = (0.0, 0u32);
    for (color, word) in clamped.iter().zip(&picture.pixels) {
        let [r, g, b, mask] = word.to_le_bytes();
        if mask > 0 {
            n_visible += 1;
            let truth = [r, g, b].map(|c| f64::from(c) / 255.0);
            squares += color.iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>();
        }
    }
    let n_visible = n_visible.max(1);
    let image: Vec<[f32; 4]> = clamped.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let image = gpu.upload("scored image", &image)?;
    let d_image = gpu.alloc("scored cotangent", clamped.len())?;
    let loss = Photometric::new(gpu, clamped.len())?;
    gpu.write(&loss.truth, &picture.pixels)?;
    let mut rec = Recording::new();
    loss.record(&mut rec, &image, &d_image, [picture.width, picture.height], n_visible);
    gpu.run(&rec)?;
    let sums = gpu.read(&loss.sums)?.first().copied().unwrap_or_default();
    let [ssim, l1, _] = Photometric::values(sums, n_visible);
    Ok(Scores { psnr: psnr(squares / (3.0 * f64::from(n_visible))), ssim, l1 })
}
