//! Adam on the device against its reference in double precision. Gradients of any size: row N24 of `tests/conformance`.

use crate::adversary::{rounds_otherwise, slack};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::kernel::assert_same_scene;
use ivv::internals::gpu::generated::Status;
use ivv::internals::stage::{Rates, StepSettings, adam_params, lazy_sums};
use ivv_conformance::fixtures::adam::{Scene, Step, cotangents, gradients, half_seen, numbers, rates};

tested! {
    "adam/adam_idle.comp" by Adam in a_step_of_every_parameter_seen_or_not_is_the_references;
    "adam/adam_catch_up.comp" by Adam in lazy_steps_catch_up_with_the_references_to_2e_5_of_the_way;
    "project/project_bwd.comp" by Adam in a_step_of_every_parameter_seen_or_not_is_the_references;
}

/// Error of a step, in units of the rate or of the step, where that is longer.
const ALLOWED: f64 = 1e-6;

#[test]
fn a_step_of_every_parameter_seen_or_not_is_the_references() {
    let otherwise = rounds_otherwise("moments follow from another kernel's gradient");
    let view = view();
    for degree in 0..=3 {
        let scene = half_seen(u64::from(degree), degree);
        let d_color = cotangents(&view, 5, 1e-3);
        let gradient =
            numbers(&gradients(&gpu(), &scene.params, &view, &d_color).unwrap(), &scene.params.scale, &rates());
        assert!(gradient.iter().filter(|g| g.0 != 0.0).count() > gradient.len() / 3, "too little has a gradient");
        for step in [1, 2, 1000] {
            let (found, n_bad) = scene.step(&gpu(), &view, &d_color, &Step::dense(step)).unwrap();
            assert_eq!(n_bad, 0);
            let (found, mut n_moved) = (found.references(), 0);
            for ((reference, found), (g, rate, name, i)) in scene.references().into_iter().zip(found).zip(&gradient) {
                let truth = reference.step(f64::from(*g), *rate, step);
                // The parameter's last bit, and the error of the step.
                let allowed = slack(1000.0) * ALLOWED * (truth.parameter - reference.parameter).abs().max(*rate)
                    + 1.2e-7 * reference.parameter.abs().max(truth.parameter.abs());
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs() + 1.2e-38;
                assert!((found.parameter - truth.parameter).abs() <= allowed, "{name} of {i}: {found:?} for {truth:?}");
                let are_close = close(found.first, truth.first) && close(found.second, truth.second);
                assert!(are_close || otherwise, "{name} of {i}");
                n_moved += usize::from(found.parameter != reference.parameter);
            }
            assert!(n_moved > gradient.len() / 3, "{n_moved} of {} moved", gradient.len());
        }
    }
}

#[test]
fn lazy_steps_leave_what_is_not_seen_alone_and_give_the_rest_the_dense_steps_bits() {
    let view = view();
    let scene = half_seen(9, 1);
    let d_color = cotangents(&view, 6, 1e-3);
    let (dense, _) = scene.step(&gpu(), &view, &d_color, &Step::dense(7)).unwrap();
    let bits =
        |s: &Scene| numbers(&s.params, &s.params.scale, &rates()).iter().map(|x| x.0.to_bits()).collect::<Vec<_>>();
    let (before, dense_bits) = (bits(&scene), bits(&dense));
    let (found, _) = scene.step(&gpu(), &view, &d_color, &Step { mode: AdamMode::Lazy, ..Step::dense(7) }).unwrap();
    let (mut n_seen, mut n_not) = (0, 0);
    for (at, number) in numbers(&found.params, &found.params.scale, &rates()).iter().enumerate() {
        let is_seen = found.state[number.3][3] == 7.0;
        let expected = if is_seen { dense_bits[at] } else { before[at] };
        assert_eq!(number.0.to_bits(), expected, "{} of {}", number.2, number.3);
        *(if is_seen { &mut n_seen } else { &mut n_not }) += 1;
    }
    assert!(n_seen > 100 && n_not > 100);
}

/// A run whose cameras differ in size is resumed with room for fewer pixels than it had.
#[test]
fn a_step_has_the_same_bits_whatever_else_there_is_room_for() {
    let view = view();
    let scene = half_seen(9, 1);
    let d_color = cotangents(&view, 6, 1e-3);
    for sums in [Sums::Slots, Sums::Fixed32, Sums::Fixed64] {
        if let Err(reason) = sums.check(gpu().caps()) {
            crate::common::notes::skip(reason);
            continue;
        }
        let [found, expected] = [100_000, 0]
            .map(|spare_pixels| scene.step(&gpu(), &view, &d_color, &Step { sums, spare_pixels, ..Step::dense(7) }));
        let ((found, n_bad), (expected, other)) = (found.unwrap(), expected.unwrap());
        assert_same_scene(format_args!("{sums:?}"), &found, &expected);
        assert_eq!(n_bad, other, "{sums:?}");
    }
}

#[test]
fn a_failed_frame_moves_nothing() {
    let view = view();
    let scene = half_seen(5, 2);
    let d_color = cotangents(&view, 2, 1e-3);
    for failed in [1, 2, 1 << 31] {
        let (found, n_bad) = scene.step(&gpu(), &view, &d_color, &Step { failed, ..Step::dense(1) }).unwrap();
        assert_same_scene(format_args!("failed {failed}"), &found, &scene);
        assert_eq!(n_bad, 0);
    }
    assert!(scene.step(&gpu(), &view, &d_color, &Step::dense(1)).unwrap().0 != scene, "nor does one that did not fail");
}

/// `scene` after all has caught up with step `until` of 2000.
pub fn caught_up(scene: &Scene, rates: impl Fn(u64) -> Rates, settings: &StepSettings, until: u64) -> Scene {
    let gpu = gpu();
    let (buffers, optimiser) = scene.upload(&gpu, AdamMode::Lazy, &lazy_sums(&rates, 2000)).unwrap();
    gpu.write(&optimiser.params, &[adam_params(&rates(until), settings, until, 1)]).unwrap();
    let status = gpu.upload("status", &[Status::default()]).unwrap();
    let mut rec = Recording::new();
    optimiser.record_catch_up(&mut rec, &buffers, None, &status, until);
    gpu.run(&rec).unwrap();
    Scene::download(&gpu, &buffers, &optimiser).unwrap()
}

#[test]
fn lazy_steps_catch_up_with_the_references_to_2e_5_of_the_way() {
    let _device = gpu();
    let mut scene = half_seen(11, 2);
    // Position decays as over a run; the second band joins on the way.
    let of = |step: u64| Rates {
        position: 1e-3 * 0.998f64.powf(step as f64),
        sh: [8e-3, 9e-3, if step > 720 { 10e-3 } else { 0.0 }, 0.0],
        ..rates()
    };
    scene.first.sh.iter_mut().for_each(|c| *c = [0.3, -0.2, 0.1]);
    scene.second.sh.iter_mut().for_each(|c| *c = [0.2; 3]);
    for (from, k) in [(0u64, 1u64), (700, 1), (700, 2), (700, 10), (700, 40), (1000, 1000)] {
        scene.state.iter_mut().for_each(|s| s[3] = from as f32);
        let settings = StepSettings { lowest_t_scale: -50.0, ..StepSettings::default() };
        let found = caught_up(&scene, of, &settings, from + k);
        assert!(found.state.iter().all(|s| s[3] == (from + k) as f32));
        let mut truths = scene.references();
        for step in from + 1..=from + k {
            for (truth, number) in truths.iter_mut().zip(numbers(&scene.params, &scene.params.scale, &of(step))) {
                *truth = truth.step(0.0, number.1, step);
            }
        }
        let mut n_moved = 0;
        for (at, ((reference, found), truth)) in
            scene.references().into_iter().zip(found.references()).zip(truths).enumerate()
        {
            let way = (truth.parameter - reference.parameter).abs();
            let allowed = 2e-5 * way.max(1e-4) + 1.2e-7 * reference.parameter.abs().max(truth.parameter.abs());
            assert!((found.parameter - truth.parameter).abs() <= allowed, "{at} after {k}: {found:?} for {truth:?}");
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs() + 1.2e-38;
            assert!(close(found.first, truth.first) && close(found.second, truth.second), "{at} after {k}");
            n_moved += usize::from(way > 0.0);
        }
        assert!(n_moved > 300, "{n_moved}");
    }
}

#[test]
fn t_center_moves_by_steps_that_are_far_below_its_last_bit() {
    let gpu = gpu();
    let mut params = scene(2, 10, 0);
    params.motion.iter_mut().for_each(|m| m.t_center = 0.75);
    let mut scene = Scene::new(&params);
    // The moments of a gradient that never changes.
    scene.first.motion.iter_mut().for_each(|m| m.t_center = 1.0);
    scene.second.motion.iter_mut().for_each(|m| m.t_center = 1.0);
    let (buffers, optimiser) = scene.upload(&gpu, AdamMode::Dense, &[[0.0; 4]]).unwrap();
    // Seen by a camera that looks away.
    let cull = ivv::internals::stage::Cull::new(&gpu, &buffers, 10, true).unwrap();
    let mut away = view();
    away.pose.translation.z = -1e3;
    let away = view_params(&away, &Constants::default(), buffers.origin, Strip::whole(&away));
    let away = gpu.upload("view", &[away]).unwrap();
    let status = gpu.upload("status", &[Status::default()]).unwrap();
    let rate = 1e-9;
    let mut params = adam_params(&Rates { t_center: rate, ..Rates::default() }, &StepSettings::default(), 1_000_000, 1);
    // No decay: the same step again and again.
    (params.beta1, params.beta2) = (1.0, 1.0);
    gpu.write(&optimiser.params, &[params]).unwrap();
    for _ in 0..1000 {
        let mut rec = Recording::new();
        cull.record(&mut rec, &buffers, &away, &status);
        optimiser.record_idle(&mut rec, &buffers, &cull, &status);
        gpu.run(&rec).unwrap();
    }
    let found = Scene::download(&gpu, &buffers, &optimiser).unwrap();
    assert!(0.75f32 - rate as f32 == 0.75, "one step alone is lost");
    for (motion, state) in found.params.motion.iter().zip(&found.state[found.params.n_static..]) {
        let exact = f64::from(motion.t_center) - f64::from(state[2]);
        assert!((exact - (0.75 - 1000.0 * rate)).abs() < 1e-3 * 1000.0 * rate, "{exact}");
    }
}
