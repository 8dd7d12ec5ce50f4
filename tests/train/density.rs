//! Density control in a run: when rounds are due, and what training with either strategy leaves.

use super::{Tiny, as_it_is, nothing_moves, steady, trainer};
use crate::common::prelude::*;
use ivv::internals::scene::capture::Extent;
use ivv::internals::stage::{Choice, PruneLimits};
use ivv::internals::train::{Round, StepReport, Strategy, density_round, noise, regularisers};

#[test]
fn a_run_that_begins_with_all_it_finds_still_grows() {
    let tiny = Tiny::on_device("room");
    let n = tiny.capture.points.len();
    // Fewer than there are points.
    let config = Config { sh_degree: 0, steps: 60, max_gaussians: 9 * n / 10, init: Init::Points, ..steady() };
    let grown = |config: &Config, options: SessionOptions| {
        let mut session = Session::begin(gpu().clone(), &tiny.capture, config.clone(), options).unwrap();
        let (first, room) = (session.trainer().n_gaussians() as usize, session.trainer().room_to_grow());
        while session.step().unwrap() {}
        session.wait().unwrap();
        let reports = session.take_events().into_iter();
        let rounds = reports.filter_map(|event| if let Event::Step(report) = event { report.density } else { None });
        (first, room.unwrap(), rounds.map(|counts| counts.cloned + counts.split).sum::<u32>())
    };
    let (first, room, added) = grown(&config, as_it_is());
    assert!(
        first < config.max_gaussians && room > 0 && added > 0,
        "{first} of {n} at first, {room} more, {added} added"
    );
    // What somebody begins with is kept, and the run can say that nothing will be added.
    let all = from_points(&tiny.capture.points, &tiny.capture, &config);
    let full = Config { max_gaussians: n, ..config.clone() };
    let options = SessionOptions { first: Some(all), ..as_it_is() };
    assert_eq!(grown(&full, options), (n, 0, 0));
    // Drawn copies take the place of others.
    let density = Density { strategy: Strategy::Mcmc, ..Density::default() };
    let initial =
        ivv::internals::train::initialise(&tiny.capture, &Config { density, ..config.clone() }, &mut |_, _| {})
            .unwrap();
    assert_eq!((initial.splats.len(), initial.thinned_from), (config.max_gaussians, Some(n)));
}

#[test]
fn the_settings_of_density_control_make_its_rounds() {
    let extent = Extent { center: [100.0, 2.0, 3.0], radius: 4.0 };
    let round =
        |config: &Config, step| density_round(config, (step, 10_000), (90_000, 90_000), &extent, [90.0, 0.0, 0.0], 7);
    let adc = exact();
    assert_eq!(round(&adc, 550), None);
    let first = round(&adc, 600).unwrap();
    assert_eq!(first.choice, Choice::Pulled { gradient: 2e-4, split_above: 0.04 });
    assert_eq!(first.limits, PruneLimits { opacity: 0.005, log_scale: 2f32.ln(), veil: 0.33 });
    assert_eq!((first.center, first.extent, first.n_frames, first.growth), ([10.0, 2.0, 3.0], 4.0, 7, 0.05));
    assert_ne!(first.key, round(&adc, 700).unwrap().key);
    // Opacity 0.05 from the reset on step 3000; MCMC has none.
    let ceiling = |config: &Config, step| round(config, step).unwrap().opacity_ceiling;
    assert!((ceiling(&adc, 3000) + 2.944_439).abs() < 1e-5 && ceiling(&adc, 2900) == f32::MAX);
    let mcmc = Config { density: Density { strategy: Strategy::Mcmc, ..Density::default() }, ..exact() };
    assert_eq!(ceiling(&mcmc, 3000), f32::MAX);
    let drawn = round(&mcmc, 600).unwrap();
    assert_eq!((drawn.choice, drawn.growth), (Choice::Drawn, 0.05));
    // A reset between two rounds adds nothing.
    let often = Config { density: Density { reset_every: 50, ..Density::default() }, ..exact() };
    assert_eq!((round(&often, 650).unwrap().growth, round(&often, 650).unwrap().choice), (0.0, first.choice));
    assert_eq!(round(&often, 6050), None);
    // After half of the run rounds remove, with either strategy, until scenes are averaged; without density control there are none.
    let (late, last) = (round(&adc, 5100).unwrap(), round(&adc, 9_000).unwrap());
    assert_eq!(round(&adc, 9_100), None);
    assert!(round(&Config { average: 0.0, ..adc.clone() }, 10_000).is_some());
    assert_eq!((round(&adc, 5000).unwrap().growth, late.growth, last.growth), (0.05, 0.0, 0.0));
    assert_eq!((late.limits.veil, late.opacity_ceiling), (f32::INFINITY, f32::MAX));
    assert_eq!(
        [round(&adc, 600), round(&often, 650), round(&mcmc, 600)].map(|round| round.unwrap().limits.veil),
        [0.33; 3]
    );
    // What is large, or wide before a lens, goes only as long as others are added: later a wall would be left with a hole.
    assert_eq!((late.choice, late.limits.log_scale), (first.choice, f32::INFINITY));
    // Few Gaussians grow by more than their share, by all of them at most.
    let few = |n| density_round(&adc, (600, 10_000), (n, n), &extent, [90.0, 0.0, 0.0], 7).unwrap().growth;
    assert_eq!([few(500), few(4000), few(70_000)], [1.0, 0.25, 0.05]);
    // Those that are not trained do not count.
    let some =
        |trained| density_round(&adc, (600, 10_000), (90_000, trained), &extent, [90.0, 0.0, 0.0], 7).unwrap().growth;
    assert_eq!([some(45_000), some(900)], [0.025, 0.01]);
    let late = round(&mcmc, 5100).unwrap();
    assert!(matches!(late.choice, Choice::Pulled { .. }) && late.growth == 0.0);
    assert_eq!([drawn, late].map(|round| round.limits.log_scale), [f32::INFINITY; 2]);
    let never = Config { density: Density { stop: 0.0, ..Density::default() }, ..exact() };
    assert!((1..=10_000).all(|step| round(&never, step).is_none()));

    let (rate, key) = noise(&mcmc, 1, 1000, 2.0).unwrap();
    assert!((f64::from(rate) - 160.0 * 30f64.powf(0.55)).abs() < 1e-2 && key != noise(&mcmc, 2, 1000, 2.0).unwrap().1);
    assert_eq!(noise(&adc, 1, 1000, 2.0), None);
    let weights = |config| [regularisers(config).opacity_reg, regularisers(config).scale_reg];
    assert_eq!((weights(&adc), weights(&mcmc)), ([0.0; 2], [0.01; 2]));
}

#[test]
fn short_runs_have_ten_rounds_that_grow_but_eight_steps_between_them() {
    let rounds = |total: u64, density: &Density| {
        let due: Vec<u64> = (1..=total).filter(|step| density.due(*step, total) == Some(Round::Growth)).collect();
        (due.len(), due.first().copied(), due.last().copied())
    };
    let default = Density::default();
    assert_eq!(rounds(60, &default), (3, Some(14), Some(30)));
    assert_eq!(rounds(100, &default), (5, Some(18), Some(50)));
    assert_eq!(rounds(200, &default), (10, Some(28), Some(100)));
    assert_eq!(rounds(1000, &default), (10, Some(140), Some(500)));
    assert_eq!(rounds(30_000, &default), (145, Some(600), Some(15_000)));
    // What is added after the last step would be as it was cloned or split.
    assert_eq!(rounds(1000, &Density { stop: 1.0, ..Density::default() }), (9, Some(190), Some(910)));
    assert_eq!(rounds(100, &Density { every: 2, ..default }), (20, Some(12), Some(50)));
}

fn with(strategy: Strategy) -> Config {
    Config { sh_degree: 1, density: Density { strategy, ..Density::default() }, ..steady() }
}

/// Steps `trainer` through the run's order up to step `until`.
fn drive(trainer: &mut Trainer, capture: &Capture, seed: u64, until: u64) -> Vec<StepReport> {
    super::drive_with(trainer, capture, seed, until, &PriorPlan::default());
    trainer.finish().unwrap();
    trainer.take_reports()
}

#[test]
fn both_strategies_learn_grow_and_obey_the_budget() {
    let tiny = Tiny::on_device("strategies");
    for strategy in [Strategy::Adc, Strategy::Mcmc] {
        let config = Config { max_gaussians: 200, backdrop: 0, ..with(strategy) };
        let begin = from_points(&tiny.capture.points[..150], &tiny.capture, &config);
        let mut trainer = trainer(&tiny.capture, &config, &begin, 200);
        let reports = drive(&mut trainer, &tiny.capture, config.seed, 200);
        let mean = |part: &[StepReport]| part.iter().map(|r| r.loss).sum::<f64>() / part.len() as f64;
        let (first, last) = (mean(&reports[..10]), mean(&reports[190..]));
        assert!(last < 0.7 * first, "{strategy:?}: loss {first:.3} at first, {last:.3} at last");
        assert!(reports.iter().all(|r| r.gaussians <= 200 && r.bad_gradients == 0));
        assert!(reports.last().unwrap().gaussians > 150);
        let rounds: Vec<_> = reports.iter().filter_map(|r| r.density).collect();
        assert!(rounds.len() >= 8, "{} rounds", rounds.len());
        let sum = |f: fn(&ivv::internals::stage::Counts) -> u32| rounds.iter().map(f).sum::<u32>();
        let (cloned, split, pruned) = (sum(|c| c.cloned), sum(|c| c.split), sum(|c| c.pruned));
        assert_eq!(trainer.n_gaussians(), 150 + cloned + split - pruned);
        if strategy == Strategy::Mcmc {
            let most = reports.iter().map(|r| r.gaussians).max();
            assert_eq!((most, split), (Some(200), 0));
            // Room for a backdrop, a tenth at most.
            let config = Config { backdrop: 1000, ..config };
            let mut with = super::trainer(&tiny.capture, &config, &begin, 200);
            // Nothing is added later.
            let reports = drive(&mut with, &tiny.capture, config.seed, 100);
            assert_eq!(reports.iter().map(|r| r.gaussians).max(), Some(180));
            assert!(reports.iter().all(|r| r.density.is_none_or(|d| d.pruned == 0)));
        }
    }
}

#[test]
fn static_gaussians_stay_as_they_began_where_only_the_others_are_trained() {
    let tiny = Tiny::on_device("held");
    // A reset and rounds that prune would touch them: some are faint.
    let density = Density { reset_every: 12, ..Density::default() };
    for adam in [AdamMode::Dense, AdamMode::Lazy] {
        let config =
            Config { adam, density: density.clone(), holds_static: true, offsets: true, ..with(Strategy::Adc) };
        let all = from_points(&tiny.capture.points[..150], &tiny.capture, &config);
        let mut begin = Splats { n_static: 100, motion: all.motion[100..].to_vec(), ..all };
        begin.opacity[..50].fill(-6.0);
        let mut trainer = trainer(&tiny.capture, &config, &begin, 60);
        let reports = drive(&mut trainer, &tiny.capture, config.seed, 60);
        let splats = trainer.splats().unwrap();
        let rows = |splats: &Splats, range: std::ops::Range<usize>| {
            let k = splats.n_coefficients();
            let row = |i: usize| {
                let sh = splats.sh[i * k..(i + 1) * k].as_flattened().to_vec();
                let place =
                    [splats.position[i].as_slice(), &splats.rotation[i], &splats.scale[i], &[splats.opacity[i]], &sh];
                place.concat().iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            };
            let mut rows: Vec<_> = range.map(row).collect();
            rows.sort_unstable();
            rows
        };
        assert_eq!(splats.n_static, 100);
        assert_eq!(rows(&splats, 0..100), rows(&begin, 0..100), "{adam:?}");
        assert!(splats.len() > 150 && rows(&splats, 100..150) != rows(&begin, 100..150));
        let mean = |part: &[StepReport]| part.iter().map(|r| r.loss).sum::<f64>() / part.len() as f64;
        // Since the reset.
        assert!(mean(&reports[50..]) < mean(&reports[12..22]));
    }
    // Nothing but the clocks is learnt: what rests says nothing of them, trained or not, to the bit.
    let offsets = |holds_static: bool| {
        let lr = nothing_moves(Pace::default());
        let config = Config {
            holds_static,
            lr,
            grids: GridKind::None,
            poses: PoseKind::Given,
            average: 0.0,
            density: Density { stop: 0.0, ..Density::default() },
            ..steady()
        };
        let all = from_points(&tiny.capture.points[..150], &tiny.capture, &config);
        let begin = Splats { n_static: 100, motion: all.motion[100..].to_vec(), ..all };
        let mut trainer = trainer(&tiny.capture, &config, &begin, 20);
        drive(&mut trainer, &tiny.capture, config.seed, 20);
        trainer.offsets().unwrap().0
    };
    let (held, trained) = (offsets(true), offsets(false));
    assert!(held == trained && held.iter().any(|offset| *offset != 0.0), "{held:?} {trained:?}");
    for config in [
        Config { holds_static: true, ..with(Strategy::Mcmc) },
        Config { holds_static: true, required: Required { reviews: 1, ..Required::default() }, ..steady() },
    ] {
        let setup = Setup::new(&tiny.capture, &config);
        let begin = from_points(&tiny.capture.points[..9], &tiny.capture, &config);
        let refused = Trainer::new(gpu().clone(), &begin, Constants::default(), config, 9, setup).map(|_| ());
        assert!(refused.unwrap_err().to_string().contains("(--base): leaves static Gaussians as they are"));
    }
}

#[test]
fn a_run_with_mcmc_that_was_killed_and_resumed_gives_the_bits_of_one_that_was_not() {
    let tiny = Tiny::on_device("mcmc-resume");
    for adam in [AdamMode::Dense, AdamMode::Lazy] {
        let config = Config { adam, ..with(Strategy::Mcmc) };
        let begin = from_points(&tiny.capture.points[..150], &tiny.capture, &config);
        let mut whole = trainer(&tiny.capture, &config, &begin, 40);
        drive(&mut whole, &tiny.capture, config.seed, 40);
        let mut half = trainer(&tiny.capture, &config, &begin, 40);
        drive(&mut half, &tiny.capture, config.seed, 15);
        let folder = tiny.folder.join(format!("checkpoints-{adam:?}"));
        half.checkpoint().unwrap().write(&folder).unwrap();
        let checkpoint = Checkpoint::newest(&folder).unwrap().unwrap();
        let setup = Setup::new(&tiny.capture, &config);
        let mut half = Trainer::resume(gpu().clone(), &checkpoint, Constants::default(), setup).unwrap();
        drive(&mut half, &tiny.capture, config.seed, 40);
        assert!(whole.n_gaussians() > 150);
        assert_eq!(whole.checkpoint().unwrap(), half.checkpoint().unwrap(), "{adam:?}");
    }
}

#[test]
fn the_opacities_are_reset_when_it_is_time() {
    let tiny = Tiny::on_device("reset");
    let density = Density { reset_every: 12, ..Density::default() };
    let config = Config { density, ..with(Strategy::Adc) };
    let begin = from_points(&tiny.capture.points[..150], &tiny.capture, &config);
    let mut trainer = trainer(&tiny.capture, &config, &begin, 40);
    let brightest = |trainer: &mut Trainer| {
        let splats = trainer.splats().unwrap();
        splats.opacity.iter().copied().fold(f32::MIN, f32::max)
    };
    drive(&mut trainer, &tiny.capture, config.seed, 11);
    assert!(brightest(&mut trainer) > -2.0);
    drive(&mut trainer, &tiny.capture, config.seed, 12);
    assert!((brightest(&mut trainer) + 2.944_439).abs() < 1e-5);
}
