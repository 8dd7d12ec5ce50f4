//! Space before lenses, kept clear of Gaussians.

use super::density::scene;
use crate::common::prelude::*;
use ivv::internals::gpu::generated::Status;
use ivv::internals::reference::cleared;
use ivv::internals::scene::Clearing;
use ivv::internals::stage::Clearings;

tested! {
    "density/clear.comp" by cleared in who_is_before_a_lens_goes_behind_it_as_in_the_reference;
}

const MARGIN: f64 = 0.06;
const LITTLE: f64 = 1e-4;
/// Largest error of a position, scene units.
const ERROR: f64 = 2e-6;

/// Bent and sloping surfaces in the midst of the scenes; two spaces overlap, one is nothing.
const CLEARINGS: [Clearing; 4] = [
    Clearing {
        place: [0.4, 0.1, 1.2],
        radius: 0.8,
        axis: [0.0, 0.0, 1.0],
        curvature: 0.4,
        slope: [0.2, 0.0, 0.0],
        depth: 0.9,
    },
    Clearing {
        place: [-0.6, -0.5, 2.0],
        radius: 1.6,
        axis: [0.6, 0.0, 0.8],
        curvature: -0.7,
        slope: [0.0, 0.3, 0.0],
        depth: 0.5,
    },
    Clearing {
        place: [0.3, 0.2, 1.5],
        radius: 0.5,
        axis: [0.0, 0.6, 0.8],
        curvature: 0.0,
        slope: [0.0; 3],
        depth: 0.7,
    },
    Clearing {
        place: [0.0, 0.0, 2.0],
        radius: 0.0,
        axis: [1.0, 0.0, 0.0],
        curvature: 0.0,
        slope: [0.0; 3],
        depth: 0.3,
    },
];

fn run(splats: &Splats, clearings: &[Clearing], failed: u32, holds_static: bool) -> Vec<[f32; 3]> {
    let gpu = gpu();
    let mut scene = SceneBuffers::upload_in_groups(&gpu, splats, &Constants::default(), 128).unwrap();
    scene.holds_static = holds_static;
    let status = gpu.upload("status", &[Status { failed, ..Status::default() }]).unwrap();
    let mut rec = Recording::new();
    Clearings::upload(&gpu, clearings).unwrap().unwrap().record(&mut rec, &scene, &status);
    gpu.run(&rec).unwrap();
    scene.download(&gpu, scene.groups.iter().map(|g| &g.params)).unwrap().position
}

fn spread(splats: &mut Splats) {
    for (i, position) in splats.position.iter_mut().enumerate().filter(|(i, _)| i % 5 != 4) {
        // Multiples of these fill a cube evenly.
        let part = |step: f64| (i as f64 * step).fract() as f32;
        *position = [4.0 * part(0.819_173) - 2.0, 4.0 * part(0.671_044) - 2.0, 0.5 + 3.0 * part(0.549_700)];
    }
}

#[test]
fn who_is_before_a_lens_goes_behind_it_as_in_the_reference() {
    for (n_static, n_dynamic) in [(1, 0), (127, 129), (700, 600)] {
        let (mut splats, _) = scene(5, n_static, n_dynamic, 0);
        spread(&mut splats);
        let found = run(&splats, &CLEARINGS, 0, false);
        let (mut n_moved, mut n_close) = (0, 0);
        for (before, after) in splats.position.iter().zip(&found) {
            let p = before.map(f64::from);
            if p.iter().any(|x| !x.is_finite() || x.abs() > 1e3) {
                assert_same("no height is known", &[*after], &[*before]);
                continue;
            }
            // At an edge, rounding decides: either is right.
            let either = [0.0, ERROR, -ERROR].map(|off| {
                let wider =
                    CLEARINGS.map(|c| Clearing { radius: c.radius + off as f32, depth: c.depth + off as f32, ..c });
                cleared(&wider, p, [MARGIN + off, LITTLE])
            });
            let error = |truth: &[f64; 3]| (0..3).map(|k| (f64::from(after[k]) - truth[k]).abs()).fold(0.0, f64::max);
            let worst = either.iter().map(error).fold(f64::INFINITY, f64::min);
            assert!(worst <= 3.0 * ERROR, "{before:?} became {after:?} instead of {:?}", either[0]);
            n_moved += usize::from(either[0] != p);
            n_close += usize::from((0..3).any(|k| (either[1][k] - either[2][k]).abs() > 1e-3));
        }
        assert!(n_static + n_dynamic < 200 || (n_moved > 20 && n_close < 5), "{n_moved}, {n_close}");
        // Who was moved stays.
        let once = Splats { position: run(&splats, &CLEARINGS[..1], 0, false), ..splats };
        assert_same("who was moved", &run(&once, &CLEARINGS[..1], 0, false), &once.position);
    }
}

#[test]
fn nobody_moves_after_a_step_that_failed_and_none_that_is_not_trained() {
    let (mut splats, _) = scene(5, 300, 300, 0);
    spread(&mut splats);
    assert_same("a step that failed", &run(&splats, &CLEARINGS, 1, false), &splats.position);
    let held = run(&splats, &CLEARINGS, 0, true);
    assert_same("static Gaussians", &held[..300], &splats.position[..300]);
    assert_ne!(held[300..], splats.position[300..]);
}

#[test]
fn a_value_that_is_not_finite_moves_nobody() {
    let (mut splats, _) = scene(5, 200, 0, 0);
    for (i, value) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e30].into_iter().enumerate() {
        splats.position[i] = [value; 3];
    }
    assert_same("not finite", &run(&splats, &CLEARINGS, 0, false)[..5], &splats.position[..5]);
}
