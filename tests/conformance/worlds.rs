//! N15 and N16: where the world's origin is, and how long its unit.

use super::prelude::*;
use glam::{DMat3, DVec3};

/// Largest RMS against the same scene at the origin or in its own unit: a PSNR of 80 dB.
const LARGEST_RMS: f64 = 1e-4;

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
    view.pose.rotation = DMat3::from_cols_array_2d(&turn).transpose();
    view.pose.translation -= DVec3::from(turn.map(|row| (0..3).map(|k| row[k] * offset[k]).sum::<f64>()));
    view
}

pub(super) fn offsets(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let directions = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.5]];
    let distances = [0.0, 60.0, 1e3, 1e5, 5e5];
    let at_origin = bench.render(&scene_of(&on_grid()), &moved_view([0.0; 3]))?.0;
    for (distance, direction) in distances.into_iter().flat_map(|d| directions.map(|direction| (d, direction))) {
        let offset = direction.map(|x| x * distance);
        let mut all = on_grid();
        for one in &mut all {
            one.position = std::array::from_fn(|k| one.position[k] + offset[k] as f32);
        }
        Case::new(format!("offset {offset:?}"), scene_of(&all), moved_view(offset))
            // At 60 units nothing is recentred yet, and the camera's centre is rounded to 4e-6.
            // The reference's band knows nothing of recentring: far away it is everywhere, and must be as exact as the rest.
            .tolerance(Tolerance { away: if distance == 60.0 { 1e-4 } else { 1e-5 }, band: 1e-4, n_band: 1.0 })
            .check(|frame, _| {
                let off = rms(frame, &at_origin);
                ensure!(off <= LARGEST_RMS, "off by {off:.1e} against the origin");
                Ok(())
            })
            .run(bench, tally);
    }
    Ok(())
}

/// The random scene in a unit `1 / k` times as long, and its view.
fn resized(k: f64) -> (Splats, View) {
    let mut splats = scene(72, 60, 1);
    let scale = |x: &mut f32| *x = (f64::from(*x) * k) as f32;
    splats.position.iter_mut().flatten().for_each(scale);
    splats.motion.iter_mut().flat_map(|m| &mut m.velocity).for_each(scale);
    splats.scale.iter_mut().flatten().for_each(|s| *s = (f64::from(*s) + k.ln()) as f32);
    let mut view = view();
    view.pose.translation *= k;
    (splats, view)
}

pub(super) fn sizes(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let (splats, view) = resized(1.0);
    let in_its_own = bench.render(&splats, &view)?.0;
    for k in [1e-4, 1e-2, 1.0, 1e2, 1e4] {
        let (splats, view) = resized(k);
        let near = (f64::from(Constants::default().near) * k) as f32;
        let case = Case::new(format!("unit / {k:e}"), splats, view).check(|frame, _| {
            let off = rms(frame, &in_its_own);
            ensure!(off <= LARGEST_RMS, "off by {off:.1e} against its own unit");
            Ok(())
        });
        Case { constants: Constants { near, ..Constants::default() }, ..case }.run(bench, tally);
    }
    // |mu - centre|^2 overflows past 1.8e19: every band but the first vanishes. Further out 1 / z is denormal, which
    // drivers may flush.
    for z in [1e10, 1e18, 1e19, 3e19, 1e25, 1e30f32] {
        let mut one = ball([0.0, 0.0, z], f64::from(z) * 0.1, 0.9, [0.5; 3]);
        one.sh = vec![[0.2; 3], [0.1; 3], [0.4, -0.3, 0.2], [0.1; 3]];
        let tolerance = Tolerance { n_band: 0.5, ..Tolerance::default() };
        Case::new(format!("a colour of degree 1 at z = {z:e}"), scene_of(&[one]), camera(24, 16))
            .tolerance(tolerance)
            .run(bench, tally);
    }
    Ok(())
}
