//! `ivv trade`: what settings and presets cost and buy, on a capture.

use crate::apart::distinct;
use crate::date::today;
use crate::device::DeviceArgs;
use crate::files::{make_folder, read_json, write_json};
use crate::offsets;
use crate::progress::{Progress, watch};
use crate::ranks::hash;
use crate::screen::{out, say};
use crate::settings::{SettingArgs, patch};
use anyhow::Context;
use ivv::Constants;
use ivv::files::write_atomic;
use ivv::gpu::{Gpu, shaders_hash, spirv_hashes};
use ivv::profile::Heat;
use ivv::report::statistics::{deviation_of_sums, mean};
use ivv::scene::Splats;
use ivv::scene::capture::{Asked, Capture, CaptureSettings, FrameCache, Picture};
use ivv::scene::prior::read_flow;
use ivv::stage::{Outputs, Renderer};
use ivv::study::{Circumstances, KNOB_SETTINGS, KernelError, Trade, TradeArm, TradeRun, trade_arms};
use ivv::train::{
    CaptureSummary, Config, Meter, Priors, Session, SessionOptions, Sight, evaluate, initialise, merge, reduced_order,
    spread,
};
use ivv::twin::render_f64;
use serde_json::{Value, json};
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Steps of the short runs before the first measured one, in which kernels are compiled; density control is in it.
const WARM_UP: u64 = 16;
/// Scores of the curve to quality, over a run.
const SCORES: u64 = 10;
/// Bytes of decoded images kept ahead.
const CACHE: u64 = 64 << 20;

/// Options of `ivv trade`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture with test cameras. A synthetic one also has true flow and clocks to compare with.
    capture: PathBuf,
    /// The folder for trade.md, trade.json, trade.svg and the runs of each seed. Runs that are there are not repeated.
    #[arg(short, long)]
    output: PathBuf,
    /// Seeds. Every setting runs once with each.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    seeds: Vec<u64>,
    /// Presets to measure, by name or path. `exact`, with which all others are compared, is always among them.
    #[arg(long, value_delimiter = ',', default_value = "balanced,fast,small")]
    presets: Vec<String>,
    /// A single setting to measure, KEY=VALUE as for --set; may be given several times. By default the settings that trade
    /// accuracy for speed, each with one value or two.
    #[arg(long)]
    knob: Vec<String>,
    /// The preset to measure again without each of its settings.
    #[arg(long, default_value = "fast")]
    without: String,
    /// Measure presets only, no single settings.
    #[arg(long, conflicts_with_all = ["knob", "without"])]
    only_presets: bool,
    /// Test cameras to score; all by default. Cameras far from the training cameras vary more between seeds than between
    /// settings; exclude them.
    #[arg(long, value_delimiter = ',')]
    test_cameras: Vec<String>,
    /// Steps of a run that are timed together before the next run's turn.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    block: u64,
    #[command(flatten)]
    settings: SettingArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// What all runs of a seed share.
struct Bench<'a> {
    args: &'a Args,
    gpu: Arc<Gpu>,
    capture: Capture,
    // As `ivv train` renders.
    constants: Constants,
    arms: Vec<(TradeArm, Config)>,
    steps: u64,
    // (camera, frame) of the test images that are scored.
    test_frames: Vec<(usize, u32)>,
    // Whether this process has compiled the kernels.
    is_warm: Cell<bool>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(!args.seeds.is_empty(), "--seeds needs at least one seed");
    distinct(&args.seeds)?;
    let shared = args.settings.resolve()?;
    let arms = arms(args, &shared)?;
    let read = CaptureSettings { background: shared.background, ..CaptureSettings::default() };
    let capture = Capture::open_with(&args.capture, &read)?;
    let world = capture.normalisation();
    let capture = capture.transformed(&world);
    let n_training = capture.training_frames().len() as u64;
    let steps = shared.total(n_training);
    let mut test_frames = capture.test_frames();
    for name in &args.test_cameras {
        let is_there = test_frames.iter().any(|(camera, _)| capture.cameras[*camera].name == *name);
        anyhow::ensure!(is_there, "--test-cameras: the capture has no test camera `{name}`");
    }
    let scored = &args.test_cameras;
    test_frames.retain(|(camera, _)| scored.is_empty() || scored.contains(&capture.cameras[*camera].name));
    if n_training == 0 || test_frames.is_empty() {
        let reason = "needs at least one training image and one test image";
        return Err(ivv::Error::data(&args.capture, "", reason, "see `ivv check`").into());
    }
    make_folder(&args.output)?;
    let gpu = args.device.open()?;
    let constants = Constants::default();
    let bench = Bench { args, gpu, capture, constants, arms, steps, test_frames, is_warm: Cell::new(false) };
    let mut runs = Vec::new();
    let mut kernel_errors = Vec::new();
    let mut since = today();
    for (index, seed) in args.seeds.iter().enumerate() {
        let found = bench.seed(*seed, index == 0)?;
        runs.push(found.runs);
        since = since.min(found.date);
        kernel_errors.extend(found.kernel_errors);
    }
    let caps = bench.gpu.caps();
    let at = Circumstances {
        device: caps.name.clone(),
        driver: caps.driver.clone(),
        date: since,
        shaders: shaders_hash(),
        kernels: spirv_hashes(),
        capture: args.capture.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned()),
        steps,
        seeds: args.seeds.clone(),
    };
    let arms = bench.arms.into_iter().map(|(arm, _)| arm).collect();
    let trade = Trade { at, arms, runs, kernel_errors };
    let comparisons: Vec<_> = (0..trade.arms.len()).map(|index| trade.comparison(index)).collect();
    let all = json!({
        "at": trade.at, "settings": shared, "arms": trade.arms, "comparisons": comparisons, "runs": trade.runs,
        "kernel_errors": trade.kernel_errors,
    });
    write_json(&args.output.join("trade.json"), &all)?;
    let text = trade.markdown();
    write_atomic(&args.output.join("trade.md"), |to| to.write_all(text.as_bytes()))?;
    write_atomic(&args.output.join("trade.svg"), |to| to.write_all(trade.svg().as_bytes()))?;
    if json {
        out!("{}", serde_json::to_string_pretty(&all)?);
    } else {
        out!("{text}\n{}", args.output.join("trade.md").display());
    }
    Ok(())
}

/// What the first Gaussians follow from: arms for which it is equal begin with the same.
fn beginning(seed: u64, config: &Config) -> Config {
    let usual = Config::default();
    let Config { loss, lr, density, resolution, frame, required, adam, moment_bits, accumulation, .. } = usual;
    Config { seed, loss, lr, density, resolution, frame, required, adam, moment_bits, accumulation, ..config.clone() }
}

/// The arms with their settings.
fn arms(args: &Args, shared: &Config) -> anyhow::Result<Vec<(TradeArm, Config)>> {
    let given: Vec<&str> = match &args.knob[..] {
        _ if args.only_presets => Vec::new(),
        [] => KNOB_SETTINGS.to_vec(),
        own => own.iter().map(String::as_str).collect(),
    };
    let single = |set: &str| Ok((set.to_owned(), patch(set).with_context(|| format!("--knob {set}"))?));
    let singles = given.into_iter().map(single).collect::<anyhow::Result<Vec<_>>>()?;
    let without = (!args.only_presets).then_some(args.without.as_str());
    let config = |arm: TradeArm| {
        let mut value = serde_json::to_value(shared)?;
        merge(&mut value, &arm.settings);
        let config: Config = serde_json::from_value(value).with_context(|| arm.name.clone())?;
        config.check().map_err(|fault| anyhow::anyhow!("{}: {fault}", arm.name))?;
        let shares = |of: &Config| (of.batch, of.steps, of.epochs, of.seed);
        let lacks = |is_used: fn(&Config) -> bool| is_used(&config) && !is_used(shared);
        anyhow::ensure!(
            shares(&config) == shares(shared),
            "{}: changes batch, steps, epochs or seed, which all settings of a trade share; give it with --set, for all",
            arm.name
        );
        anyhow::ensure!(
            (config.loss.depth_space == shared.loss.depth_space || config.loss.depth == 0.0)
                && !lacks(|of| of.loss.depth > 0.0)
                && !lacks(|of| of.loss.flow > 0.0),
            "{}: takes depth or flow otherwise than what all settings of a trade share; give loss.depth_space, loss.depth or loss.flow \
             with --set, for all",
            arm.name
        );
        Ok((arm, config))
    };
    trade_arms(&args.presets, &singles, without)?.into_iter().map(config).collect()
}

/// What a seed's file holds.
#[derive(serde::Serialize, serde::Deserialize)]
struct Found {
    /// What it must be of to serve again.
    of: Value,
    /// When it was measured.
    date: String,
    runs: Vec<TradeRun>,
    kernel_errors: Vec<KernelError>,
}

/// The images `whole` as a run with `config` sees them after `done` of `total` steps. Those that are smaller there are made once, in
/// `reduced`, and not while steps are timed: other threads make those of `ivv train`.
fn at_their_size(
    whole: &[((usize, u32), Arc<Picture>)],
    reduced: &mut HashMap<Asked, Arc<Picture>>,
    config: &Config,
    (done, total): (u64, u64),
) -> Vec<((usize, u32), Arc<Picture>)> {
    let order: Vec<_> = whole.iter().map(|(at, _)| *at).collect();
    let image = |(asked, (at, picture)): (Asked, &((usize, u32), Arc<Picture>))| {
        let factor = asked.reduction.min(picture.width).min(picture.height);
        let make = || if factor > 1 { Arc::new(picture.reduced(factor)) } else { picture.clone() };
        (*at, reduced.entry(asked).or_insert_with(make).clone())
    };
    reduced_order(&order, config, done, total).zip(whole).map(image).collect()
}

/// A run under way.
struct Running<'a> {
    config: &'a Config,
    session: Session<'a>,
    run: TradeRun,
}

impl Bench<'_> {
    /// The runs of one seed, unless its file has them; with the errors of renderings if it is the first.
    fn seed(&self, seed: u64, is_first: bool) -> anyhow::Result<Found> {
        let file = self.args.output.join(format!("seed-{seed}.json"));
        let settings: Vec<&Config> = self.arms.iter().map(|(_, config)| config).collect();
        let capture = std::path::absolute(&self.args.capture).ok();
        let capture = capture.as_ref().map(|path| path.to_string_lossy());
        let of = json!({
            "settings": settings, "constants": self.constants, "steps": self.steps, "block": self.args.block,
            "shaders": shaders_hash(), "test_frames": self.test_frames, "timed": "steps of a warm device",
            "device": self.gpu.caps().name, "driver": self.gpu.caps().driver, "capture": capture,
            "held": CaptureSummary::new(&self.capture), "first": is_first,
        });
        if let Some(found) = read_json::<Found>(&file, "").ok().filter(|found| found.of == of) {
            return Ok(found);
        }
        if !self.is_warm.replace(true) {
            self.train(seed, WARM_UP, "warm-up")?;
        }
        let trained = self.train(seed, self.steps, "block")?;
        let mut progress = Progress::new("scored", trained.len());
        let (mut runs, mut kernel_errors) = (Vec::new(), Vec::new());
        for (index, running) in trained.into_iter().enumerate() {
            let Running { config, mut session, mut run } = running;
            let splats = session.finish()?;
            run.offset_error = offsets::learnt_error(session.trainer(), &self.capture)?;
            let before = self.live_bytes();
            drop(session);
            run.device_bytes = before - self.live_bytes();
            self.score(&splats, config, &mut run)?;
            progress.step(&format!("{}, {:.2} dB", self.arms[index].0.name, run.psnr));
            if is_first && index == 0 {
                kernel_errors = self.kernel_errors(&splats)?;
            }
            runs.push(run);
        }
        let found = Found { of, date: today(), runs, kernel_errors };
        write_json(&file, &found)?;
        Ok(found)
    }

    /// Trains all arms for `steps` steps, a block of each in turn.
    fn train(&self, seed: u64, steps: u64, what: &'static str) -> anyhow::Result<Vec<Running<'_>>> {
        let mut all: Vec<Running> = Vec::new();
        // What begins alike is made once.
        let mut begun: Vec<(Config, Splats)> = Vec::new();
        let mut priors: Option<Priors> = None;
        for (_, config) in &self.arms {
            let key = beginning(seed, config);
            let own = Config { seed, ..config.clone() };
            let first = match begun.iter().find(|(known, _)| *known == key) {
                Some((_, splats)) => splats.clone(),
                None => {
                    let mut progress = Progress::new("initialisation", 0);
                    let mut reach = |done, total| progress.reach(done, total, "frames, pictures or depths");
                    let initial = initialise(&self.capture, &own, &mut reach)?;
                    drop(progress);
                    say!("initialised {initial}");
                    begun.push((key, initial.splats.clone()));
                    initial.splats
                }
            };
            let options = SessionOptions {
                constants: self.constants,
                total: Some(steps),
                first: Some(first),
                priors: priors.clone(),
                // What all arms share is printed once.
                watch: if all.is_empty() { watch() } else { Box::new(|_| ()) },
                ..SessionOptions::default()
            };
            let session = Session::begin(self.gpu.clone(), &self.capture, own, options)?;
            priors.get_or_insert_with(|| session.priors().clone());
            all.push(Running { config, session, run: TradeRun::default() });
        }
        let order = all.first().map_or(Vec::new(), |first| first.session.order());
        let plan = priors.map(|priors| priors.plan).unwrap_or_default();
        let mut cache = FrameCache::new(&self.capture, order.iter().copied(), &plan, CACHE, 1)?;
        // Which all arms share.
        let batch = all.first().map_or(1, |first| first.config.batch as usize);
        let blocks: Vec<&[(usize, u32)]> = order.chunks(self.args.block as usize * batch).collect();
        let n_arms = all.len();
        let mut heat = Heat::new(&self.gpu)?;
        let mut progress = Progress::new(what, blocks.len());
        for (index, block) in blocks.iter().enumerate() {
            let next = |at: &(usize, u32)| -> anyhow::Result<((usize, u32), Arc<Picture>)> {
                Ok((*at, cache.next_picture().context("the order of images ended early")??))
            };
            let whole = block.iter().map(next).collect::<Result<Vec<_>, _>>()?;
            let mut reduced = HashMap::new();
            let of_arm = |Running { config, session, .. }: &Running| {
                at_their_size(&whole, &mut reduced, config, (session.steps(), steps))
            };
            let images: Vec<_> = all.iter().map(of_arm).collect();
            let done = (index + 1) as u64;
            let is_scored = done * SCORES / blocks.len() as u64 > (done - 1) * SCORES / blocks.len() as u64;
            for place in 0..n_arms {
                // Nobody is always first.
                let arm = (place + index) % n_arms;
                let Running { config, session, run } = &mut all[arm];
                heat.before(&self.gpu)?;
                let start = Instant::now();
                images[arm].chunks(config.batch as usize).try_for_each(|images| {
                    let images: Vec<_> = images.iter().map(|(at, picture)| (*at, &**picture)).collect();
                    session.step_on(&images)
                })?;
                session.wait()?;
                session.settle()?;
                run.block_seconds.push(start.elapsed().as_secs_f64());
                session.take_events();
                if is_scored && steps == self.steps {
                    let psnr = self.psnr(&session.scene()?, config)?;
                    run.curve.push([run.block_seconds.iter().sum(), psnr]);
                }
            }
            progress.step(&format!("{} steps of {n_arms} settings, seed {seed}", block.len() / batch));
        }
        Ok(all)
    }

    /// Bytes of all device buffers.
    fn live_bytes(&self) -> u64 {
        self.gpu.device().memory().0.values().sum()
    }

    /// Mean PSNR of some test views.
    fn psnr(&self, splats: &Splats, config: &Config) -> anyhow::Result<f64> {
        let mut renderer = Renderer::new(self.gpu.clone(), splats, self.constants)?;
        let mut meter = Meter::new(self.gpu.clone(), config)?;
        let some = spread(&self.test_frames, 6);
        let sight = Sight::new(&self.capture, config.background);
        let scored = evaluate(&mut renderer, &mut meter, &sight, &some, 0, |_, _, _| Ok(()))?;
        Ok(scored.map_or(f64::NAN, |scored| scored.mean.psnr))
    }

    /// Scores a scene on all test views, rendered exactly.
    fn score(&self, splats: &Splats, config: &Config, run: &mut TradeRun) -> anyhow::Result<()> {
        let mut renderer = Renderer::new(self.gpu.clone(), splats, self.constants)?;
        let mut meter = Meter::new(self.gpu.clone(), config)?;
        let sight = Sight::new(&self.capture, config.background);
        let frames = &self.test_frames;
        let mut residuals: BTreeMap<usize, Residuals> = BTreeMap::new();
        let scored = evaluate(&mut renderer, &mut meter, &sight, frames, 0, |camera, frame, rendered| {
            let Some(moves) = self.capture.foreground(camera, frame)? else { return Ok(()) };
            let truth = self.capture.picture(camera, frame)?;
            residuals.entry(camera).or_insert_with(|| Residuals::new(moves.len())).add(&rendered.color, &truth, &moves);
            Ok(())
        })?
        .context(
            "the capture has no test image that counts: name other cameras with --test-cameras, or mend the masks",
        )?;
        run.scene_hash = format!("{:x}", hash(splats));
        run.gaussians = splats.len();
        (run.psnr, run.ssim) = (scored.mean.psnr, scored.mean.ssim);
        run.worst_psnr = scored.views.iter().map(|view| view.scores.psnr).fold(f64::INFINITY, f64::min);
        run.flicker = mean(residuals.values().flat_map(Residuals::deviations));
        let mut errors = Vec::new();
        for &(camera, frame) in frames {
            let view = sight.view(camera, frame)?;
            let file = format!("truth/exact/{}/{frame:05}.exr", self.capture.cameras[camera].name);
            let file = self.capture.path.join(file);
            if !file.is_file() || frame + 1 >= self.capture.n_frames {
                continue;
            }
            let truth = read_flow(&file, view.intrinsics.width, view.intrinsics.height)?;
            let (rendered, _) = renderer.render(&view, Outputs::All)?;
            let error = |(a, b): (&[f32; 2], &[f32; 2])| f64::from(a[0] - b[0]).hypot(f64::from(a[1] - b[1]));
            errors.extend(rendered.flow.iter().zip(&truth).map(error).filter(|error| error.is_finite()));
        }
        run.flow_error = mean(errors);
        Ok(())
    }

    /// What each way to render does to one view of `splats`, against the twin in double precision.
    fn kernel_errors(&self, splats: &Splats) -> anyhow::Result<Vec<KernelError>> {
        let (camera, frame) = *spread(&self.test_frames, 1).first().context("the capture has no test image")?;
        let view = self.capture.view(camera, frame)?;
        let truth = render_f64(splats, &view, &self.constants);
        let mut seen: Vec<ivv::Knobs> = Vec::new();
        let mut errors = Vec::new();
        for (arm, config) in &self.arms {
            if seen.contains(&config.frame) {
                continue;
            }
            seen.push(config.frame);
            let constants = config.frame.on(self.constants);
            let (rendered, _) = Renderer::new(self.gpu.clone(), splats, constants)?.render(&view, Outputs::Color)?;
            errors.push(KernelError::new(&arm.name, &rendered.color, &truth.color));
        }
        Ok(errors)
    }
}

/// What is wrong with a camera's pixels in time, where nothing moves.
struct Residuals {
    /// By pixel: sum and sum of squares of the mean over the channels, and whether something moved over it.
    sums: Vec<([f64; 2], bool)>,
    n: f64,
}

impl Residuals {
    fn new(n_pixels: usize) -> Self {
        Residuals { sums: vec![([0.0; 2], false); n_pixels], n: 0.0 }
    }

    fn add(&mut self, color: &[[f32; 3]], truth: &Picture, moves: &[bool]) {
        self.n += 1.0;
        for (((sums, moved), color), (word, moves)) in
            self.sums.iter_mut().zip(color).zip(truth.pixels.iter().zip(moves))
        {
            let truth = word.to_le_bytes();
            let error =
                (0..3).map(|c| 255.0 * f64::from(color[c].clamp(0.0, 1.0)) - f64::from(truth[c])).sum::<f64>() / 3.0;
            *sums = [sums[0] + error, sums[1] + error * error];
            *moved |= *moves || truth[3] == 0;
        }
    }

    /// Standard deviations of the pixels that nothing moved over.
    fn deviations(&self) -> impl Iterator<Item = f64> {
        let n = self.n;
        let still = self.sums.iter().filter(move |(_, moved)| !moved && n > 1.0);
        still.map(move |([sum, squares], _)| deviation_of_sums(n, *sum, *squares))
    }
}
