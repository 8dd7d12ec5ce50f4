//! N15 and N16 of training: where a capture's origin is and how long its unit changes nothing.

use super::{Tiny, drive};
use crate::common::device::gpu;
use crate::common::frames::{render, render_with, rms};
use crate::common::random::{scene, view};
use ivv::Constants;
use ivv::scene::capture::{Camera, Capture, Point, TRAINING_RADIUS};
use ivv::scene::{Frame, Similarity, Splats};
use ivv::train::{Config, Setup, Trainer, from_points, near_plane};

/// Least PSNR against the same thing in its own units at the origin, dB.
const LEAST_PSNR: f64 = 80.0;

/// Peak signal-to-noise ratio of the colours, dB, peak 1; infinite when they are equal.
fn psnr(a: &Frame, b: &Frame) -> f64 {
    -20.0 * rms(a, b).log10()
}

/// What a short training gives, in the frame of training, with the way there.
fn train(capture: Capture) -> (Splats, Capture, Similarity) {
    let world = capture.normalisation();
    let capture = capture.transformed(&world);
    let config = Config { sh_degree: 1, ..Config::default() };
    let begin = from_points(&capture.points, &capture, &config);
    let setup = Setup::new(&capture, &config);
    let mut trainer = Trainer::new(gpu().clone(), &begin, Constants::default(), config.clone(), 100, setup).unwrap();
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
fn the_near_plane_is_an_eighth_of_the_extent_or_half_the_depth_of_the_nearest_points() {
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
    capture.points = Vec::new();
    assert_eq!(near_plane(&capture), 0.375);
    capture.points = points(&capture, false, 0.2);
    assert!((near_plane(&capture) - 0.1).abs() < 1e-6);
    // What stands just before a test camera does not count, unless a training camera sees it as near.
    capture.points = points(&capture, true, 0.2);
    assert!(capture.points.len() > 1 && near_plane(&capture) > 0.3);
}

#[test]
fn training_is_the_same_wherever_the_origin_is_and_however_long_the_unit() {
    let _device = gpu();
    let tiny = Tiny::new("worlds");
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
    let moved = ivv::scene::View { pose: to.pose(&view.pose), ..view.clone() };
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
