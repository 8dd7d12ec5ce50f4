//! The losses against priors of depth and flow (SPEC 4).

use super::real::Real;

/// Mean |D - D^| over the pixels that count and have a finite prior, and their number (mean 0 for none). No derivative where
/// the error is 0.
pub fn depth_loss<R: Real>(depth: &[R], prior: &[f32], counts: &[bool]) -> (R, usize) {
    let errors = depth.iter().zip(prior).zip(counts).filter(|((_, prior), counts)| **counts && prior.is_finite());
    mean(errors.map(|((depth, prior), _)| {
        let error = *depth - R::from_f64(f64::from(*prior));
        if error > R::zero() {
            error
        } else if error < R::zero() {
            -error
        } else {
            R::zero()
        }
    }))
}

/// Mean end-point error |F - F^| over the pixels that count and have a finite prior, and their number. No derivative where
/// the error is 0.
pub fn flow_loss<R: Real>(flow: &[[R; 2]], prior: &[[f32; 2]], counts: &[bool]) -> (R, usize) {
    let has = |prior: &[f32; 2]| prior.iter().all(|x| x.is_finite());
    let errors = flow.iter().zip(prior).zip(counts).filter(|((_, prior), counts)| **counts && has(prior));
    mean(errors.map(|((flow, prior), _)| {
        let [x, y] = [0, 1].map(|k| flow[k] - R::from_f64(f64::from(prior[k])));
        let square = x * x + y * y;
        if square > R::zero() { square.sqrt() } else { R::zero() }
    }))
}

fn mean<R: Real>(values: impl Iterator<Item = R>) -> (R, usize) {
    let (sum, n) = values.fold((R::zero(), 0), |(sum, n), x| (sum + x, n + 1));
    (sum / R::from_f64(f64::max(n as f64, 1.0)), n)
}
