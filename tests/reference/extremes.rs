//! Extremes of single parameters: which Gaussians are dropped and what the others give (N1, N2, N4, N5, N11, N12).

use super::{single, with_motion, zero_like};
use crate::common::prelude::*;
use crate::common::random::view;
use ivv::internals::reference::{Dual, Gaussian, Real, Temporal, project};

fn projected<R: Real>(splats: &Splats, time: f64) -> Option<Projected<R>> {
    let view = view();
    let params = Params::<R>::new(splats, &view);
    project(&params.gaussian(0), &Camera::new(&view), R::from_f64(time), &Rules::new(&Constants::default()))
}

/// A name and the number it stands for.
type Slot = (&'static str, fn(&mut Splats) -> &mut f32);

#[test]
fn a_value_that_is_not_finite_in_any_slot_drops_the_gaussian() {
    let base = with_motion(&single([0.1, 0.2, 0.3]), Motion { velocity: [0.1; 3], t_center: 0.5, t_scale: 0.0 });
    assert!(projected::<f32>(&base, 0.4).is_some());
    let slots: [Slot; 9] = [
        ("position", |s| &mut s.position[0][1]),
        ("rotation", |s| &mut s.rotation[0][2]),
        ("scale", |s| &mut s.scale[0][1]),
        ("opacity", |s| &mut s.opacity[0]),
        ("sh", |s| &mut s.sh[0][2]),
        ("velocity", |s| &mut s.motion[0].velocity[0]),
        ("t_center", |s| &mut s.motion[0].t_center),
        ("t_scale", |s| &mut s.motion[0].t_scale),
        ("depth", |s| &mut s.position[0][2]),
    ];
    for (name, slot) in slots {
        let with = |value: f32| {
            let mut splats = base.clone();
            *slot(&mut splats) = value;
            splats
        };
        assert!(projected::<f32>(&with(f32::NAN), 0.4).is_none(), "{name}");
        for value in [f32::INFINITY, f32::NEG_INFINITY, f32::MAX / 2.0, f32::MIN / 2.0, 1e-45, -0.0, 1e38, -1e38] {
            if let Some(p) = projected::<f32>(&with(value), 0.4) {
                let all = [p.xy, p.m[0], p.m[1], p.flow, p.extent];
                let finite = all.as_flattened().iter().chain(&p.color).all(|x| x.is_finite());
                assert!(finite && p.z > 0.01 && p.opacity <= 1.0, "{name} = {value}: {p:?}");
            }
        }
    }
}

#[test]
fn a_gaussian_of_any_scale_up_to_e_to_the_40_stays_visible_in_f32() {
    for scale in [-30.0, -15.0, -5.0, 0.0, 5.0, 10.0, 20.0, 40.0] {
        for n_axes in 1..=3 {
            let mut splats = single([0.2, 0.1, 0.0]);
            splats.rotation[0] = [0.7, -0.2, 0.4, 0.1];
            splats.scale[0][..n_axes].fill(scale);
            let p = projected::<f32>(&splats, 0.0).unwrap_or_else(|| panic!("scale {scale}, {n_axes} axes: dropped"));
            let rules = Rules::new(&Constants::default());
            assert!(p.alpha_at(p.xy, &rules) == p.opacity, "scale {scale}, {n_axes} axes");
            if scale == 40.0 && n_axes == 3 {
                assert!(p.alpha_at([1e4, -1e4], &rules) > 0.88, "a Gaussian larger than the world fades");
            }
        }
    }
}

#[test]
fn a_quaternion_without_direction_drops_the_gaussian() {
    for length in [0.0, 1e-40, 1e-38] {
        let mut splats = single([0.0; 3]);
        splats.rotation[0] = [0.5, 0.5, -0.5, 0.5].map(|x: f32| x * length);
        assert!(projected::<f32>(&splats, 0.0).is_none(), "length {length}");
        assert!(projected::<f64>(&splats, 0.0).is_none(), "length {length}");
    }
}

#[test]
fn the_near_plane_drops_at_the_plane_and_not_beyond() {
    let near = Constants::default().near;
    let mut view = view();
    view.pose.translation.z = 0.0;
    for (z, kept) in [(near.next_down(), false), (near, false), (near.next_up(), true), (-1.0, false), (1e6, true)] {
        let params = Params::<f32>::new(&single([0.0, 0.0, z]), &view);
        let rules = Rules::new(&Constants::default());
        let found = project(&params.gaussian(0), &Camera::new(&view), 0.0, &rules);
        assert_eq!(found.is_some(), kept, "z = {z}");
    }
}

/// A Gaussian with base opacity 0.99 (u visible up to 2.352) that peaks at time 0.
fn fading(t_scale: f32) -> Splats {
    let motion = Motion { velocity: [0.0; 3], t_center: 0.0, t_scale };
    Splats { opacity: vec![99f32.ln()], ..with_motion(&single([0.0; 3]), motion) }
}

#[test]
fn opacity_over_time_is_exact_inside_the_window_and_gone_outside() {
    for t_scale in [-18.42, 0.0, 9.21] {
        let tau = f64::from(f32::exp(t_scale));
        for u in [0.0, 1e-20, 0.707, 1.0, 2.35, 2.36, 9.3, 9.4, 16.0, 1e10, 1e19, 1e30] {
            let splats = fading(t_scale);
            let (narrow, truth) = (projected::<f32>(&splats, u * tau), projected::<f64>(&splats, u * tau));
            assert_eq!(narrow.is_some(), u < 2.355, "u = {u}, log tau = {t_scale}");
            assert_eq!(truth.is_some(), u < 2.355, "u = {u}, log tau = {t_scale}");
            if let (Some(narrow), Some(truth)) = (narrow, truth) {
                let error = (f64::from(narrow.opacity) / truth.opacity - 1.0).abs();
                // exp is good to 3 + 2|x| ULP, once of u^2 and once (squared) of log tau.
                let tolerance = 1.2e-7 * (3.0 + 2.0 * u * u * (1.0 + f64::from(t_scale).abs()));
                assert!(error <= tolerance, "u = {u}, log tau = {t_scale}: {error:e}");
            }
        }
    }
}

#[test]
fn the_derivative_by_log_tau_is_bounded_for_every_tau() {
    let view = view();
    let mut largest = 0f64;
    for t_scale in [-80.0, -18.0, -3.0, 0.0, 9.0, f32::INFINITY] {
        for u in [0.0, 0.3, 0.707, 1.0, 1.5, 2.3, 2.4, 1e3, 1e19, 1e30] {
            let params = Params::<f64>::new(&fading(t_scale), &view);
            let mut tangent = zero_like(&params);
            tangent.motion[0].t_scale = 1.0;
            let dual = params.zip(&tangent, Dual::new);
            let tau = f64::from(t_scale).exp();
            let time = Dual::from_f64(if tau.is_finite() { u * tau } else { u });
            let rules = Rules::<Dual>::new(&Constants::default());
            if let Some(p) = project(&dual.gaussian(0), &Camera::new(&view), time, &rules) {
                assert!(p.opacity.tangent.abs() <= 0.736, "u = {u}, log tau = {t_scale}: {:?}", p.opacity);
                largest = largest.max(p.opacity.tangent);
            }
        }
    }
    assert!(largest > 0.72, "the bound 2 / e is nearly reached at u = 1, but {largest}");
}

#[test]
fn a_moving_gaussian_is_where_its_velocity_brings_it() {
    let sh = [[1.0f64; 3]];
    let gaussian = Gaussian {
        position: [1.0, 2.0, 3.0],
        rotation: [1.0, 0.0, 0.0, 0.0],
        scale: [-2.0; 3],
        opacity: 0.0,
        sh: &sh,
        motion: Some(Temporal { velocity: [0.5, -1.0, 2.0], t_center: 0.25, t_scale: 0.0 }),
    };
    assert_eq!(gaussian.position_at(0.75), [1.25, 1.5, 4.0]);
    assert!((gaussian.opacity_at(0.75) - 0.5 * (-0.25f64).exp()).abs() < 1e-16);
}
