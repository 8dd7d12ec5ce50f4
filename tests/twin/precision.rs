//! The same formulas in f32 and f64, and identities that hold bit for bit.

use ivv::Constants;
use ivv::scene::{Motion, Splats, View};
use ivv::twin::{Outputs, Params, Real, Rules, render};

use super::{relative_l2, tensors, with_motion};
use crate::common::golden::{CASES, load};
use crate::common::random::{scene, view};

fn render_as<R: Real>(splats: &Splats, view: &View) -> Outputs<R> {
    render(&Params::new(splats, view), view, &Rules::new(&Constants::default()))
}

/// f32 against f64: close everywhere, and the same Gaussians wherever the band does not warn.
fn assert_f32_agrees(what: &str, splats: &Splats, view: &View) {
    let (narrow, truth) = (render_as::<f32>(splats, view), render_as::<f64>(splats, view));
    for ((name, found), (_, expected)) in tensors(&narrow.map(f64::from)).iter().zip(tensors(&truth)) {
        if expected.iter().all(|x| *x == 0.0) {
            assert!(found.iter().all(|x| *x == 0.0), "{what}: {name} is not zero");
            continue;
        }
        let error = relative_l2(found, &expected);
        assert!(error < 1e-5, "{what}: {name} differs by {error:e}");
    }
    let n_marked = truth.near_discontinuity.iter().filter(|x| **x).count();
    assert!(n_marked * 20 < truth.alpha.len(), "{what}: {n_marked} of {} pixels are marked", truth.alpha.len());
    for i in 0..truth.alpha.len() {
        if !truth.near_discontinuity[i] {
            assert_eq!(narrow.n_contributing[i], truth.n_contributing[i], "{what}: pixel {i}");
        }
    }
}

#[test]
fn f32_agrees_with_f64_on_the_golden_scenes() {
    for case in CASES {
        let Some(golden) = load(case) else { return };
        assert_f32_agrees(case, &golden.splats, &golden.view);
    }
}

#[test]
fn f32_agrees_with_f64_on_random_scenes() {
    for seed in 0..12 {
        assert_f32_agrees(&format!("seed {seed}"), &scene(seed, 60, 2), &view());
    }
}

/// Every float of a render as bits, so that -0 and 0 differ.
fn bits(outputs: &Outputs<f32>) -> Vec<u32> {
    let floats = [&outputs.alpha, &outputs.depth, &outputs.inverse_depth];
    let flat = floats.into_iter().flatten();
    flat.chain(outputs.color.as_flattened()).chain(outputs.flow.as_flattened()).map(|x| x.to_bits()).collect()
}

#[test]
fn a_static_gaussian_renders_as_a_dynamic_one_without_velocity_and_with_infinite_tau_bit_for_bit() {
    let splats = Splats { n_static: 50, motion: vec![], ..scene(21, 50, 3) };
    let view = view();
    let fixed = render_as::<f32>(&splats, &view);
    assert!(fixed.n_contributing.iter().any(|n| *n > 3), "the image is empty");
    for t_center in [0.0, 0.4, 1e5] {
        let motion = Motion { velocity: [0.0; 3], t_center, t_scale: f32::INFINITY };
        let moving = render_as::<f32>(&with_motion(&splats, motion), &view);
        assert_eq!(bits(&fixed), bits(&moving), "t_center {t_center}");
        assert_eq!(fixed.n_contributing, moving.n_contributing);
    }
}

#[test]
fn the_length_of_a_quaternion_does_not_matter_in_f32() {
    let splats = scene(8, 40, 0);
    let view = view();
    let truth = render_as::<f64>(&splats, &view);
    for length in [1e-10, 1e-5, 1.0, 1e10, 1e19, 1e20] {
        let mut longer = splats.clone();
        for q in &mut longer.rotation {
            *q = q.map(|x| x * length);
        }
        let found: Vec<f64> = render_as::<f32>(&longer, &view).alpha.into_iter().map(f64::from).collect();
        let error = relative_l2(&found, &truth.alpha);
        assert!(error < 1e-5, "length {length}: {error:e}");
    }
}
