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

/// The floats of pixel `i`: colour, alpha, depth, inverse depth, flow.
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

/// Says where a frame holds something that is not finite.
pub fn check_finite(frame: &Frame) -> Result<(), String> {
    match (0..frame.alpha.len()).map(|i| (i, pixel(frame, i))).find(|(_, p)| p.iter().any(|x| !x.is_finite())) {
        Some((i, pixel)) => Err(format!("pixel {i} is {pixel:?}")),
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

/// Compares every output of every pixel with the truth; a tensor that is zero everywhere must be exactly so.
pub fn compare(frame: &Frame, truth: &Truth<f64>, tolerance: &Tolerance) -> Result<(), String> {
    let n = truth.alpha.len();
    let expected = |i: usize| -> [f64; 8] {
        let ([r, g, b], [x, y]) = (truth.color[i], truth.flow[i]);
        [r, g, b, truth.alpha[i], truth.depth[i], truth.inverse_depth[i], x, y]
    };
    if n == 0 || [frame.color.len(), frame.alpha.len(), frame.depth.len(), frame.flow.len()] != [n; 4] {
        return Err(format!("{} pixels, {n} in the truth", frame.color.len()));
    }
    check_finite(frame)?;
    let n_band = truth.near_discontinuity.iter().filter(|near| **near).count() as f64 / n as f64;
    if n_band > tolerance.n_band {
        return Err(format!("{:.0} % of the pixels are in the band", 100.0 * n_band));
    }
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
                    return Err(format!(
                        "{name} of pixel ({x}, {y}) {place} is {:e}, not {:e}: off by {error:.1e} of {largest:e}",
                        a[k], b[k]
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Peak signal-to-noise ratio of the colours, dB, peak 1; infinite when they are equal.
pub fn psnr(a: &Frame, b: &Frame) -> f64 {
    assert_eq!(a.color.len(), b.color.len());
    let squares = a.color.as_flattened().iter().zip(b.color.as_flattened()).map(|(x, y)| f64::from(x - y).powi(2));
    -10.0 * (squares.sum::<f64>() / (3 * a.color.len()) as f64).log10()
}

/// A frame of two pixels and its truth, the second pixel in the band.
fn pair() -> (Frame, Truth<f64>) {
    let truth = Truth {
        width: 2,
        height: 1,
        color: vec![[1.0, 0.5, 0.25]; 2],
        alpha: vec![0.5; 2],
        depth: vec![4.0; 2],
        inverse_depth: vec![0.125; 2],
        flow: vec![[0.0; 2]; 2],
        n_contributing: vec![1; 2],
        near_discontinuity: vec![false, true],
    };
    let frame = Frame {
        width: 2,
        height: 1,
        color: vec![[1.0, 0.5, 0.25]; 2],
        alpha: vec![0.5; 2],
        depth: vec![4.0; 2],
        inverse_depth: vec![0.125; 2],
        flow: vec![[0.0; 2]; 2],
    };
    (frame, truth)
}

#[test]
fn the_comparison_of_frames_finds_what_it_is_made_to_find() {
    let tolerance = Tolerance { n_band: 0.5, ..Tolerance::default() };
    let with = |change: fn(&mut Frame)| {
        let (mut frame, truth) = pair();
        change(&mut frame);
        compare(&frame, &truth, &tolerance)
    };
    assert_eq!(with(|_| ()), Ok(()));
    assert_eq!(with(|frame| frame.alpha[0] += 4e-6), Ok(()));
    assert!(with(|frame| frame.alpha[0] += 6e-6).is_err(), "an error away from the band");
    assert_eq!(with(|frame| frame.alpha[1] += 0.009), Ok(()), "an error in the band");
    assert!(with(|frame| frame.alpha[1] += 0.011).is_err(), "a large error in the band");
    assert!(with(|frame| frame.flow[0][1] = 1e-30).is_err(), "a flow that should be exactly zero");
    assert!(with(|frame| frame.color[1][2] = f32::NAN).is_err(), "NaN in the band");
    assert!(with(|frame| frame.depth.truncate(1)).is_err(), "a missing pixel");
    let (frame, truth) = pair();
    assert!(compare(&frame, &truth, &Tolerance::default()).is_err(), "half of the pixels in the band");
    assert_eq!(psnr(&frame, &frame), f64::INFINITY);
    assert!(compare(&Frame::default(), &Truth::default(), &tolerance).is_err(), "nothing to compare");
}
