//! The reference against the independent float64 implementation. Measured: outputs within 2e-15, derivatives within 2e-14.

use super::{relative_l2, tensors, zero_like};
use crate::common::golden::{CASES, Tensors, group, load};
use crate::common::prelude::*;
use ivv::internals::reference::jvp_of;
use ivv::internals::reference::render;

/// The golden program's constants: the decimals of SPEC 3 in double precision, not rounded to f32.
const RULES: Rules<f64> = Rules { alpha_min: 1.0 / 255.0, alpha_max: 0.99, t_min: 1e-4, blur: 0.3, near: 0.01 };

/// Compares every tensor; `static-small` has no flow, so its flow must be exactly zero.
fn assert_outputs(case: &str, found: &[(&str, Vec<f64>)], truth: &Tensors, tolerance: f64) {
    for (name, values) in found {
        let truth = &truth[*name];
        if case == "static-small" && *name == "flow" {
            assert_eq!(values, truth, "a static scene flows");
            assert!(values.iter().all(|x| *x == 0.0), "a static scene flows");
            continue;
        }
        let error = relative_l2(values, truth);
        assert!(error < tolerance, "{case}: {name} differs by {error:e}");
    }
}

#[test]
fn outputs_of_every_golden_case_match() {
    for case in CASES {
        let Some(golden) = load(case) else { continue };
        let outputs = render(&golden.params, &golden.view, &RULES);
        let covered = outputs.n_contributing.iter().filter(|n| **n > 0).count();
        assert!(covered * 4 > outputs.alpha.len(), "{case}: only {covered} pixels are covered");
        assert_outputs(case, &tensors(&outputs), &golden.outputs, 1e-13);
    }
}

#[test]
fn the_constants_that_f32_holds_change_the_golden_outputs_by_less_than_a_rounding_of_f32() {
    for case in CASES {
        let Some(golden) = load(case) else { continue };
        let outputs = render_f64(&golden.splats, &golden.view, &Constants::default());
        assert_outputs(case, &tensors(&outputs), &golden.outputs, 6e-8);
    }
}

#[test]
fn golden_gradients_match_directional_derivatives_in_every_group() {
    for case in CASES {
        let Some(golden) = load(case) else { continue };
        assert_eq!(golden.gradients.len(), 9, "{case}: every group has a gradient");
        for (name, gradient) in &golden.gradients {
            let mut random = Random::new(gradient.len() as u64);
            let mut tangent = zero_like(&golden.params);
            for number in group(&mut tangent, name) {
                *number = random.uniform(-1.0, 1.0);
            }
            let direction: Vec<f64> = group(&mut tangent, name).into_iter().map(|x| *x).collect();
            let (_, derivative) = jvp_of(&golden.params, &tangent, &golden.view, &RULES);

            let (expected, size) = dot(&direction, gradient);
            assert!(size > 0.0, "{case}: the gradient of {name} is zero");
            let found: f64 =
                tensors(&derivative).iter().map(|(name, values)| dot(values, &golden.cotangents[*name]).0).sum();
            let error = (found - expected).abs() / size;
            assert!(error < 1e-11, "{case}: {name}: {found} but {expected}, {error:e}");
        }
    }
}

/// The sum of the products, and their Euclidean norm: the size of a sum of random signs.
fn dot(a: &[f64], b: &[f64]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let terms: Vec<f64> = a.iter().zip(b).map(|(x, y)| x * y).collect();
    (terms.iter().sum(), terms.iter().map(|x| x * x).sum::<f64>().sqrt())
}
