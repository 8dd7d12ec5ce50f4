//! The same formulas in f32 and f64, and identities that hold bit for bit.

use super::{relative_l2, tensors, with_motion};
use crate::common::golden::{CASES, load};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::render;
use ivv::internals::reference::{Outputs, Real};

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
        let Some(golden) = load(case) else { continue };
        assert_f32_agrees(case, &golden.splats, &golden.view);
    }
}

#[test]
fn f32_agrees_with_f64_on_random_scenes() {
    for seed in 0..12 {
        assert_f32_agrees(&format!("seed {seed}"), &scene(seed, 60, 2), &view());
    }
}

#[test]
fn far_from_the_origin_f32_adds_other_gaussians_only_where_the_band_warns() {
    let offset = [1000.0, -500.0, 250.0];
    let (mut n_different, mut n_marked, mut n) = (0, 0, 0);
    for seed in 0..6 {
        let (mut splats, mut view) = (scene(seed, 60, 0), view());
        for position in &mut splats.position {
            *position = std::array::from_fn(|k| position[k] + offset[k]);
        }
        // Turned, so that the large terms of R x + t round before they cancel: R (x - offset) + (0, 0, 4).
        let ((sin_a, cos_a), (sin_b, cos_b)) = (0.7f64.sin_cos(), 0.4f64.sin_cos());
        let turn =
            [[cos_a, 0.0, sin_a], [sin_a * sin_b, cos_b, -cos_a * sin_b], [-sin_a * cos_b, sin_b, cos_a * cos_b]];
        view.pose.rotation = DMat3::from_cols_array_2d(&turn).transpose();
        view.pose.translation -=
            DVec3::from(turn.map(|row| (0..3).map(|k| row[k] * f64::from(offset[k])).sum::<f64>()));
        let (narrow, truth) = (render_as::<f32>(&splats, &view), render_as::<f64>(&splats, &view));
        for i in 0..truth.alpha.len() {
            let different = narrow.n_contributing[i] != truth.n_contributing[i];
            assert!(!different || truth.near_discontinuity[i], "seed {seed}: pixel {i} is not marked");
            n_different += usize::from(different);
            n_marked += usize::from(truth.near_discontinuity[i]);
        }
        n += truth.alpha.len();
    }
    assert!(n_different > 0, "f32 never differs, so the band is not tested");
    assert!(n_marked * 4 < n, "{n_marked} of {n} pixels are marked");
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
        let what = |name: &str| format!("{name} at t_center {t_center}");
        assert_same(what("colour"), &moving.color, &fixed.color);
        assert_same(what("alpha"), &moving.alpha, &fixed.alpha);
        assert_same(what("depth"), &moving.depth, &fixed.depth);
        assert_same(what("inverse depth"), &moving.inverse_depth, &fixed.inverse_depth);
        assert_same(what("flow"), &moving.flow, &fixed.flow);
        assert_same(what("number of Gaussians"), &moving.n_contributing, &fixed.n_contributing);
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
