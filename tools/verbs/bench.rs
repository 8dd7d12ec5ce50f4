//! `ivv bench`: settings beside each other, by runs that it makes or by runs that are there.

use crate::apart::{Apart, distinct, held, named};
use crate::date::today;
use crate::files::{make_folder, read_json, write_json};
use crate::screen::{out, say};
use crate::settings::patch;
use anyhow::Context;
use glam::DVec3;
use ivv::files::write_atomic;
use ivv::scene::capture::Capture;
use ivv::study::{Arm, Bench, BenchRun, Entry, History, RunResult, Study, differences};
use ivv::train::{CaptureSummary, Config, first_gaussians, merge};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Options of `ivv bench`.
#[derive(clap::Args)]
pub struct Args {
    /// The study: trade, presets, schedule, quality, clips, required, initialisation, offsets, supervision or perceptual; or the
    /// path of a study's .json file.
    #[arg(required_unless_present = "runs", conflicts_with = "runs")]
    study: Option<String>,
    /// Captures, with test cameras.
    #[arg(value_name = "CAPTURE", required_unless_present = "runs", conflicts_with = "runs")]
    captures: Vec<PathBuf>,
    /// The folder for bench.md, bench.json, bench.svg and the runs. Runs that are there are not repeated.
    #[arg(short, long, required_unless_present = "runs")]
    output: Option<PathBuf>,
    /// Seeds, instead of the study's. Every arm runs once with each.
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Steps of a run, instead of the study's; with several numbers every arm is run for each.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u64).range(1..))]
    steps: Vec<u64>,
    /// Weights of LPIPS, as tools/lpips_weights.py makes them; without them LPIPS is not measured.
    #[arg(long)]
    lpips_weights: Option<PathBuf>,
    /// One setting of all arms, KEY=VALUE; may be given several times. What an arm changes goes before it.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Vulkan device, as `ivv train` takes it.
    #[arg(long)]
    device: Option<String>,
    /// Runs at a time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    jobs: u32,
    /// Trains nothing: compares the folders of runs that have ended and have test images. Runs that differ in their seeds alone share
    /// a row.
    #[arg(long, num_args = 1.., value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// A JSON file to which these runs are added as a new measurement, made where it is absent. Beside it, with the ending
    /// `.svg`, the course of all measurements is drawn.
    #[arg(long)]
    history: Option<PathBuf>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    // clap asks for --runs only where nothing conflicts with it.
    anyhow::ensure!(
        args.history.is_none() || !args.runs.is_empty(),
        "--history: expected --runs with it, found a study"
    );
    let bench = match (&args.study, &args.output) {
        (Some(study), Some(output)) => of_study(args, study, output)?,
        _ => of_runs(args)?,
    };
    let (text, all) = (bench.markdown(), bench.json());
    if let Some(folder) = &args.output {
        make_folder(folder)?;
        write_json(&folder.join("bench.json"), &all)?;
        write_atomic(&folder.join("bench.md"), |to| to.write_all(text.as_bytes()))?;
        write_atomic(&folder.join("bench.svg"), |to| to.write_all(bench.svg().as_bytes()))?;
    }
    if json {
        out!("{}", serde_json::to_string_pretty(&all)?);
    } else {
        out!("{}", text.trim_end());
    }
    Ok(())
}

/// Runs that are there, which are added to a history where one is asked for.
fn of_runs(args: &Args) -> anyhow::Result<Bench> {
    let read = |run: &PathBuf| RunResult::read(run);
    let results = args.runs.iter().map(read).collect::<ivv::Result<Vec<_>>>()?;
    let found: Vec<(&Path, RunResult)> = args.runs.iter().map(PathBuf::as_path).zip(results.iter().cloned()).collect();
    let bench = Bench::of_runs(&found, today())?;
    if let Some(file) = &args.history {
        let mut history = match file.try_exists() {
            Ok(false) => History::default(),
            _ => read_json(file, "give a file that `ivv bench --history` wrote, or the name of a new one")?,
        };
        history.0.push(Entry { date: today(), runs: results });
        write_json(file, &history)?;
        write_atomic(&file.with_extension("svg"), |to| to.write_all(history.svg().as_bytes()))?;
    }
    Ok(bench)
}

/// The runs of a study, which are made where they are not there.
fn of_study(args: &Args, name: &str, output: &Path) -> anyhow::Result<Bench> {
    let mut study = Study::find(name)?;
    if !args.seeds.is_empty() {
        study.seeds.clone_from(&args.seeds);
    }
    if !args.steps.is_empty() {
        study.steps.clone_from(&args.steps);
    }
    distinct("seeds", &study.seeds)?;
    distinct("steps", &study.steps)?;
    let shared = shared(args)?;
    let has_lpips = |arm: &Arm| arm.settings["loss"]["lpips"].as_f64().is_some_and(|weight| weight > 0.0);
    if let Some(arm) = study.arms.iter().find(|arm| has_lpips(arm) && shared.loss.lpips_weights.is_none()) {
        anyhow::bail!(
            "{}: the arm {} needs the weights of LPIPS; give them with --lpips-weights",
            study.title,
            arm.key
        );
    }
    // All are opened before the first is trained on.
    let captures = named(&args.captures)?;
    let places = captures.iter().map(|(name, path)| Place::new(name, path, (&study, &shared)));
    let places: Vec<Place> = places.collect::<anyhow::Result<_>>()?;
    let jobs = jobs(&study, &shared, (&places, output))?;
    train(args, &jobs)?;
    let read = |job: &Job| {
        let peripheral = job.place.peripheral.as_deref();
        BenchRun::read(&job.folder, &job.place.name, &job.arm.key, job.steps, job.config.seed, peripheral)
    };
    let mut runs = jobs.iter().map(read).collect::<ivv::Result<Vec<_>>>()?;
    runs.sort_by_key(|run| places.iter().position(|place| place.name == run.capture));
    let budgets = places.iter().filter_map(|place| Some((place.name.clone(), place.budget?))).collect();
    Ok(Bench { study, date: today(), settings: differences(&shared), budgets, runs })
}

/// The settings that all arms share.
fn shared(args: &Args) -> anyhow::Result<Config> {
    let mut value = serde_json::to_value(Config::default())?;
    for set in &args.set {
        merge(&mut value, &patch(set).with_context(|| format!("--set {set}"))?);
    }
    let mut config: Config = serde_json::from_value(value).context("--set")?;
    if let Some(weights) = &args.lpips_weights {
        anyhow::ensure!(weights.is_file(), "--lpips-weights {}: there is no such file", weights.display());
        config.loss.lpips_weights = Some(std::fs::canonicalize(weights)?);
    }
    config.check().map_err(|fault| anyhow::anyhow!("--set: {fault}"))?;
    Ok(config)
}

/// A capture.
struct Place {
    name: String,
    capture: PathBuf,
    held: [CaptureSummary; 2],
    peripheral: Option<String>,
    /// Gaussians that each arm may have, where all have the same budget.
    budget: Option<usize>,
}

impl Place {
    fn new(name: &str, path: &Path, (study, shared): (&Study, &Config)) -> anyhow::Result<Self> {
        let capture = Capture::open(path)?;
        let held = held(&capture);
        let untested = "expected test cameras, found none; name some in its capture.toml";
        anyhow::ensure!(held[0].test_images > 0, "{}: {untested}", path.display());
        let budget = if study.equal_budgets { Some(2 * largest_start(&capture, study, shared)?) } else { None };
        Ok(Place { name: name.to_owned(), capture: path.to_owned(), held, peripheral: peripheral(&capture), budget })
    }
}

/// The most Gaussians that an arm of `study` begins with.
fn largest_start(capture: &Capture, study: &Study, shared: &Config) -> anyhow::Result<usize> {
    let start = |arm: &Arm| {
        let own = Config { max_gaussians: usize::MAX, ..study.config(shared, arm)? };
        Ok(first_gaussians(capture, &own, &mut |_, _| {})?.splats.len())
    };
    let starts: Vec<usize> = study.arms.iter().map(start).collect::<ivv::Result<_>>()?;
    Ok(starts.into_iter().max().unwrap_or(0))
}

/// The test camera whose lens is farthest from the middle of all lenses.
fn peripheral(capture: &Capture) -> Option<String> {
    let centers: Vec<DVec3> = capture.cameras.iter().map(|camera| camera.pose(0).center()).collect();
    let middle = centers.iter().sum::<DVec3>() / centers.len() as f64;
    let distance = |c: &DVec3| c.distance_squared(middle);
    let tests = capture.cameras.iter().zip(&centers).filter(|(camera, _)| camera.is_test);
    let farthest = tests.max_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
    farthest.map(|(camera, _)| camera.name.clone())
}

/// A training to be made.
struct Job<'a> {
    place: &'a Place,
    arm: &'a Arm,
    /// 0 where epochs give them.
    steps: u64,
    config: Config,
    folder: PathBuf,
}

/// All trainings. Arms follow each other, and with each seed another one is the first, so that what else the machine does slows
/// all alike.
fn jobs<'a>(study: &'a Study, shared: &Config, (places, output): (&'a [Place], &Path)) -> ivv::Result<Vec<Job<'a>>> {
    let configs = study.arms.iter().map(|arm| study.config(shared, arm)).collect::<ivv::Result<Vec<Config>>>()?;
    let lengths = if study.steps.is_empty() { vec![0] } else { study.steps.clone() };
    let mut jobs = Vec::new();
    for (turn, &seed) in study.seeds.iter().enumerate() {
        for (place, &steps) in places.iter().flat_map(|place| lengths.iter().map(move |steps| (place, steps))) {
            for index in 0..configs.len() {
                let index = (index + turn) % configs.len();
                let mut config = Config { seed, ..configs[index].clone() };
                let length = if steps > 0 { format!("-{steps}") } else { String::new() };
                config.steps = if steps > 0 { steps } else { config.steps };
                config.max_gaussians = place.budget.unwrap_or(config.max_gaussians);
                let folder =
                    output.join("runs").join(&place.name).join(format!("{}{length}-{seed}", study.arms[index].key));
                jobs.push(Job { place, arm: &study.arms[index], steps, config, folder });
            }
        }
    }
    Ok(jobs)
}

/// Makes the runs that are not there, as many at a time as --jobs says. After a fault no new one is begun.
fn train(args: &Args, jobs: &[Job]) -> anyhow::Result<()> {
    let (next, fault) = (AtomicUsize::new(0), Mutex::new(None));
    let one = |job: &Job| {
        let Job { place, config, folder, .. } = job;
        let apart = Apart {
            capture: &place.capture,
            held: &place.held,
            device: args.device.as_deref(),
            is_beside: args.jobs > 1,
        };
        make_folder(folder.parent().context("a run has a folder above it")?)?;
        apart.train(folder, config)
    };
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else { break };
            say!("run {} of {}: {}", index + 1, jobs.len(), job.folder.display());
            if let Err(error) = one(job) {
                next.store(jobs.len(), Ordering::Relaxed);
                fault.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(error);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..args.jobs {
            scope.spawn(work);
        }
    });
    fault.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).map_or(Ok(()), Err)
}
