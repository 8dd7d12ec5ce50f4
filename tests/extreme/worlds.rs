//! N15 and N16: where the world's origin is, and how long its unit.

use super::table::Case;
use crate::common::frames::{Tolerance, psnr, render};
use crate::common::one::{One, ones, scene_of};
use crate::common::random::{scene, view};
use ivv::Constants;
use ivv::scene::{Splats, View};

/// Least PSNR against the same scene at the origin or in its own unit, dB.
const LEAST_PSNR: f64 = 80.0;

/// A scene whose positions are on a grid of 1/16, which f32 holds at 5e5: only the rendering is measured.
fn on_grid() -> Vec<One> {
    let mut all = ones(&scene(71, 60, 1));
    all.iter_mut().flat_map(|one| &mut one.position).for_each(|x| *x = (*x * 16.0).round() / 16.0);
    all
}

/// The view of a scene moved by `offset`, turned so that the large terms of R x + t would round before they cancel.
fn moved_view(offset: [f64; 3]) -> View {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (0.35f64.sin_cos(), 0.2f64.sin_cos());
    let turn = [[cos_a, 0.0, sin_a], [sin_a * sin_b, cos_b, -cos_a * sin_b], [-sin_a * cos_b, sin_b, cos_a * cos_b]];
    let mut view = view();
    for (row, turn) in view.world_to_camera.iter_mut().zip(turn) {
        row[..3].copy_from_slice(&turn);
        row[3] -= (0..3).map(|k| turn[k] * offset[k]).sum::<f64>();
    }
    view
}

pub fn offsets() -> Vec<Case> {
    let directions = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.5]];
    let distances = [0.0, 60.0, 1e3, 1e5, 5e5];
    let mut cases = Vec::new();
    for (distance, direction) in distances.into_iter().flat_map(|d| directions.map(|direction| (d, direction))) {
        let offset = direction.map(|x| x * distance);
        let mut all = on_grid();
        for one in &mut all {
            one.position = std::array::from_fn(|k| one.position[k] + offset[k] as f32);
        }
        cases.push(Case {
            // At 60 units nothing is recentred yet, and the camera's centre is rounded to 4e-6.
            // The twin's band knows nothing of recentring: far away it is everywhere, and must be as exact as the rest.
            tolerance: Tolerance { away: if distance == 60.0 { 1e-4 } else { 1e-5 }, band: 1e-4, n_band: 1.0 },
            check: Box::new(|frame, _| {
                let at_origin = render(&scene_of(&on_grid()), &moved_view([0.0; 3])).0;
                let ratio = psnr(frame, &at_origin);
                if ratio >= LEAST_PSNR { Ok(()) } else { Err(format!("PSNR {ratio:.1} dB against the origin")) }
            }),
            ..Case::new(format!("offset {offset:?}"), scene_of(&all), moved_view(offset))
        });
    }
    cases
}

/// The random scene in a unit `1 / k` times as long, and its view.
fn resized(k: f64) -> (Splats, View) {
    let mut splats = scene(72, 60, 1);
    let scale = |x: &mut f32| *x = (f64::from(*x) * k) as f32;
    splats.position.iter_mut().flatten().for_each(scale);
    splats.motion.iter_mut().flat_map(|m| &mut m.velocity).for_each(scale);
    splats.scale.iter_mut().flatten().for_each(|s| *s = (f64::from(*s) + k.ln()) as f32);
    let mut view = view();
    view.world_to_camera.iter_mut().take(3).for_each(|row| row[3] *= k);
    (splats, view)
}

pub fn sizes() -> Vec<Case> {
    [1e-4, 1e-2, 1.0, 1e2, 1e4]
        .into_iter()
        .map(|k| {
            let (splats, view) = resized(k);
            let near = (f64::from(Constants::default().near) * k) as f32;
            Case {
                constants: Constants { near, ..Constants::default() },
                check: Box::new(|frame, _| {
                    let (splats, view) = resized(1.0);
                    let ratio = psnr(frame, &render(&splats, &view).0);
                    if ratio >= LEAST_PSNR { Ok(()) } else { Err(format!("PSNR {ratio:.1} dB against its own unit")) }
                }),
                ..Case::new(format!("unit / {k:e}"), splats, view)
            }
        })
        .collect()
}
