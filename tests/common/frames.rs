//! Frames of the device beside those of the reference.

use super::device::gpu;
use ivv::Constants;
use ivv::internals::reference::Outputs as Truth;
use ivv::internals::scene::{Frame, Splats, View};
use ivv::internals::stage::{FrameReport, Outputs, Renderer};
pub use ivv_conformance::frames::*;

/// All outputs of `splats` seen by `view`, by a fresh renderer with the default constants.
pub fn render(splats: &Splats, view: &View) -> (Frame, FrameReport) {
    render_with(splats, view, Constants::default())
}

pub fn render_with(splats: &Splats, view: &View, constants: Constants) -> (Frame, FrameReport) {
    let gpu = gpu();
    Renderer::new(gpu.clone(), splats, constants).unwrap().render(view, Outputs::All).unwrap()
}

pub fn psnr(a: &Frame, b: &Frame) -> f64 {
    -20.0 * rms(a, b).log10()
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
    assert!(with(|_| ()).is_ok());
    assert!(with(|frame| frame.alpha[0] += 4e-6).is_ok());
    assert!(with(|frame| frame.alpha[0] += 6e-6).is_err(), "an error away from the band");
    assert!(with(|frame| frame.alpha[1] += 0.009).is_ok(), "an error in the band");
    assert!(with(|frame| frame.alpha[1] += 0.011).is_err(), "a large error in the band");
    assert!(with(|frame| frame.flow[0][1] = 1e-30).is_err(), "a flow that should be exactly zero");
    assert!(with(|frame| frame.color[1][2] = f32::NAN).is_err(), "NaN in the band");
    assert!(with(|frame| frame.depth.truncate(1)).is_err(), "a missing pixel");
    let (frame, truth) = pair();
    assert!(compare(&frame, &truth, &Tolerance::default()).is_err(), "half of the pixels in the band");
    assert_eq!(rms(&frame, &frame), 0.0);
    assert!(compare(&Frame::default(), &Truth::default(), &tolerance).is_err(), "nothing to compare");
}
