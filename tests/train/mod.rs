//! Training as a whole, on a synthetic capture of its own making.

mod background;
mod base;
mod bench;
mod cases;
mod changed;
mod clocks;
mod cut_out;
mod density;
mod fall;
mod feed;
mod init;
mod knobs;
mod leak;
mod live;
mod lives;
mod look;
mod overwrite;
mod photos;
mod plan;
mod points;
mod poses;
mod ranks;
mod report;
mod require;
mod require_seen;
mod resume;
mod rigs;
mod run;
mod scores;
mod segments;
mod session;
mod settings;
mod terms;
mod worlds;

use crate::common::folder::copy;
use crate::common::prelude::*;
use ivv::internals::synth::Options;
use ivv::internals::train::{LearningRates, Meter, Priors, Scores, StepReport, random_points, rates, training_order};

struct Tiny {
    folder: PathBuf,
    capture: Capture,
    /// Last, so that all that was trained is gone before another test gets it.
    _device: Option<Watched>,
}

/// Defaults with the rates of a long run, the same for Gaussians of any size, for tests of a few steps that must not depend on
/// how fast short runs and large Gaussians learn.
fn steady() -> Config {
    let pace = Pace { steps: 0 };
    let lr = LearningRates { pace, position_size: 0.0, ..LearningRates::default() };
    Config { lr, ..exact() }
}

/// Rates of 0: a run that learns only what a test gives a rate. Poses and colour maps, where there are any, learn too.
fn nothing_moves(pace: Pace) -> LearningRates {
    let still = Rate::constant(0.0);
    LearningRates {
        position: still,
        position_size: 0.0,
        sh: still,
        opacity: still,
        scale: still,
        rotation: still,
        velocity: still,
        t_center: still,
        t_scale: still,
        pace,
    }
}

/// Scores of a view without masks and LPIPS.
fn scores_of(psnr: f64) -> Scores {
    let (psnr_foreground, psnr_covisible, lpips, lpips_unscaled) = (None, None, None, None);
    let (ssim, l1, flicker, flicker_true) = (0.5, 0.1, None, None);
    let psnr_aligned = psnr + 1.0;
    Scores {
        psnr,
        psnr_aligned,
        psnr_foreground,
        psnr_covisible,
        ssim,
        l1,
        lpips,
        lpips_unscaled,
        flicker,
        flicker_true,
    }
}

impl Tiny {
    fn new(name: &str) -> Self {
        Self::of_frames(name, 4)
    }

    /// Holds the device for as long.
    fn on_device(name: &str) -> Self {
        let mut tiny = Self::new(name);
        tiny._device = Some(gpu());
        tiny
    }

    /// A copy of the capture of so many frames, up to 8, which is made once.
    fn of_frames(name: &str, frames: u32) -> Self {
        static MADE: [OnceLock<PathBuf>; 9] = [const { OnceLock::new() }; 9];
        let made = MADE[frames as usize].get_or_init(|| {
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("train-tiny-{frames}"));
            let options = Options { frames, ..Preset::Tiny.options(7) };
            write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
            folder
        });
        let folder = Self::folder(name);
        copy(made, &folder, &|_| false);
        Self::open(folder)
    }

    /// A folder that stays, for runs that several tests share.
    fn kept(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("train-{name}"));
        write_capture(&folder, &Options { frames: 4, ..Preset::Tiny.options(7) }, 2, &mut |_, _| {}).unwrap();
        Self::open(folder)
    }

    fn of(name: &str, options: &Options) -> Self {
        let folder = Self::folder(name);
        write_capture(&folder, options, 2, &mut |_, _| {}).unwrap();
        Self::open(folder)
    }

    fn folder(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("ivv-train-{name}-{}", std::process::id()))
    }

    fn open(folder: PathBuf) -> Self {
        Tiny { capture: Capture::open(&folder).unwrap(), folder, _device: None }
    }
}

impl Drop for Tiny {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Mean PSNR of the test views, dB.
fn test_psnr(capture: &Capture, splats: &Splats) -> f64 {
    let (gpu, test) = (gpu(), capture.test_frames());
    let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
    let mut meter = Meter::new(gpu.clone(), &exact()).unwrap();
    assert!(!test.is_empty());
    let score = |(camera, frame): &(usize, u32)| {
        let (rendered, _) = renderer.render(&capture.view(*camera, *frame).unwrap(), Outputs::Color).unwrap();
        meter.scores(&rendered, &capture.picture(*camera, *frame).unwrap()).unwrap().unwrap().psnr
    };
    test.iter().map(score).sum::<f64>() / test.len() as f64
}

/// Of a session that computes in the world of its capture.
fn as_it_is<'a>() -> SessionOptions<'a> {
    SessionOptions { world: Some(Similarity::default()), ..SessionOptions::default() }
}

/// Trains `steps` steps; returns the Gaussians and the mean loss of the first and the last ten steps.
fn train(capture: &Capture, config: &Config, splats: &Splats, steps: u64) -> (Splats, f64, f64) {
    let gpu = gpu();
    let options = SessionOptions {
        total: Some(steps),
        first: Some(splats.clone()),
        priors: Some(Priors::default()),
        ..as_it_is()
    };
    let mut session = Session::begin(gpu.clone(), capture, config.clone(), options).unwrap();
    while session.step().unwrap() {}
    let splats = session.finish().unwrap();
    let reports = session.take_events().into_iter();
    let reports: Vec<StepReport> =
        reports.filter_map(|event| if let Event::Step(report) = event { Some(report) } else { None }).collect();
    assert!(reports.iter().map(|report| report.step).eq(1..=steps), "one report a step, in order");
    let mut losses = Vec::new();
    for report in reports {
        assert!(report.loss.is_finite() && report.bad_gradients == 0 && report.visible > 0, "{report:?}");
        assert!(report.gaussians as usize <= config.max_gaussians, "more than the budget: {report:?}");
        losses.push(report.loss);
    }
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (splats, mean(&losses[..10]), mean(&losses[losses.len() - 10..]))
}

#[test]
fn training_halves_the_loss_of_a_dynamic_capture_and_improves_views_it_has_not_seen() {
    let tiny = Tiny::on_device("learns");
    let config = Config { sh_degree: 1, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    assert!(begin.len() > 50 && begin.n_static == 0);
    let (end, first, last) = train(&tiny.capture, &config, &begin, 250);
    assert!(last < 0.5 * first, "loss {first:.3} at first, {last:.3} at last");
    assert!(end.len() > begin.len(), "density control adds Gaussians");
    let (before, after) = (test_psnr(&tiny.capture, &begin), test_psnr(&tiny.capture, &end));
    assert!(after > before + 3.0, "PSNR {before:.2} dB before, {after:.2} dB after");
}

#[test]
fn two_runs_of_the_same_command_give_the_same_bits_and_another_seed_does_not() {
    let tiny = Tiny::on_device("repeats");
    let config = Config { sh_degree: 1, init_points: 300, ..exact() };
    let begin = from_points(&random_points(&tiny.capture, &config), &tiny.capture, &config);
    assert_eq!(begin.len(), 300);
    let run = |seed| train(&tiny.capture, &Config { seed, ..config.clone() }, &begin, 30).0;
    let first = run(1);
    assert_same_splats("the same seed", &run(1), &first);
    assert!(!first.is_empty() && first != run(2));
}

#[test]
fn tau_stays_above_half_a_frame() {
    let tiny = Tiny::on_device("tau");
    // A rate that would carry log tau far down within a few steps.
    let lr = LearningRates { t_scale: Rate { start: 1.0, end: 1.0 }, ..LearningRates::default() };
    let config = Config { sh_degree: 0, lr, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let (end, ..) = train(&tiny.capture, &config, &begin, 30);
    let floor = (0.5 / f64::from(tiny.capture.n_frames)).ln() as f32;
    let lowest = end.motion.iter().map(|m| m.t_scale).fold(f32::INFINITY, f32::min);
    assert_eq!(lowest, floor, "some Gaussian reaches the floor and none passes it");
}

#[test]
fn a_static_clip_trains_static_gaussians_without_temporal_parameters() {
    let tiny = Tiny::on_device("static");
    let mut still = tiny.capture.clone();
    still.n_frames = 1;
    still.cameras.iter_mut().for_each(|camera| camera.shots.retain(|shot| shot.frame == 0));
    let config = Config { sh_degree: 1, ..exact() };
    let begin = from_points(&still.points, &still, &config);
    let (end, first, last) = train(&still, &config, &begin, 40);
    assert!(last < first && end.n_static == end.len() && end.motion == Vec::<Motion>::new());
}

#[test]
fn rates_decay_exponentially_and_bands_join_one_by_one() {
    let config = exact();
    let ends = |total: u64| (rates(&config, 1, total, 2.0), rates(&config, total + 1, total, 2.0));
    // 3DGS's in a run of its length and in longer ones; larger in shorter ones, most of all at their begin.
    for total in [30_000, 300_000] {
        let (begin, end) = ends(total);
        assert!((begin.position - 3.2e-4).abs() < 1e-12 && (end.position - 3.2e-6).abs() < 1e-12);
        assert_eq!([begin.reference_size, end.reference_size], [2.0 * config.lr.position_size; 2]);
        assert_eq!([begin.scale, end.scale, begin.opacity, end.sh[0]], [5e-3, 5e-3, 2.5e-2, 2.5e-3]);
        assert_eq!(end.sh[1..], [1.25e-4; 3]);
    }
    let (begin, end) = ends(1000);
    let [start, slow] = [30f64.powf(0.55), 3f64.powf(0.6)];
    assert!(start > slow && slow > 1.5);
    assert!((begin.position - 3.2e-4 * start).abs() < 1e-9 && (end.position - 3.2e-6 * start).abs() < 1e-9);
    assert!((begin.rotation - 1e-3 * start).abs() < 1e-9 && (end.opacity - 2.5e-2 * slow).abs() < 1e-9);
    assert!(ends(1).0.scale <= 5e-3 * 16.0);
    let active = |step| rates(&config, step, 1000, 1.0).sh.iter().filter(|rate| **rate > 0.0).count();
    assert_eq!([active(1), active(34), active(35), active(68), active(102), active(1000)], [1, 1, 2, 3, 4, 4]);
}

#[test]
fn a_rate_may_be_written_as_one_number_and_must_not_change_its_sign() {
    let read = |text: &str| serde_json::from_str::<Config>(text);
    let config = read(r#"{"lr": {"scale": 0.25, "position": {"start": 1e-3, "end": 1e-5}}}"#).unwrap();
    assert_eq!(config.lr.scale, Rate { start: 0.25, end: 0.25 });
    assert!((config.lr.position.at(0.5) - 1e-4).abs() < 1e-12 && config.check().is_ok());
    assert_eq!(read(&serde_json::to_string(&config).unwrap()).unwrap(), config);
    for wrong in [(1e-3, 0.0), (-1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        let lr = LearningRates { sh: Rate { start: wrong.0, end: wrong.1 }, ..LearningRates::default() };
        let fault = Config { lr, ..exact() }.check().unwrap_err();
        assert!(fault.contains("lr.sh is "), "{fault}");
    }
    assert!(read(r#"{"lr": {"scales": 0.25}}"#).is_err() && read(r#"{"lr": {"scale": "fast"}}"#).is_err());
}

/// A run of `total` steps on `capture` from `first` on, before its first step.
fn trainer(capture: &Capture, config: &Config, first: &Splats, total: u64) -> Trainer {
    let setup = Setup::new(capture, config);
    Trainer::new(gpu().clone(), first, Constants::default(), config.clone(), total, setup).unwrap()
}

/// Steps `trainer` through the run's order up to step `until`, with all priors.
fn drive(trainer: &mut Trainer, capture: &Capture, seed: u64, until: u64) {
    let depth = capture.training_frames().into_iter().map(|image| (image, [1.0, 0.1])).collect();
    drive_with(trainer, capture, seed, until, &PriorPlan { flow: true, depth });
}

fn drive_with(trainer: &mut Trainer, capture: &Capture, seed: u64, until: u64, priors: &PriorPlan) {
    for (camera, frame) in training_order(&capture.training_frames(), seed, trainer.step(), until) {
        let picture = capture.picture_with(camera, frame, priors).unwrap();
        trainer.train(camera, &capture.view(camera, frame).unwrap(), &picture).unwrap();
    }
}

#[test]
fn a_run_that_was_killed_and_resumed_gives_the_bits_of_one_that_was_not() {
    resumes_to_the_same_bits("resume", &Config { sh_degree: 1, ..exact() });
}

#[test]
fn a_run_with_moments_in_16_bits_that_was_killed_and_resumed_gives_the_bits_of_one_that_was_not() {
    let lazy = Config { sh_degree: 1, adam: AdamMode::Lazy, moment_bits: 16, ..exact() };
    resumes_to_the_same_bits("resume 16", &lazy);
}

fn resumes_to_the_same_bits(name: &str, config: &Config) {
    let tiny = Tiny::new(name);
    let gpu = gpu();
    let begin = from_points(&tiny.capture.points, &tiny.capture, config);
    let setup = Setup::new(&tiny.capture, config);
    assert!(setup.learns_offset.contains(&true) && setup.data != TermData::NONE);
    let new = || Trainer::new(gpu.clone(), &begin, Constants::default(), config.clone(), 40, setup.clone()).unwrap();
    let mut whole = new();
    drive(&mut whole, &tiny.capture, config.seed, 40);
    // Between the two rounds of density control, whose statistics must survive.
    let mut first_half = new();
    drive(&mut first_half, &tiny.capture, config.seed, 15);
    let folder = tiny.folder.join("checkpoints");
    first_half.checkpoint().unwrap().write(&folder).unwrap();
    drop(first_half);
    let checkpoint = Checkpoint::newest(&folder).unwrap().unwrap();
    assert_eq!(checkpoint.step, 15);
    assert!(checkpoint.state.iter().any(|s| s[1] > 0.0), "there is something to lose");
    assert!(checkpoint.first.opacity.iter().any(|m| *m != 0.0) && checkpoint.second.opacity.iter().any(|v| *v > 0.0));
    let mut second_half = Trainer::resume(gpu.clone(), &checkpoint, Constants::default(), setup.clone()).unwrap();
    drive(&mut second_half, &tiny.capture, config.seed, 40);
    assert!(whole.n_gaussians() as usize > begin.len());
    assert_same_splats("resumed", &second_half.splats().unwrap(), &whole.splats().unwrap());
}

#[test]
fn a_damaged_checkpoint_is_told_apart_and_the_one_before_serves() {
    let tiny = Tiny::on_device("damage");
    let config = Config { sh_degree: 0, ..exact() };
    let begin = from_points(&tiny.capture.points[..20], &tiny.capture, &config);
    let mut trainer = trainer(&tiny.capture, &config, &begin, 100);
    let folder = tiny.folder.join("checkpoints");
    for step in 1..=5 {
        drive(&mut trainer, &tiny.capture, config.seed, step);
        trainer.checkpoint().unwrap().write(&folder).unwrap();
    }
    let kept = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(kept, 3, "the last three are kept");
    let newest = Checkpoint::file(&folder, 5);
    let good = std::fs::read(&newest).unwrap();
    assert_eq!(Checkpoint::read(&newest).unwrap(), trainer.checkpoint().unwrap());
    for at in (0..good.len()).step_by(good.len() / 97) {
        let mut flipped = good.clone();
        flipped[at] ^= 0x10;
        for bad in [&flipped[..], &good[..at]] {
            std::fs::write(&newest, bad).unwrap();
            let fault = Checkpoint::read(&newest).unwrap_err();
            assert_eq!(fault.exit_code(), 3, "byte {at}: {fault}");
        }
        std::fs::write(&newest, &good[..at]).unwrap();
        assert_eq!(Checkpoint::newest(&folder).unwrap().unwrap().step, 4, "cut at {at}");
    }
}

#[test]
fn a_step_that_is_replayed_with_more_room_leaves_the_bits_of_one_that_is_not() {
    let tiny = Tiny::on_device("replay");
    let config = Config { sh_degree: 0, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let run = |room: Option<u32>| {
        let mut trainer = trainer(&tiny.capture, &config, &begin, 100);
        if let Some(n) = room {
            trainer.limit_intersections(n);
        }
        drive(&mut trainer, &tiny.capture, config.seed, 4);
        trainer.checkpoint().unwrap()
    };
    let (roomy, replayed) = (run(None), run(Some(1)));
    assert!(roomy.state.iter().any(|s| s[1] > 0.0));
    assert_ne!(roomy.room, replayed.room);
    assert_eq!(roomy, Checkpoint { room: roomy.room, ..replayed });
}

#[test]
fn a_run_goes_on_with_the_room_that_it_had() {
    let tiny = Tiny::new("room");
    let gpu = gpu();
    let config = Config { sh_degree: 0, adam: AdamMode::Lazy, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let setup = Setup::new(&tiny.capture, &config);
    let mut trainer =
        Trainer::new(gpu.clone(), &begin, Constants::default(), config.clone(), 100, setup.clone()).unwrap();
    // Less than a run begins with, so that steps run again for lack of it.
    trainer.limit_intersections(1);
    drive(&mut trainer, &tiny.capture, config.seed, 4);
    let checkpoint = trainer.checkpoint().unwrap();
    let folder = tiny.folder.join("checkpoints");
    checkpoint.write(&folder).unwrap();
    let read = Checkpoint::newest(&folder).unwrap().unwrap();
    let mut resumed = Trainer::resume(gpu.clone(), &read, Constants::default(), setup).unwrap();
    assert_eq!(resumed.checkpoint().unwrap(), checkpoint);
    for (until, trainer) in [(9, &mut trainer), (9, &mut resumed)] {
        drive(trainer, &tiny.capture, config.seed, until);
    }
    assert_eq!(resumed.checkpoint().unwrap(), trainer.checkpoint().unwrap());
}
