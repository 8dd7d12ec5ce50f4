//! What a frame does not depend on, to the last bit.

use crate::common::device::gpu;
use crate::common::frames::{Tolerance, bits, check_finite, compare, render};
use crate::common::one::{One, camera, ones, round, scene_of};
use crate::common::random::{Random, scene, view};
use crate::twin::with_motion;
use ivv::Constants;
use ivv::scene::{Frame, Motion, Splats};
use ivv::stage::{Outputs, Renderer};
use ivv::twin::render_f64;

/// Where more than one Gaussian shows.
fn assert_busy(frame: &Frame) {
    let n = frame.alpha.iter().filter(|alpha| **alpha > 0.1).count();
    assert!(4 * n > frame.alpha.len(), "only {n} of {} pixels show anything", frame.alpha.len());
}

#[test]
fn a_static_gaussian_is_a_dynamic_one_without_velocity_and_with_infinite_tau_bit_for_bit() {
    for sh_degree in 0..=3 {
        let splats = Splats { n_static: 100, motion: vec![], ..scene(21, 100, sh_degree) };
        let (fixed, _) = render(&splats, &view());
        assert_busy(&fixed);
        for t_center in [0.0, 0.4, 1e5] {
            let motion = Motion { velocity: [0.0; 3], t_center, t_scale: f32::INFINITY };
            let (moving, report) = render(&with_motion(&splats, motion), &view());
            assert_eq!(report.bad_gaussians, 0);
            assert!(bits(&fixed) == bits(&moving), "degree {sh_degree}, t_center {t_center}");
        }
    }
}

#[test]
fn twenty_renders_have_the_same_bits_with_one_renderer_and_with_fresh_ones() {
    let gpu = gpu();
    let (splats, view) = (scene(31, 300, 2), view());
    let mut kept = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let (first, _) = kept.render(&view, Outputs::All).unwrap();
    assert_busy(&first);
    for run in 0..10 {
        let (again, _) = kept.render(&view, Outputs::All).unwrap();
        assert!(bits(&again) == bits(&first), "render {run} of the same renderer differs");
        assert!(bits(&render(&splats, &view).0) == bits(&first), "fresh renderer {run} differs");
    }
}

#[test]
fn a_renderer_that_has_drawn_other_views_draws_the_same_bits() {
    let gpu = gpu();
    let splats = scene(32, 200, 1);
    let small = view();
    let large = ivv::scene::View { width: 200, height: 120, ..view() };
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let mut frame = |view, outputs| renderer.render(view, outputs).unwrap().0;
    let first = frame(&small, Outputs::All);
    frame(&large, Outputs::All);
    frame(&small, Outputs::Color);
    assert_busy(&first);
    assert!(bits(&frame(&small, Outputs::All)) == bits(&first), "the frame depends on what was drawn before");
}

#[test]
fn colour_alone_is_the_colour_of_all_outputs_bit_for_bit() {
    let gpu = gpu();
    for seed in 0..3 {
        let splats = scene(seed, 200, 1);
        let (all, _) = render(&splats, &view());
        assert_busy(&all);
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        let (color, _) = renderer.render(&view(), Outputs::Color).unwrap();
        let words = |frame: &Frame| -> Vec<u32> {
            frame.color.as_flattened().iter().chain(&frame.alpha).map(|x| x.to_bits()).collect()
        };
        assert!(words(&all) == words(&color), "seed {seed}");
        assert!(color.depth.is_empty() && color.inverse_depth.is_empty() && color.flow.is_empty());
    }
}

/// `items` in a random order.
fn shuffled(mut items: Vec<One>, random: &mut Random) -> Vec<One> {
    for i in (1..items.len()).rev() {
        items.swap(i, random.bits() as usize % (i + 1));
    }
    items
}

#[test]
fn the_order_of_gaussians_of_different_depths_does_not_matter_bit_for_bit() {
    let mut random = Random::new(41);
    let splats = scene(41, 200, 1);
    let (first, _) = render(&splats, &view());
    assert_busy(&first);
    for _ in 0..3 {
        // Static ones stay before dynamic ones; all depths of a random scene differ.
        let other = scene_of(&shuffled(ones(&splats), &mut random));
        assert!(other.position != splats.position);
        assert!(bits(&render(&other, &view()).0) == bits(&first));
    }
}

#[test]
fn a_thousand_gaussians_of_one_depth_are_drawn_in_the_order_of_their_index() {
    let mut random = Random::new(42);
    let all: Vec<One> = (0..1000)
        .map(|i| {
            let [x, y] = random.vector(-1.0, 1.0);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            let one = round([x, y, 4.0], random.uniform(0.03, 0.1), random.uniform(0.1, 0.9), color);
            let motion = Motion { velocity: [0.25, 0.0, 0.0], t_center: 0.5, t_scale: 0.0 };
            One { motion: (i >= 500).then_some(motion), ..one }
        })
        .collect();
    let view = camera(48, 32);
    let mut frames = Vec::new();
    for all in [all.clone(), shuffled(all, &mut random)] {
        let splats = scene_of(&all);
        let (frame, _) = render(&splats, &view);
        let truth = render_f64(&splats, &view, &Constants::default());
        // Saturated pixels end where rounding says.
        let tolerance = Tolerance { n_band: 0.3, ..Tolerance::default() };
        compare(&frame, &truth, &tolerance).unwrap();
        frames.push(bits(&frame));
    }
    assert!(frames[0] != frames[1], "the order of equal depths cannot be seen");
}

#[test]
fn an_empty_scene_a_scene_behind_the_camera_and_a_single_gaussian_render() {
    let view = camera(33, 17);
    let behind = scene_of(&[round([0.0, 0.0, -3.0], 0.1, 0.9, [1.0; 3]), round([0.0, 0.0, 0.0], 0.1, 0.9, [1.0; 3])]);
    let degrees = (0..=3).map(Splats::new);
    for splats in degrees.chain([behind]) {
        let (frame, report) = render(&splats, &view);
        assert_eq!((report.active, report.intersections, report.bad_gaussians), (0, 0, 0));
        assert!(frame.color.iter().all(|color| *color == view.background) && frame.color.len() == 33 * 17);
        assert!(frame.alpha.iter().chain(&frame.depth).chain(&frame.inverse_depth).all(|x| *x == 0.0));
        assert!(frame.flow.as_flattened().iter().all(|x| *x == 0.0));
    }
    let motion = Motion { velocity: [1.0, 0.0, 0.0], t_center: 0.5, t_scale: 0.0 };
    for motion in [None, Some(motion)] {
        let splats = scene_of(&[One { motion, ..round([0.0, 0.0, 3.0], 0.1, 0.9, [1.0, 0.5, 0.0]) }]);
        let (frame, report) = render(&splats, &view);
        assert_eq!((report.active, report.visible), (1, 1));
        compare(&frame, &render_f64(&splats, &view, &Constants::default()), &Tolerance::default()).unwrap();
    }
}

#[test]
fn scenes_with_some_poisoned_numbers_render_finite_frames() {
    const VALUES: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-45, 1e38, f32::MIN / 2.0];
    let (mut n_poisoned, mut n_bad) = (0, 0);
    for seed in 0..20 {
        let mut random = Random::new(1000 + seed);
        let mut splats = scene(seed, 120, (seed % 4) as u32);
        let rate = random.uniform(0.0, 0.05);
        let motion = splats.motion.iter_mut().flat_map(|m| {
            let Motion { velocity: [x, y, z], t_center, t_scale } = m;
            [x, y, z, t_center, t_scale]
        });
        let all = splats.position.as_flattened_mut().iter_mut().chain(splats.rotation.as_flattened_mut());
        let all = all.chain(splats.scale.as_flattened_mut()).chain(&mut splats.opacity);
        for slot in all.chain(splats.sh.as_flattened_mut()).chain(motion) {
            if random.uniform(0.0, 1.0) < rate {
                *slot = VALUES[random.bits() as usize % VALUES.len()];
                n_poisoned += 1;
            }
        }
        let (frame, report) = render(&splats, &view());
        check_finite(&frame).unwrap_or_else(|fault| panic!("seed {seed}: {fault}"));
        n_bad += report.bad_gaussians;
    }
    assert!(n_poisoned > 500 && n_bad > 100, "{n_poisoned} numbers, {n_bad} Gaussians");
}
