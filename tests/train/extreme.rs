//! Training at the extremes (N13, N28).

use crate::common::device::gpu;
use crate::common::random::{Random, scene, view};
use ivv::Constants;
use ivv::scene::capture::{Extent, Picture};
use ivv::scene::{Motion, Splats, View};
use ivv::train::{Config, Setup, StepReport, Strategy, Trainer};

const EXTENT: Extent = Extent { center: [0.0; 3], radius: 4.0 };

/// A picture of noise as large as `view`.
fn noise(seed: u64, view: &View) -> Picture {
    let mut random = Random::new(seed);
    let pixels = (0..view.width * view.height).map(|_| random.bits() as u32 | 0xff00_0000).collect();
    Picture { width: view.width, height: view.height, pixels, ..Picture::default() }
}

fn small() -> View {
    View { width: 40, height: 28, fx: 35.0, fy: 37.5, cx: 19.25, cy: 14.5, ..view() }
}

/// Every number of the Gaussians, flat.
fn numbers(splats: &Splats) -> Vec<f32> {
    let all = [splats.position.as_flattened(), splats.rotation.as_flattened(), splats.scale.as_flattened()];
    let rest: [&[f32]; 3] = [&splats.opacity, splats.sh.as_flattened(), bytemuck::cast_slice(&splats.motion)];
    all.into_iter().chain(rest).flatten().copied().collect()
}

#[test]
fn n28_ten_steps_on_poisoned_scenes_leave_finite_losses_and_finite_gaussians() {
    const VALUES: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-45, 1e38, f32::MIN / 2.0];
    let gpu = gpu();
    let (mut n_poisoned, mut n_left) = (0, 0);
    for seed in 0..100 {
        let mut random = Random::new(2000 + seed);
        let mut splats = scene(seed, 60, (seed % 4) as u32);
        let rate = 0.05 * seed as f64 / 99.0;
        let motion = splats.motion.iter_mut().flat_map(|m| {
            let Motion { velocity: [x, y, z], t_center, .. } = m;
            [x, y, z, t_center]
        });
        let all = splats.position.as_flattened_mut().iter_mut().chain(splats.rotation.as_flattened_mut());
        for slot in all.chain(splats.scale.as_flattened_mut()).chain(&mut splats.opacity).chain(motion) {
            if random.uniform(0.0, 1.0) < rate {
                *slot = VALUES[random.bits() as usize % VALUES.len()];
                n_poisoned += 1;
            }
        }
        let mut config = Config { sh_degree: splats.sh_degree, seed, ..Config::default() };
        if seed % 2 == 1 {
            config.density.strategy = Strategy::Mcmc;
        }
        let (view, total) = (small(), 10);
        let mut trainer =
            Trainer::new(gpu.clone(), &splats, Constants::default(), config, total, Setup::plain(EXTENT, 0.05))
                .unwrap();
        for step in 0..total {
            trainer.train(0, &view, &noise(seed + step, &view)).unwrap();
        }
        let end = trainer.splats().unwrap();
        for StepReport { step, loss, l1, ssim, .. } in trainer.take_reports() {
            assert!([loss, l1, ssim.unwrap()].iter().all(|x| x.is_finite()), "seed {seed}, step {step}");
        }
        // Density control, which ran on the way, removes what can never be drawn.
        let bad = numbers(&end).iter().filter(|x| !x.is_finite()).count();
        assert!(bad == 0 && !end.is_empty(), "seed {seed}: {bad} numbers of {} Gaussians", end.len());
        n_left += end.len();
    }
    assert!(n_poisoned > 1000 && n_left > 2000, "{n_poisoned} poisoned, {n_left} left");
}

#[test]
fn n13_t_center_moves_in_a_clip_of_any_length() {
    let gpu = gpu();
    for n_frames in [10.0, 300.0, 18_000.0] {
        let mut splats = scene(5, 60, 0);
        for motion in &mut splats.motion {
            (motion.t_center, motion.t_scale) = (0.4, -1.0);
        }
        let view = View { time: 0.4, flow_dt: 1.0 / n_frames, ..small() };
        let config = Config { sh_degree: 0, ..Config::default() };
        let mut trainer = Trainer::new(
            gpu.clone(),
            &splats,
            Constants::default(),
            config,
            10_000,
            Setup::plain(EXTENT, 1.0 / n_frames),
        )
        .unwrap();
        for step in 0..100 {
            trainer.train(0, &view, &noise(step, &view)).unwrap();
        }
        let moved: f32 = trainer.splats().unwrap().motion.iter().map(|m| (m.t_center - 0.4).abs()).sum();
        assert!(moved > 1e-4 && moved < 0.1, "{moved} in a clip of {n_frames} frames");
    }
}
