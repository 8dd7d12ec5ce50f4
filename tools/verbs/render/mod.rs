//! `ivv render`.

mod picture;
pub mod video;

use crate::run::constants::{ConstantArgs, KnobArgs};
use crate::run::device::DeviceArgs;
use crate::run::files::make_folder;
use crate::run::source::{Gaussians, LoadedScene, Source, is_run};
use crate::run::views::{ViewArgs, clip_time};
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::progress::Progress;
use crate::ui::screen::{alert, print_json};
use crate::verbs::render::picture::{Format, check_finite};
use crate::verbs::render::video::{Film, PathArgs, VideoJob};
use ivv::Constants;
use ivv::internals::formats::{Clock, FourDgs};
use ivv::internals::scene::View;
use ivv::internals::sound::rig::Rig;
use ivv::internals::stage::{Destination, FrameReport, Outputs, Renderer};
use ivv::internals::train::Run;
use ivv::internals::words::count;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(clap::Args)]
pub struct Args {
    /// The folder of a run, for its scene, views and rendering constants; or a scene file of any format.
    #[arg(value_name = "RUN|SCENE")]
    source: PathBuf,
    /// Views to render: a cameras file (JSON, as of `ivv inspect --cameras`), a transforms.json, or a capture, as a COLMAP project.
    #[arg(long, conflicts_with_all = ["path", "capture"])]
    cameras: Option<PathBuf>,
    /// The capture of the scene, for its views and, with --path, its clock; for a run, where its capture is now.
    #[arg(long)]
    capture: Option<PathBuf>,
    #[command(flatten)]
    views: ViewArgs,
    /// Shows a dynamic scene at this normalised time, 0 to 1, from every view. A static camera is rendered once.
    #[arg(long, value_parser = clip_time, allow_negative_numbers = true)]
    time: Option<f64>,
    /// The folder for the pictures; with --path or --orbit the video: .mp4, .mov or .mkv (by ffmpeg), or .y4m.
    #[arg(short, long)]
    output: PathBuf,
    /// Formats of the pictures: png (colour), exr (all outputs as named channels), safetensors (all outputs).
    #[arg(long, value_delimiter = ',', default_value = "png", conflicts_with = "film")]
    format: Vec<Format>,
    #[command(flatten)]
    film: PathArgs,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    constants: ConstantArgs,
    #[command(flatten)]
    knobs: KnobArgs,
}

#[derive(serde::Serialize)]
struct ViewReport {
    name: String,
    width: u32,
    height: u32,
    seconds: f64,
    #[serde(flatten)]
    frame: FrameReport,
}

impl Args {
    fn clock(&self, source: &Source, run: Option<&Run>) -> ivv::Result<Option<Clock>> {
        match (run, &self.capture) {
            (Some(run), _) => Ok(Some(Clock { fps: run.held.fps, frames: run.held.frames })),
            (None, Some(capture)) => {
                let Rig { fps, n_frames, .. } = Rig::open_with(capture, &self.views.settings())?;
                Ok(Some(Clock { fps, frames: n_frames }))
            }
            (None, None) => Ok(source.clip.as_ref().map(FourDgs::clock)),
        }
    }

    /// The span of the clip in normalised time, if the views come from the scene's file: those are starting places, whatever their times.
    fn span_of_file(&self, source: &Source, run: Option<&Run>) -> Option<[f64; 2]> {
        let is_of_file = run.is_none() && self.capture.is_none() && self.cameras.is_none();
        let frames = source.clip.as_ref().filter(|_| is_of_file)?.clock().frames.max(1);
        Some([0.0, f64::from(frames - 1) / f64::from(frames)])
    }

    /// The video that the options ask for; `None` if they ask for views.
    fn film(&self, source: &Source, run: Option<&Run>) -> anyhow::Result<Option<Film>> {
        let Some(path) = &self.film.path else {
            let span = self.span_of_file(source, run);
            let orbit = |seconds| Film::around(&self.film, seconds, &self.views(source)?, span, self.time);
            return self.film.orbit.map(orbit).transpose();
        };
        let remedy = "leave them out, or use --orbit";
        anyhow::ensure!(!self.views.choose(), "--camera and --frames choose views, and --path has its own; {remedy}");
        match run {
            Some(run) => self.views.agree_with(run)?,
            None if self.capture.is_none() => self.views.need_no_capture("--capture is not given")?,
            None => {}
        }
        let background = source.look.background.unwrap_or_default();
        Ok(Some(Film::along(&self.film, path, self.clock(source, run)?, self.time, background)?))
    }

    fn views(&self, source: &Source) -> anyhow::Result<Vec<View>> {
        let mut views = match (&self.cameras, &self.capture) {
            (Some(cameras), _) => self.views.of_cameras(cameras, self.time)?,
            (None, capture) if is_run(source.path) => self.views.of_run(source.path, capture.as_deref(), self.time)?,
            (None, Some(capture)) => self.views.of_capture(capture, self.time)?,
            (None, None) => {
                let views = source.clip.as_ref().map_or(Ok(Vec::new()), FourDgs::views)?;
                anyhow::ensure!(
                    !views.is_empty(),
                    "{} is a scene without cameras; give --capture or --cameras, or --path for a video, or the folder of \
                     its run",
                    source.path.display()
                );
                self.views.need_no_capture("the views are those of the file")?;
                views
            }
        };
        if let Some(time) = self.time {
            views.iter_mut().for_each(|view| (view.time, view.time_offset) = (time, 0.0));
        }
        Ok(views)
    }
}

/// Refuses views of a dynamic scene at times outside of its clip.
fn within_clip(cameras: &Path, loaded: &LoadedScene<Gaussians>, views: &[View]) -> ivv::Result<()> {
    let outside = |view: &&View| !loaded.splats.are_static() && !(0.0..=1.0).contains(&view.time);
    views.iter().find(outside).map_or(Ok(()), |view| {
        let reason = format!("expected a time within the clip, 0 to 1, found {}", view.time);
        let remedy = "correct `time` of this view, or give --time for all views";
        Err(ivv::Error::data(cameras, format!("view `{}`", view.name.escape_debug()), reason, remedy))
    })
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let path = args.source.as_path();
    let run = is_run(path).then(|| Run::read(path)).transpose()?;
    // Report errors of options before reading a scene.
    args.knobs.on(args.constants.over(Constants::default())?)?;
    let stop = Stop::listen()?;
    let source = Source::open(path)?;
    let constants = args.knobs.on(args.constants.over(source.look.constants)?)?;
    if let Some(film) = args.film(&source, run.as_ref())? {
        let loaded = source.seen()?;
        let job = VideoJob { output: &args.output, args: &args.film, device: &args.device, constants, stop: &stop };
        return video::run(&film, loaded, &job, json);
    }
    let views = args.views(&source)?;
    let loaded = source.seen()?;
    within_clip(args.cameras.as_deref().unwrap_or(path), &loaded, &views)?;
    make_folder(&args.output)?;
    let gpu = args.device.open()?;
    let outputs = if args.format.iter().all(|f| *f == Format::Png) { Outputs::Color } else { Outputs::All };
    let mut renderer = loaded.splats.renderer(gpu.clone(), constants)?;
    let reports = write_views(args, &mut renderer, &views, outputs, &stop)?;
    let bad = reports.iter().map(|r| r.frame.bad_gaussians).max().unwrap_or(0);
    if bad > 0 {
        alert!("{} not drawn: their parameters are not finite", count(bad, "Gaussian"));
    }
    if json {
        let (caps, peak_bytes) = (gpu.caps(), gpu.device().memory().1);
        print_json(&json!({ "device": caps, "constants": constants, "views": reports, "peak_bytes": peak_bytes }))?;
    }
    Ok(())
}

fn write_views(
    args: &Args,
    renderer: &mut Renderer,
    views: &[View],
    outputs: Outputs,
    stop: &Stop,
) -> anyhow::Result<Vec<ViewReport>> {
    let mut progress = Progress::new("view", views.len());
    let mut reports = Vec::new();
    let mut begun = Instant::now();
    renderer.stream(views.iter().cloned(), outputs, Destination::Host, |view, frame, report| {
        let seconds = begun.elapsed().as_secs_f64();
        check_finite(&frame, view)?;
        args.format.iter().try_for_each(|format| format.write(&frame, &args.output, view))?;
        let FrameReport { gaussians, intersections, .. } = &report;
        let (name, ms) = (&view.name, 1e3 * seconds);
        progress.step(&format!("{name}, {gaussians} Gaussians, {intersections} intersections, {ms:.1} ms"));
        reports.push(ViewReport {
            name: view.name.clone(),
            width: view.intrinsics.width,
            height: view.intrinsics.height,
            seconds,
            frame: report,
        });
        begun = Instant::now();
        if stop.is_asked() && reports.len() < views.len() {
            return Err(Interrupted("the files written so far are complete").into());
        }
        anyhow::Ok(true)
    })?;
    Ok(reports)
}
