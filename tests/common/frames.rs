//! Frames of the device beside those of the twin.

use super::device::gpu;
use ivv::Constants;
use ivv::scene::{Frame, Splats, View};
use ivv::stage::{FrameReport, Outputs, Renderer};
use ivv::twin::Outputs as Truth;

/// All outputs of `splats` seen by `view`, by a fresh renderer with the default constants.
pub fn render(splats: &Splats, view: &View) -> (Frame, FrameReport) {
    render_with(splats, view, Constants::default())
}

/// As [`render`], with other constants.
pub fn render_with(splats: &Splats, view: &View, constants: Constants) -> (Frame, FrameReport) {
    let gpu = gpu();
    Renderer::new(gpu.clone(), splats, constants).unwrap().render(view, Outputs::All).unwrap()
}

/// The floats of a frame, pixel by pixel: colour, alpha, depth, inverse depth, flow.
pub fn pixels(frame: &Frame) -> Vec<[f32; 8]> {
    let n = frame.width as usize * frame.height as usize;
    assert_eq!([frame.color.len(), frame.alpha.len(), frame.depth.len(), frame.flow.len()], [n; 4]);
    (0..n)
        .map(|i| {
            let ([r, g, b], [x, y]) = (frame.color[i], frame.flow[i]);
            [r, g, b, frame.alpha[i], frame.depth[i], frame.inverse_depth[i], x, y]
        })
        .collect()
}

/// Every float of a frame as bits, so that -0 and 0 differ.
pub fn bits(frame: &Frame) -> Vec<[u32; 8]> {
    pixels(frame).into_iter().map(|p| p.map(f32::to_bits)).collect()
}

/// Says where a frame holds something that is not finite.
pub fn check_finite(frame: &Frame) -> Result<(), String> {
    match pixels(frame).iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(i) => Err(format!("pixel {i} is {:?}", pixels(frame)[i])),
        None => Ok(()),
    }
}

/// What [`compare`] allows. Errors are in units of the largest magnitude of the tensor in the truth.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Largest error of a pixel where the truth is far from every discontinuity.
    pub away: f64,
    /// Largest error of a pixel where rounding may decide which Gaussians are added.
    pub band: f64,
    /// Largest part of the pixels that may be in the band.
    pub n_band: f64,
}

impl Default for Tolerance {
    /// 1e-5 is below A.3's 1/65536 of the range; five Gaussians more or less at alpha_min; a twentieth of the pixels.
    fn default() -> Self {
        Tolerance { away: 1e-5, band: 0.02, n_band: 0.05 }
    }
}

/// What [`compare`] found, in the units of [`Tolerance`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    pub away: f64,
    pub band: f64,
    pub n_band: f64,
}

/// Compares every output of every pixel with the truth; a tensor that is zero everywhere must be exactly so.
pub fn compare(frame: &Frame, truth: &Truth<f64>, tolerance: &Tolerance) -> Result<Errors, String> {
    check_finite(frame)?;
    let found = pixels(frame);
    let expected: Vec<[f64; 8]> = (0..truth.alpha.len())
        .map(|i| {
            let ([r, g, b], [x, y]) = (truth.color[i], truth.flow[i]);
            [r, g, b, truth.alpha[i], truth.depth[i], truth.inverse_depth[i], x, y]
        })
        .collect();
    if found.len() != expected.len() || found.is_empty() {
        return Err(format!("{} pixels, {} in the truth", found.len(), expected.len()));
    }
    let n_band = truth.near_discontinuity.iter().filter(|near| **near).count() as f64 / found.len() as f64;
    let mut errors = Errors { n_band, ..Errors::default() };
    if n_band > tolerance.n_band {
        return Err(format!("{:.0} % of the pixels are in the band", 100.0 * n_band));
    }
    for (name, channels) in [("color", 0..3), ("alpha", 3..4), ("depth", 4..5), ("1/depth", 5..6), ("flow", 6..8)] {
        let magnitudes = expected.iter().flat_map(|p| &p[channels.clone()]).map(|x| x.abs());
        let largest = magnitudes.fold(0.0, f64::max);
        for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
            for k in channels.clone() {
                let difference = (f64::from(a[k]) - b[k]).abs();
                let error = if difference == 0.0 { 0.0 } else { difference / largest };
                let near = truth.near_discontinuity[i];
                let (worst, allowed) =
                    if near { (&mut errors.band, tolerance.band) } else { (&mut errors.away, tolerance.away) };
                *worst = worst.max(error);
                if error > allowed {
                    let place = if near { "in the band" } else { "away from the band" };
                    let (x, y) = (i as u32 % truth.width, i as u32 / truth.width);
                    return Err(format!(
                        "{name} of pixel ({x}, {y}) {place} is {:e}, not {:e}: off by {error:.1e} of {largest:e}",
                        a[k], b[k]
                    ));
                }
            }
        }
    }
    Ok(errors)
}

/// Peak signal-to-noise ratio of the colours, dB, peak 1; infinite when they are equal.
pub fn psnr(a: &Frame, b: &Frame) -> f64 {
    assert_eq!(a.color.len(), b.color.len());
    let squares = a.color.as_flattened().iter().zip(b.color.as_flattened()).map(|(x, y)| f64::from(x - y).powi(2));
    -10.0 * (squares.sum::<f64>() / (3 * a.color.len()) as f64).log10()
}
