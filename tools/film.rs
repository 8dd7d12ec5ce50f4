//! `ivv render --path`: a video of the way of a head, with what it hears.

use crate::device::DeviceArgs;
use crate::files::make_folder;
use crate::interrupt::{Interrupted, Stop};
use crate::progress::Progress;
use crate::render::check_finite;
use crate::screen::out;
use crate::synth::size;
use anyhow::Context;
use ivv::Constants;
use ivv::scene::{FlowModel, View, read_scene};
use ivv::sound::hrtf::HrtfSet;
use ivv::sound::path::{Convention, HeadPath, read_path};
use ivv::sound::pose::Pose;
use ivv::sound::render::{RenderConfig, Rendered, render};
use ivv::sound::rig::Rig;
use ivv::sound::scene_file::SoundScene;
use ivv::sound::wav::{Depth, write};
use ivv::stage::{Outputs, Renderer};
use ivv::video::{Made, Video, VideoSettings};
use ivv::words::count;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Frames per second where nothing says.
const FPS: f64 = 30.0;
/// Most frames of a video: a path in milliseconds, taken for seconds, would render for years.
const MOST_FRAMES: f64 = 5_184_000.0;
/// Size in pixels and vertical field of view in degrees where nothing says.
const SIZE: (u32, u32) = (640, 360);
const FOV: f64 = 50.0;

/// Options of a video along a path.
#[derive(clap::Args)]
pub struct PathArgs {
    /// Camera (head) path for a video: TUM, CSV (t,x,y,z,qx,qy,qz,qw), or the JSON of nerfstudio or nerfview. Times are
    /// seconds of the clip; positions are in the scene's frame.
    #[arg(long)]
    path: Option<PathBuf>,
    /// The axes of the path's poses. By default the head's in a CSV, OpenGL's in a JSON, OpenCV's in a TUM file.
    #[arg(long, requires = "path")]
    path_convention: Option<Axes>,
    /// The capture that the scene was trained on. Its frame rate and length map seconds to scene time. A dynamic scene needs
    /// it.
    #[arg(long, requires = "path")]
    capture: Option<PathBuf>,
    /// Frames per second. By default the path's, else the capture's, else 30.
    #[arg(long, requires = "path")]
    fps: Option<f64>,
    /// WIDTHxHEIGHT in pixels. By default the path's, else 640x360.
    #[arg(long, requires = "path", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Vertical field of view, degrees. By default the path's, else 50.
    #[arg(long, requires = "path")]
    fov: Option<f64>,
    /// Sound to hear along the path: the scene.json of `ivv sound localize`.
    #[arg(long, requires = "path")]
    sound: Option<PathBuf>,
    /// The ears: `sphere`, a SOFA file, or a folder of WAV files as SADIE's.
    #[arg(long, requires = "sound", default_value = "sphere")]
    hrtf: PathBuf,
    /// Sound that was rendered along the path before. It starts at second 0 of the clip.
    #[arg(long, requires = "path", conflicts_with = "sound")]
    wav: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Axes {
    /// x right, y down, z forward.
    Opencv,
    /// x right, y up, z backward.
    Opengl,
    /// As OpenGL.
    Openxr,
    /// x forward, y left, z up.
    Head,
}

impl From<Axes> for Convention {
    fn from(axes: Axes) -> Self {
        match axes {
            Axes::Opencv => Convention::OpenCv,
            Axes::Opengl => Convention::OpenGl,
            Axes::Openxr => Convention::OpenXr,
            Axes::Head => Convention::Head,
        }
    }
}

/// What a video shows, from when to when.
struct Film {
    path: HeadPath,
    fps: f64,
    size: (u32, u32),
    /// Focal length, pixels.
    focal: f64,
    /// Frames of the capture per second, and how many.
    clip: Option<(f64, u32)>,
    n_frames: usize,
}

impl Film {
    fn new(args: &PathArgs, path: &Path) -> anyhow::Result<Film> {
        let path = read_path(path, args.path_convention.map(Convention::from))?;
        let clip = args.capture.as_ref().map(|capture| Rig::open(capture)).transpose()?;
        let clip = clip.map(|rig| (rig.fps, rig.n_frames));
        let camera = path.camera;
        let fps = args.fps.or(camera.map(|camera| camera.fps)).or(clip.map(|clip| clip.0)).unwrap_or(FPS);
        anyhow::ensure!(fps.is_finite() && fps > 0.0, "--fps must be positive");
        let size = args.size.or(camera.map(|camera| (camera.width, camera.height))).unwrap_or(SIZE);
        let fov = args.fov.or(camera.map(|camera| camera.fov)).unwrap_or(FOV);
        anyhow::ensure!(fov > 0.0 && fov < 180.0, "--fov must lie between 0 and 180");
        let focal = 0.5 * f64::from(size.1) / (0.5 * fov.to_radians()).tan();
        // A head that stays sees the whole clip.
        let seconds = match (path.track.poses(), clip) {
            ([_], Some((fps, n_frames))) => f64::from(n_frames - 1) / fps,
            (poses, _) => poses[poses.len() - 1].t - poses[0].t,
        };
        let n_frames = seconds * fps + 1.0;
        if n_frames > MOST_FRAMES {
            let reason = format!(
                "the video would have {n_frames:.0} frames ({seconds} s at {fps} a second); at most {MOST_FRAMES} are \
                 rendered, a day at 60 a second"
            );
            let remedy = "give a shorter path, check that its times are in seconds, or give a lower --fps";
            return Err(ivv::Error::data(&args.path.clone().unwrap_or_default(), "", reason, remedy).into());
        }
        let n_frames = (n_frames + 1e-6) as usize;
        Ok(Film { path, fps, size, focal, clip, n_frames })
    }

    /// When the first frame is, seconds of the clip.
    fn start(&self) -> f64 {
        self.path.track.poses()[0].t
    }

    fn view(&self, frame: usize) -> View {
        let pose: Pose = self.path.track.at(self.start() + frame as f64 / self.fps);
        let (width, height) = self.size;
        let time = self.clip.map_or(0.0, |(fps, n_frames)| pose.t * fps / f64::from(n_frames));
        View {
            name: format!("{frame:05}"),
            width,
            height,
            fx: self.focal,
            fy: self.focal,
            cx: 0.5 * f64::from(width),
            cy: 0.5 * f64::from(height),
            world_to_camera: pose.world_to_camera(),
            time,
            time_offset: 0.0,
            flow_dt: self.clip.map_or(1.0, |(_, n_frames)| 1.0 / f64::from(n_frames)),
            background: [0.0; 3],
            flow_model: FlowModel::Velocity,
            next_world_to_camera: None,
        }
    }

    /// What is heard while the video lasts; silence where nothing is rendered.
    fn heard(&self, rendered: &Rendered) -> Vec<[f32; 2]> {
        let fs = f64::from(rendered.fs);
        let first = (self.start() * fs).round() as i64;
        let n = (self.n_frames as f64 / self.fps * fs).round() as i64;
        let sample = |at: i64| usize::try_from(at).ok().and_then(|at| rendered.samples.get(at)).copied();
        (first..first + n).map(|at| sample(at).unwrap_or_default()).collect()
    }
}

impl PathArgs {
    /// The path, where a video is asked for.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }
}

/// Renders the video to `output`.
pub fn run(
    args: &PathArgs,
    path: &Path,
    scene: &Path,
    output: &Path,
    device: &DeviceArgs,
    constants: Constants,
    json: bool,
) -> anyhow::Result<()> {
    let stop = Stop::listen()?;
    let film = Film::new(args, path)?;
    let splats = read_scene(scene)?.by_degree();
    let is_still = splats.motion.is_empty();
    anyhow::ensure!(
        is_still || film.clip.is_some(),
        "{} is dynamic; pass --capture to map seconds of the path to scene time",
        scene.display()
    );
    make_folder(output.parent().context("-o must name a video file")?)?;
    let (sound, report) = sound(args, &film, output)?;
    let gpu = device.open()?;
    let mut renderer = Renderer::new(gpu, &splats, constants)?;
    drop(splats);
    let settings = VideoSettings { width: film.size.0, height: film.size.1, fps: film.fps, sound };
    let mut video = Video::create(output, settings)?;
    let mut progress = Progress::new("frame", film.n_frames);
    let start = Instant::now();
    for index in 0..film.n_frames {
        if stop.is_asked() {
            return Err(Interrupted("no video was written").into());
        }
        let view = film.view(index);
        let (frame, report) = renderer.render(&view, Outputs::Color)?;
        check_finite(&frame, &view)?;
        video.push(&frame)?;
        progress.step(&format!("{}, {} Gaussians", view.name, report.gaussians));
    }
    let made = video.finish()?;
    let seconds = start.elapsed().as_secs_f64();
    if json {
        let (file, command) = match &made {
            Made::Whole(file) => (file, None),
            Made::Pictures { file, command } => (file, command.as_ref()),
        };
        let line = serde_json::json!({
            "path": file, "frames": film.n_frames, "fps": film.fps, "seconds": seconds, "command": command, "sound": report,
        });
        out!("{line}");
        return Ok(());
    }
    let (Made::Whole(file) | Made::Pictures { file, .. }) = &made;
    out!("{}: {}, {} per second, in {seconds:.1} s", file.display(), count(film.n_frames, "frame"), film.fps);
    if let Made::Pictures { command: Some(command), .. } = &made {
        out!("ffmpeg is not installed; once it is, this command makes {}:\n  {command}", output.display());
    }
    Ok(())
}

/// A sound file, and the second of it where the video begins; with a report where it is rendered here.
type Sound = (Option<(PathBuf, f64)>, Option<ivv::sound::render::Report>);

fn sound(args: &PathArgs, film: &Film, output: &Path) -> anyhow::Result<Sound> {
    let Some(scene) = &args.sound else {
        return Ok((args.wav.clone().map(|wav| (wav, film.start())), None));
    };
    let hrtf = HrtfSet::open(&args.hrtf)?;
    let rendered = render(&SoundScene::read(scene)?, &film.path.track, &hrtf, &RenderConfig::default())?;
    let wav = output.with_extension("wav");
    write(&wav, &film.heard(&rendered), Depth::Int24)?;
    Ok((Some((wav, 0.0)), Some(rendered.report)))
}
