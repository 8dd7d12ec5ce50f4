//! `ivv render --path` and `--orbit`: a video along a path, with its sound, or around a scene.

use crate::run::clip::start_in_run;
use crate::run::device::DeviceArgs;
use crate::run::files::make_folder;
use crate::run::source::{Gaussians, LoadedScene};
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::progress::Progress;
use crate::ui::screen::{alert, answer};
use crate::verbs::render::picture::check_finite;
use crate::verbs::synth::size;
use anyhow::Context;
use ivv::Constants;
use ivv::internals::formats::Clock;
use ivv::internals::scene::{FlowModel, Intrinsics, Orbit, View};
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::path::{HeadPath, read_path};
use ivv::internals::sound::pose::{HeadPose, PoseTrack};
use ivv::internals::sound::render::{RenderConfig, Rendered, render};
use ivv::internals::sound::scene_file::SoundScene;
use ivv::internals::sound::wav::{Depth, write};
use ivv::internals::stage::{Destination, Outputs};
use ivv::internals::train::Run;
use ivv::internals::video::{Made, Video, VideoSettings};
use ivv::internals::words::count;
use std::path::{Path, PathBuf};
use std::time::Instant;

const FPS: f64 = 30.0;
/// Most frames of a video: a path in milliseconds, taken for seconds, would render for years.
const MOST_FRAMES: f64 = 5_184_000.0;
/// Default size in pixels and vertical field of view in degrees.
const SIZE: (u32, u32) = (640, 360);
const FOV: f64 = 50.0;

#[derive(clap::Args)]
pub struct PathArgs {
    /// Camera path for a video, in seconds of the clip: TUM, CSV (t,x,y,z,qx,qy,qz,qw), or the JSON of nerfstudio or nerfview.
    #[arg(long, group = "film")]
    pub path: Option<PathBuf>,
    /// Makes a video that circles once around the point that the views look at. A dynamic scene plays once, unless --time is
    /// given.
    #[arg(long, group = "film", value_name = "SECONDS")]
    pub orbit: Option<f64>,
    /// Frames per second. By default the path's, else the capture's, else 30; with --orbit 30.
    #[arg(long, requires = "film")]
    fps: Option<f64>,
    /// WIDTHxHEIGHT in pixels. By default the path's, else 640x360; with --orbit that of the first view.
    #[arg(long, requires = "film", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Vertical field of view, degrees. By default the path's, else 50; with --orbit that of the first view.
    #[arg(long, requires = "film")]
    fov: Option<f64>,
    /// The sound scene for the path: the scene.json of `ivv sound localize`.
    #[arg(long, requires = "path")]
    sound: Option<PathBuf>,
    /// The ears: `sphere`, a SOFA file, or a folder of WAV files as SADIE's.
    #[arg(long, requires = "sound", default_value = "sphere")]
    hrtf: PathBuf,
    /// Sound of the path that was rendered before. It starts at second 0 of the clip.
    #[arg(long, requires = "path", conflicts_with = "sound")]
    wav: Option<PathBuf>,
}

/// The times of a dynamic scene in the frames.
#[derive(Clone, Copy)]
enum Times {
    Path,
    /// From one normalised time to another while the video lasts.
    Span(f64, f64),
    /// This normalised time in every frame.
    Fixed(f64),
}

pub struct Film {
    path: HeadPath,
    fps: f64,
    size: (u32, u32),
    /// Vertical, degrees.
    fov: f64,
    clip: Option<Clock>,
    times: Times,
    background: [f32; 3],
    n_frames: usize,
}

impl Film {
    /// Along the path in the file `path`, through `clip` or at `time`, over `background`.
    pub fn along(
        args: &PathArgs,
        path: &Path,
        clip: Option<Clock>,
        time: Option<f64>,
        background: [f32; 3],
    ) -> anyhow::Result<Film> {
        let head = read_path(path, None)?;
        let times = time.map_or(Times::Path, Times::Fixed);
        let fps = args.fps.or(head.camera.map(|camera| camera.fps)).or(clip.map(|clip| clip.fps)).unwrap_or(FPS);
        // A path of one pose shows the whole clip.
        let seconds = match (head.track.poses(), clip) {
            ([_], Some(Clock { fps, frames })) => f64::from(frames.saturating_sub(1)) / fps,
            (poses, _) => poses[poses.len() - 1].t - poses[0].t,
        };
        let n_frames = n_frames(seconds, fps).map_err(|reason| {
            let remedy = "give a shorter path, check that its times are in seconds, or give a lower --fps";
            ivv::Error::data(path, "", reason, remedy)
        })?;
        let size = head.camera.map_or(SIZE, |camera| (camera.width, camera.height));
        let fov = head.camera.map_or(FOV, |camera| camera.fov);
        Film { path: head, fps, size, fov, clip, times, background, n_frames }.with_lens(args)
    }

    /// Once around the point that `views` look at, in `seconds`, through `span` of normalised time or that of the views, or at
    /// `time`.
    pub fn around(
        args: &PathArgs,
        seconds: f64,
        views: &[View],
        span: Option<[f64; 2]>,
        time: Option<f64>,
    ) -> anyhow::Result<Film> {
        anyhow::ensure!(
            seconds.is_finite() && seconds > 0.0,
            "--orbit: expected a positive number of seconds, found {seconds}"
        );
        let orbit = Orbit::new(views).context(
            "--orbit: expected at least two views that look at one place, found none there; give a path with --path",
        )?;
        let of_views =
            || [f64::min, f64::max].map(|pick| views.iter().map(|view| view.time).reduce(pick).unwrap_or(0.0));
        let [first, last] = span.unwrap_or_else(of_views);
        let times = time.map_or(Times::Span(first, last), Times::Fixed);
        let fps = args.fps.unwrap_or(FPS);
        // The last frame comes one before the first again.
        let n_frames = n_frames(seconds, fps).map_err(|reason| anyhow::anyhow!("--orbit: {reason}"))?.max(3) - 1;
        let pose = |index: usize| {
            let p = orbit.at(index as f64 / n_frames as f64);
            HeadPose { t: index as f64 / fps, p, q: HeadPose::looking(orbit.middle - p, orbit.up) }
        };
        let path = HeadPath { track: PoseTrack::new((0..n_frames).map(pose).collect())?, camera: None };
        let view = &views[0];
        // Encoders want both sides even.
        let size = (view.intrinsics.width.max(2) & !1, view.intrinsics.height.max(2) & !1);
        let fov = 2.0 * (0.5 * f64::from(view.intrinsics.height) / view.intrinsics.fy).atan().to_degrees();
        let background = view.background;
        Film { path, fps, size, fov, clip: None, times, background, n_frames }.with_lens(args)
    }

    /// With the size and field of view of the options.
    fn with_lens(self, args: &PathArgs) -> anyhow::Result<Film> {
        let (size, fov) = (args.size.unwrap_or(self.size), args.fov.unwrap_or(self.fov));
        let fps = self.fps;
        anyhow::ensure!(fps.is_finite() && fps > 0.0, "--fps: expected a positive number, found {fps}");
        anyhow::ensure!(fov > 0.0 && fov < 180.0, "--fov: expected degrees above 0 and below 180, found {fov}");
        Ok(Film { size, fov, ..self })
    }

    /// The time of the first frame, seconds of the clip.
    fn start(&self) -> f64 {
        self.path.track.poses()[0].t
    }

    /// The normalised time of a frame, clamped to the clip, and whether it is within the clip.
    fn time(&self, frame: usize) -> (f64, bool) {
        match self.times {
            Times::Fixed(time) => (time, true),
            Times::Span(first, last) => {
                let done = frame as f64 / self.n_frames.saturating_sub(1).max(1) as f64;
                (first + done * (last - first), true)
            }
            Times::Path => self.clip.map_or((0.0, true), |Clock { fps, frames }| {
                let at = (self.start() + frame as f64 / self.fps) * fps;
                let last = f64::from(frames.saturating_sub(1));
                (at.clamp(0.0, last) / f64::from(frames.max(1)), (-1e-6..=last + 1e-6).contains(&at))
            }),
        }
    }

    /// Warns of frames outside of the clip; refuses a film without any other frame.
    fn within_clip(&self) -> anyhow::Result<()> {
        let n_outside = (0..self.n_frames).filter(|frame| !self.time(*frame).1).count();
        let Clock { fps, frames } = self.clip.unwrap_or(Clock { fps: FPS, frames: 1 });
        let clip = format!("the clip, which lasts from 0 to {:.3} s", f64::from(frames.saturating_sub(1)) / fps);
        let remedy = "check that they are in seconds of the clip, or give --time";
        anyhow::ensure!(
            n_outside < self.n_frames,
            "expected a path within {clip}, found none of its times there; {remedy}"
        );
        if n_outside > 0 {
            let frames = count(self.n_frames, "frame");
            alert!("{n_outside} of {frames} lie outside of {clip}; they show its first or last moment");
        }
        Ok(())
    }

    fn view(&self, frame: usize) -> View {
        let pose: HeadPose = self.path.track.at(self.start() + frame as f64 / self.fps);
        let (width, height) = self.size;
        let time = self.time(frame).0;
        View {
            name: format!("{frame:05}"),
            intrinsics: Intrinsics::of_fov(width, height, self.fov),
            pose: pose.world_to_camera(),
            time,
            time_offset: 0.0,
            flow_dt: self.clip.map_or(1.0, |clip| 1.0 / f64::from(clip.frames)),
            background: self.background,
            flow_model: FlowModel::Velocity,
            next_pose: None,
        }
    }

    /// The part of `rendered`, the sound of the capture, during the video; silence outside of it. The clip begins at second `start`.
    fn sound_of(&self, rendered: &Rendered, start: f64) -> Vec<[f32; 2]> {
        let fs = f64::from(rendered.fs);
        let first = ((start + self.start()) * fs).round() as i64;
        let n = (self.n_frames as f64 / self.fps * fs).round() as i64;
        let sample = |at: i64| usize::try_from(at).ok().and_then(|at| rendered.samples.get(at)).copied();
        (first..first + n).map(|at| sample(at).unwrap_or_default()).collect()
    }
}

/// Frames of a video of `seconds`, both ends included; an error if they are too many.
fn n_frames(seconds: f64, fps: f64) -> Result<usize, String> {
    let n_frames = seconds * fps + 1.0;
    if n_frames > MOST_FRAMES {
        return Err(format!(
            "the video would have {n_frames:.0} frames ({seconds} s at {fps} a second); at most {MOST_FRAMES} are rendered, a \
             day at 60 a second"
        ));
    }
    Ok((n_frames + 1e-6) as usize)
}

pub struct VideoJob<'a> {
    pub output: &'a Path,
    pub args: &'a PathArgs,
    pub device: &'a DeviceArgs,
    pub constants: Constants,
    pub stop: &'a Stop,
}

pub fn run(film: &Film, shown: LoadedScene<Gaussians>, job: &VideoJob, json: bool) -> anyhow::Result<()> {
    let VideoJob { output, args, device, constants, stop } = *job;
    let is_still = shown.splats.are_static();
    anyhow::ensure!(
        is_still || film.clip.is_some() || !matches!(film.times, Times::Path),
        "{} is dynamic; pass --capture to map seconds of the path to scene time, or --time",
        shown.file.display()
    );
    if !is_still {
        film.within_clip()?;
    }
    make_folder(output.parent().context("-o must name a video file")?)?;
    // Check it before the sound is rendered, which takes minutes.
    Video::check(output, film.size.into(), film.fps)?;
    let (sound, report) = sound(args, film, &shown.file, output)?;
    let gpu = device.open()?;
    let mut renderer = shown.splats.renderer(gpu, constants)?;
    let settings = VideoSettings { width: film.size.0, height: film.size.1, fps: film.fps, sound };
    let mut video = Video::create(output, settings)?;
    let mut progress = Progress::new("frame", film.n_frames);
    let start = Instant::now();
    let views = (0..film.n_frames).map(|index| film.view(index));
    renderer.stream(views, Outputs::Color, Destination::Host, |view, frame, report| -> anyhow::Result<bool> {
        if stop.is_asked() {
            return Err(Interrupted("no video was written").into());
        }
        check_finite(&frame, view)?;
        video.push(&frame)?;
        progress.step(&format!("{}, {} Gaussians", view.name, report.gaussians));
        Ok(true)
    })?;
    let (file, command) = match video.finish()? {
        Made::Whole(file) => (file, None),
        Made::Pictures { file, command } => (file, command),
    };
    let (path, n, fps, seconds) = (file.to_string_lossy(), film.n_frames, film.fps, start.elapsed().as_secs_f64());
    let mut text = format!("{path}: {}, {fps} per second, in {seconds:.1} s", count(n, "frame"));
    if let Some(command) = &command {
        let output = output.display();
        text += &format!("\nffmpeg is not installed; once it is, this command makes {output}:\n  {command}");
    }
    let line = serde_json::json!({
        "path": path, "frames": n, "fps": fps, "seconds": seconds, "command": command, "sound": report,
    });
    answer(json, &line, text);
    Ok(())
}

/// A sound file, and the second of it at which the video begins; with the report of a rendering.
type Sound = (Option<(PathBuf, f64)>, Option<ivv::internals::sound::render::Report>);

fn sound(args: &PathArgs, film: &Film, file: &Path, output: &Path) -> anyhow::Result<Sound> {
    let Some(scene) = &args.sound else {
        return Ok((args.wav.clone().map(|wav| (wav, film.start())), None));
    };
    let hrtf = HrtfSet::open(&args.hrtf)?;
    let scene = SoundScene::read(scene)?;
    let wav = output.with_extension("wav");
    let is_same = |other: &PathBuf| wav.exists() && wav.canonicalize().ok() == other.canonicalize().ok();
    let mut recordings = scene.sources.iter().filter_map(|source| source.wav.as_ref()).chain([&scene.mic.wav]);
    anyhow::ensure!(
        !recordings.any(is_same),
        "{}: the sound of the video would replace the recording that it is made of; choose another name with -o",
        wav.display()
    );
    // The times of another clip, such as that of --capture, are its own.
    let start = start_in_run(file, |run: &Run| film.clip == Some(Clock { fps: run.held.fps, frames: run.held.frames }));
    let of_capture = |pose: &HeadPose| HeadPose { t: start + pose.t, ..*pose };
    let head = PoseTrack::new(film.path.track.poses().iter().map(of_capture).collect())?;
    let rendered = render(&scene, &head, &hrtf, &RenderConfig::default())?;
    write(&wav, &film.sound_of(&rendered, start), Depth::Int24)?;
    Ok((Some((wav, 0.0)), Some(rendered.report)))
}
