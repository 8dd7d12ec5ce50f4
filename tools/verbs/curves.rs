//! `ivv curves`: quality against time, preset by preset.

use crate::apart::{distinct, held, named, train_apart};
use crate::files::{make_folder, read_json, write_json};
use crate::screen::{out, say};
use crate::settings::patch;
use anyhow::Context;
use ivv::files::write_atomic;
use ivv::scene::capture::Capture;
use ivv::study::{Frontier, PresetCurve, Reached, chart};
use ivv::train::{CaptureSummary, Config, Preset, merge};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Options of `ivv curves`.
#[derive(clap::Args)]
pub struct Args {
    /// Captures, with test cameras.
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// The folder for the runs, curves.md, curves.json and curves.svg. Runs that are there are not repeated.
    #[arg(short, long)]
    output: PathBuf,
    /// Seconds of training, start-up included, after which presets are compared. Runs become longer until one has taken the
    /// longest of them.
    #[arg(long, value_delimiter = ',', default_value = "30,60,120,300,600")]
    seconds: Vec<f64>,
    /// Steps of the shortest run; each further one has twice as many.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    shortest: u64,
    /// Presets to compare, by name or path.
    #[arg(long, value_delimiter = ',', default_value = "exact,balanced,fast,small")]
    presets: Vec<String>,
    /// Seeds. Every preset runs once with each, for each length.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    seeds: Vec<u64>,
    /// Weights of LPIPS, as tools/lpips_weights.py makes them; without them LPIPS is not measured.
    #[arg(long)]
    lpips_weights: Option<PathBuf>,
    /// One setting of all presets, KEY=VALUE; may be given several times.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Vulkan device, as `ivv train` takes it.
    #[arg(long)]
    device: Option<String>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(!args.seeds.is_empty() && !args.presets.is_empty(), "--seeds and --presets need at least one each");
    distinct(&args.seeds)?;
    let is_time = |seconds: &f64| seconds.is_finite() && *seconds > 0.0;
    anyhow::ensure!(args.seconds.iter().all(is_time), "--seconds: expected numbers above 0");
    let longest = args.seconds.iter().copied().reduce(f64::max).context("--seconds needs at least one number")?;
    let presets: Vec<(String, Config)> =
        args.presets.iter().map(|name| settings(args, name)).collect::<anyhow::Result<_>>()?;
    let named_alike =
        presets.iter().enumerate().find(|(at, (name, _))| presets[..*at].iter().any(|(other, _)| other == name));
    if let Some((_, (name, _))) = named_alike {
        anyhow::bail!("--presets: two are called {name}, and runs are named after their preset; rename one");
    }
    // All are looked at before the first is trained on.
    let captures = named(&args.captures)?;
    let summary = |(_, path): &(String, &Path)| {
        let held = held(&Capture::open(path)?);
        anyhow::ensure!(held[0].test_images > 0, "{}: the capture has no test image; see `ivv check`", path.display());
        Ok(held)
    };
    let all_held = captures.iter().map(summary).collect::<anyhow::Result<Vec<_>>>()?;
    let mut frontiers = Vec::new();
    for ((name, capture), held) in captures.into_iter().zip(&all_held) {
        let folder = args.output.join(&name);
        make_folder(&folder)?;
        let curves = curves(args, (capture, held), &folder, &presets, longest)?;
        frontiers.push(Frontier { capture: name, times: args.seconds.clone(), curves });
        tell(args, &frontiers)?;
    }
    if json {
        out!("{}", serde_json::to_string_pretty(&frontiers)?);
    } else {
        out!("{}\n{}", markdown(args, &frontiers), args.output.join("curves.md").display());
    }
    Ok(())
}

/// The name of a preset and its settings.
fn settings(args: &Args, name: &str) -> anyhow::Result<(String, Config)> {
    let preset = Preset::find(name)?;
    let mut value = serde_json::to_value(Config::default())?;
    merge(&mut value, &preset.settings);
    for set in &args.set {
        merge(&mut value, &patch(set).with_context(|| format!("--set {set}"))?);
    }
    let mut config: Config = serde_json::from_value(value).with_context(|| name.to_owned())?;
    // Measured, and no part of the loss.
    config.loss.lpips = 0.0;
    if let Some(weights) = &args.lpips_weights {
        anyhow::ensure!(weights.is_file(), "--lpips-weights {}: there is no such file", weights.display());
        config.loss.lpips_weights = Some(std::fs::canonicalize(weights)?);
    }
    config.check().map_err(|fault| anyhow::anyhow!("{name}: {fault}"))?;
    Ok((preset.id.name, config))
}

/// Trains presets for twice as long each time, each until a run has taken `longest` seconds with every seed. They take turns: what
/// else the machine does meets all alike.
fn curves(
    args: &Args,
    (capture, held): (&Path, &[CaptureSummary; 2]),
    folder: &Path,
    presets: &[(String, Config)],
    longest: f64,
) -> anyhow::Result<Vec<PresetCurve>> {
    let mut curves: Vec<PresetCurve> =
        presets.iter().map(|(preset, _)| PresetCurve { preset: preset.clone(), lengths: Vec::new() }).collect();
    let mut going: Vec<usize> = (0..presets.len()).collect();
    let mut steps = args.shortest;
    while !going.is_empty() {
        going.iter().for_each(|&k| curves[k].lengths.push(Vec::new()));
        for (&seed, &k) in args.seeds.iter().flat_map(|seed| going.iter().map(move |k| (seed, k))) {
            let (preset, config) = &presets[k];
            say!("{}, {preset}, {steps} steps, seed {seed}", capture.display());
            let run = folder.join(format!("{preset}-{steps}-{seed}"));
            let own = Config { seed, steps, ..config.clone() };
            train_apart((capture, held), &run, &own, args.device.as_deref())?;
            curves[k].lengths.last_mut().context("no length was begun")?.push(reached(&run, seed, steps)?);
        }
        going.retain(|&k| curves[k].lengths.last().is_some_and(|runs| runs.iter().any(|run| run.seconds < longest)));
        steps = steps.checked_mul(2).context("--seconds asks for a run of more steps than can be counted")?;
    }
    Ok(curves)
}

/// What a run that has ended came to.
fn reached(run: &Path, seed: u64, steps: u64) -> anyhow::Result<Reached> {
    let remedy = "remove the folder and run again";
    let eval: Value = read_json(&run.join("eval.json"), remedy)?;
    let train: Value = read_json(&run.join("train.json"), remedy)?;
    let number = |of: &Value, key: &str| {
        of[key].as_f64().with_context(|| format!("{}: its scores lack `{key}`; {remedy}", run.display()))
    };
    let whole = |of: &Value, key: &str| {
        of[key].as_u64().with_context(|| format!("{}: its scores lack `{key}`; {remedy}", run.display()))
    };
    Ok(Reached {
        seed,
        steps,
        seconds: number(&train, "seconds")?,
        psnr: number(&eval, "psnr")?,
        lpips: eval["lpips"].as_f64(),
        gaussians: whole(&eval, "gaussians")?,
        bytes: whole(&eval, "bytes")?,
    })
}

fn markdown(args: &Args, frontiers: &[Frontier]) -> String {
    let seeds: Vec<String> = args.seeds.iter().map(u64::to_string).collect();
    let mut text = format!(
        "# Quality against time\n\n{}, start-up included, on this machine; presets took turns. Each run is as long as its \
         schedule; what lies between two lengths is interpolated over the logarithm of the time. A preset is beaten where another one has at most its \
         bytes and more than 0.05 dB on top of its PSNR, or as much PSNR with less than 98 % of the bytes.\n",
        match seeds.as_slice() {
            [one] => format!("Seed {one}"),
            all => format!("Means of seeds {}", all.join(", ")),
        }
    );
    for frontier in frontiers {
        text += &format!("\n{}", frontier.markdown());
    }
    text
}

/// Writes what has been measured so far.
fn tell(args: &Args, frontiers: &[Frontier]) -> anyhow::Result<()> {
    let text = markdown(args, frontiers);
    write_json(&args.output.join("curves.json"), &frontiers)?;
    write_atomic(&args.output.join("curves.svg"), |to| to.write_all(chart(frontiers).svg().as_bytes()))?;
    write_atomic(&args.output.join("curves.md"), |to| to.write_all(text.as_bytes()))?;
    Ok(())
}
