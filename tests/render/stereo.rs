//! Two eyes that share culling, projection and the sort by depth.

use super::clip::bits;
use crate::adversary::rounds_otherwise;
use crate::common::device::gpu;
use crate::common::one::with;
use crate::common::random::{self, Random, view};
use ivv::Constants;
use ivv::scene::{Frame, Splats, View};
use ivv::stage::{Destination, FrameReport, Outputs, Renderer};

/// `view` from so far to the right, a picture's middle moved by `shift` pixels.
fn eye(view: &View, right: f64, shift: f64) -> View {
    let mut eye = with(view.clone(), |of| of.cx += shift);
    eye.pose.translation.x -= right;
    eye
}

#[test]
fn two_eyes_that_share_their_order_see_what_each_sees_alone() {
    if rounds_otherwise("two kernels have the same bits") {
        return;
    }
    let _device = gpu();
    let worst = |a: &Frame, b: &Frame| {
        let differences = a.color.as_flattened().iter().zip(b.color.as_flattened()).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f32::max)
    };
    for seed in 0..12 {
        let mut random = Random::new(seed);
        // Near ones, wide ones and ones beyond the border, of all degrees.
        let mut splats = random::scene(seed, 3000, (seed % 4) as u32);
        splats.scale.iter_mut().step_by(7).for_each(|scale| scale.iter_mut().for_each(|s| *s += 1.5));
        splats.position.iter_mut().for_each(|[x, _, _]| *x *= 2.5);
        let apart = random.uniform(0.0, 0.8);
        let shift = random.uniform(-15.0, 15.0);
        let (left, right) = (eye(&view(), -apart / 2.0, shift), eye(&view(), apart / 2.0, -shift));
        let mut alone = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
        let mut both = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
        if seed % 3 == 0 {
            both.limit_intersections(1);
        }
        for outputs in [Outputs::All, Outputs::Color, Outputs::Color] {
            let [first, second] = both.stereo([&left, &right], outputs, Destination::Host).unwrap();
            let expected = [&left, &right].map(|eye| alone.render(eye, outputs).unwrap());
            assert!(bits(&first.0) == bits(&expected[0].0), "seed {seed}: the first eye");
            let off = worst(&second.0, &expected[1].0);
            assert!(off < 1e-4, "seed {seed}: {off}");
            for (found, expected) in [first, second].iter().zip(&expected) {
                // Culled for both, a few more reach a tile's part beyond the picture's border.
                let numbers = |r: &FrameReport| [r.active, r.visible, r.intersections].map(|n| n as f64);
                for (found, expected) in numbers(&found.1).into_iter().zip(numbers(&expected.1)) {
                    assert!(found >= expected && found < 1.3 * expected, "seed {seed}: {found} for {expected}");
                }
            }
        }
    }
}

#[test]
fn eyes_that_cannot_share_see_what_each_sees_alone() {
    let _device = gpu();
    let splats = random::scene(5, 2000, 1);
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let first = view();
    let mut nearer = eye(&first, 0.1, 0.0);
    nearer.pose.translation.z -= 0.2;
    let mut turned = eye(&first, 0.1, 0.0);
    let (sin, cos) = 0.1f64.sin_cos();
    let rotation = &mut turned.pose.rotation;
    (rotation.x_axis.x, rotation.z_axis.x) = (cos, sin);
    (rotation.x_axis.z, rotation.z_axis.z) = (-sin, cos);
    for other in [nearer, turned, View { time: 0.9, ..first.clone() }, random::small_view()] {
        let found = renderer.stereo([&first, &other], Outputs::All, Destination::Host).unwrap();
        for (view, (frame, report)) in [&first, &other].into_iter().zip(found) {
            let (expected, alone) = renderer.render(view, Outputs::All).unwrap();
            assert!(bits(&frame) == bits(&expected), "{}", view.name);
            assert_eq!(report.active, alone.active);
        }
    }
}

#[test]
fn an_eye_that_sees_next_to_nothing_takes_nothing_from_the_other() {
    if rounds_otherwise("two kernels have the same bits") {
        return;
    }
    let _device = gpu();
    // All that is active for both eyes is before one of them: the lists of the other are shorter than there are Gaussians.
    let [left, right] = [eye(&view(), -2.0, 0.0), eye(&view(), 2.0, 0.0)];
    let mut splats: Splats = random::scene(9, 3000, 1);
    for position in &mut splats.position {
        (position[0], position[1]) = (2.0 + 0.3 * position[0], 0.3 * position[1]);
    }
    splats.motion.iter_mut().for_each(|motion| (motion.velocity, motion.t_scale) = ([0.1; 3], 3.0));
    splats.scale.iter_mut().for_each(|scale| *scale = [-2.5; 3]);
    splats.opacity.iter_mut().for_each(|opacity| *opacity = 2.0);
    for eyes in [[&left, &right], [&right, &left]] {
        let mut alone = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
        let expected = eyes.map(|eye| alone.render(eye, Outputs::All).unwrap());
        let mut both = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
        let found = both.stereo(eyes, Outputs::All, Destination::Host).unwrap();
        let mut lists = expected.each_ref().map(|(_, report)| report.intersections);
        lists.sort_unstable();
        let active = found[0].1.active;
        assert!(lists[0] < active / 8 && lists[1] > active, "{lists:?} of {active}");
        for ((frame, report), (truth, own)) in found.iter().zip(&expected) {
            assert_eq!(report.intersections, own.intersections);
            assert!(bits(frame) == bits(truth), "of {} intersections", own.intersections);
        }
    }
}
