//! N28: scenes of which any number may be poisoned, drawn, differentiated and trained.

use super::adjoint::{GROUPS, flat};
use super::prelude::*;
use super::random::poison;
use ivv::internals::reference::{Camera, Params, Rules, project};
use ivv::internals::train::{Config, Setup, StepReport, Strategy, Trainer};

pub(super) fn poisoned_scenes(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let (mut n_poisoned, mut n_gradients, mut n_undrawn, mut n_left) = (0, 0, 0, 0);
    for seed in 0..40 {
        let mut random = Random::new(1000 + seed);
        let mut splats = scene(seed, 120, (seed % 4) as u32);
        let rate = random.uniform(0.0, 0.05);
        n_poisoned += poison(&mut splats, &mut random, rate);
        tally.case(format!("seed {seed}, a frame and its gradient"), |_| {
            let view = view();
            let (frame, _) = bench.render(&splats, &view)?;
            check_finite(&frame)?;
            let (found, report) = bench.vjp(&splats, &view, &cotangents(seed, &view, |_| false))?;
            ensure!(is_finite(&found), "a gradient that is not finite");
            ensure!(report.bad_gaussians > 0 || rate < 0.01, "no bad Gaussian: {report:?}");
            for (i, drawable) in drawable(&splats, &view).into_iter().enumerate() {
                let p = &found.params;
                let none = p.position[i] == [0.0; 3] && p.opacity[i] == 0.0 && p.rotation[i] == [0.0; 4];
                ensure!(drawable || none, "Gaussian {i} is not drawn and has a gradient");
                n_undrawn += usize::from(!drawable);
            }
            n_gradients += found.params.opacity.iter().filter(|x| **x != 0.0).count();
            Ok(())
        });
    }
    ensure!(n_gradients > 500 && n_undrawn > 100, "{n_gradients} gradients, {n_undrawn} not drawn");
    poisoned_cotangents(bench, tally)?;
    for seed in 0..100 {
        let mut random = Random::new(2000 + seed);
        let mut splats = scene(seed, 60, (seed % 4) as u32);
        n_poisoned += poison(&mut splats, &mut random, 0.05 * seed as f64 / 99.0);
        tally.case(format!("seed {seed}, ten steps"), |_| {
            n_left += ten_steps(bench, seed, &splats)?;
            Ok(())
        });
    }
    ensure!(n_poisoned > 2000 && n_left > 2000, "{n_poisoned} poisoned, {n_left} left");
    Ok(())
}

/// Which Gaussians the truth can show.
fn drawable(splats: &Splats, view: &View) -> Vec<bool> {
    let (params, camera) = (Params::<f64>::new(splats, view), Camera::<f64>::new(view));
    let rules = Rules::<f64>::new(&Constants::default());
    let time = camera.shifted_time(params.time_offset);
    (0..params.len()).map(|i| project(&params.gaussian(i), &camera, time, &rules).is_some()).collect()
}

/// One number of the cotangent zeroes the gradients that it reaches, and they are counted.
fn poisoned_cotangents(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let (splats, view) = (scene(70, 60, 2), view());
    let clean = cotangents(8, &view, |_| false);
    let (before, _) = bench.vjp(&splats, &view, &clean)?;
    ensure!(before.n_bad == 0, "{} bad gradients before", before.n_bad);
    ensure!(GROUPS.iter().all(|name| flat(&before, name).iter().any(|x| *x != 0.0)), "a group has no gradient");
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        tally.case(format!("a cotangent of {value}"), |_| {
            let mut cotangents = clean.clone();
            cotangents.color
                [(view.intrinsics.width * view.intrinsics.height / 2 + view.intrinsics.width / 2) as usize][1] = value;
            let (found, _) = bench.vjp(&splats, &view, &cotangents)?;
            ensure!(is_finite(&found) && found.n_bad > 0, "{} bad", found.n_bad);
            let (after, before) = (&found.params, &before.params);
            let changed: Vec<usize> = (0..splats.len()).filter(|i| after.opacity[*i] != before.opacity[*i]).collect();
            ensure!(changed.len() < splats.len() / 2, "{} gradients differ", changed.len());
            let is_zero = |i: &&usize| after.opacity[**i] == 0.0 && after.position[**i] == [0.0; 3];
            let n_zero = changed.iter().filter(is_zero).count();
            ensure!(n_zero == found.n_bad as usize, "{n_zero} are zero, {} are counted", found.n_bad);
            Ok(())
        });
    }
    Ok(())
}

/// Trains on noise; gives how many Gaussians are left.
fn ten_steps(bench: &Bench, seed: u64, splats: &Splats) -> Result<usize> {
    let mut config = Config {
        sh_degree: splats.sh_degree,
        seed,
        ..Config::default().with_preset("exact").expect("a preset of the engine")
    };
    if seed % 2 == 1 {
        config.density.strategy = Strategy::Mcmc;
    }
    let (view, total) = (small_view(), 10);
    let gpu = bench.gpu();
    let setup = Setup::plain(Extent { center: [0.0; 3], radius: 4.0 }, 0.05);
    let mut trainer = Trainer::new(Arc::clone(&gpu), splats, Constants::default(), config, total, setup)?;
    for step in 0..total {
        trainer.train(0, &view, &noise(seed + step, &view))?;
    }
    let end = trainer.splats()?;
    for StepReport { step, loss, terms, .. } in trainer.take_reports() {
        let (l1, ssim) = (terms.get("l1"), terms.get("ssim"));
        let is_finite = [Some(&loss), l1, ssim].iter().all(|x| x.is_some_and(|x| x.is_finite()));
        ensure!(is_finite, "a loss of {loss} in step {step}, L1 {l1:?}, SSIM {ssim:?}");
    }
    let all = [end.position.as_flattened(), end.rotation.as_flattened(), end.scale.as_flattened()];
    let motion: &[f32] = bytemuck::cast_slice(&end.motion);
    let numbers = all.into_iter().chain([&end.opacity, end.sh.as_flattened()]).flatten();
    let n_bad = numbers.filter(|x| !x.is_finite()).count();
    // Infinite tau is a value.
    let of_motion = motion.chunks(5).filter(|m| m.iter().take(4).any(|x| !x.is_finite()) || m[4].is_nan()).count();
    ensure!(n_bad + of_motion == 0 && !end.is_empty(), "{n_bad} bad numbers of {} Gaussians", end.len());
    Ok(end.len())
}
