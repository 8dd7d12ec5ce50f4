//! `ivv train`.

use crate::Interrupted;
use crate::begin;
use crate::render::{ConstantArgs, cache_folder};
use anyhow::Context;
use ivv::gpu::{Gpu, Options};
use ivv::scene::capture::{Capture, CaptureSettings, FrameCache};
use ivv::scene::write_atomic;
use ivv::stage::{Outputs, Renderer};
use ivv::train::{Checkpoint, Config, Scores, Trainer, permutation, scores};
use ivv::vk::DeviceChoice;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Options of `ivv train`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture: SPEC 8's folder, COLMAP, transforms.json or Dynamic3DGaussians; see `ivv check`.
    capture: PathBuf,
    /// The run folder: config.json, train.jsonl, train.json, scene.ply, eval.json, renders.
    #[arg(short, long)]
    output: PathBuf,
    /// Passes over all training images.
    #[arg(long)]
    epochs: Option<u32>,
    /// Steps, instead of what the epochs give.
    #[arg(long)]
    steps: Option<u64>,
    /// Settings, JSON; as config.json of an earlier run has them.
    #[arg(long)]
    config: Option<PathBuf>,
    /// One setting, KEY=VALUE, after the file; nested keys with dots, as density.gradient=1e-4.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Gaussians never exceed this.
    #[arg(long)]
    max_gaussians: Option<usize>,
    /// Seed of the order of the images, the initial points and density control.
    #[arg(long)]
    seed: Option<u64>,
    /// Highest degree of the spherical harmonics.
    #[arg(long)]
    sh_degree: Option<u32>,
    /// Bytes of decoded images kept ahead.
    #[arg(long, default_value_t = 256 << 20)]
    cache_bytes: u64,
    /// Steps between two lines of train.jsonl.
    #[arg(long, default_value_t = 20)]
    log_every: u64,
    /// Cameras to test on, by name, separated by commas; the capture's own choice without it.
    #[arg(long, value_delimiter = ',')]
    test_cameras: Option<Vec<String>>,
    /// Goes on from the newest checkpoint of the run folder, with its settings.
    #[arg(long)]
    resume: bool,
    /// Steps between two checkpoints; a tenth of the run without it.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Also score the test views after these steps, separated by commas.
    #[arg(long, value_delimiter = ',')]
    eval_at: Vec<u64>,
    /// Print the time of every pass of the last step.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    constants: ConstantArgs,
    /// The device: an index or part of a name from `ivv devices`.
    #[arg(long)]
    device: Option<String>,
}

/// Scores of one test view.
#[derive(serde::Serialize)]
struct ViewScores {
    view: String,
    #[serde(flatten)]
    scores: Scores,
}

/// Scores of all test views after a number of steps.
#[derive(serde::Serialize)]
struct Evaluation {
    step: u64,
    psnr: f64,
    ssim: f64,
    views: Vec<ViewScores>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let start = Instant::now();
    let constants = args.constants.checked()?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("no handler for Ctrl-C")?;
    let checkpoints = args.output.join("checkpoints");
    let resumed = if args.resume { Checkpoint::newest(&checkpoints)? } else { None };
    let config = match &resumed {
        Some(checkpoint) => checkpoint.config.clone(),
        None => config(args)?,
    };
    let settings = CaptureSettings { test_cameras: args.test_cameras.clone(), ..CaptureSettings::default() };
    let capture = Capture::open_with(&args.capture, &settings)?;
    let world = resumed.as_ref().map_or_else(|| capture.normalisation(), |checkpoint| checkpoint.world);
    let capture = capture.transformed(&world);
    let (training, test) = (capture.training_frames(), capture.test_frames());
    if training.is_empty() {
        return Err(ivv::Error::data(&args.capture, "", "has no training image", "see `ivv check`").into());
    }
    let total = if config.steps > 0 { config.steps } else { u64::from(config.epochs) * training.len() as u64 };
    make_folder(&args.output)?;
    write_json(&args.output.join("config.json"), &config)?;
    let choice = DeviceChoice {
        device: args.device.clone(),
        pipeline_cache: cache_folder().map(|folder| folder.join("pipelines.bin")),
        ..DeviceChoice::default()
    };
    let gpu = Arc::new(Gpu::open(&Options { device: choice, ..Options::default() })?);
    eprintln!("device: {} ({})", gpu.caps().name, gpu.chosen_because());
    let (extent, dt) = (capture.extent().radius, 1.0 / f64::from(capture.n_frames.max(1)));
    let splats = match &resumed {
        Some(checkpoint) => checkpoint.params.clone(),
        None => begin::first_gaussians(&capture, &config)?,
    };
    let plan = begin::plan(&capture, &config, &splats, gpu.caps(), args.cache_bytes);
    eprintln!("{plan}");
    let mut trainer = match &resumed {
        Some(checkpoint) => Trainer::resume(gpu.clone(), checkpoint, constants, extent, dt)?,
        None => Trainer::new(gpu.clone(), &splats, constants, config.clone(), total, extent, dt)?,
    };
    eprintln!(
        "{} training images, {} test images, {} Gaussians, steps {} to {total}, SH degree {}",
        training.len(),
        test.len(),
        trainer.n_gaussians(),
        trainer.step() + 1,
        config.sh_degree
    );

    let order: Vec<(usize, u32)> = (0..total.div_ceil(training.len() as u64))
        .flat_map(|epoch| permutation(training.len(), &[config.seed, epoch]).into_iter().map(|i| training[i]))
        .take(total as usize)
        .skip(trainer.step() as usize)
        .collect();
    let mut cache = FrameCache::new(&capture, order.iter().copied(), args.cache_bytes, 2)?;
    let mut log = Log::new(&args.output.join("train.jsonl"), trainer.step())?;
    let checkpoint_every = args.checkpoint_every.unwrap_or(total / 10).max(1);
    let n_steps = order.len();
    let mut evaluations = Vec::new();
    let mut seconds_stepping = 0.0;
    let mut profile = Vec::new();
    for (camera, frame) in order {
        let picture = cache.next_picture().context("the order of images ended early")??;
        let view = capture.view(camera, frame)?;
        let begun = Instant::now();
        let is_last = trainer.step() + 1 == total;
        let report = if args.profile && is_last {
            let (report, times) = trainer.profile(&view, &picture)?;
            profile = times;
            report
        } else {
            trainer.train(&view, &picture)?
        };
        let density = trainer.control_density()?;
        seconds_stepping += begun.elapsed().as_secs_f64();
        if report.step.is_multiple_of(args.log_every) || is_last {
            let waited = cache.stats().waited.as_secs_f64();
            log.push(&serde_json::json!({
                "seconds": seconds_stepping, "waited_for_images_s": waited, "report": report, "density": density,
            }))?;
        }
        log.show(&report, total, seconds_stepping);
        if args.eval_at.contains(&report.step) && !is_last {
            let evaluation = evaluate(&gpu, &trainer, &capture, &test, args, &config, None)?;
            eprintln!("\nafter {} steps: PSNR {:.2} dB, SSIM {:.4}", report.step, evaluation.psnr, evaluation.ssim);
            evaluations.push(evaluation);
        }
        let is_stopped = stop.load(Ordering::Relaxed);
        if report.step.is_multiple_of(checkpoint_every) || is_last || is_stopped {
            Checkpoint { world, ..trainer.checkpoint()? }.write(&checkpoints)?;
            log.write()?;
        }
        if is_stopped {
            return Err(Interrupted("a checkpoint was written; go on with --resume").into());
        }
    }
    begin::write_scene(&args.output.join("scene.ply"), &trainer.splats()?, &world)?;
    let evaluation = evaluate(&gpu, &trainer, &capture, &test, args, &config, Some(&args.output.join("renders")))?;
    let (mean_psnr, mean_ssim) = (evaluation.psnr, evaluation.ssim);
    evaluations.push(evaluation);
    write_json(&args.output.join("eval.json"), &evaluations)?;
    let seconds_per_step = seconds_stepping / n_steps.max(1) as f64;
    let totals = serde_json::json!({
        "device": gpu.caps(), "steps": trainer.step(), "gaussians": trainer.n_gaussians(),
        "seconds": start.elapsed().as_secs_f64(), "seconds_stepping": seconds_stepping,
        "seconds_per_step": seconds_per_step, "peak_bytes": gpu.device().memory().1,
        "waited_for_images_s": cache.stats().waited.as_secs_f64(), "plan": plan, "world": world,
    });
    write_json(&args.output.join("train.json"), &totals)?;
    if json {
        println!("{}", serde_json::to_string_pretty(&totals)?);
        return Ok(());
    }
    println!(
        "{} test images: PSNR {mean_psnr:.2} dB, SSIM {mean_ssim:.4}; {} Gaussians, {seconds_per_step:.3} s a step; {}",
        test.len(),
        trainer.n_gaussians(),
        args.output.display()
    );
    for time in &profile {
        println!("{:<40} {:>9.3} ms", time.label, time.ns / 1e6);
    }
    Ok(())
}

fn make_folder(folder: &Path) -> ivv::Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| ivv::Error::data(folder, "", format!("cannot be made: {e}"), "choose another folder with -o"))
}

/// The settings: defaults, then the file, then each `--set`, then the flags.
fn config(args: &Args) -> anyhow::Result<Config> {
    let mut value = serde_json::to_value(Config::default())?;
    if let Some(file) = &args.config {
        let bad = |e: String| ivv::Error::data(file, "", e, "start from the config.json of a run");
        let text = std::fs::read_to_string(file).map_err(|e| bad(e.to_string()))?;
        let config: Config = serde_json::from_str(&text).map_err(|e| bad(e.to_string()))?;
        value = serde_json::to_value(config)?;
    }
    for set in &args.set {
        let (key, text) = set.split_once('=').with_context(|| format!("--set {set}: KEY=VALUE is needed"))?;
        let pointer = format!("/{}", key.replace('.', "/"));
        let place = value.pointer_mut(&pointer).with_context(|| format!("--set {set}: there is no such setting"))?;
        *place = serde_json::from_str(text).with_context(|| format!("--set {set}: the value is not JSON"))?;
    }
    let mut config: Config = serde_json::from_value(value).context("--set")?;
    config.epochs = args.epochs.unwrap_or(config.epochs);
    config.steps = args.steps.unwrap_or(config.steps);
    config.max_gaussians = args.max_gaussians.unwrap_or(config.max_gaussians);
    config.seed = args.seed.unwrap_or(config.seed);
    config.sh_degree = args.sh_degree.unwrap_or(config.sh_degree);
    anyhow::ensure!(config.sh_degree <= 3, "--sh-degree is 0 to 3");
    anyhow::ensure!(config.epochs > 0 || config.steps > 0, "--epochs or --steps must be positive");
    Ok(config)
}

/// Renders and scores the test views; writes the pictures below `folder`.
fn evaluate(
    gpu: &Arc<Gpu>,
    trainer: &Trainer,
    capture: &Capture,
    test: &[(usize, u32)],
    args: &Args,
    config: &Config,
    folder: Option<&Path>,
) -> anyhow::Result<Evaluation> {
    let mut renderer = Renderer::new(gpu.clone(), &trainer.splats()?, args.constants.checked()?)?;
    let mut views = Vec::new();
    for &(camera, frame) in test {
        let picture = capture.picture(camera, frame)?;
        let view = ivv::scene::View { background: config.background, ..capture.view(camera, frame)? };
        let (rendered, _) = renderer.render(&view, Outputs::Color)?;
        let scores = scores(gpu, &rendered, &picture)?;
        if let Some(folder) = folder {
            let folder = folder.join(&capture.cameras[camera].name);
            make_folder(&folder)?;
            rendered.write_png(&folder.join(format!("{frame:05}.png")))?;
        }
        views.push(ViewScores { view: view.name, scores });
    }
    let mean = |f: fn(&Scores) -> f64| views.iter().map(|v| f(&v.scores)).sum::<f64>() / views.len().max(1) as f64;
    Ok(Evaluation { step: trainer.step(), psnr: mean(|s| s.psnr), ssim: mean(|s| s.ssim), views })
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_vec_pretty(value)?;
    Ok(write_atomic(path, |to| to.write_all(&text))?)
}

/// train.jsonl, and progress on standard error.
struct Log {
    file: PathBuf,
    lines: Vec<u8>,
    last_shown: Option<Instant>,
}

impl Log {
    /// Keeps the lines of an earlier run of the folder up to `step`.
    fn new(file: &Path, step: u64) -> anyhow::Result<Self> {
        let mut log = Log { file: file.to_owned(), lines: Vec::new(), last_shown: None };
        let old = if step > 0 { std::fs::read_to_string(file).unwrap_or_default() } else { String::new() };
        for line in old.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok()) {
            if line["report"]["step"].as_u64().is_some_and(|at| at <= step) {
                log.push(&line)?;
            }
        }
        Ok(log)
    }

    fn push(&mut self, line: &serde_json::Value) -> anyhow::Result<()> {
        serde_json::to_writer(&mut self.lines, line)?;
        self.lines.push(b'\n');
        Ok(())
    }

    fn write(&self) -> ivv::Result<()> {
        write_atomic(&self.file, |to| to.write_all(&self.lines))
    }

    /// One line of progress, at most five a second on a terminal and one in five seconds elsewhere.
    fn show(&mut self, report: &ivv::train::StepReport, total: u64, seconds: f64) {
        let mut out = std::io::stderr().lock();
        let pause = Duration::from_millis(if out.is_terminal() { 200 } else { 5000 });
        let is_last = report.step == total;
        if !is_last && self.last_shown.is_some_and(|at| at.elapsed() < pause) {
            return;
        }
        self.last_shown = Some(Instant::now());
        let rate = report.step as f64 / seconds.max(1e-9);
        let line = format!(
            "step {}/{total}, {rate:.1} it/s, {:.0} s left, loss {:.4}, {} Gaussians, {} visible, {} intersections",
            report.step,
            (total - report.step) as f64 / rate,
            report.loss,
            report.gaussians,
            report.visible,
            report.intersections
        );
        // A closed standard error must not end the work.
        let _ = if out.is_terminal() {
            write!(out, "\r\x1b[2K{line}{}", if is_last { "\n" } else { "" })
        } else {
            writeln!(out, "{line}")
        };
        let _ = out.flush();
    }
}
