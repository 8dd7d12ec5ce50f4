//! What 3DGS-MCMC needs of density control: copies that share their opacity, draws by opacity, noise.

use super::density::{Case, DRAWN, scene};
use crate::common::one::logit;
use crate::common::prelude::*;
use ivv::internals::gpu::generated::Status;
use ivv::internals::reference::{normals, shared_opacity};
use ivv::internals::stage::{DensityRound, record_mcmc_noise};

tested! {
    "density/mcmc_noise.comp" by normals in noise_moves_the_faint_along_their_covariance_and_nothing_when_the_step_failed;
}

/// `n` static Gaussians at one place, the first of opacity logit `x`, the others dead.
fn one_and_the_dead(x: f32, n: usize) -> Splats {
    let mut splats = scene_of(&vec![ball([0.1, 0.05, 3.0], 0.3, 0.5, [0.9, 0.4, 0.1]); n]);
    splats.opacity.fill(-30.0);
    splats.opacity[0] = x;
    splats
}

#[test]
fn n_copies_share_opacity_and_size_as_the_double_sum_tells() {
    let mut worst = 0.0f64;
    for x in [-5.2f32, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0, 10.0] {
        for n in [2, 3, 4, 7, 20, 51] {
            let case = Case::new(one_and_the_dead(x, n), vec![[0.0; 4]; n], 128);
            let after = case.run(&DensityRound { max_gaussians: 0, ..DRAWN }).unwrap().splats;
            let (opacity, factor) = shared_opacity(f64::from(x), n as u32);
            for i in 0..n {
                let scale = f64::from(after.scale[i][0]) - f64::from(case.splats.scale[0][0]) - factor.ln();
                let logit = (f64::from(after.opacity[i]) - opacity) / (1.0 + opacity.abs());
                worst = worst.max(scale.abs()).max(logit.abs());
            }
            // 1 - (1 - o')^n is the old opacity.
            let one = 1.0 / (1.0 + (-f64::from(after.opacity[0])).exp());
            let (together, before) = (1.0 - (1.0 - one).powi(n as i32), 1.0 / (1.0 + (-f64::from(x)).exp()));
            assert!((together - before).abs() < 1e-6, "{together} for {before}");
        }
    }
    assert!(worst > 0.0 && worst < 2e-6, "{worst:e}");
}

#[test]
fn the_picture_stays_when_a_gaussian_becomes_many() {
    let gpu = gpu();
    let view = camera(96, 80);
    let render = |splats: &Splats| {
        let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
        renderer.render(&view, Outputs::Color).unwrap().0.color
    };
    for n in [2, 10] {
        let case = Case::new(one_and_the_dead(1.0, n), vec![[0.0; 4]; n], 128);
        let after = case.run(&DensityRound { max_gaussians: 0, ..DRAWN }).unwrap().splats;
        // What the copies would show at the old size and opacity.
        let mut naive = after.clone();
        naive.scale.fill(case.splats.scale[0]);
        naive.opacity.fill(case.splats.opacity[0]);
        let before = render(&case.splats);
        let error = |splats: &Splats| {
            let found = render(splats);
            let sum: f64 =
                found.iter().zip(&before).flat_map(|(a, b)| (0..3).map(|k| f64::from((a[k] - b[k]).abs()))).sum();
            sum / (3 * before.len()) as f64
        };
        let (shared, naive) = (error(&after), error(&naive));
        assert!(shared < 0.01 && shared < 0.25 * naive, "{n} copies: {shared:.4}, naively {naive:.4}");
    }
}

#[test]
fn the_dead_draw_the_living_as_often_as_their_opacity_says() {
    // 20 living ones of opacities 0.05 to 1, 40,000 dead.
    let opacities: Vec<f64> = (1..=20).map(|k| f64::from(k) * 0.049).collect();
    let mut splats = one_and_the_dead(0.0, 40_020);
    for (i, opacity) in opacities.iter().enumerate() {
        // Among the dead, not before them.
        splats.opacity[i * 2000 + 7] = logit(*opacity);
        splats.sh[i * 2000 + 7] = [i as f32; 3];
    }
    splats.opacity[0] = -30.0;
    let case = Case::new(splats, vec![[0.0; 4]; 40_020], 1024);
    let after = case.run(&DensityRound { max_gaussians: 0, ..DRAWN }).unwrap();
    assert_eq!(after.grown.counts.relocated, 40_000);
    let mut found = [0.0f64; 20];
    after.splats.sh.iter().for_each(|sh| found[sh[0] as usize] += 1.0);
    let all: f64 = opacities.iter().sum();
    let chi_square: f64 = opacities
        .iter()
        .zip(found)
        .map(|(opacity, found)| {
            let expected = 40_000.0 * opacity / all;
            (found - 1.0 - expected).powi(2) / expected
        })
        .sum();
    // 19 degrees of freedom: 43.8 is passed once in a thousand keys, 6.8 is not reached as often.
    assert!((5.0..43.8).contains(&chi_square), "{chi_square}");
}

#[test]
fn random_numbers_are_normal_and_independent() {
    let n = 200_000;
    let all: Vec<[f64; 3]> = (0..n).map(|i| normals(77, i, 0)).collect();
    let mean = |f: &dyn Fn(&[f64; 3]) -> f64| all.iter().map(f).sum::<f64>() / f64::from(n);
    for k in 0..3 {
        let moments = [1, 2, 3, 4].map(|p| mean(&|x| x[k].powi(p)));
        let expected = [0.0, 1.0, 0.0, 3.0];
        assert!(moments.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.05), "{moments:?}");
        assert!(mean(&|x| x[k] * x[(k + 1) % 3]).abs() < 0.01);
    }
}

#[test]
fn noise_moves_the_faint_along_their_covariance_and_nothing_when_the_step_failed() {
    let (mut splats, _) = scene(8, 200, 200, 0);
    for i in 0..400 {
        // Opacities around the gate at 0.005, and bright ones.
        splats.opacity[i] = [-9.0, -5.3, -4.0, 2.0][i % 4];
    }
    let gpu = gpu();
    let scene = SceneBuffers::upload_in_groups(&gpu, &splats, &Constants::default(), 128).unwrap();
    let run = |failed: u32| {
        let status = gpu.upload("status", &[Status { failed, ..Status::default() }]).unwrap();
        let mut rec = Recording::new();
        record_mcmc_noise(&mut rec, &scene, &status, 50.0, 31);
        gpu.run(&rec).unwrap();
        scene.download(&gpu, scene.groups.iter().map(|g| &g.params)).unwrap()
    };
    assert_same("a failed frame", &run(1).position, &splats.position);
    let found = run(0);
    let flat: Vec<u32> = scene.groups.iter().flat_map(|g| g.first..g.first + g.n).collect();
    let mut n_moved = 0;
    for (i, flat) in flat.into_iter().enumerate() {
        let deviations = splats.scale[i].map(|s| f64::from(s).exp());
        let [w, x, y, z] = splats.rotation[i].map(f64::from);
        let broken = deviations.iter().any(|s| !s.is_finite()) || splats.position[i].iter().any(|x| x.is_nan());
        if broken || [w, x, y, z] == [0.0; 4] {
            assert_eq!(found.position[i].map(f32::to_bits), splats.position[i].map(f32::to_bits));
            continue;
        }
        let turn = glam::DQuat::from_xyzw(x, y, z, w).normalize();
        let normal = glam::DVec3::from_array(normals(31, flat, 0));
        let variances = glam::DVec3::from_array(deviations.map(|s| s * s));
        let opacity = 1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp());
        let gate = 1.0 / (1.0 + (-100.0 * ((1.0 - opacity) - 0.995)).exp());
        let step = (turn * (variances * (turn.inverse() * normal))) * 50.0 * gate;
        for k in 0..3 {
            let (before, after) = (f64::from(splats.position[i][k]), f64::from(found.position[i][k]));
            let allowed = 1e-6 * before.abs() + 5e-5 * step.length();
            assert!((after - before - step[k]).abs() <= allowed, "{i}: {after} for {before} + {}", step[k]);
        }
        n_moved += usize::from(step.length() > 1e-3);
    }
    assert!(n_moved > 100, "{n_moved}");
}
