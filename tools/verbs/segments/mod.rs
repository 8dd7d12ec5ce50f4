//! `ivv segments`: trains a long clip in segments, on one machine or as jobs of many.

use crate::run::appearance::Appearance;
use crate::run::capture::{self, CaptureArgs};
use crate::run::device::DeviceArgs;
use crate::run::files::{make_folder, read_json, write_json};
use crate::run::settings::SettingArgs;
use crate::run::subprocess::{train_command, wait_for};
use crate::run::workload::work;
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::screen::{self, answer, out, say};
use anyhow::{Context, ensure};
use ivv::internals::files::write_atomic;
use ivv::internals::formats::{PlyParts, read_ply, write_parts};
use ivv::internals::scene::Parts;
use ivv::internals::scene::capture::{Capture, CaptureSettings};
use ivv::internals::settings::Constants;
use ivv::internals::train::{Checkpoint, Config, Joined, Plan as TrainingPlan, Run, RunLock, Segments, Strategy};
use ivv::internals::words::count;
use serde_json::json;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Stdio;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Cuts a clip into segments that share frames, and writes the jobs that train them.
    Plan(Box<PlanArgs>),
    /// Trains the static scene, then the segments, then joins them; or does one of these jobs. Finished jobs are skipped.
    Run {
        /// A folder that `ivv segments plan` made.
        plan: PathBuf,
        /// One job alone: `base`, the static scene, or the number of a segment, from 0.
        #[arg(long, value_name = "base|N")]
        only: Option<String>,
        /// More options for `ivv train`, such as --device.
        #[arg(last = true)]
        options: Vec<OsString>,
    },
    /// Joins the scenes of the segments into PLAN/scene.ply, which `render`, `eval`, `export` and others take as that of a run.
    Join {
        /// A folder that `ivv segments plan` made, all of whose segments are trained.
        plan: PathBuf,
    },
}

#[derive(clap::Args)]
// Here `--frames` is the length of a segment, and a plan covers the whole clip.
#[command(mut_arg("max_frames", |of_capture| of_capture.visible_alias(None).hide(true)))]
struct PlanArgs {
    /// The capture, see `ivv check`.
    capture: PathBuf,
    /// The folder of the plan, and of all that its jobs write.
    #[arg(short, long)]
    output: PathBuf,
    /// Most frames of a segment: the memory of a training grows with them.
    #[arg(long, default_value_t = 60)]
    frames: u32,
    /// Makes segments as long as this memory, in bytes on host and device together, allows with `--max-gaussians`.
    #[arg(long, value_name = "BYTES", conflicts_with = "frames")]
    memory: Option<u64>,
    /// Frames that a segment shares with the next one, at most half of it. The segments cross-fade there.
    #[arg(long, default_value_t = 8)]
    overlap: u32,
    #[command(flatten)]
    settings: SettingArgs,
    #[command(flatten)]
    read: CaptureArgs,
    // For `--memory`.
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Plan(args) => plan(args, json),
        Verb::Run { plan, only, options } => Jobs::open(plan, json)?.run(only.as_deref(), options),
        Verb::Join { plan } => Jobs::open(plan, json)?.join(),
    }
}

fn plan(args: &PlanArgs, json: bool) -> anyhow::Result<()> {
    let config = args.settings.resolve()?;
    ensure!(
        config.density.strategy != Strategy::Mcmc,
        "density.strategy=mcmc: would change the static Gaussians, which segments take over as they are; leave it out"
    );
    ensure!(!config.holds_static, "holds_static: this would remove all static Gaussians; leave it out");
    let settings = CaptureSettings { background: config.background, ..args.read.settings() };
    let capture = capture::open(&args.capture, &settings)?;
    ensure!(
        capture.settings().frames.are_all(),
        "--max-frames: a plan is of a whole clip; leave it out, or `ivv prepare` the part of the clip that is wanted"
    );
    let (frames, cache_bytes) = match args.memory {
        Some(bytes) => longest_within(bytes, args, &capture, &config)?,
        None => (args.frames, None),
    };
    let mut segments = Segments::new(capture.n_frames, frames, args.overlap).map_err(anyhow::Error::msg)?;
    segments.cache_bytes = cache_bytes;
    // Joined segments have set the constants.
    let constants = Run::read(&args.output).map_or_else(|_| Constants::default(), |before| before.constants);
    let run = Run::new(&capture, constants)?;
    make_folder(&args.output)?;
    let is_plan = Segments::file(&args.output).is_file();
    let is_another = (!is_plan && Run::file(&args.output).is_file())
        || Segments::read(&args.output).is_ok_and(|before| before != segments)
        || Run::read(&args.output).is_ok_and(|before| before != run)
        || read_json::<Config>(&args.output.join("config.json"), "").is_ok_and(|before| before != config);
    if is_another {
        let remedy = "choose another folder with -o, or remove it";
        return Err(ivv::Error::data(&args.output, "", "holds another plan or a run", remedy).into());
    }
    segments.write(&args.output)?;
    run.write(&args.output)?;
    write_json(&args.output.join("config.json"), &config)?;
    let n = segments.segments.len();
    for (name, text) in [
        ("Snakefile", include_str!("Snakefile").replace("@N@", &n.to_string())),
        ("slurm.sh", include_str!("slurm.sh").replace("@LAST@", &(n - 1).to_string())),
    ] {
        write_atomic(&args.output.join(name), |to| to.write_all(text.as_bytes()))?;
    }
    let still = segments.still.of(segments.n_frames).len();
    if json {
        let frames = segments.n_frames;
        out!("{}", json!({ "segments": segments.segments, "frames": frames, "frames_of_what_rests": still }));
        return Ok(());
    }
    out!("{}: the static scene, with {} of {}", args.output.display(), count(still, "frame"), segments.n_frames);
    for (segment, [from, to]) in segments.segments.iter().enumerate() {
        out!("segment {segment}: frames {from} to {}", to - 1);
    }
    out!("next: ivv segments run {}", args.output.display());
    Ok(())
}

/// Frames of the longest segment that trains in `memory` bytes, and the bytes of its images.
fn longest_within(
    memory: u64,
    args: &PlanArgs,
    capture: &Capture,
    config: &Config,
) -> anyhow::Result<(u32, Option<u64>)> {
    let (work, limits) = work(capture, config, &*args.device.open()?, 0)?;
    let of_scene = TrainingPlan::new(&work, &limits).full;
    let of_frame = work.image_bytes.div_ceil(u64::from(capture.n_frames.max(1))).max(1);
    let frames = memory.saturating_sub(of_scene.bytes()) / of_frame;
    let least = u64::from(args.overlap.saturating_add(2).max(args.overlap.saturating_mul(2)).min(capture.n_frames));
    let (bytes, gaussians) = (of_scene.bytes(), count(of_scene.gaussians, "Gaussian"));
    ensure!(
        frames >= least,
        "--memory {memory}: expected at least {}: {gaussians} take {bytes} bytes, and the images of a frame {of_frame}; give \
         more, or allow fewer with --max-gaussians",
        bytes + least * of_frame,
    );
    let frames = u32::try_from(frames).unwrap_or(u32::MAX).min(capture.n_frames);
    Ok((frames, Some(u64::from(frames) * of_frame)))
}

/// The jobs of a plan: the static scene, which is `None`, and the segments.
struct Jobs<'a> {
    folder: &'a Path,
    segments: Segments,
    run: Run,
    json: bool,
}

impl<'a> Jobs<'a> {
    fn open(folder: &'a Path, json: bool) -> anyhow::Result<Self> {
        Ok(Jobs { folder, segments: Segments::read(folder)?, run: Run::read(folder)?, json })
    }

    fn all(&self) -> impl Iterator<Item = Option<usize>> {
        [None].into_iter().chain((0..self.segments.segments.len()).map(Some))
    }

    fn folder(&self, job: Option<usize>) -> PathBuf {
        self.folder.join(job.map_or_else(|| "base".to_owned(), |segment| format!("segment-{segment:04}")))
    }

    fn run(&self, only: Option<&str>, options: &[OsString]) -> anyhow::Result<()> {
        let stop = Stop::listen()?;
        let n = self.segments.segments.len();
        let job = match only {
            None => {
                self.all().try_for_each(|job| self.train(job, options, &stop))?;
                return self.join();
            }
            Some("base") => None,
            Some(word) => {
                let wrong = || format!("--only: expected base or a segment from 0 to {}, found {word}", n - 1);
                Some(word.parse().ok().filter(|segment| *segment < n).with_context(wrong)?)
            }
        };
        self.train(job, options, &stop)?;
        if self.json {
            out!("{}", json!({ "path": self.folder(job).to_string_lossy() }));
        }
        Ok(())
    }

    /// Does a job in a process of its own, which frees its memory at its end; resumes its run, or skips one that has ended.
    fn train(&self, job: Option<usize>, options: &[OsString], stop: &Stop) -> anyhow::Result<()> {
        let Segments { segments, still, .. } = &self.segments;
        let folder = self.folder(job);
        match job {
            None => say!("the static scene"),
            Some(job) => {
                say!("segment {job} of {}: frames {} to {}", segments.len(), segments[job][0], segments[job][1] - 1)
            }
        }
        if has_ended(&folder)? {
            say!("{}: is done", folder.display());
            return Ok(());
        }
        let mut command = train_command()?;
        command.arg("-o").arg(&folder);
        let mut options = options.to_vec();
        if Run::file(&folder).is_file() {
            command.arg("--resume");
            without_viewpoints(&mut options);
        } else {
            let frames = job.map_or(*still, |segment| self.segments.frames(segment));
            command.arg(&self.run.capture).arg("--config").arg(self.folder.join("config.json"));
            command.arg("--max-frames").arg(frames.to_string()).args(CaptureArgs::words(&self.run.capture_settings));
            if job.is_some() {
                command.arg("--base").arg(self.folder(None));
            }
            if !self.run.test_cameras.is_empty() {
                command.arg("--test-cameras").arg(self.run.test_cameras.join(","));
            }
        }
        let sets_cache = options.iter().any(|option| option.as_encoded_bytes().starts_with(b"--cache-bytes"));
        if let Some(bytes) = self.segments.cache_bytes.filter(|_| !sets_cache) {
            command.arg("--cache-bytes").arg(bytes.to_string());
        }
        if self.json {
            // Only the results of all jobs together are printed.
            command.stdout(Stdio::null());
        }
        if !screen::has_messages() {
            command.arg("--quiet");
        }
        let mut child = command.args(options).spawn().context("ivv train")?;
        let status = wait_for(&mut child, stop).context("ivv train")?;
        if stop.is_asked() || status.code() == Some(i32::from(Interrupted::EXIT_CODE)) {
            return Err(Interrupted("run the same command again to continue").into());
        }
        ensure!(
            status.success(),
            "the training into {} ended with {status}; run the same command again to continue from its newest checkpoint",
            folder.display()
        );
        Ok(())
    }

    fn join(&self) -> anyhow::Result<()> {
        let _lock = RunLock::take(self.folder)?;
        for folder in self.all().map(|job| self.folder(job)) {
            if !has_ended(&folder)? {
                let remedy = "train it first: `ivv segments run PLAN`";
                return Err(ivv::Error::data(&folder, "", "expected a run that has ended, found none", remedy).into());
            }
        }
        let file = self.folder.join("scene.ply");
        let read = |job: Option<usize>| read_ply(&self.folder(job).join("scene.ply"));
        let mut joined = Joined::new(&file, self.segments.clone(), read)?;
        let base = self.folder(None);
        write_parts(&file, &mut joined, &Appearance::of(&base, None)?.0.unusual())?;
        // The constants of the jobs, as set by --blur and the like. On a moving rig the jobs trained in a frame with another unit, so
        // convert the near plane.
        let base = Run::read(&base)?;
        let near = (f64::from(base.constants.near) * (self.run.world.scale / base.world.scale)) as f32;
        Run { constants: Constants { near, ..base.constants }, ..self.run.clone() }.write(self.folder)?;
        let n_dynamic: usize = joined.parts().iter().map(|part| part.n).sum();
        let n = PlyParts::open(&file)?.map_or(0, |written| written.n_static()) + n_dynamic;
        let (path, n_segments) = (file.to_string_lossy(), self.segments.segments.len());
        let line = json!({ "path": path, "gaussians": n, "dynamic_gaussians": n_dynamic, "segments": n_segments });
        let (gaussians, segments) = (count(n, "Gaussian"), count(n_segments, "segment"));
        answer(self.json, &line, format_args!("{path}: {gaussians}, {n_dynamic} of them dynamic, of {segments}"));
        Ok(())
    }
}

/// Removes the file of viewpoints: a resumed run has them.
fn without_viewpoints(options: &mut Vec<OsString>) {
    options.retain(|option| option.to_str().is_none_or(|option| !option.starts_with("--viewpoints=")));
    if let Some(at) = options.iter().position(|option| option == "--viewpoints") {
        options.drain(at..(at + 2).min(options.len()));
    }
}

/// True if the run in `folder` has ended and written its scene.
fn has_ended(folder: &Path) -> ivv::Result<bool> {
    if !folder.join("scene.ply").is_file() || !folder.join("train.json").is_file() {
        return Ok(false);
    }
    let totals: serde_json::Value = read_json(&folder.join("train.json"), "train it again, with --overwrite")?;
    // An extended run has passed the step of its last totals.
    let newest = Checkpoint::newest_step(&folder.join("checkpoints"))?;
    Ok(newest.is_none_or(|step| totals["steps"].as_u64().is_some_and(|steps| step <= steps)))
}
