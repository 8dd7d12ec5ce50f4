//! `ivv prepare`.

use crate::run::capture::{CaptureArgs, print_report};
use crate::run::files::word;
use crate::ui::fault::{self, FaultyCapture};
use crate::ui::progress::StageProgress;
use crate::ui::screen::{answer, out, print_json, say};
use anyhow::Context;
use ivv::internals::prepare::{
    Estimate, ImageFormat, PrepareSettings, Progress, Share, ShiftBy, Stage, Triangulate, estimate, forecast, prepare,
    prepare_share,
};
use ivv::internals::scene::capture::CaptureSettings;
use ivv::internals::words::count;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

#[derive(clap::Args)]
pub struct Args {
    /// Photos or a video of a static scene, or a folder of videos of one moment, whose cameras COLMAP finds; or a recording with its
    /// calibration: ImViD or COLMAP's calibration beside videos, N3V, MeetRoom, Google Immersive, Dynamic3DGaussians,
    /// transforms.json, plain COLMAP, LLFF, OpenSfM, Pose2Sim, anipose, EasyMocap, caliscope, or a capture folder.
    source: PathBuf,
    /// The capture folder. Run the same command again to continue an interrupted preparation.
    #[arg(short, long)]
    output: PathBuf,
    /// The folder of the footage if it is not beside the calibration; for plain COLMAP, the folder of images inside the source.
    #[arg(long)]
    footage: Option<PathBuf>,
    /// Frames to skip at the start of a camera's footage, as `cam02=3,cam05=-1`. `timecode` and `sound` find them in the videos.
    #[arg(long, value_delimiter = ',', value_name = "CAMERA=FRAMES|timecode|sound")]
    shift: Vec<String>,
    /// For videos without calibration of cameras that move together on one rig: COLMAP places every N-th frame.
    #[arg(long, value_name = "N")]
    moving: Option<u32>,
    /// Size of the images relative to the source's, at most 1.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Format of new images. Images that need no change are copied as they are.
    #[arg(long, value_parser = ["png", "jpg"], default_value = "png")]
    format: String,
    /// Frames per second of the capture: by default the lowest of the videos. For image sequences, how they were taken; by default
    /// 30.
    #[arg(long)]
    fps: Option<f64>,
    /// Frames for which COLMAP triangulates points: none, the reference frame, or every N-th. By default every one if there are no
    /// points.
    #[arg(long, num_args = 1..=2, value_names = ["none|reference|every", "N"])]
    triangulate: Option<Vec<String>>,
    /// Photographs of the same place, taken at another time, for the static scene. If the source has cameras, a capture of them in
    /// its world.
    #[arg(long = "static", value_name = "PHOTOS")]
    photos: Option<PathBuf>,
    /// A folder of masks: CAMERA/FRAME.png for footage, NAME.png for photographs. Bright pixels count, black ones are left out.
    #[arg(long, value_name = "FOLDER")]
    masks: Option<PathBuf>,
    /// Estimates optical flow. dis: OpenCV's DIS, in Python.
    #[arg(long, value_parser = ["dis"])]
    flow: Option<String>,
    #[command(flatten)]
    read: CaptureArgs,
    /// Replaces a capture that was made with other settings, or not by `ivv prepare`.
    #[arg(long)]
    force: bool,
    /// Only estimates time and disk space: prepares four frames from the middle, measures, and removes them.
    #[arg(long)]
    plan: bool,
    /// Does one stage alone: cameras, images, points or flow. The same command without this completes the capture.
    #[arg(long, conflicts_with_all = ["plan", "force"], value_name = "cameras|images|points|flow", value_parser = word::<Stage>)]
    only: Option<Stage>,
    /// With `--only`: does the K-th of N parts of the stage. Machines that share a file system can do one each at the same time.
    #[arg(long, value_name = "K/N", requires = "only", value_parser = part)]
    part: Option<Share>,
    /// Most threads and concurrent programs. By default the number of cores.
    #[arg(long)]
    threads: Option<usize>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let settings = settings(args)?;
    let forecast = forecast(&settings)?;
    if let Some(forecast) = &forecast {
        say!("{forecast}");
        forecast.notes.iter().for_each(|note| say!("note: {note}"));
    }
    let progress_line = Mutex::new(StageProgress::new());
    let report = |progress: Progress| {
        // A thread that panicked while it showed progress is no reason to stop.
        progress_line.lock().unwrap_or_else(std::sync::PoisonError::into_inner).show(&progress);
    };
    if args.plan {
        anyhow::ensure!(
            forecast.is_none(),
            "--plan: expected a source with cameras, found pictures that COLMAP places first (see above); prepare one frame \
             (--frames 1), and plan with its cameras"
        );
        let estimate = estimate(&settings, &report)?;
        drop(progress_line);
        return print_plan(&estimate, json);
    }
    if let Some(only) = args.only {
        let share = args.part.unwrap_or(Share::ALL);
        prepare_share(&settings, only, share, &report)?;
        drop(progress_line);
        print_share(only, share, json);
        return Ok(());
    }
    let prepared = prepare(&settings, &report)?;
    drop(progress_line);
    let faulty = FaultyCapture::of(prepared.report.n_faults);
    if json {
        fault::results(&prepared, faulty.as_ref())?;
    } else {
        let format = if prepared.source_format.is_empty() { "unknown format" } else { prepared.source_format };
        out!("source:  {}, {format}", args.source.display());
        let is_known = |note: &&String| forecast.as_ref().is_some_and(|forecast| forecast.notes.contains(note));
        for note in prepared.notes.iter().filter(|note| !is_known(note)) {
            out!("note:    {note}");
        }
        if !prepared.points.is_empty() {
            let counts = prepared.points.iter().map(|(_, n)| *n);
            let (least, most) = (counts.clone().min().unwrap_or(0), counts.clone().max().unwrap_or(0));
            let mean = counts.sum::<usize>() as f64 / prepared.points.len() as f64;
            out!("points:  {mean:.0} a frame, {least} to {most}, of {}", count(prepared.points.len(), "frame"));
        }
        print_report(&prepared.report);
    }
    faulty.map_or(Ok(()), Err)
}

fn print_share(stage: Stage, share: Share, json: bool) {
    let (part, of) = (share.part + 1, share.of);
    let line = serde_json::json!({ "stage": stage, "part": part, "parts": of });
    let done = if of == 1 { "done".to_owned() } else { format!("part {part} of {of} is done") };
    let next = "next: the remaining stages, then the same command without --only";
    answer(json, &line, format_args!("{}: {done}\n{next}", line["stage"].as_str().unwrap_or_default()));
}

fn part(word: &str) -> Result<Share, String> {
    let parsed = word.split_once('/').and_then(|(part, of)| Some((part.parse::<u32>().ok()?, of.parse::<u32>().ok()?)));
    match parsed {
        Some((part, of)) if (1..=of).contains(&part) => Ok(Share { part: part - 1, of }),
        _ => Err("expected K/N with K from 1 to N, such as 2/4".to_owned()),
    }
}

fn print_plan(estimate: &Estimate, json: bool) -> anyhow::Result<()> {
    if json {
        return print_json(estimate);
    }
    let Estimate { cameras, frames, sampled, threads, stages } = estimate;
    out!("{}, {}; from {sampled} frames, with {threads} threads:", count(*cameras, "camera"), count(*frames, "frame"));
    let row = |stage: &str, seconds: f64, bytes: u64| {
        let time = match seconds {
            s if s < 120.0 => format!("{s:.0} s"),
            s if s < 7200.0 => format!("{:.0} min", s / 60.0),
            s => format!("{:.1} h", s / 3600.0),
        };
        out!("{stage:<8} {time:>9} {:>12.1} MB", bytes as f64 / 1e6);
    };
    stages.iter().for_each(|stage| row(stage.stage, stage.seconds, stage.bytes));
    row("all", stages.iter().map(|stage| stage.seconds).sum(), stages.iter().map(|stage| stage.bytes).sum());
    Ok(())
}

fn settings(args: &Args) -> anyhow::Result<PrepareSettings> {
    let defaults = PrepareSettings::new(&args.source, &args.output);
    let (shift_by, shifts) = match args.shift.as_slice() {
        [word] if word == "timecode" => (ShiftBy::Timecode, BTreeMap::new()),
        [word] if word == "sound" => (ShiftBy::Sound, BTreeMap::new()),
        words => (ShiftBy::Given, words.iter().map(|word| shift(word)).collect::<anyhow::Result<_>>()?),
    };
    let capture = args.read.settings();
    let capture = CaptureSettings { fps: args.fps.unwrap_or(capture.fps), ..capture };
    Ok(PrepareSettings {
        footage: args.footage.clone(),
        frames: capture.frames,
        shifts,
        shift_by,
        fps: args.fps,
        moving: args.moving,
        scale: args.scale,
        format: if args.format == "jpg" { ImageFormat::Jpeg } else { ImageFormat::Png },
        triangulate: args.triangulate.as_deref().map(triangulate).transpose()?,
        photos: args.photos.clone(),
        masks: args.masks.clone(),
        flow: args.flow.is_some(),
        capture,
        force: args.force,
        threads: args.threads.unwrap_or(defaults.threads).max(1),
        ..defaults
    })
}

fn shift(word: &str) -> anyhow::Result<(String, f64)> {
    let parsed = word.rsplit_once('=').and_then(|(name, frames)| Some((name.to_owned(), frames.parse::<f64>().ok()?)));
    let parsed = parsed.filter(|(_, frames)| frames.abs() < 1e9);
    parsed.with_context(|| format!("--shift takes CAMERA=FRAMES, or timecode or sound alone, not `{word}`"))
}

fn triangulate(words: &[String]) -> anyhow::Result<Triangulate> {
    let words = words.join(" ");
    match (words.as_str(), words.strip_prefix("every ")) {
        ("none", _) => Ok(Triangulate::None),
        ("reference", _) => Ok(Triangulate::Reference),
        ("every", _) => Ok(Triangulate::Every(1)),
        (_, Some(n)) => Ok(Triangulate::Every(n.parse().with_context(|| format!("--triangulate {words}"))?)),
        _ => anyhow::bail!("--triangulate takes none, reference or every N, not `{words}`"),
    }
}
