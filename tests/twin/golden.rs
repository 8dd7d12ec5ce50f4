//! The twin against the independent float64 implementation.

use ivv::Constants;
use ivv::twin::{Rules, jvp_of, render};

use super::{relative_l2, tensors, zero_like};
use crate::common::golden::{CASES, Tensors, group, load};
use crate::common::random::Random;

/// The golden program's constants: the decimals of SPEC 3 in double precision, not rounded to f32.
const RULES: Rules<f64> = Rules { alpha_min: 1.0 / 255.0, alpha_max: 0.99, t_min: 1e-4, blur: 0.3, near: 0.01 };

#[test]
fn outputs_of_every_golden_case_match() {
    for case in CASES {
        let Some(golden) = load(case) else { return };
        let outputs = render(&golden.params, &golden.view, &RULES);
        let covered = outputs.n_contributing.iter().filter(|n| **n > 0).count();
        assert!(covered * 4 > outputs.alpha.len(), "{case}: only {covered} pixels are covered");
        for (name, values) in tensors(&outputs) {
            let truth = &golden.outputs[name];
            if case == "static-small" && name == "flow" {
                assert!(values.iter().chain(truth).all(|x| *x == 0.0), "{case}: a static scene flows");
                continue;
            }
            let error = relative_l2(&values, truth);
            eprintln!("{case} {name} {error:e}");
            assert!(error < 1e-9, "{case}: {name} differs by {error:e}");
        }
    }
}

#[test]
fn golden_gradients_match_directional_derivatives_in_every_group() {
    for case in CASES {
        let Some(golden) = load(case) else { return };
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
            let found = against_cotangents(&tensors(&derivative), &golden.cotangents);
            let error = (found - expected).abs() / size;
            eprintln!("{case} {name} {error:e} {found:e}");
            assert!(error < 1e-6, "{case}: {name}: {found} but {expected}");
        }
    }
}

/// The sum of products, and the size of its terms taken together.
fn dot(a: &[f64], b: &[f64]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let terms: Vec<f64> = a.iter().zip(b).map(|(x, y)| x * y).collect();
    (terms.iter().sum(), terms.iter().map(|x| x * x).sum::<f64>().sqrt())
}

fn against_cotangents(derivative: &[(&str, Vec<f64>)], cotangents: &Tensors) -> f64 {
    derivative.iter().map(|(name, values)| dot(values, &cotangents[*name]).0).sum()
}
