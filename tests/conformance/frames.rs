//! Frames of the device beside those of the reference.

use anyhow::{Result, bail, ensure};
use ivv::internals::reference::Outputs as Truth;
use ivv::internals::scene::Frame;

fn pixel(frame: &Frame, i: usize) -> [f32; 8] {
    let ([r, g, b], [x, y]) = (frame.color[i], frame.flow[i]);
    [r, g, b, frame.alpha[i], frame.depth[i], frame.inverse_depth[i], x, y]
}

/// The floats of a frame, pixel by pixel: colour, alpha, depth, inverse depth, flow.
pub fn pixels(frame: &Frame) -> Vec<[f32; 8]> {
    let n = frame.width as usize * frame.height as usize;
    assert_eq!([frame.color.len(), frame.alpha.len(), frame.depth.len(), frame.flow.len()], [n; 4]);
    (0..n).map(|i| pixel(frame, i)).collect()
}

/// Every float of a frame as bits, so that -0 and 0 differ.
pub fn bits(frame: &Frame) -> Vec<[u32; 8]> {
    pixels(frame).into_iter().map(|p| p.map(f32::to_bits)).collect()
}

pub fn check_finite(frame: &Frame) -> Result<()> {
    match (0..frame.alpha.len()).map(|i| (i, pixel(frame, i))).find(|(_, p)| p.iter().any(|x| !x.is_finite())) {
        Some((i, pixel)) => bail!("pixel {i} is {pixel:?}"),
        None => Ok(()),
    }
}

/// The bounds of [`compare`]. Errors are in units of the largest magnitude of the tensor in the truth.
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

/// An error, and the most that may be, in the same unit.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    pub error: f64,
    pub allowed: f64,
}

/// Compares every output of every pixel with the truth; a tensor that is zero everywhere must be exactly so. Gives the
/// error that is nearest to what is allowed.
pub fn compare(frame: &Frame, truth: &Truth<f64>, tolerance: &Tolerance) -> Result<Compared> {
    let n = truth.alpha.len();
    let expected = |i: usize| -> [f64; 8] {
        let ([r, g, b], [x, y]) = (truth.color[i], truth.flow[i]);
        [r, g, b, truth.alpha[i], truth.depth[i], truth.inverse_depth[i], x, y]
    };
    let lengths = [frame.color.len(), frame.alpha.len(), frame.depth.len(), frame.flow.len()];
    ensure!(n > 0 && lengths == [n; 4], "{} pixels, {n} in the truth", frame.color.len());
    check_finite(frame)?;
    let n_band = truth.near_discontinuity.iter().filter(|near| **near).count() as f64 / n as f64;
    ensure!(n_band <= tolerance.n_band, "{:.0} % of the pixels are in the band", 100.0 * n_band);
    let mut worst = Compared { error: 0.0, allowed: tolerance.away };
    for (name, channels) in [("color", 0..3), ("alpha", 3..4), ("depth", 4..5), ("1/depth", 5..6), ("flow", 6..8)] {
        let magnitude = |i| expected(i)[channels.clone()].iter().fold(0.0, |m, x| f64::max(m, x.abs()));
        let largest = (0..n).map(magnitude).fold(0.0, f64::max);
        for i in 0..n {
            let (a, b) = (pixel(frame, i), expected(i));
            for k in channels.clone() {
                let difference = (f64::from(a[k]) - b[k]).abs();
                let error = if difference == 0.0 { 0.0 } else { difference / largest };
                let near = truth.near_discontinuity[i];
                let allowed = if near { tolerance.band } else { tolerance.away };
                if error > allowed {
                    let place = if near { "in the band" } else { "away from the band" };
                    let (x, y) = (i as u32 % truth.width, i as u32 / truth.width);
                    bail!(
                        "{name} of pixel ({x}, {y}) {place} is {:e}, not {:e}: off by {error:.1e} of {largest:e}",
                        a[k],
                        b[k]
                    );
                }
                if error * worst.allowed > worst.error * allowed {
                    worst = Compared { error, allowed };
                }
            }
        }
    }
    Ok(worst)
}

/// Root of the mean squared difference of the colours: 1e-4 is a PSNR of 80 dB, peak 1.
pub fn rms(a: &Frame, b: &Frame) -> f64 {
    let squares = a.color.as_flattened().iter().zip(b.color.as_flattened()).map(|(x, y)| f64::from(x - y).powi(2));
    (squares.sum::<f64>() / (3 * a.color.len()) as f64).sqrt()
}
