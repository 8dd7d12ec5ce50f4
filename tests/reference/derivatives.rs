//! Dual numbers against central finite differences.

use super::{relative_l2, tensors, zero_like};
use crate::common::golden::group;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::render;
use ivv::internals::reference::{Dual, Real, jvp, project};

const GROUPS: [&str; 10] =
    ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale", "time_offset", "background"];

fn direction(params: &Params<f64>, name: &str, seed: u64) -> Params<f64> {
    let mut random = Random::new(seed);
    let mut tangent = zero_like(params);
    for number in group(&mut tangent, name) {
        *number = random.uniform(-1.0, 1.0);
    }
    tangent
}

/// A name, the function on dual numbers and the same on plain ones.
type Function = (&'static str, fn(Dual) -> Dual, fn(f64) -> f64);

#[test]
fn dual_arithmetic_matches_finite_differences() {
    let functions: [Function; 7] = [
        ("exp", Real::exp, f64::exp),
        ("ln", Real::ln, f64::ln),
        ("sqrt", Real::sqrt, f64::sqrt),
        ("product", |x| x * (x + Dual::from_f64(2.0)), |x| x * (x + 2.0)),
        ("quotient", |x| (x - Dual::one()) / (x * x), |x| (x - 1.0) / (x * x)),
        ("negation", |x| -(x * x * x), |x| -(x * x * x)),
        ("min and max", |x| (x * x).max(x).min(Dual::from_f64(3.0)), |x| (x * x).max(x).min(3.0)),
    ];
    let step = 1e-6;
    for (name, dual, plain) in functions {
        for x in [0.3, 0.8, 1.4, 2.5] {
            let found = dual(Dual::new(x, 1.0));
            let expected = (plain(x + step) - plain(x - step)) / (2.0 * step);
            assert_eq!(found.value, plain(x), "{name} at {x}");
            assert!((found.tangent - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{name} at {x}");
        }
    }
}

#[test]
fn a_dual_number_takes_the_derivative_of_the_branch_it_takes() {
    let (low, x) = (Dual::from_f64(1.0), Dual::new(0.5, 7.0));
    assert_eq!(x.max(low).tangent, 0.0);
    assert_eq!(x.min(low).tangent, 7.0);
    assert_eq!(Dual::new(-2.0, 3.0).abs().tangent, -3.0);
}

#[test]
fn derivatives_of_renders_match_finite_differences_in_every_group() {
    let (splats, view) = (scene(11, 40, 3), view());
    let rules = Rules::new(&Constants::default());
    let params = Params::<f64>::new(&splats, &view);
    for name in GROUPS {
        let tangent = direction(&params, name, 5);
        let (values, derivative) = jvp(&splats, &tangent, &view, &Constants::default());
        let step = 1e-6;
        let [plus, minus] = [step, -step].map(|h| render(&params.zip(&tangent, |x, t| x + h * t), &view, &rules));

        // Smooth pieces only: the same Gaussians on both sides.
        let smooth: Vec<bool> = (0..values.alpha.len())
            .map(|i| plus.n_contributing[i] == minus.n_contributing[i] && !values.near_discontinuity[i])
            .collect();
        let n_smooth = smooth.iter().filter(|x| **x).count();
        assert!(n_smooth * 10 > 9 * smooth.len(), "{name}: only {n_smooth} smooth pixels");

        let mut n_compared = 0;
        for (((tensor, found), (_, plus)), (_, minus)) in
            tensors(&derivative).into_iter().zip(tensors(&plus)).zip(tensors(&minus))
        {
            let channels = found.len() / smooth.len();
            let keep = |i: &usize| smooth[i / channels];
            let kept: Vec<usize> = (0..found.len()).filter(keep).collect();
            let found: Vec<f64> = kept.iter().map(|&i| found[i]).collect();
            let expected: Vec<f64> = kept.iter().map(|&i| (plus[i] - minus[i]) / (2.0 * step)).collect();
            if expected.iter().all(|x| *x == 0.0) {
                assert!(found.iter().all(|x| *x == 0.0), "{tensor} by {name}");
                continue;
            }
            let error = relative_l2(&found, &expected);
            assert!(error < 1e-6, "{tensor} by {name}: {error:e}");
            n_compared += 1;
        }
        assert!(n_compared > 0, "{name} changes nothing");
    }
}

fn flat(p: &Projected<Dual>) -> Vec<Dual> {
    [p.xy, p.m[0], p.m[1], p.flow].as_flattened().iter().chain(&p.color).chain(&[p.opacity, p.z]).copied().collect()
}

#[test]
fn the_length_of_a_quaternion_has_no_derivative() {
    let (splats, view) = (scene(4, 30, 1), view());
    let params = Params::<f64>::new(&splats, &view);
    let mut along = zero_like(&params);
    along.rotation.clone_from(&params.rotation);
    let dual = params.zip(&along, Dual::new);
    let rules = Rules::<Dual>::new(&Constants::default());
    let camera = Camera::new(&view);
    let time = camera.shifted_time(dual.time_offset);
    let projected: Vec<_> = (0..dual.len()).filter_map(|i| project(&dual.gaussian(i), &camera, time, &rules)).collect();
    assert!(projected.len() > 10, "too few are visible");
    for p in projected {
        assert!(flat(&p).iter().all(|x| x.tangent.abs() < 1e-13 * (1.0 + x.value.abs())), "{p:?}");
    }
}

#[test]
fn outside_the_clamp_the_jacobian_does_not_turn_with_the_centre() {
    let view = view();
    let rules = Rules::<Dual>::new(&Constants::default());
    let camera = Camera::<Dual>::new(&view);
    // By the derivative of m along x: none outside in the x column, since only u depends on x.
    let m_tangent = |x: f64| {
        let mut splats = super::single([0.0, 0.0, 0.0]);
        splats.scale[0] = [-1.0, -2.0, 1.0];
        let mut params = Params::<Dual>::new(&splats, &view);
        params.position[0][0] = Dual::new(x, 1.0);
        let p = project(&params.gaussian(0), &camera, Dual::from_f64(0.0), &rules).expect("visible");
        p.m.as_flattened().iter().map(|x| x.tangent.abs()).fold(0.0, f64::max)
    };
    assert!(m_tangent(1.0) > 1e-3, "inside, the footprint follows the centre");
    assert_eq!(m_tangent(40.0), 0.0, "outside, it does not");
}
