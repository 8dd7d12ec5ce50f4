//! N15 and N16 of training: where a capture's origin is and how long its unit changes nothing.

use super::{Tiny, drive, trainer};
use crate::common::frames::{psnr, render_with};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::cleared;
use ivv::internals::scene::capture::{Camera, TRAINING_RADIUS};

const LEAST_PSNR: f64 = 80.0;

/// What a short training gives, in the frame of training, with the way there.
fn train(capture: Capture) -> (Splats, Capture, Similarity) {
    let world = capture.normalisation();
    let capture = capture.transformed(&world);
    let config = Config { sh_degree: 1, ..exact() };
    let begin = from_points(&capture.points, &capture, &config);
    let mut trainer = trainer(&capture, &config, &begin, 100);
    drive(&mut trainer, &capture, config.seed, 30);
    let trained = trainer.splats().unwrap();
    assert!(trained.len() > begin.len() && trained.motion.iter().any(|m| m.velocity != [0.0; 3]));
    (trained, capture, world)
}

/// The first test view of a capture at its second frame.
fn seen(splats: &Splats, capture: &Capture, constants: Constants) -> Frame {
    let (camera, _) = capture.test_frames()[0];
    render_with(splats, &capture.view(camera, 1).unwrap(), constants).0
}

#[test]
fn the_space_before_a_lens_is_a_twentieth_of_the_extent_deep_or_half_as_deep_as_the_nearest_points() {
    let tiny = Tiny::new("near");
    let capture = tiny.capture.clone();
    let mut capture = capture.transformed(&tiny.capture.normalisation());
    let before = |camera: &Camera, depth: f64| {
        let pose = camera.world_to_camera;
        let position = (pose.center() + depth * pose.forward()).to_array();
        Point { position, color: [0; 3] }
    };
    let points = |capture: &Capture, is_test: bool, depth: f64| {
        capture.cameras.iter().filter(|c| c.is_test == is_test).map(|camera| before(camera, depth)).collect()
    };
    let depths = |capture: &Capture| -> Vec<f32> {
        Setup::new(capture, &exact()).clearings.iter().map(|clearing| clearing.depth).collect()
    };
    let n_trained = capture.cameras.iter().filter(|camera| !camera.is_test).count();
    capture.points = Vec::new();
    assert_eq!(depths(&capture), vec![0.15; n_trained]);
    capture.points = points(&capture, false, 0.2);
    assert!(depths(&capture).iter().all(|depth| (depth - 0.1).abs() < 1e-6));
    // What stands just before a test camera does not count, unless a training camera sees it as near.
    capture.points = points(&capture, true, 0.2);
    assert!(capture.points.len() > 1 && depths(&capture)[0] > 0.14);
    // At another time somebody may be where one that moves has been.
    let (first, second) = (capture.cameras[0].world_to_camera, capture.cameras[1].world_to_camera);
    let trained = capture.cameras.iter_mut().find(|camera| !camera.is_test).unwrap();
    for (shot, pose) in trained.shots.iter_mut().zip([first, second].into_iter().cycle()) {
        shot.world_to_camera = Some(pose);
    }
    assert!(depths(&capture).is_empty());
}

/// Cameras on a part of a sphere of radius 3 that look at its middle, every fifth a test camera.
fn dome(capture: &Capture) -> Capture {
    let mut dome = capture.clone();
    let camera = dome.cameras[0].clone();
    let rows = (-2..=2).flat_map(|row: i32| (-2..=2).map(move |column: i32| (row, column)));
    let at = |(index, (row, column)): (usize, (i32, i32))| {
        let (up, around) = (0.3 * f64::from(row), 0.3 * f64::from(column));
        let center = 3.0 * glam::DVec3::new(around.sin() * up.cos(), up.sin(), -around.cos() * up.cos());
        let world_to_camera = Pose::look_at(center, glam::DVec3::ZERO, glam::DVec3::NEG_Y);
        Camera { name: format!("{index}"), is_test: index % 5 == 2, world_to_camera, ..camera.clone() }
    };
    dome.cameras = rows.enumerate().map(at).collect();
    dome
}

#[test]
fn what_hangs_before_lenses_of_a_dome_goes_behind_them_and_the_rest_stays() {
    let tiny = Tiny::new("dome");
    let dome = dome(&tiny.capture);
    let clearings = Setup::new(&dome, &exact()).clearings;
    let moved = |place: glam::DVec3| {
        let to = glam::DVec3::from(cleared(&clearings, place.to_array(), [0.06, 1e-4]));
        (to.distance(place) > 0.0).then_some(to)
    };
    let mut n = 0;
    for camera in dome.cameras.iter().filter(|camera| camera.name != "0") {
        // Within the rows and columns of cameras: beyond, no surface is known.
        let (center, forward) = (camera.world_to_camera.center(), camera.world_to_camera.forward());
        let is_inner = center.x.abs() < 1.4 && center.y.abs() < 1.4;
        for depth in [0.01, 0.05, 0.1] {
            let to = moved(center + depth * forward);
            n += usize::from(camera.is_test);
            // A lens that training does not know of is free, too.
            assert!(!is_inner || to.is_some_and(|to| to.length() > 3.0), "{}: {depth}, {to:?}", camera.name);
        }
        assert_eq!(moved(center + 0.4 * forward), None);
        assert_eq!(moved(center - 0.15 * forward), None, "a wall behind the cameras");
    }
    assert!(n > 5 && moved(glam::DVec3::ZERO).is_none());
}

#[test]
fn training_is_the_same_wherever_the_origin_is_and_however_long_the_unit() {
    let tiny = Tiny::on_device("worlds");
    let own = Constants::default();
    let (splats, capture, _) = train(tiny.capture.clone());
    let reference = seen(&splats, &capture, own);
    assert!(reference.alpha.iter().any(|a| *a > 0.5));
    let moves = [[1e3, 0.0, 0.0], [0.0, -1e5, 0.0], [5e5, -5e5, 2.5e5]].map(|origin| (origin, 1.0));
    for (origin, scale) in moves.into_iter().chain([1e-4, 1e4].map(|scale| ([0.0; 3], scale))) {
        let elsewhere = tiny.capture.clone().transformed(&Similarity { origin, scale });
        let (splats, normal, world) = train(elsewhere.clone());
        let radius = normal.extent().radius;
        assert!((radius - TRAINING_RADIUS).abs() < 1e-6, "{origin:?}, {scale}: radius {radius}");
        let ratio = psnr(&seen(&splats, &normal, own), &reference);
        assert!(ratio >= LEAST_PSNR, "{origin:?}, {scale}: PSNR {ratio:.1} dB in the frame of training");
        // Back in the capture's own frame, as far as f32 has digits for positions there.
        let exported = world.inverse().splats(&splats);
        let near = (f64::from(own.near) / world.scale) as f32;
        let ratio = psnr(&seen(&exported, &elsewhere, Constants { near, ..own }), &reference);
        let least = if world.is_exact_in_f32() { LEAST_PSNR } else { 15.0 };
        assert_eq!(world.is_exact_in_f32(), origin.iter().all(|x| x.abs() <= 1e3), "{origin:?}");
        assert!(ratio >= least, "{origin:?}, {scale}: PSNR {ratio:.1} dB in the capture's frame");
    }
}

#[test]
fn a_similarity_moves_cameras_and_gaussians_together_and_its_inverse_brings_them_back() {
    let _device = gpu();
    let (splats, view) = (scene(31, 60, 1), view());
    let to = Similarity { origin: [3.0, -20.0, 0.5], scale: 0.37 };
    let there = to.splats(&splats);
    let moved = ivv::internals::scene::View { pose: to.pose(&view.pose), ..view.clone() };
    let near = (f64::from(Constants::default().near) * to.scale) as f32;
    let (own, _) = render(&splats, &view);
    let (other, _) = render_with(&there, &moved, Constants { near, ..Constants::default() });
    assert!(psnr(&other, &own) >= LEAST_PSNR, "{}", psnr(&other, &own));
    for (a, b) in own.depth.iter().zip(&other.depth) {
        assert!((f64::from(*a) * to.scale - f64::from(*b)).abs() < 1e-4, "depth {a} became {b}");
    }
    for (a, b) in own.flow.as_flattened().iter().zip(other.flow.as_flattened()) {
        assert!((a - b).abs() < 1e-3, "flow {a} became {b}");
    }
    let back = to.inverse().splats(&there);
    let numbers = |s: &Splats| -> Vec<f32> {
        let motion: &[f32] = bytemuck::cast_slice(&s.motion);
        [s.position.as_flattened(), s.scale.as_flattened(), motion].concat()
    };
    for (a, b) in numbers(&splats).iter().zip(numbers(&back)) {
        assert!((a - b).abs() <= 1e-5 * (1.0 + a.abs()), "{a} came back as {b}");
    }
    assert_eq!((splats.rotation, splats.opacity, splats.sh), (back.rotation, back.opacity, back.sh));
}
