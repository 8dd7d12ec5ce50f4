//! The four ways of adding gradients up.

use super::check::{bits, cotangents, dot, flat, smooth_cotangents};
use crate::common::device::gpu;
use crate::common::random::{scene, view};
use crate::common::twins::tested;
use ivv::Constants;
use ivv::extremes::adjoint::group_error;
use ivv::scene::{Frame, Splats};
use ivv::stage::{Accumulation, Gradients, Renderer};

tested! {
    "blend/fixed_sums.comp" by jvp in all_ways_agree_with_each_other_and_with_dual_numbers;
}

fn gradients(splats: &Splats, mode: Accumulation) -> Option<Gradients> {
    gradients_of(splats, mode, &cotangents(3, &view(), |_| false))
}

fn gradients_of(splats: &Splats, mode: Accumulation, cotangents: &Frame) -> Option<Gradients> {
    let (gpu, view) = (gpu(), view());
    let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
    if let Err(reason) = renderer.accumulate(mode) {
        crate::common::notes::skip(reason);
        return None;
    }
    let (found, report) = renderer.vjp(&view, cotangents).unwrap();
    assert!(report.intersections > 0);
    Some(found)
}

#[test]
fn all_ways_agree_with_each_other_and_with_dual_numbers() {
    let splats = scene(8, 300, 1);
    let slots = gradients(&splats, Accumulation::Slots).unwrap();
    for mode in Accumulation::ALL {
        let Some(found) = gradients(&splats, mode) else { continue };
        assert_eq!(found.n_bad, 0, "{mode:?}");
        for name in ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale"] {
            let (a, b) = (flat(&found, name), flat(&slots, name));
            let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            let norm = dot(&b, &b).sqrt();
            let error = dot(&difference, &difference).sqrt() / norm;
            assert!(norm > 0.0 && error <= 2e-6, "{mode:?}: {name} differs by {error:e}");
        }
    }
    let (splats, view) = (scene(31, 60, 1), view());
    let smooth = smooth_cotangents(4, &splats, &view);
    for mode in Accumulation::ALL {
        let Some(found) = gradients_of(&splats, mode, &smooth) else { continue };
        for name in ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale"] {
            let error = group_error(&found, name, &splats, &view, &smooth).expect("a gradient");
            assert!(error <= 1e-5, "{mode:?}: {name} is off by {error:e}");
        }
    }
}

#[test]
fn slots_and_fixed_point_give_the_same_bits_in_every_run() {
    let splats = scene(9, 400, 0);
    for mode in [Accumulation::Slots, Accumulation::FixedPoint] {
        let first = bits(&gradients(&splats, mode).unwrap());
        assert!(first.iter().any(|x| *x != 0));
        for _ in 0..3 {
            assert_eq!(first, bits(&gradients(&splats, mode).unwrap()), "{mode:?}");
        }
    }
}

#[test]
fn a_cotangent_beyond_the_fixed_point_s_range_is_counted_and_never_wraps() {
    let (gpu, view) = (gpu(), view());
    let splats = scene(10, 60, 0);
    for size in [1e9f32, 1e30, f32::INFINITY, f32::NAN] {
        let mut huge = cotangents(4, &view, |_| true);
        huge.color[(28 * view.intrinsics.width + 40) as usize] = [size, 0.0, 0.0];
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        renderer.accumulate(Accumulation::FixedPoint).unwrap();
        let (found, _) = renderer.vjp(&view, &huge).unwrap();
        assert!(found.n_bad > 0 && super::check::is_finite(&found), "{size:e}");
    }
}
