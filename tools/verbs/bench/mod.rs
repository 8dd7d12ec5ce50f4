//! `ivv bench`: compares settings, by the runs of a study or by finished runs.

mod captures;
mod date;

use crate::run::files::{make_folder, read_json, write_json};
use crate::run::settings::patch;
use crate::run::subprocess::train_command;
use crate::ui::screen::{out, print_json, say};
use crate::verbs::bench::captures::{StudyCapture, named};
use crate::verbs::bench::date::today;
use anyhow::Context;
use ivv::internals::files::{folder_of, write_atomic};
use ivv::internals::study::{Arm, Bench, BenchRun, Entry, History, RunOf, RunResult, Study, differences};
use ivv::internals::train::{Config, Run, merge};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(clap::Args)]
pub struct Args {
    #[arg(required_unless_present = "runs", conflicts_with = "runs", help = study_help())]
    study: Option<String>,
    /// Captures, with test cameras.
    #[arg(value_name = "CAPTURE", required_unless_present = "runs", conflicts_with = "runs")]
    captures: Vec<PathBuf>,
    /// The folder for bench.md, bench.json, bench.svg and the runs. Finished runs are not repeated.
    #[arg(short, long, required_unless_present = "runs")]
    output: Option<PathBuf>,
    /// Seeds, instead of the study's. Every arm runs once with each seed.
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Steps of a run, instead of the study's. With several numbers, every arm runs with each.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u64).range(1..))]
    steps: Vec<u64>,
    /// One setting of all arms, KEY=VALUE, which an arm's own settings override. May be given several times.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Vulkan device, as `ivv train` takes it.
    #[arg(long)]
    device: Option<String>,
    /// Most runs at a time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    jobs: u32,
    /// Trains nothing: compares finished runs with test images. Runs that differ only in their seeds share a row.
    #[arg(long, num_args = 1.., value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// A JSON file to which these runs are added as a new measurement. A plot of all measurements is written beside it.
    #[arg(long)]
    history: Option<PathBuf>,
}

fn study_help() -> String {
    format!("The study: {}; or the path of a study's .json file", Study::names())
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
        print_json(&all)?;
    } else {
        out!("{}", text.trim_end());
    }
    Ok(())
}

/// Compares finished runs, and adds them to the history if one is given.
fn of_runs(args: &Args) -> anyhow::Result<Bench> {
    let results = args.runs.iter().map(|run| RunResult::read(run)).collect::<ivv::Result<Vec<_>>>()?;
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

/// Compares the runs of a study, after training the missing ones.
fn of_study(args: &Args, name: &str, output: &Path) -> anyhow::Result<Bench> {
    let mut study = Study::find(name)?;
    if !args.seeds.is_empty() {
        study.seeds.clone_from(&args.seeds);
    }
    if !args.steps.is_empty() {
        study.steps.clone_from(&args.steps);
    }
    refuse_duplicates("seeds", &study.seeds)?;
    refuse_duplicates("steps", &study.steps)?;
    let shared = shared(args)?;
    let has_lpips = |arm: &Arm| arm.settings["loss"]["lpips"].as_f64().is_some_and(|weight| weight > 0.0);
    if let Some(arm) = study.arms.iter().find(|arm| has_lpips(arm) && shared.loss.lpips_weights.is_none()) {
        let remedy = "give them with --set loss.lpips_weights=FILE";
        anyhow::bail!("{}: the arm {} needs the weights of LPIPS; {remedy}", study.title, arm.key);
    }
    // Open all captures before training on the first.
    let captures = named(&args.captures)?;
    let captures = captures.iter().map(|(name, path)| StudyCapture::new(name, path, &study, &shared));
    let captures: Vec<StudyCapture> = captures.collect::<anyhow::Result<_>>()?;
    let jobs = jobs(&study, &shared, &captures, output)?;
    train(args, &jobs)?;
    let read = |job: &Job| {
        let Job { capture, arm, steps, config, folder } = job;
        let of = RunOf { capture: &capture.name, arm: &arm.key, steps: *steps, seed: config.seed };
        BenchRun::read(folder, of, capture.peripheral.as_deref())
    };
    let mut runs = jobs.iter().map(read).collect::<ivv::Result<Vec<_>>>()?;
    runs.sort_by_key(|run| captures.iter().position(|capture| capture.name == run.capture));
    let budgets = captures.iter().filter_map(|capture| Some((capture.name.clone(), capture.budget?))).collect();
    Ok(Bench { study, date: today(), settings: differences(&shared), budgets, runs })
}

/// Refuses a number that is given twice: its second run would count as another observation.
fn refuse_duplicates(of: &str, numbers: &[u64]) -> anyhow::Result<()> {
    let twice = numbers.iter().enumerate().find(|(at, number)| numbers[..*at].contains(number));
    twice.map_or(Ok(()), |(_, number)| Err(anyhow::anyhow!("{of}: {number} is named twice; give each number once")))
}

fn shared(args: &Args) -> anyhow::Result<Config> {
    let mut value = serde_json::to_value(Config::default())?;
    for set in &args.set {
        merge(&mut value, &patch(set).with_context(|| format!("--set {set}"))?);
    }
    let mut config: Config = serde_json::from_value(value).context("--set")?;
    if let Some(weights) = &mut config.loss.lpips_weights {
        anyhow::ensure!(weights.is_file(), "loss.lpips_weights {}: there is no such file", weights.display());
        *weights = std::fs::canonicalize(&*weights)?;
    }
    config.check().map_err(|fault| anyhow::anyhow!("--set: {fault}"))?;
    Ok(config)
}

struct Job<'a> {
    capture: &'a StudyCapture,
    arm: &'a Arm,
    /// 0 if epochs give them.
    steps: u64,
    config: Config,
    folder: PathBuf,
}

impl Job<'_> {
    /// Trains the run, unless that has been done. Its settings and its log go to files beside its folder.
    fn train(&self, args: &Args) -> anyhow::Result<()> {
        let Job { capture, config, folder, .. } = self;
        make_folder(folder_of(folder))?;
        let settings = sibling(folder, ".json");
        let path = std::path::absolute(&capture.path)?;
        let is_done = folder.join("eval.json").is_file()
            && read_json::<Config>(&settings, "remove it").is_ok_and(|before| before == *config)
            && Run::read(folder).is_ok_and(|run| run.capture == path && capture.summaries.contains(&run.held));
        if is_done {
            return Ok(());
        }
        // If this run fails before it replaces them, scores of a run with other settings must not pass for its own.
        if let Err(fault) = std::fs::remove_file(folder.join("eval.json"))
            && fault.kind() != ErrorKind::NotFound
        {
            return Err(fault).with_context(|| format!("{}: earlier scores cannot be removed", folder.display()));
        }
        write_json(&settings, config)?;
        let log = sibling(folder, ".log");
        let remedy = "free space or choose another folder with -o";
        let log = std::fs::File::create(&log)
            .map_err(|e| ivv::Error::data(&log, "", format!("the log of a run cannot be made: {e}"), remedy))?;
        let mut command = train_command()?;
        if args.jobs > 1 && std::env::var_os("LP_NUM_THREADS").is_none() {
            // Lavapipe: several runs with one thread each are faster than one run after the other with all threads.
            command.env("LP_NUM_THREADS", "0");
        }
        command
            .arg(&capture.path)
            .args(["--overwrite", "--eval-every", "0", "-o"])
            .arg(folder)
            .arg("--config")
            .arg(&settings);
        command.args(args.device.iter().flat_map(|device| ["--device", device]));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let status = command.status().context("`ivv train` cannot be started")?;
        anyhow::ensure!(status.success(), "{}: the run ended with {status}; see its .log", folder.display());
        Ok(())
    }
}

/// The path of `folder` with `ending` behind its whole name: the name of a preset may have a dot.
fn sibling(folder: &Path, ending: &str) -> PathBuf {
    let mut path = folder.as_os_str().to_owned();
    path.push(ending);
    path.into()
}

/// All runs, arm by arm. With each seed another arm is first, so that other load on the machine slows all alike.
fn jobs<'a>(
    study: &'a Study,
    shared: &Config,
    captures: &'a [StudyCapture],
    output: &Path,
) -> ivv::Result<Vec<Job<'a>>> {
    let configs = study.arms.iter().map(|arm| study.config(shared, arm)).collect::<ivv::Result<Vec<Config>>>()?;
    let lengths = if study.steps.is_empty() { vec![0] } else { study.steps.clone() };
    let mut jobs = Vec::new();
    for (turn, &seed) in study.seeds.iter().enumerate() {
        for (capture, &steps) in captures.iter().flat_map(|capture| lengths.iter().map(move |steps| (capture, steps))) {
            for index in 0..configs.len() {
                let index = (index + turn) % configs.len();
                let mut config = Config { seed, ..configs[index].clone() };
                let length = if steps > 0 { format!("-{steps}") } else { String::new() };
                config.steps = if steps > 0 { steps } else { config.steps };
                config.max_gaussians = capture.budget.unwrap_or(config.max_gaussians);
                let folder =
                    output.join("runs").join(&capture.name).join(format!("{}{length}-{seed}", study.arms[index].key));
                jobs.push(Job { capture, arm: &study.arms[index], steps, config, folder });
            }
        }
    }
    Ok(jobs)
}

/// Trains the missing runs, --jobs at a time. After an error no other starts.
fn train(args: &Args, jobs: &[Job]) -> anyhow::Result<()> {
    let (next, fault) = (AtomicUsize::new(0), Mutex::new(None));
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else { break };
            say!("run {} of {}: {}", index + 1, jobs.len(), job.folder.display());
            if let Err(error) = job.train(args) {
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
