//! `ivv ablate`: the paper's ablations and other techniques, on captures.

use crate::apart::{distinct, held, named, train_apart};
use crate::files::{make_folder, read_json, write_json};
use crate::screen::{out, say};
use crate::settings::SettingArgs;
use anyhow::Context;
use clap::builder::PossibleValuesParser;
use glam::DVec3;
use ivv::files::write_atomic;
use ivv::report::statistics::{Estimate, mean};
use ivv::scene::capture::Capture;
use ivv::study::{Arm, ArmResult, Base, Measure, STUDIES, Study, StudyResult, standings};
use ivv::train::{CaptureSummary, Config, initialise};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `ivv ablate`.
#[derive(clap::Args)]
pub struct Args {
    /// Captures. With several, each has a folder of its own in OUTPUT, and OUTPUT/standings.md tells what they show together.
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// The folder for the runs, ablation.md, ablation.json and the plots. Runs that are there are not repeated.
    #[arg(short, long)]
    output: PathBuf,
    /// Seeds. Every setting runs once with each.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    seeds: Vec<u64>,
    /// Studies, separated by commas: initialisation, offsets, supervision, perceptual (needs --lpips-weights), required,
    /// quality, clips.
    #[arg(long, value_delimiter = ',', default_value = "initialisation,offsets,supervision")]
    studies: Vec<String>,
    /// The settings that each study starts from, separated by commas. given: those of --config and --set, LPIPS measured only.
    /// paper: these with the paper's weights and rates, one background and no backdrop, LPIPS in the loss where there are weights.
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
    distinct(&args.seeds)?;
    if let Some(weights) = &args.lpips_weights {
        anyhow::ensure!(weights.is_file(), "--lpips-weights {}: there is no such file", weights.display());
        config.loss.lpips_weights = Some(std::fs::canonicalize(weights)?);
    }
    let places = places(args)?;
    // All are opened before the first is trained on.
    let jobs: Vec<Job> = places.iter().map(|place| Job::new(args, place, &config)).collect::<anyhow::Result<_>>()?;
    let n_runs: usize = jobs.iter().map(|job| job.runs.len()).sum();
    let mut done = 0;
    let mut told = Vec::new();
    for job in &jobs {
        make_folder(&job.place.output.join("runs"))?;
        for (key, seed, own) in &job.runs {
            done += 1;
            say!("run {done} of {n_runs}: {}, {key}, seed {seed}", job.place.name);
            train_apart((&job.place.capture, &job.held), &job.folder(key, *seed), own, args.device.as_deref())?;
        }
        told.push(job.tell(args, &config, json)?);
    }
    if let [_, _, ..] = jobs.as_slice() {
        let (file, text) = (args.output.join("standings.md"), together(&jobs, &told));
        write_atomic(&file, |to| to.write_all(text.as_bytes()))?;
        if !json {
            out!("{text}\n{}", file.display());
        }
    }
    if json {
        let told: Vec<&Value> = told.iter().map(|told| &told.json).collect();
        let text = match told.as_slice() {
            [one] => serde_json::to_string_pretty(one)?,
            all => serde_json::to_string_pretty(all)?,
        };
        out!("{text}");
    }
    Ok(())
}

/// A capture and where its runs go.
struct Place {
    name: String,
    capture: PathBuf,
    output: PathBuf,
}

/// A place for each capture, by the name of its folder.
fn places(args: &Args) -> anyhow::Result<Vec<Place>> {
    let place = |(name, capture): (String, &Path)| {
        let output = if args.captures.len() > 1 { args.output.join(&name) } else { args.output.clone() };
        Place { name, capture: capture.to_owned(), output }
    };
    Ok(named(&args.captures)?.into_iter().map(place).collect())
}

/// What several captures show of each study together.
fn together(jobs: &[Job], told: &[Told]) -> String {
    let names: Vec<&str> = jobs.iter().map(|job| job.place.name.as_str()).collect();
    let mut text = "# What the captures show together\n".to_owned();
    let mut before: Vec<(&str, Base)> = Vec::new();
    for Plan { study, base, .. } in jobs.iter().flat_map(|job| &job.plans) {
        if before.contains(&(study.name, *base)) {
            continue;
        }
        before.push((study.name, *base));
        let of_arm =
            |arm: usize| jobs.iter().zip(told).map(|(job, told)| told.difference(job, study, *base, arm)).collect();
        let differences: Vec<_> = (1..study.arms.len()).map(of_arm).collect();
        text += &format!("\n{}", standings(study, &names, &differences));
        if *base == Base::Paper {
            text += "These runs have the paper's weights and rates.\n";
        }
    }
    text
}

/// What a capture showed: by study, by arm, the difference to its first.
struct Told {
    differences: Vec<Vec<Option<Estimate>>>,
    json: Value,
}

impl Told {
    /// That of an arm of `study`; none where the capture of `job` was left out of it.
    fn difference(&self, job: &Job, study: &Study, base: Base, arm: usize) -> Option<Estimate> {
        let index = job.plans.iter().position(|plan| plan.study.name == study.name && plan.base == base)?;
        self.differences[index][arm]
    }
}

/// The studies of a capture.
struct Job<'a> {
    place: &'a Place,
    held: [CaptureSummary; 2],
    peripheral: String,
    plans: Vec<Plan>,
    /// Key, seed and settings.
    runs: Vec<(String, u64, Config)>,
}

impl<'a> Job<'a> {
    fn new(args: &Args, place: &'a Place, config: &Config) -> anyhow::Result<Self> {
        let capture = Capture::open(&place.capture)?;
        let peripheral = match &args.peripheral {
            Some(name) => {
                let test = capture.cameras.iter().filter(|camera| camera.is_test).map(|camera| camera.name.as_str());
                let (known, path) = (test.collect::<Vec<_>>(), place.capture.display());
                anyhow::ensure!(
                    known.contains(&name.as_str()),
                    "--peripheral: expected a test camera of {path}, found {name}; it has {}",
                    known.join(", ")
                );
                name.clone()
            }
            None => peripheral(&capture).with_context(|| {
                format!("{}: expected test cameras, found none; name some in its capture.toml", place.capture.display())
            })?,
        };
        let plans = plans(args, place, &capture, config)?;
        let runs = runs(args, &plans, config);
        Ok(Job { place, held: held(&capture), peripheral, plans, runs })
    }

    /// Writes and, unless it is to be JSON, prints what the runs show.
    fn tell(&self, args: &Args, config: &Config, json: bool) -> anyhow::Result<Told> {
        let Place { capture, output, .. } = self.place;
        let mut text = format!("# Ablations on `{}`\n", capture.display());
        let (mut all, mut every) = (Vec::new(), Vec::new());
        for Plan { study, base, budget } in &self.plans {
            let result = StudyResult { budget: *budget, ..self.collect(args, study, *base)? };
            text += &format!("\n{}", result.markdown());
            let name = if *base == Base::Given { study.name.to_owned() } else { format!("{}-paper", study.name) };
            let file = output.join(format!("{name}.svg"));
            write_atomic(&file, |to| to.write_all(result.svg().as_bytes()))?;
            let measures: Vec<&str> = study.measures.iter().map(|measure| measure.title()).collect();
            let differences: Vec<_> = (0..result.arms.len()).map(|index| result.difference(index)).collect();
            all.push(json!({
                "study": study.name, "base": base, "max_gaussians": budget, "lpips_trunk": result.trunk,
                "measures": measures, "seeds": args.seeds, "arms": result.arms, "differences": differences,
            }));
            every.push(differences);
        }
        write_atomic(&output.join("ablation.md"), |to| to.write_all(text.as_bytes()))?;
        let all = json!({
            "capture": capture.to_string_lossy(), "peripheral_camera": self.peripheral, "settings": config, "studies": all,
        });
        write_json(&output.join("ablation.json"), &all)?;
        if !json {
            out!("{text}\n{}", output.join("ablation.md").display());
        }
        Ok(Told { differences: every, json: all })
    }
}

/// The studies that are asked for, from each base.
fn plans(args: &Args, place: &Place, capture: &Capture, config: &Config) -> anyhow::Result<Vec<Plan>> {
    let mut plans = Vec::new();
    for name in &args.studies {
        let known = STUDIES.iter().find(|study| study.name == name);
        let names: Vec<&str> = STUDIES.iter().map(|study| study.name).collect();
        let study =
            known.with_context(|| format!("--studies {name}: unknown study; choose from {}", names.join(", ")))?;
        if study.name == "perceptual" && config.loss.lpips_weights.is_none() {
            anyhow::bail!("--studies perceptual: needs the weights of LPIPS, give them with --lpips-weights");
        }
        if study.is_of_clips && !capture.is_rig_clip() {
            say!("{name}: left out for {}, which is no clip of several cameras", place.capture.display());
            continue;
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

/// The test camera whose lens is farthest from the middle of all lenses.
fn peripheral(capture: &Capture) -> Option<String> {
    let centers: Vec<DVec3> = capture.cameras.iter().map(|camera| camera.pose(0).center()).collect();
    let middle = centers.iter().sum::<DVec3>() / centers.len() as f64;
    let distance = |c: &DVec3| c.distance_squared(middle);
    let tests = capture.cameras.iter().zip(&centers).filter(|(camera, _)| camera.is_test);
    let farthest = tests.max_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
    farthest.map(|(camera, _)| camera.name.clone())
}

impl Job<'_> {
    fn folder(&self, key: &str, seed: u64) -> PathBuf {
        self.place.output.join("runs").join(format!("{key}-{seed}"))
    }

    /// The numbers of all runs of a study.
    fn collect<'b>(&self, args: &Args, study: &'b Study, base: Base) -> anyhow::Result<StudyResult<'b>> {
        let (mut arms, mut trunk) = (Vec::new(), None);
        for arm in study.arms {
            let mut values = vec![Vec::new(); study.measures.len()];
            for &seed in &args.seeds {
                let folder = self.folder(&base.key(arm), seed);
                let remedy = "remove the folder and run again";
                let eval: Value = read_json(&folder.join("eval.json"), remedy)?;
                let train: Value = read_json(&folder.join("train.json"), remedy)?;
                trunk = eval["lpips_trunk"].as_str().map(str::to_owned).or(trunk);
                for (values, measure) in values.iter_mut().zip(study.measures) {
                    values.extend(value(*measure, &eval, &train, &self.peripheral));
                }
            }
            arms.push(ArmResult { name: arm.name.to_owned(), values });
        }
        Ok(StudyResult { study, base, budget: None, trunk, arms })
    }
}

/// Noise that images have at least: half a step of 8 bits. Synthetic ones without noise do not change at all where nothing moves.
const LEAST_NOISE: f64 = 0.5 / 255.0;

/// A measure of one run; none where its capture does not allow it.
fn value(measure: Measure, eval: &Value, train: &Value, peripheral: &str) -> Option<f64> {
    match measure {
        Measure::FirstGaussians => train["plan"]["begin"]["gaussians"].as_f64(),
        Measure::LastGaussians => eval["gaussians"].as_f64(),
        Measure::Psnr => eval["psnr"].as_f64(),
        Measure::PsnrForeground => eval["psnr_foreground"].as_f64(),
        Measure::PsnrCovisible => eval["psnr_covisible"].as_f64(),
        Measure::PsnrWorst => scores(eval, "psnr", |_| true)?.into_iter().min_by(f64::total_cmp),
        Measure::PsnrAligned => eval["psnr_aligned"].as_f64(),
        Measure::Ssim => eval["ssim"].as_f64(),
        Measure::Flicker => Some(eval["flicker"].as_f64()? / eval["flicker_true"].as_f64()?.max(LEAST_NOISE)),
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
