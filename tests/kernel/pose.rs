//! The cameras' poses on the device, against their reference.

use crate::common::prelude::*;
use glam::Vec3;
use ivv::internals::gpu::generated::constants::pose::POSE_MOST_TURN;
use ivv::internals::gpu::generated::{Status, ViewParams};
use ivv::internals::reference::{PoseMoments, PoseRule, PoseState, corrected, pose_step};
use ivv::internals::stage::{PoseRows, PoseStep, Poses};

tested! {
    "pose/pose_apply.comp" by corrected in a_view_is_turned_and_shifted_as_its_pose_is;
    "pose/pose_step.comp" by pose_step in poses_are_the_references_for_any_number_of_cameras;
}

const RULE: PoseRule = PoseRule { rates: [2e-3, 3e-3], most: [POSE_MOST_TURN as f64, 0.05] };

fn vector(random: &mut Random, most: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.uniform(-most, most)))
}

fn seen(random: &mut Random) -> View {
    let rotation = DMat3::from_quat(DQuat::from_scaled_axis(vector(random, 1.5)));
    View { pose: Pose::at(vector(random, 4.0), rotation), ..crate::common::random::view() }
}

fn params(view: &View) -> ViewParams {
    view_params(view, &Constants::default(), [0.0; 3], Strip::whole(view))
}

fn rows(params: &ViewParams, next: bool) -> [[f32; 4]; 3] {
    if next { [params.next0, params.next1, params.next2] } else { [params.row0, params.row1, params.row2] }
}

#[test]
fn a_view_is_turned_and_shifted_as_its_pose_is() {
    let gpu = gpu();
    let mut random = Random::new(3);
    for most in [0.0, 1e-6, 1e-3, 0.1, f64::from(POSE_MOST_TURN) / 3f64.sqrt()] {
        let view = seen(&mut random);
        let view = View { next_pose: Some(seen(&mut random).pose), ..view };
        let correction = [vector(&mut random, most), vector(&mut random, most)];
        let mut state = vec![PoseRows::default(); 4];
        (state[1][0], state[1][1]) = (wide(correction[0]), wide(correction[1]));
        let poses = Poses::new(&gpu, &state, &[None, Some(DVec3::ONE), None]).unwrap();
        for (camera, correction) in [(0, [DVec3::ZERO; 2]), (1, correction)] {
            let buffer = gpu.upload("view", &[params(&view)]).unwrap();
            let mut rec = Recording::new();
            poses.record_apply(&mut rec, &buffer, camera);
            gpu.run(&rec).unwrap();
            let found = gpu.read(&buffer).unwrap()[0];
            if correction == [DVec3::ZERO; 2] {
                assert_eq!(bytemuck::bytes_of(&found), bytemuck::bytes_of(&params(&view)), "camera {camera}");
            }
            for (next, pose) in [(false, view.pose), (true, view.next_pose.unwrap())] {
                let truth = corrected(&pose, correction);
                // What the host makes of it is the same.
                let host = pose.corrected(correction[0], correction[1]);
                assert!((host.translation - truth.translation).length() < 1e-12, "{host:?} for {truth:?}");
                assert!(host.rotation.abs_diff_eq(truth.rotation, 1e-12), "{host:?} for {truth:?}");
                for (k, row) in rows(&found, next).into_iter().enumerate() {
                    let exact = truth.rotation.row(k).extend(truth.center()[k]);
                    let off = (Vec3::from_slice(&row).as_dvec3().extend(f64::from(row[3])) - exact).abs().max_element();
                    assert!(off < 1e-6, "turn and shift of {most}, row {k}: {row:?} for {exact}");
                }
            }
            let rest = |p: &ViewParams| ViewParams {
                row0: [0.0; 4],
                row1: [0.0; 4],
                row2: [0.0; 4],
                next0: [0.0; 4],
                next1: [0.0; 4],
                next2: [0.0; 4],
                ..*p
            };
            assert_eq!(bytemuck::bytes_of(&rest(&found)), bytemuck::bytes_of(&rest(&params(&view))), "the rest");
        }
    }
}

fn wide(v: DVec3) -> [f32; 4] {
    v.as_vec3().extend(0.0).to_array()
}

fn on_device(
    views: &[View],
    centers: &[Option<DVec3>],
    steps: &[(usize, [DVec3; 2])],
    fails: impl Fn(usize) -> bool,
) -> Vec<Vec<[DVec3; 2]>> {
    let gpu = gpu();
    let poses = Poses::new(&gpu, &vec![PoseRows::default(); centers.len() + 1], centers).unwrap();
    let step = |(i, (camera, [turn, shift])): (usize, &(usize, [DVec3; 2]))| {
        let status = gpu.upload("status", &[Status { failed: u32::from(fails(i)), ..Status::default() }]).unwrap();
        let total = [turn.as_vec3().extend(7.0).to_array(), shift.as_vec3().extend(7.0).to_array(), [7.0; 4]];
        let total = gpu.upload("total", &total).unwrap();
        let view = gpu.upload("view", &[params(&views[*camera])]).unwrap();
        let [turn_rate, shift_rate] = RULE.rates;
        let at = PoseStep { camera: *camera as u32, turn_rate, shift_rate, most_shift: RULE.most[1] };
        let mut rec = Recording::new();
        poses.record_apply(&mut rec, &view, *camera as u32);
        poses.record_step(&mut rec, &total, &view, &status, &at);
        gpu.run(&rec).unwrap();
        let state = gpu.read(&poses.state).unwrap();
        let rows: &[PoseRows] = state.as_chunks().0;
        rows[..centers.len()]
            .iter()
            .map(|[turn, shift, ..]| [turn, shift].map(|row| Vec3::from_slice(row).as_dvec3()))
            .collect()
    };
    steps.iter().enumerate().map(step).collect()
}

#[test]
fn poses_are_the_references_for_any_number_of_cameras() {
    for n in [1, 2, 5, 63, 64, 65, 200] {
        let mut random = Random::new(n as u64);
        let views: Vec<View> = (0..n).map(|_| seen(&mut random)).collect();
        let is_learnt = |k: usize| n == 1 || k % 4 != 1;
        let centers: Vec<Option<DVec3>> =
            views.iter().enumerate().map(|(k, view)| is_learnt(k).then(|| view.pose.center())).collect();
        let gradient = |random: &mut Random| [vector(random, 3.0), vector(random, 0.3)].map(|v| v.as_vec3().as_dvec3());
        let steps: Vec<(usize, [DVec3; 2])> =
            (0..60).map(|_| (random.bits() as usize % n, gradient(&mut random))).collect();
        let found = on_device(&views, &centers, &steps, |_| false);
        let (mut poses, mut all) = (vec![PoseState::default(); n], PoseMoments::default());
        for (i, (camera, gradient)) in steps.iter().enumerate() {
            let seen = corrected(&views[*camera].pose, poses[*camera].value);
            pose_step(&mut poses, &mut all, &centers, *camera, &seen.rotation, *gradient, &RULE);
            for (k, (found, truth)) in found[i].iter().zip(&poses).enumerate() {
                for (part, (found, truth)) in found.iter().zip(truth.value).enumerate() {
                    let off = (*found - truth).length();
                    assert!(off <= 2e-5, "{n} cameras, step {i}, camera {k}, part {part}: {found} for {truth}");
                }
                assert!(is_learnt(k) || *found == [DVec3::ZERO; 2], "a pose that is not learnt moved");
            }
        }
        let moved = found[59].iter().any(|[turn, shift]| turn.length() > 1e-3 && shift.length() > 1e-3);
        // Of one camera whose pose is learnt the gauge leaves nothing.
        assert!(moved || n <= 2, "{n}: nothing moved");
        for part in 0..2 {
            let learnt = found[59].iter().enumerate().filter(|(k, _)| is_learnt(*k));
            let mean: DVec3 = learnt.map(|(_, pose)| pose[part]).sum::<DVec3>() / n as f64;
            assert!(mean.length() < 1e-6, "{n}: the gauge leaves {mean}");
        }
    }
}

#[test]
fn a_failed_frame_or_a_gradient_that_is_not_finite_moves_no_pose() {
    let mut random = Random::new(11);
    let views: Vec<View> = (0..3).map(|_| seen(&mut random)).collect();
    let centers: Vec<Option<DVec3>> = views.iter().map(|view| Some(view.pose.center())).collect();
    let good = [DVec3::ONE, DVec3::X];
    let steps = [
        (0, good),
        (1, [DVec3::new(0.0, f64::NAN, 0.0), DVec3::X]),
        (2, [DVec3::ONE, DVec3::new(f64::INFINITY, 0.0, 0.0)]),
        (1, good),
    ];
    let found = on_device(&views, &centers, &steps, |i| i == 0);
    assert!(found[..3].iter().all(|poses| *poses == [[DVec3::ZERO; 2]; 3]), "{found:?}");
    assert!(found[3].iter().all(|[turn, shift]| turn.length() > 0.0 && shift.length() > 0.0), "{:?}", found[3]);
}

/// The gradients are along the camera's axes, as the backward pass gives them; turn and shift are along the world's.
#[test]
fn a_step_goes_down_the_loss() {
    let mut random = Random::new(5);
    // So many that the gauge turns no sign.
    let views: Vec<View> = (0..200).map(|_| seen(&mut random)).collect();
    let centers: Vec<Option<DVec3>> = views.iter().map(|view| Some(view.pose.center())).collect();
    // The loss is a number of where the camera sees a point: its gradient by a turn is p x g, by a shift of the points g.
    let (point, pull) = (vector(&mut random, 2.0), vector(&mut random, 1.0));
    let loss = |correction| corrected(&views[0].pose, correction).to_camera(point).dot(pull);
    let seen = views[0].pose.to_camera(point);
    let found = on_device(&views, &centers, &[(0, [seen.cross(pull), pull])], |_| false)[0][0];
    for part in 0..2 {
        let slope = |axis: usize| {
            let mut ahead = [DVec3::ZERO; 2];
            ahead[part][axis] = 1e-6;
            (loss(ahead) - loss([DVec3::ZERO; 2])) / 1e-6
        };
        // The first step is along the gradient, the rate in the mean over the axes.
        let expected = -RULE.rates[part] * 3f64.sqrt() * DVec3::from_array(std::array::from_fn(slope)).normalize();
        assert!((found[part] - expected).length() < 0.1 * RULE.rates[part], "part {part}: {found:?} for {expected}");
    }
}
