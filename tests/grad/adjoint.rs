//! The backward pass is the adjoint of the forward pass's derivative, for random scenes and views.

use super::check::{check_adjoint, is_finite, smooth_cotangents, vjp};
use crate::adversary::slack;
use crate::common::one::with;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv_conformance::adjoint::{GROUPS, flat};

tested! {
    "blend/blend_bwd.comp" by jvp in the_backward_pass_is_the_adjoint_in_every_group_of_every_population_and_degree;
    "project/project_bwd.comp" by jvp in the_backward_pass_is_the_adjoint_in_every_group_of_every_population_and_degree;
}

fn population(splats: &Splats, is_static: bool) -> Splats {
    let n = splats.len();
    let motion = Motion { velocity: [0.3, -0.2, 0.1], t_center: 0.35, t_scale: -0.5 };
    Splats {
        n_static: if is_static { n } else { 0 },
        motion: if is_static {
            Vec::new()
        } else {
            (0..n).map(|i| splats.motion.get(i.wrapping_sub(splats.n_static)).copied().unwrap_or(motion)).collect()
        },
        ..splats.clone()
    }
}

/// [`view`] with another size, seeing the same part of the world.
fn sized(width: u32, height: u32) -> View {
    let base = view();
    let scale = f64::from(width.max(height)) / 80.0;
    View {
        intrinsics: Intrinsics {
            width,
            height,
            fx: base.intrinsics.fx * scale,
            fy: base.intrinsics.fy * scale,
            cx: f64::from(width) * 0.48,
            cy: f64::from(height) * 0.52,
        },
        ..base
    }
}

#[test]
fn the_backward_pass_is_the_adjoint_in_every_group_of_every_population_and_degree() {
    let mut faults = Vec::new();
    for degree in 0..=3 {
        let mixed = scene(30 + u64::from(degree), 40, degree);
        for (name, splats, least) in [
            ("static", population(&mixed, true), 5),
            ("dynamic", population(&mixed, false), 9),
            ("mixed", mixed.clone(), 9),
        ] {
            let view = sized(40, 33);
            let cotangents = smooth_cotangents(3, &splats, &view);
            if let Err(fault) = check_adjoint(&splats, &view, &cotangents, slack(4.0) * 1e-5, least) {
                faults.push(format!("{name}, degree {degree}: {fault}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_backward_pass_is_the_adjoint_for_any_view() {
    let turned = {
        let (s, c) = 0.4f64.sin_cos();
        let rows = [[c, 0.0, s, 0.2], [0.0, 1.0, 0.0, -0.1], [-s, 0.0, c, 3.5], [0.0, 0.0, 0.0, 1.0]];
        View { pose: Pose::of_rows(&rows), ..sized(40, 33) }
    };
    let views = [
        ("1x1", sized(1, 1)),
        ("15x17", sized(15, 17)),
        ("40x33", sized(40, 33)),
        ("16x16", sized(16, 16)),
        ("off centre", with(sized(40, 33), |of| (of.cx, of.cy) = (3.0, 40.0))),
        ("turned", turned),
        // The frustum's clamp is active where the picture is smaller than the scene.
        ("close", with(sized(40, 33), |of| (of.fx, of.fy) = (150.0, 140.0))),
        ("no frame time", View { flow_dt: 0.0, ..sized(15, 17) }),
    ];
    let mut faults = Vec::new();
    for (name, view) in views {
        for seed in [50, 51] {
            let mut splats = scene(seed, 50, 1);
            if name == "1x1" {
                splats.position.iter_mut().flatten().for_each(|x| *x *= 0.1);
            }
            let cotangents = smooth_cotangents(seed, &splats, &view);
            // Without a frame's time there is neither flow nor a time offset.
            let least = if view.flow_dt == 0.0 { 8 } else { 9 };
            if let Err(fault) = check_adjoint(&splats, &view, &cotangents, 1e-5, least) {
                faults.push(format!("{name}, seed {seed}: {fault}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn gaussians_partly_outside_have_the_clamped_jacobians_gradient() {
    let view = sized(40, 33);
    let mut random = Random::new(8);
    let mut all = Vec::new();
    for i in 0..12 {
        // Beyond the clamp of 0.15 widths past the border, wide enough to be seen.
        let angle = f64::from(i) * 0.52;
        let [x, y] = [angle.cos() * 3.6, angle.sin() * 3.2].map(|x| x as f32);
        let mut one = ball([x, y, random.uniform(-0.5, 0.5) as f32], 0.5, 0.6, random.vector(0.1, 0.9).map(f64::from));
        one.scale = random.vector(-0.8, 0.2);
        one.rotation = random.vector(-1.0, 1.0);
        all.push(one);
    }
    let splats = scene_of(&all);
    let cotangents = smooth_cotangents(4, &splats, &view);
    let (found, _) = vjp(&splats, &view, &cotangents);
    let camera = Camera::<f64>::new(&view);
    let clamped = |p: &[f32; 3]| {
        let ratio = [0, 1].map(|axis| f64::from(p[axis]) / (f64::from(p[2]) + 4.0));
        (0..2).any(|axis| camera.clamped(ratio[axis], axis) != ratio[axis])
    };
    let seen = (0..splats.len()).filter(|i| clamped(&splats.position[*i]) && found.params.position[*i] != [0.0; 3]);
    let n = seen.count();
    assert!(n >= 6, "the clamp is active for {n} Gaussians that are seen");
    check_adjoint(&splats, &view, &cotangents, 1e-5, 5).unwrap();
}

#[test]
fn gradients_have_the_same_bits_in_every_run_and_after_a_replay() {
    let gpu = gpu();
    let (splats, view) = (scene(90, 120, 2), view());
    let cotangents = smooth_cotangents(5, &splats, &view);
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let (first, report) = renderer.vjp(&view, &cotangents).unwrap();
    let n_moved = GROUPS.iter().flat_map(|group| flat(&first, group)).filter(|x| *x != 0.0).count();
    assert!(report.replays == 0 && n_moved > 1000, "{n_moved}");
    let (second, _) = renderer.vjp(&view, &cotangents).unwrap();
    assert_same_gradients("the second run", &second, &first);
    let (fresh, _) = vjp(&splats, &view, &cotangents);
    assert_same_gradients("a fresh renderer", &fresh, &first);
    renderer.limit_intersections(1);
    let (replayed, report) = renderer.vjp(&view, &cotangents).unwrap();
    assert!(report.replays > 0, "{report:?}");
    assert_same_gradients("the replay", &replayed, &first);
}

/// `n` Gaussians of a few pixels, one behind the other, that [`camera`] (16, 16) sees, with opacities from `low` to `high`.
pub fn layers(n: u64, low: f64, high: f64) -> Splats {
    let mut random = Random::new(n);
    let all: Vec<_> = (0..n)
        .map(|i| {
            // Depths on a grid of 2^-16, no two equal; pixels are 1/64 of the depth.
            let z = 2.0 + ((i * 7919) % n) as f32 / 65_536.0;
            let [x, y] = [0, 1].map(|_| random.uniform(-7.9, 7.9) as f32 / 64.0 * z);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            // A pixel is 1/32 of a unit.
            let scale = random.vector(-5.5, -3.5);
            let rotation = random.vector(-1.0, 1.0);
            One { scale, rotation, ..ball([x, y, z], 1.0, random.uniform(low, high), color) }
        })
        .collect();
    scene_of(&all)
}

#[test]
fn lists_longer_than_a_round_have_the_gradients_of_the_truth() {
    let (splats, view) = (layers(40_000, 1.1 / 255.0, 1.5 / 255.0), camera(16, 16));
    let cotangents = smooth_cotangents(6, &splats, &view);
    let (found, report) = vjp(&splats, &view, &cotangents);
    assert!(report.max_tile_list > 32_768 && is_finite(&found), "{report:?}");
    // A GPU walks chunks, which need no more rounds.
    assert_eq!(report.replays > 0, gpu().caps().kind == DeviceKind::Cpu, "{report:?}");
    check_adjoint(&splats, &view, &cotangents, 1e-5, 5).unwrap();
}
