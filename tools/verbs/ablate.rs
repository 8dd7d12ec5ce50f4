//! `ivv ablate`: the paper's ablations on a capture.

use crate::files::{make_folder, read_json, write_json};
use crate::screen::{out, say};
use crate::settings::SettingArgs;
use anyhow::Context;
use clap::builder::PossibleValuesParser;
use glam::DVec3;
use ivv::files::write_atomic;
use ivv::report::statistics::mean;
use ivv::scene::capture::Capture;
use ivv::study::{Arm, ArmResult, Base, Measure, STUDIES, Study, StudyResult};
use ivv::train::{Config, initialise};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Options of `ivv ablate`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture.
    capture: PathBuf,
    /// The folder for the runs, ablation.md, ablation.json and the plots. Runs that are there are not repeated.
    #[arg(short, long)]
    output: PathBuf,
    /// Seeds. Every setting runs once with each.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    seeds: Vec<u64>,
    /// Studies, separated by commas: initialisation, offsets, supervision, perceptual (needs --lpips-weights), required.
    #[arg(long, value_delimiter = ',', default_value = "initialisation,offsets,supervision")]
    studies: Vec<String>,
    /// The settings that each study starts from, separated by commas. given: those of --config and --set, LPIPS measured only.
    /// paper: these with the paper's weights and rates, LPIPS in the loss where there are weights.
    #[arg(long, value_delimiter = ',', default_value = "given,paper", value_parser = PossibleValuesParser::new(Base::ALL.map(Base::name)))]
    bases: Vec<String>,
    /// Weights of LPIPS, as tools/lpips_weights.py makes them; without them LPIPS is not measured.
    #[arg(long)]
    lpips_weights: Option<PathBuf>,
    /// The test camera to call peripheral. By default the one farthest from the middle of all.
    #[arg(long)]
    peripheral: Option<String>,
    #[command(flatten)]
    settings: SettingArgs,
    /// Vulkan device, as `ivv train` takes it.
    #[arg(long)]
    device: Option<String>,
}

/// A study from one base, and what its arms may have.
struct Plan {
    study: &'static Study,
    base: Base,
    /// Gaussians, where all arms have the same budget.
    budget: Option<usize>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let mut config = args.settings.resolve()?;
    anyhow::ensure!(!args.seeds.is_empty(), "--seeds names none");
    if let Some(weights) = &args.lpips_weights {
        anyhow::ensure!(weights.is_file(), "--lpips-weights {}: there is no such file", weights.display());
        config.loss.lpips_weights = Some(std::path::absolute(weights)?);
    }
    let capture = Capture::open(&args.capture)?;
    let peripheral = match &args.peripheral {
        Some(name) => name.clone(),
        None => peripheral(&capture).context("the capture has no test camera")?,
    };
    let plans = plans(args, &capture, &config)?;
    make_folder(&args.output.join("runs"))?;
    let runs = runs(args, &plans, &config);
    for (index, (key, seed, own)) in runs.iter().enumerate() {
        say!("run {} of {}: {key}, seed {seed}", index + 1, runs.len());
        train(args, &folder(args, key, *seed), own)?;
    }
    let mut text = format!("# Ablations on `{}`\n", args.capture.display());
    let mut all = Vec::new();
    for Plan { study, base, budget } in plans {
        let result = StudyResult { budget, ..collect(args, study, base, &peripheral)? };
        text += &format!("\n{}", result.markdown());
        let name = if base == Base::Given { study.name.to_owned() } else { format!("{}-paper", study.name) };
        let file = args.output.join(format!("{name}.svg"));
        write_atomic(&file, |to| to.write_all(result.svg().as_bytes()))?;
        let measures: Vec<&str> = study.measures.iter().map(|measure| measure.title()).collect();
        let differences: Vec<_> = (0..result.arms.len()).map(|index| result.difference(index)).collect();
        all.push(json!({
            "study": study.name, "base": base, "max_gaussians": budget, "lpips_trunk": result.trunk, "measures": measures,
            "seeds": args.seeds, "arms": result.arms, "differences": differences,
        }));
    }
    write_atomic(&args.output.join("ablation.md"), |to| to.write_all(text.as_bytes()))?;
    let all = json!({ "capture": args.capture, "peripheral_camera": peripheral, "settings": config, "studies": all });
    write_json(&args.output.join("ablation.json"), &all)?;
    if json {
        out!("{}", serde_json::to_string_pretty(&all)?);
    } else {
        out!("{text}\n{}", args.output.join("ablation.md").display());
    }
    Ok(())
}

/// The studies that are asked for, from each base.
fn plans(args: &Args, capture: &Capture, config: &Config) -> anyhow::Result<Vec<Plan>> {
    let mut plans = Vec::new();
    for name in &args.studies {
        let known = STUDIES.iter().find(|study| study.name == name);
        let names: Vec<&str> = STUDIES.iter().map(|study| study.name).collect();
        let study =
            known.with_context(|| format!("--studies {name}: unknown study; choose from {}", names.join(", ")))?;
        if study.name == "perceptual" && config.loss.lpips_weights.is_none() {
            anyhow::bail!("--studies perceptual: needs the weights of LPIPS, give them with --lpips-weights");
        }
        let budget = if study.equal_budgets { Some(2 * largest_start(capture, study, config)?) } else { None };
        if let Some(budget) = budget {
            say!("{name}: each arm may have {budget} Gaussians, twice as many as the largest start");
        }
        let bases = Base::ALL.into_iter().filter(|base| args.bases.iter().any(|name| name == base.name()));
        // What is in the loss is no arm of settings that have it already.
        let bases = bases.filter(|base| study.name != "perceptual" || *base == Base::Given);
        plans.extend(bases.map(|base| Plan { study, base, budget }));
    }
    Ok(plans)
}

/// The most Gaussians that an arm of `study` begins with.
fn largest_start(capture: &Capture, study: &Study, config: &Config) -> anyhow::Result<usize> {
    let capture = capture.clone().transformed(&capture.normalisation());
    let start = |arm: &Arm| {
        let mut own = config.clone();
        (arm.change)(&mut own);
        own.max_gaussians = usize::MAX;
        Ok(initialise(&capture, &own, &mut |_, _| {})?.splats.len())
    };
    let starts: Vec<usize> = study.arms.iter().map(start).collect::<ivv::Result<_>>()?;
    Ok(starts.into_iter().max().unwrap_or(0))
}

/// Key, seed and settings of every run; arms of equal settings share theirs.
fn runs(args: &Args, plans: &[Plan], config: &Config) -> Vec<(String, u64, Config)> {
    let mut runs: Vec<(String, u64, Config)> = Vec::new();
    for &seed in &args.seeds {
        for Plan { study, base, budget } in plans {
            for arm in study.arms {
                let key = base.key(arm);
                if runs.iter().all(|(other, of, _)| (other, *of) != (&key, seed)) {
                    let mut own = Config { seed, ..config.clone() };
                    base.apply(&mut own);
                    (arm.change)(&mut own);
                    own.max_gaussians = budget.unwrap_or(own.max_gaussians);
                    runs.push((key, seed, own));
                }
            }
        }
    }
    runs
}

fn folder(args: &Args, key: &str, seed: u64) -> PathBuf {
    args.output.join("runs").join(format!("{key}-{seed}"))
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

/// Trains with `config` in a process of its own, which leaves nothing behind in this one; unless that has been done.
fn train(args: &Args, folder: &Path, config: &Config) -> anyhow::Result<()> {
    let settings = folder.with_extension("json");
    let is_done = folder.join("eval.json").is_file()
        && read_json::<Config>(&settings, "remove it").is_ok_and(|before| before == *config);
    if is_done {
        return Ok(());
    }
    write_json(&settings, config)?;
    let log = std::fs::File::create(folder.with_extension("log")).context("the log of a run cannot be made")?;
    let program = std::env::current_exe().context("the path of this program is not known")?;
    let status = Command::new(program)
        .arg("train")
        .arg(&args.capture)
        .args(["--overwrite", "--eval-every", "0", "-o"])
        .arg(folder)
        .arg("--config")
        .arg(&settings)
        .args(args.device.iter().flat_map(|device| ["--device", device]))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(log)
        .status()
        .context("`ivv train` cannot be started")?;
    anyhow::ensure!(status.success(), "{}: the run ended with {status}; see its .log", folder.display());
    Ok(())
}

/// The numbers of all runs of a study.
fn collect<'a>(args: &Args, study: &'a Study, base: Base, peripheral: &str) -> anyhow::Result<StudyResult<'a>> {
    let (mut arms, mut trunk) = (Vec::new(), None);
    for arm in study.arms {
        let mut values = vec![Vec::new(); study.measures.len()];
        for &seed in &args.seeds {
            let folder = folder(args, &base.key(arm), seed);
            let remedy = "remove the folder and run again";
            let eval: Value = read_json(&folder.join("eval.json"), remedy)?;
            let train: Value = read_json(&folder.join("train.json"), remedy)?;
            trunk = eval["lpips_trunk"].as_str().map(str::to_owned).or(trunk);
            for (values, measure) in values.iter_mut().zip(study.measures) {
                values.extend(value(*measure, &eval, &train, peripheral));
            }
        }
        arms.push(ArmResult { name: arm.name.to_owned(), values });
    }
    Ok(StudyResult { study, base, budget: None, trunk, arms })
}

/// A measure of one run; none where its capture does not allow it.
fn value(measure: Measure, eval: &Value, train: &Value, peripheral: &str) -> Option<f64> {
    match measure {
        Measure::FirstGaussians => train["plan"]["begin"]["gaussians"].as_f64(),
        Measure::LastGaussians => eval["gaussians"].as_f64(),
        Measure::Psnr => eval["psnr"].as_f64(),
        Measure::PsnrForeground => eval["psnr_foreground"].as_f64(),
        Measure::PsnrCovisible => eval["psnr_covisible"].as_f64(),
        Measure::PsnrPeripheral => mean(scores(eval, "psnr", |camera| camera == peripheral)?),
        Measure::PsnrPeripheralCovisible => mean(scores(eval, "psnr_covisible", |camera| camera == peripheral)?),
        Measure::PsnrInner => mean(scores(eval, "psnr", |camera| camera != peripheral)?),
        Measure::PsnrInnerWorst => {
            scores(eval, "psnr", |camera| camera != peripheral)?.into_iter().min_by(f64::total_cmp)
        }
        Measure::Lpips => eval["lpips"].as_f64(),
        Measure::Seconds => train["seconds_stepping"].as_f64(),
        Measure::SceneBytes => eval["bytes"].as_f64(),
        Measure::StepTime => train["seconds_per_step"].as_f64().map(|seconds| 1e3 * seconds),
        Measure::OffsetError => train["offset_error"].as_f64(),
    }
}

/// A score of the test views of some cameras, of those that have it.
fn scores(eval: &Value, score: &str, of: impl Fn(&str) -> bool) -> Option<Vec<f64>> {
    let views = eval["views"].as_array()?.iter();
    let some = views.filter(|view| view["camera"].as_str().is_some_and(&of));
    Some(some.filter_map(|view| view[score].as_f64()).collect())
}
