//! The adjoint test on the device of this lane.

use crate::common::device::bench;
use crate::common::prelude::*;
use ivv_conformance::adjoint;
pub use ivv_conformance::adjoint::{cotangents, dot, flat, is_finite};

pub fn vjp(splats: &Splats, view: &View, cotangents: &Frame) -> (Gradients, FrameReport) {
    let gpu = gpu();
    Renderer::new(gpu.clone(), splats, Constants::default()).unwrap().vjp(view, cotangents).unwrap()
}

/// Random cotangents away from the pixels where rounding decides what is added; at least half of them must be.
pub fn smooth_cotangents(seed: u64, splats: &Splats, view: &View) -> Frame {
    let truth = render_f64(splats, view, &Constants::default());
    assert!(truth.alpha.iter().any(|alpha| *alpha > 0.0), "an empty picture");
    let n_band = truth.near_discontinuity.iter().filter(|near| **near).count();
    assert!(2 * n_band <= truth.alpha.len(), "{n_band} of {} pixels are in the band", truth.alpha.len());
    cotangents(seed, view, |i| truth.near_discontinuity[i])
}

pub fn check_adjoint(
    splats: &Splats,
    view: &View,
    cotangents: &Frame,
    allowed: f64,
    least: usize,
) -> Result<(), String> {
    let checked = bench(false, |bench| adjoint::check_adjoint(bench, splats, view, cotangents, allowed, least));
    checked.map(drop).map_err(|fault| fault.to_string())
}
