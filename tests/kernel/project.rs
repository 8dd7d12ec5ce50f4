//! Projected records of the device against the float64 projection.

use crate::adversary::slack;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::common::stages::{Active, Fixture};
use ivv::internals::reference::{basis, power, project, tiles_truth};

tested! {
    "project/project.comp" by project in records_of_every_degree_and_population_are_those_of_float64;
}

/// One unit of f32 in the last place, relative.
const ULP: f64 = f32::EPSILON as f64;

/// Largest error of each quantity over its allowance; 1 is the limit.
#[derive(Debug, Default)]
struct Worst {
    xy: f64,
    z: f64,
    opacity: f64,
    exponent: f64,
    color: f64,
    flow: f64,
    shape: f64,
    n: usize,
}

/// Covariance's slope C_xy / C_yy, chord sqrt(det C / C_yy) and sqrt(C_yy) from a square root of its inverse.
fn shape(m: [[f64; 2]; 2]) -> [f64; 3] {
    // The inverse covariance is m^T m, and its determinant that of m squared.
    let a = m[0][0] * m[0][0] + m[1][0] * m[1][0];
    let b = m[0][0] * m[0][1] + m[1][0] * m[1][1];
    let det = (m[0][0] * m[1][1] - m[0][1] * m[1][0]).powi(2);
    [-b / a, 1.0 / a.sqrt(), (a / det).sqrt()]
}

fn record(worst: &mut Worst, found: &[[f32; 4]; 4], p: &Projected<f64>, u: f64, color_size: f64, flow_size: f64) {
    let [[x, y, m00, m01], [m10, m11, opacity, z], [r, g, b, flow_x], [flow_y, slope, chord, reach_y]] =
        found.map(|v| v.map(f64::from));
    let put = |worst: &mut f64, error: f64, allowed: f64| {
        *worst = worst.max(if error.is_nan() { 1e9 } else { error / allowed })
    };
    let log_opacity = (255.0 * p.opacity).ln();
    for (found, truth) in [x, y].into_iter().zip(p.xy) {
        // A rotation, a division, a product and a sum of numbers up to the image's size.
        put(&mut worst.xy, (found - truth).abs(), 3.0 * ULP * (truth.abs() + 80.0));
    }
    put(&mut worst.z, (z - p.z).abs(), 2.0 * ULP * (p.z + 4.0));
    // Two exponentials of 3 + 2|x| ULP each (A.1).
    put(&mut worst.opacity, (opacity / p.opacity - 1.0).abs(), ULP * (12.0 + 4.0 * (u * u + log_opacity.abs())));
    for d in [[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [-0.6, 0.8]] {
        let truth = power(p.m, d);
        // 2^-|M d|^2 of the device is e^-(|m d|^2 / 2) of SPEC.
        let [v, w] = [m00 * d[0] + m01 * d[1], m10 * d[0] + m11 * d[1]];
        let found = (v * v + w * w) * std::f64::consts::LN_2;
        let norm = p.m.as_flattened().iter().map(|x| x * x).sum::<f64>();
        put(&mut worst.exponent, (found - truth).abs(), 12.0 * ULP * (truth + (truth * norm).sqrt()));
    }
    for (found, truth) in [r, g, b].into_iter().zip(p.color) {
        put(&mut worst.color, (found - truth).abs(), 2.0 * ULP * color_size);
    }
    for (found, truth) in [flow_x, flow_y].into_iter().zip(p.flow) {
        put(&mut worst.flow, (found - truth).abs(), 3.0 * ULP * flow_size);
    }
    let [true_slope, true_chord, true_sd_y] = shape(p.m);
    let reach = (2.0 * log_opacity.max(0.0)).sqrt();
    // Never shorter than the truth, and longer by the margin only: it acts on the square, where `log_opacity` may be 0.
    let margin = 1e-5 * (1.0 + log_opacity) + 4.0 * ULP * (4.0 + u * u);
    for (found, truth) in [(chord, true_chord), (reach_y, true_sd_y)] {
        let (low, high) = (truth * reach, truth * (reach * reach + 2.0 * margin).sqrt() * (1.0 + 20.0 * ULP));
        assert!(found >= low * (1.0 - 4.0 * ULP) && found <= high, "{found} is not in {low}..{high}");
    }
    put(&mut worst.shape, (slope - true_slope).abs(), 60.0 * ULP * (1.0 + true_slope.abs()));
    worst.n += 1;
}

fn check(what: &str, splats: &Splats, view: &View) -> Worst {
    let fixture = Fixture::new(splats, view);
    let Active { status, ids, ranges, splats: records, depth_keys, tile_counts } = fixture.project();
    assert_eq!(status.n_bad, 0, "{what}");
    assert!(ids.len() > splats.len() / 2, "{what}: only {} are active", ids.len());
    assert_eq!(ranges.last().unwrap()[1], ids.len() as u32);
    assert_eq!(status.n_visible as usize, tile_counts.iter().filter(|n| **n > 0).count(), "{what}");

    let params = Params::<f64>::new(splats, view);
    let (camera, rules) = (Camera::<f64>::new(view), Rules::<f64>::new(&Constants::default()));
    let time = camera.shifted_time(params.time_offset);
    let mut worst = Worst::default();
    for (at, id) in ids.iter().enumerate() {
        assert_eq!(depth_keys[at], records[at][1][3].to_bits(), "{what}: the key of {at} is not its depth");
        let g = params.gaussian(fixture.index_of(*id));
        let Some(p) = project(&g, &camera, time, &rules) else {
            assert_eq!(tile_counts[at], 0, "{what}: {at} is drawn but dropped by the truth");
            continue;
        };
        let u = g.motion.map_or(0.0, |m| (time - m.t_center) * (-m.t_scale).exp());
        let dir = std::array::from_fn::<f64, 3, _>(|k| g.position_at(time)[k] - camera.centre[k]);
        let length = dir.iter().map(|x| x * x).sum::<f64>().sqrt();
        let terms = g.sh.iter().zip(basis(dir.map(|x| x / length)));
        let color_size =
            1.0 + terms.map(|(c, b)| c[0].abs().max(c[1].abs()).max(c[2].abs()) * (b.abs() + 1.0)).sum::<f64>();
        let speed = g.velocity().iter().map(|v| v.abs()).sum::<f64>();
        let flow_size = f64::max(view.flow_dt * view.intrinsics.fy / p.z * speed * 2.0, f64::MIN_POSITIVE);
        record(&mut worst, &records[at], &p, u, color_size, flow_size);
        let drawn = tile_counts[at] > 0;
        assert!(
            drawn || tiles_truth(&p, &rules, [view.intrinsics.width, view.intrinsics.height]).is_empty(),
            "{what}: {at} has no tile"
        );
    }
    worst
}

#[test]
fn records_of_every_degree_and_population_are_those_of_float64() {
    let view = view();
    let turned = View { pose: rotated(view.pose), time: 0.1, ..view.clone() };
    for sh_degree in 0..=3 {
        for seed in 0..2 {
            let mixed = scene(10 * u64::from(sh_degree) + seed, 120, sh_degree);
            for (name, view) in [("straight", &view), ("turned", &turned)] {
                let what = format!("degree {sh_degree}, seed {seed}, {name}");
                let worst = check(&what, &mixed, view);
                assert!(worst.n > 60, "{what}: only {} records", worst.n);
                let Worst { xy, z, opacity, exponent, color, flow, shape, n: _ } = worst;
                let all = [xy, z, opacity, exponent, color, flow, shape];
                assert!(all.iter().all(|error| *error <= slack(2.0)), "{what}: {worst:?}");
                assert!(all.iter().all(|error| *error > 0.0), "{what}: nothing was measured: {worst:?}");
            }
        }
    }
}

/// The pose after a turn about the camera's y and x axes by about 20 degrees each; the scene stays in sight.
fn rotated(pose: Pose) -> Pose {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (0.35f64.sin_cos(), 0.2f64.sin_cos());
    let turn = [[cos_a, 0.0, sin_a], [sin_a * sin_b, cos_b, -cos_a * sin_b], [-sin_a * cos_b, sin_b, cos_a * cos_b]];
    Pose { rotation: DMat3::from_cols_array_2d(&turn).transpose(), ..pose }
}
