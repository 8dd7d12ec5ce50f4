//! `ivv sound bench`.

use super::render::ConfigArgs;
use crate::ui::screen::out;
use ivv::report::Table;
use ivv::sound::bench::{Ablation, Difference, Trade, ablation, compare, lateness, trade};
use ivv::sound::geometry::Mode;
use ivv::sound::hrtf::HrtfSet;
use ivv::sound::path::read_path;
use ivv::sound::render::render;
use ivv::sound::scene_file::SoundScene;
use ivv::sound::simulate::{Motion, simulate};
use ivv::sound::wav;
use ivv::words::count;
use std::path::{Path, PathBuf};

/// Seconds of the ablation's scene.
const SECONDS: f64 = 4.0;

/// Options of `ivv sound bench`.
#[derive(clap::Args)]
pub struct Args {
    /// The scene.json to measure, with --truth; without one the built-in scene is measured.
    #[arg(requires = "truth")]
    scene: Option<PathBuf>,
    /// The folder of `ivv sound synth` that tells the truth of the scene.
    #[arg(long, requires = "scene")]
    truth: Option<PathBuf>,
    /// Measure the built-in scene, as without a scene.json.
    #[arg(long, conflicts_with_all = ["scene", "truth"])]
    built_in: bool,
    /// The ears, which must be those of the truth.
    #[arg(long, default_value = "sphere")]
    hrtf: PathBuf,
    #[command(flatten)]
    config: ConfigArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match (&args.scene, &args.truth) {
        (Some(scene), Some(truth)) => measure(args, scene, truth, json),
        _ => built_in(args, json),
    }
}

fn measure(args: &Args, scene: &Path, truth: &Path, json: bool) -> anyhow::Result<()> {
    let config = args.config.config()?;
    let hrtf = HrtfSet::open(&args.hrtf)?;
    let scene = SoundScene::read(scene)?;
    let head = read_path(&truth.join("path.csv"), None)?.track;
    let file = truth.join("truth.wav");
    let channels = wav::read(&file)?.channels;
    let [left, right] = channels.as_slice() else {
        let reason = format!("expected two channels, found {}", channels.len());
        return Err(ivv::Error::data(&file, "", reason, "give the folder that `ivv sound synth` wrote").into());
    };
    let truth: Vec<[f32; 2]> = left.iter().zip(right).map(|(left, right)| [*left, *right]).collect();
    let rendered = render(&scene, &head, &hrtf, &config)?;
    // The synthetic scenes are in metres, also where localisation was not told so.
    let metric = SoundScene { metres_per_unit: scene.metres_per_unit.or(Some(1.0)), ..scene };
    let late = |t: f64| if config.mode == Mode::Physical { 0.0 } else { lateness(&metric, &head, t) };
    let scale = 10f32.powf(-rendered.report.gain_db as f32 / 20.0);
    let heard: Vec<[f32; 2]> = rendered.samples.iter().map(|frame| frame.map(|value| scale * value)).collect();
    let difference = compare(&heard, &truth, &hrtf, late)?;
    if json {
        out!("{}", serde_json::to_string(&difference)?);
    } else {
        let Difference { azimuth, azimuth_95, level, frames } = difference;
        out!(
            "azimuth {azimuth:.2} degrees off (95 %: {azimuth_95:.2}), level {level:.2} dB off, {}",
            count(frames, "frame")
        );
    }
    Ok(())
}

fn built_in(args: &Args, json: bool) -> anyhow::Result<()> {
    let open = || HrtfSet::open(&args.hrtf);
    let hrtf = open()?;
    let rows = ablation(&simulate(Motion::Walk, SECONDS, 1, &hrtf), &hrtf)?;
    let table = trade(open)?;
    if json {
        out!("{}", serde_json::json!({ "ablation": rows, "trade": table }));
        return Ok(());
    }
    out!("ears: {}\n", hrtf.meta.title);
    let row = |Ablation { direction, distance, error }| {
        let name = match (direction, distance) {
            (false, false) => "neither",
            (false, true) => "distance",
            (true, false) => "direction",
            (true, true) => "both",
        };
        vec![name.to_owned(), format!("{:.1}", error.azimuth), format!("{:.2}", error.level)]
    };
    let heads = ["rendered", "azimuth off, degrees", "level off, dB"];
    out!("{}", Table::new(&heads, rows.into_iter().map(row)).markdown());
    let row = |Trade { setting, error, splatter, spectrum, real_time }| {
        let [azimuth, level] = [error.azimuth, error.level].map(|off| format!("{off:.2}"));
        let costs = [format!("{splatter:.0}"), format!("{spectrum:.2}"), format!("{real_time:.0}")];
        [vec![setting.to_string(), azimuth, level], costs.to_vec()].concat()
    };
    let heads =
        ["setting", "azimuth off, degrees", "level off, dB", "splatter, dB", "filters off, dB", "times real time"];
    out!("{}", Table::new(&heads, table.into_iter().map(row)).markdown().trim_end());
    Ok(())
}
