//! The conservative visibility bound against the pixels.

use crate::common::prelude::*;
use crate::common::random::view;
use ivv::internals::reference::{Real, project, tiles_truth, visible};

/// Gaussians everywhere around the camera, of all sizes, brightnesses and times; needles among them.
fn wild_scene(seed: u64, n: usize) -> Splats {
    let mut random = Random::new(seed);
    let mut splats = Splats { sh_degree: 0, ..Splats::default() };
    for i in 0..n {
        let spread = random.pick(&[1.0, 10.0, 1000.0]);
        splats.position.push(random.vector(-spread, spread));
        splats.rotation.push(random.vector(-1.0, 1.0));
        let size = random.pick(&[-15.0, -4.0, -2.0, 0.0, 3.0, 20.0]);
        let mut scale = [size as f32; 3];
        scale[(random.bits() % 3) as usize] += random.uniform(-4.0, 4.0) as f32;
        splats.scale.push(scale);
        splats.opacity.push(random.pick(&[-5.541_263_6, -5.5, -3.0, 0.0, 3.0, 20.0]) as f32);
        splats.sh.push([0.5; 3]);
        splats.motion.push(Motion {
            velocity: random.vector(-2.0, 2.0),
            t_center: random.uniform(-0.5, 1.5) as f32,
            t_scale: random.pick(&[-18.0, -3.0, -1.0, 0.0, 9.0, f64::INFINITY]) as f32,
        });
        splats.source_row.push(i as u32);
    }
    splats
}

/// Asserts that nothing visible is culled; gives the numbers of culled, contributing and all Gaussians.
fn check<R: Real>(splats: &Splats, view: &View) -> [usize; 3] {
    let rules = Rules::<R>::new(&Constants::default());
    let params = Params::<R>::new(splats, view);
    let camera = Camera::new(view);
    let time = camera.shifted_time(params.time_offset);
    let size = [view.intrinsics.width, view.intrinsics.height];
    let all_rows = [0.0, f64::from(view.intrinsics.height)].map(R::from_f64);
    let mut counts = [0, 0, params.len()];
    for i in 0..params.len() {
        let g = params.gaussian(i);
        let kept = visible(&g, &camera, time, all_rows, &rules);
        counts[0] += usize::from(!kept);
        let Some(p) = project(&g, &camera, time, &rules) else { continue };
        let touched = tiles_truth(&p, &rules, size);
        counts[1] += usize::from(!touched.is_empty());
        assert!(kept || touched.is_empty(), "Gaussian {i} is culled but seen: {g:?}");
        // A strip of rows: the first row of tiles, and all below it.
        let n_columns = size[0].div_ceil(16);
        for (rows, inside) in [([0.0, 16.0], true), ([16.0, f64::from(size[1])], false)] {
            let kept = visible(&g, &camera, time, rows.map(R::from_f64), &rules);
            let seen = touched.iter().any(|tile| (*tile < n_columns) == inside);
            assert!(kept || !seen, "Gaussian {i} is culled from rows {rows:?} but seen: {g:?}");
        }
    }
    counts
}

#[test]
fn no_gaussian_that_contributes_is_culled() {
    for seed in 0..3 {
        let splats = wild_scene(seed, 300);
        for [n_culled, n_seen, n] in [check::<f64>(&splats, &view()), check::<f32>(&splats, &view())] {
            assert!(n_seen > 20, "seed {seed}: only {n_seen} are seen");
            assert!(n_culled * 2 > n, "seed {seed}: only {n_culled} of {n} are culled");
        }
    }
}

#[test]
fn the_time_window_ends_where_the_opacity_does() {
    let view = view();
    let rules = Rules::<f64>::new(&Constants::default());
    let motion = Motion { velocity: [0.0; 3], t_center: 0.5, t_scale: -2.0 };
    let splats = super::with_motion(&super::single([0.0; 3]), motion);
    let params = Params::<f64>::new(&splats, &view);
    let (g, camera) = (params.gaussian(0), Camera::new(&view));
    let base = 1.0 / (1.0 + (-2f64).exp());
    let half = (-2f64).exp() * (base / rules.alpha_min).ln().sqrt();
    let kept = |time: f64| visible(&g, &camera, time, [0.0, 56.0], &rules);
    assert!(kept(0.5) && kept(0.5 + half) && kept(0.5 - half));
    assert!(!kept(0.5 + half * 1.0001) && !kept(0.5 - half * 1.0001));
}

#[test]
fn a_needle_outside_the_image_that_just_reaches_in_is_kept() {
    let view = view();
    let rules = Rules::<f64>::new(&Constants::default());
    let camera = Camera::<f64>::new(&view);
    let (focal, middle, size) =
        ([view.intrinsics.fx, view.intrinsics.fy], [view.intrinsics.cx, view.intrinsics.cy], [80.0, 56.0]);
    for axis in 0..2 {
        for ratio in [-1.5, -0.9, -0.7, 0.75, 1.0, 1.5f64] {
            // Along the row of J, where the bound is tight: (1, 0, -u) or (0, 1, -v), and 1 px past the edge's centres.
            let u = camera.clamped(ratio, axis);
            let at = focal[axis] * ratio + middle[axis];
            let distance = if ratio < 0.0 { 1.5 - at } else { at - (size[axis] - 1.5) };
            let (sin, cos) = (0.5 * u.atan()).sin_cos();
            let mut splats = super::single([0.0; 3]);
            // Camera depth 4, on the axis' middle line otherwise.
            splats.position[0][axis] = (4.0 * ratio) as f32;
            splats.rotation[0] = [[cos, 0.0, sin, 0.0], [cos, -sin, 0.0, 0.0]][axis].map(|x| x as f32);
            let opacity = 1.0 / (1.0 + f64::from(-splats.opacity[0]).exp());
            let reach = (2.0 * (opacity / rules.alpha_min).ln()).sqrt();
            let deviation = distance / reach * 4.0 / focal[axis] / (1.0 + u * u).sqrt();
            splats.scale[0] = [-9.0; 3];
            splats.scale[0][axis] = deviation.ln() as f32;
            let counts = check::<f64>(&splats, &view);
            assert_eq!(counts, [0, 1, 1], "axis {axis}, ratio {ratio}: [culled, seen, all]");
        }
    }
}
