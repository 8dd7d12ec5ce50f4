//! `ivv train`.

use crate::device::DeviceArgs;
use crate::eval::Scorer;
use crate::files::{make_folder, write_json};
use crate::interrupt::{Interrupted, Stop};
use crate::profile::{self, TimedPass};
use crate::progress::Steps;
use crate::render::ConstantArgs;
use crate::settings::SettingArgs;
use crate::totals::{ProfiledStep, Seconds, totals};
use anyhow::Context;
use ivv::gpu::PassTime;
use ivv::scene::capture::{Capture, CaptureSettings, FrameCache};
use ivv::scene::{View, write_ply};
use ivv::train::{
    Checkpoint, Evaluation, Kind, Log, Run, StepReport, Trainer, from_points, permutation, random_points, spread,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Steps whose passes are timed.
const PROFILED: u64 = 5;
/// Side of a tile, pixels.
const TILE: u32 = 16;

/// Options of `ivv train`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture: SPEC 8's folder, COLMAP, transforms.json or Dynamic3DGaussians; see `ivv check`.
    capture: PathBuf,
    /// The run folder: run.json, config.json, train.jsonl, train.json, checkpoints, scene.ply, eval.json, renders,
    /// report.html.
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    settings: SettingArgs,
    /// Bytes of decoded images kept ahead.
    #[arg(long, default_value_t = 256 << 20)]
    cache_bytes: u64,
    /// Steps between two lines of train.jsonl.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    log_every: u64,
    /// Cameras to test on, by name, separated by commas; the capture's own choice without it.
    #[arg(long, value_delimiter = ',')]
    test_cameras: Option<Vec<String>>,
    /// Goes on from the newest checkpoint of the run folder, with its settings, cameras and constants.
    #[arg(long)]
    resume: bool,
    /// Begins anew in a folder that holds a run, whose checkpoints are removed.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Steps between two checkpoints; a tenth of the run without it.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Steps between two evaluations of some test images; a tenth of the run without it, 0 for none.
    #[arg(long)]
    eval_every: Option<u64>,
    /// Evaluations after these steps too, separated by commas.
    #[arg(long, value_delimiter = ',')]
    eval_at: Vec<u64>,
    /// Test images of such an evaluation, evenly spread over all of them; the end of the run takes all.
    #[arg(long, default_value_t = 16)]
    eval_images: usize,
    /// Print the mean time of every pass of a step.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    constants: ConstantArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let start = Instant::now();
    let stop = Stop::listen()?;
    let checkpoints = args.output.join("checkpoints");
    let resumed = newest_checkpoint(args, &checkpoints)?;
    let config = match &resumed {
        Some(checkpoint) => checkpoint.config.clone(),
        None => args.settings.resolve()?,
    };
    let (capture, run) = capture(args, resumed.is_some())?;
    let (training, test) = (capture.training_frames(), capture.test_frames());
    if training.is_empty() {
        return Err(ivv::Error::data(&args.capture, "", "has no training image", "see `ivv check`").into());
    }
    let total = if config.steps > 0 { config.steps } else { u64::from(config.epochs) * training.len() as u64 };
    make_folder(&args.output)?;
    write_json(&args.output.join("config.json"), &config)?;
    run.write(&args.output)?;
    let gpu = args.device.open()?;
    let (extent, dt) = (capture.extent().radius, 1.0 / f64::from(capture.n_frames.max(1)));
    let mut trainer = match &resumed {
        Some(checkpoint) => Trainer::resume(gpu.clone(), checkpoint, run.constants, extent, dt)?,
        None => {
            Checkpoint::remove_all(&checkpoints)?;
            let random = capture.points.is_empty().then(|| random_points(&capture, &config));
            let splats = from_points(random.as_deref().unwrap_or(&capture.points), &capture, &config);
            Trainer::new(gpu.clone(), &splats, run.constants, config.clone(), total, extent, dt)?
        }
    };
    let before = trainer.step();
    eprintln!(
        "{} training images, {} test images, {} Gaussians{}, steps {} to {total}, SH degree {}",
        training.len(),
        test.len(),
        trainer.n_gaussians(),
        if resumed.is_none() && capture.points.is_empty() { " at random places" } else { "" },
        before + 1,
        config.sh_degree
    );

    let order: Vec<(usize, u32)> = (0..total.div_ceil(training.len() as u64))
        .flat_map(|epoch| permutation(training.len(), &[config.seed, epoch]).into_iter().map(|i| training[i]))
        .take(total as usize)
        .skip(before as usize)
        .collect();
    let mut cache = FrameCache::new(&capture, order.iter().copied(), args.cache_bytes, 2)?;
    let scorer = Scorer { gpu: &gpu, capture: &capture, run: &run, config: &config };
    let some_test = spread(&test, args.eval_images);
    let mut log = Log::open(&args.output, before);
    let seconds_before = log.series(Kind::Step, "seconds").last().map_or(0.0, |[_, seconds]| *seconds);
    let due = Due::new(args, total);
    let mut progress = Steps::new(total, before);
    let mut seconds = 0.0;
    for (camera, frame) in order {
        let picture = cache.next_picture().context("the order of images ended early")??;
        let view = capture.view(camera, frame)?;
        let begun = Instant::now();
        let (report, times) = if due.profile(trainer.step() + 1) {
            trainer.profile(&view, &picture)?
        } else {
            (trainer.train(&view, &picture)?, Vec::new())
        };
        let density = trainer.control_density()?;
        seconds += begun.elapsed().as_secs_f64();

        let step = trainer.step();
        if !times.is_empty() {
            log.push(Kind::Profile, &profiled(&scorer, &report, &times, &view))?;
        }
        let is_stopped = stop.is_asked();
        let scored =
            if due.evaluation(step) && !is_stopped { scorer.some(&trainer.splats()?, &some_test, step)? } else { None };
        if let Some(Evaluation { mean, views, .. }) = &scored {
            progress.scored(step, mean.psnr, mean.ssim, views.len());
            log.push(Kind::Evaluation, &scored)?;
        }
        let best = Checkpoint::best(&checkpoints).map(|(_, psnr)| psnr);
        let new_best = scored.as_ref().map(|s| s.mean.psnr).filter(|psnr| best.is_none_or(|best| *psnr > best));
        let saves = due.checkpoint(step) || new_best.is_some() || is_stopped;
        if saves || report.step.is_multiple_of(args.log_every) {
            let mut line = serde_json::to_value(&report)?;
            line["seconds"] = (seconds_before + seconds).into();
            line["waited_for_images_s"] = cache.stats().waited.as_secs_f64().into();
            line["density"] = serde_json::to_value(density)?;
            log.push(Kind::Step, &line)?;
        }
        progress.show(&report, seconds);
        if saves {
            trainer.checkpoint()?.write(&checkpoints)?;
            log.write()?;
        }
        if let Some(psnr) = new_best {
            Checkpoint::keep_best(&checkpoints, step, psnr)?;
        }
        if is_stopped {
            return Err(Interrupted("a checkpoint was written; go on with --resume").into());
        }
    }

    let splats = trainer.splats()?;
    let scene = args.output.join("scene.ply");
    write_ply(&scene, &splats)?;
    let seconds_stepping = seconds_before + seconds;
    let seconds = Seconds {
        seconds: start.elapsed().as_secs_f64(),
        seconds_stepping,
        seconds_per_step: seconds_stepping / trainer.step().max(1) as f64,
        waited_for_images_s: cache.stats().waited.as_secs_f64(),
    };
    let totals = totals(&gpu, &trainer, &run, &log, &seconds)?;
    write_json(&args.output.join("train.json"), &totals)?;
    let (scores, examples) = scorer.all(&splats, &scene, trainer.step(), &args.output)?;
    if let Some(scores) = &scores {
        // The last point of the curve: the same images as those before it.
        let is_some = |name: &str, at: u32| some_test.iter().any(|(c, f)| capture.cameras[*c].name == name && *f == at);
        if let Some(some) = scores.evaluation.of(is_some) {
            log.push(Kind::Evaluation, &some)?;
            Checkpoint::keep_best(&checkpoints, some.step, some.mean.psnr)?;
        }
    }
    log.write()?;
    let report = scorer.report(scores.as_ref(), &examples, &args.output, &args.output)?;
    if json {
        println!("{}", serde_json::to_string_pretty(&totals)?);
        return Ok(());
    }
    let quality = scores.as_ref().map_or("no test images".to_owned(), |scores| {
        let Evaluation { mean, views, .. } = &scores.evaluation;
        format!("{} test images: PSNR {:.2} dB, SSIM {:.4}", views.len(), mean.psnr, mean.ssim)
    });
    println!(
        "{quality}; {} Gaussians, {:.3} s a step; {}",
        trainer.n_gaussians(),
        seconds.seconds_per_step,
        report.display()
    );
    if args.profile {
        let passes = totals["profile"]["passes"].clone();
        profile::print(&serde_json::from_value::<Vec<TimedPass>>(passes)?, "step");
    }
    Ok(())
}

/// The checkpoint to go on from.
///
/// # Errors
/// [`ivv::Error::Data`] when the folder holds a run and nothing says what to do with it.
fn newest_checkpoint(args: &Args, folder: &Path) -> ivv::Result<Option<Checkpoint>> {
    if args.resume {
        return Checkpoint::newest(folder);
    }
    if !args.overwrite && Checkpoint::any_in(folder) {
        let remedy = "go on with --resume, begin anew with --overwrite, or choose another folder with -o";
        return Err(ivv::Error::data(folder, "", "holds the checkpoints of a run", remedy));
    }
    Ok(None)
}

/// The capture, and what run.json says of it; a run that goes on has the cameras and constants that it had.
fn capture(args: &Args, goes_on: bool) -> anyhow::Result<(Capture, Run)> {
    if goes_on {
        let run = Run::read(&args.output)?;
        let capture = run.open_capture(Some(&args.capture))?;
        return Ok((capture, run));
    }
    let constants = args.constants.checked()?;
    let settings = CaptureSettings { test_cameras: args.test_cameras.clone(), ..CaptureSettings::default() };
    let capture = Capture::open_with(&args.capture, &settings)?;
    let run = Run::new(&capture, constants)?;
    Ok((capture, run))
}

/// A line about a step whose passes were timed.
fn profiled(scorer: &Scorer, report: &StepReport, times: &[PassTime], view: &View) -> ProfiledStep {
    let n_tiles = view.width.div_ceil(TILE) * view.height.div_ceil(TILE);
    let passes = profile::of_step(times, report, n_tiles);
    let passes = passes.iter().map(|pass| TimedPass::new(pass, scorer.gpu.caps())).collect();
    ProfiledStep { step: report.step, passes, bytes_by_buffer: scorer.gpu.device().memory().0 }
}

/// What is due after which step.
struct Due<'a> {
    total: u64,
    eval_every: u64,
    eval_at: &'a [u64],
    checkpoint_every: u64,
}

impl<'a> Due<'a> {
    fn new(args: &'a Args, total: u64) -> Self {
        let tenth = (total / 10).max(1);
        Due {
            total,
            eval_every: args.eval_every.unwrap_or(tenth),
            eval_at: &args.eval_at,
            checkpoint_every: args.checkpoint_every.unwrap_or(tenth).max(1),
        }
    }

    /// The last step has an evaluation of its own, of all test images.
    fn evaluation(&self, step: u64) -> bool {
        let is_periodic = self.eval_every > 0 && step.is_multiple_of(self.eval_every);
        step != self.total && (is_periodic || self.eval_at.contains(&step))
    }

    fn checkpoint(&self, step: u64) -> bool {
        step == self.total || step.is_multiple_of(self.checkpoint_every)
    }

    /// In the middle of each fifth of the run.
    fn profile(&self, step: u64) -> bool {
        (0..PROFILED).any(|k| step == ((2 * k + 1) * self.total / (2 * PROFILED)).max(1))
    }
}
