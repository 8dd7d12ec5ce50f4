//! The set-up of `ivv train`: of a new run, from the newest checkpoint of a run, or of a run that was killed before its first.

use crate::run::files::{make_folder, read_json, write_json};
use crate::run::overwrite::{contains_run, remove_run};
use crate::run::ranks::local_rank;
use crate::run::scoring::warn_of_shared_pictures;
use crate::ui::progress::watch;
use crate::ui::screen::{alert, say};
use crate::verbs::train::args::Args;
use anyhow::{Context, bail, ensure};
use ivv::Error;
use ivv::internals::files::remove_temporaries;
use ivv::internals::gpu::Gpu;
use ivv::internals::scene::capture::{Capture, CaptureSettings};
use ivv::internals::scene::read_views;
use ivv::internals::settings::Constants;
use ivv::internals::train::{Base, Checkpoint, Config, DueEvents, Run, RunLock, Session, all_settings};
use ivv::internals::vk::DeviceChoice;
use ivv::internals::words::count;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run that is about to start or resume. The process that writes its folder holds the lock while this lives.
pub struct TrainingSetup {
    lock: Option<RunLock>,
    pub gpu: Arc<Gpu>,
    pub run: Run,
    pub capture: Capture,
    pub config: Config,
    pub total: u64,
    pub output: PathBuf,
    pub checkpoints: PathBuf,
    pub resumed: Option<Checkpoint>,
    /// True if the folder contains another run until [`TrainingSetup::replace`].
    replaces: bool,
}

impl TrainingSetup {
    /// The run of `args`. Nothing is written before all input is checked, and nothing at all unless this process `leads` the run.
    pub fn new(args: &Args, leads: bool) -> anyhow::Result<Self> {
        if args.resume { Self::resumed_run(args, leads) } else { Self::new_run(args, leads) }
    }

    fn new_run(args: &Args, leads: bool) -> anyhow::Result<Self> {
        let mut config = args.settings.resolve()?;
        let base = args.base.as_deref().map(Base::read).transpose()?;
        let mut capture = capture(args, &config)?;
        if let Some(base) = &base {
            config = base.config(config);
            config.check_held()?;
            if let Some(reason) = base.moves() {
                alert!("{reason}");
            }
            capture = base.calibrated(capture)?;
        } else if config.holds_static {
            let remedy = "name with --base the run that has the static scene, or leave holds_static out";
            let file = args.settings.config.as_deref().unwrap_or(Path::new("settings"));
            return Err(Error::data(file, "holds_static", "is true, but no --base is given", remedy).into());
        }
        let capture = training_capture(capture, &config);
        let mut run = Run::new(&capture, Constants::default())?;
        if leads {
            warn_of_shared_pictures(&run);
        }
        run.constants = args.constants.over(Constants::default())?;
        let total = config.total(n_training_images(&capture)?);
        let output = folder(args)?;
        let checkpoints = output.join("checkpoints");
        let (mut lock, mut replaces) = (None, false);
        if leads {
            make_folder(&output)?;
            lock = Some(lock_folder(&output)?);
            replaces = contains_run(&output)?;
        }
        if replaces && !args.overwrite {
            let remedy = "continue it with --resume, replace it with --overwrite, or choose another folder with -o";
            return Err(Error::data(&output, "", "already holds a run", remedy).into());
        }
        let gpu = device(args)?;
        config.check_on(&gpu, total)?;
        let begin = |base: Base| base.begin(&capture, &run, config.clone(), total, &mut watch());
        let resumed = base.map(begin).transpose()?;
        let setup = TrainingSetup { lock, gpu, run, capture, config, total, output, checkpoints, resumed, replaces };
        if leads && !replaces {
            setup.write_settings()?;
        }
        Ok(setup)
    }

    /// Removes the run that this one replaces, if any. Call it after capture and settings are checked.
    pub fn replace(&self) -> ivv::Result<()> {
        if !self.replaces {
            return Ok(());
        }
        remove_run(&self.output, &self.run)?;
        self.write_settings()
    }

    fn write_settings(&self) -> ivv::Result<()> {
        write_json(&self.output.join("config.json"), &self.config)?;
        // No other file has what a run takes from its base. If it is killed before its next checkpoint, it resumes from this one.
        if let Some(base) = &self.resumed {
            base.write(&self.checkpoints)?;
        }
        self.run.write(&self.output)
    }

    fn resumed_run(args: &Args, leads: bool) -> anyhow::Result<Self> {
        let output = folder(args)?;
        let (folder, checkpoints) = (output.as_path(), output.join("checkpoints"));
        check_is_run(folder)?;
        let lock = leads.then(|| lock_folder(folder)).transpose()?;
        let mut run = Run::read(folder)?;
        let checkpoint = Checkpoint::newest(&checkpoints)?;
        let file = folder.join("config.json");
        let planned = match &checkpoint {
            Some(checkpoint) => checkpoint.config.clone(),
            None => settings_of_a_run_without_checkpoint(folder, &file)?,
        };
        check_agreement(args, &planned, &run)?;
        if let (true, Some(new)) = (leads, new_since(&file)) {
            alert!(
                "another version of ivv started the run, without these settings, which now have their defaults: {new}; to \
                 avoid that, train again from the start"
            );
        }
        let (capture, changes) = run.compare_capture(args.capture.as_deref())?;
        if leads && !changes.is_empty() {
            let path = capture.path.display();
            alert!(
                "warning: {path} differs from what the run has trained on so far: {changes}. To avoid that, restore it"
            );
        }
        let capture = training_capture(capture, &planned);
        let now = args.capture.as_ref().map(|path| std::path::absolute(path).unwrap_or_else(|_| path.clone()));
        if let Some(now) = now.filter(|now| leads && *now != run.capture) {
            say!("the capture is now at {}", now.display());
            run.capture = now;
            run.write(folder)?;
        }
        let n_images = n_training_images(&capture)?;
        let planned_total = checkpoint.as_ref().map_or(planned.total(n_images), |checkpoint| checkpoint.total);
        let asked = args.settings.extended(&planned);
        let total = if asked == planned { planned_total } else { asked.total(n_images) };
        let done = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.step);
        let n = count(done, "step");
        ensure!(
            total >= done,
            "the run has done {n}: expected at least as many, found {total}; raise --steps or --epochs"
        );
        let is_extended = total != planned_total;
        let config = if is_extended { asked } else { planned };
        let gpu = device(args)?;
        config.check_on(&gpu, total)?;
        if checkpoint.is_none() {
            say!("no checkpoint was written yet: the run starts again with its own settings");
        }
        // Renew a lost or damaged file.
        let is_stale = (is_extended && checkpoint.is_none()) || read_json::<Config>(&file, "").is_err();
        if leads && is_stale {
            write_json(&file, &config)?;
        }
        let resumed = checkpoint;
        Ok(TrainingSetup { lock, gpu, run, capture, config, total, output, checkpoints, resumed, replaces: false })
    }

    pub fn warn(&self, session: &mut Session) {
        if let n @ 1.. = session.n_left_out() {
            alert!("{} left out: not finite, or too bright", count(n, "Gaussian"));
        }
        let n = session.trainer().n_gaussians();
        if let Some(room) = session.trainer().room_to_grow().filter(|room| 20 * u64::from(*room) < u64::from(n)) {
            let (room, most) = (count(room, "Gaussian"), self.config.max_gaussians);
            alert!(
                "warning: density control may only add {room} to the {n} that there are; raise --max-gaussians above {most}"
            );
        }
    }

    /// Extends `session`, which resumes [`TrainingSetup::resumed`], to the length that is asked for, and saves that.
    pub fn extend(&self, session: &mut Session) -> anyhow::Result<()> {
        let Some(checkpoint) = self.resumed.as_ref().filter(|checkpoint| checkpoint.total != self.total) else {
            return Ok(());
        };
        let now = session.extend(self.config.clone(), self.total)?;
        if self.lock.is_none() {
            return Ok(());
        }
        // If the run is killed before its next checkpoint, it still keeps the new length.
        let due = DueEvents { density: false, ..now };
        Checkpoint { due, ..session.checkpoint()? }.write(&self.checkpoints)?;
        write_json(&self.output.join("config.json"), &self.config)?;
        let before = checkpoint.total;
        let [was, is] = [before, self.total].map(|total| 100.0 * checkpoint.step as f64 / total.max(1) as f64);
        say!(
            "the run now has {} instead of {before}, so {was:.0} % done becomes {is:.0} % done: rates and density control go on \
             as in a run of that length, and the scores may fall for a while",
            count(self.total, "step"),
        );
        Ok(())
    }
}

fn folder(args: &Args) -> anyhow::Result<PathBuf> {
    args.output.clone().context("give the run folder, -o FOLDER")
}

/// The device that `args` name; of several equal ones the one of this process.
fn device(args: &Args) -> ivv::Result<Arc<Gpu>> {
    args.device.open_as(DeviceChoice { nth: local_rank(), ..args.device.choice() })
}

/// The capture that `args` name, read for a run of `config`.
pub fn capture(args: &Args, config: &Config) -> anyhow::Result<Capture> {
    let path = args.capture.as_deref().context("expected CAPTURE, found none; give it, or --resume a run")?;
    let settings = CaptureSettings { background: config.background, ..args.read.settings() };
    let mut capture = crate::run::capture::open(path, &settings)?;
    capture.viewpoints = args.viewpoints.as_deref().map_or(Ok(Vec::new()), read_views)?;
    Ok(capture)
}

/// The capture that a run trains on. Photographs show static objects, so a run with a fixed static scene leaves them out.
pub fn training_capture(capture: Capture, config: &Config) -> Capture {
    if config.holds_static { capture.without_photos() } else { capture }
}

fn n_training_images(capture: &Capture) -> ivv::Result<u64> {
    match capture.training_frames().len() {
        0 => Err(Error::data(&capture.path, "", "has no training image", "see `ivv check`")),
        n => Ok(n as u64),
    }
}

/// Locks a run's folder and removes the unfinished files of killed processes.
fn lock_folder(folder: &Path) -> ivv::Result<RunLock> {
    let lock = RunLock::take(folder)?;
    let parts = [("", 0), ("checkpoints", 0), ("renders", 1)].map(|(name, depth)| (folder.join(name), depth));
    parts.iter().filter(|(part, _)| part.is_dir()).try_for_each(|(part, depth)| remove_temporaries(part, *depth))?;
    Ok(lock)
}

/// Refuses a folder without a run, and names what it holds.
fn check_is_run(folder: &Path) -> ivv::Result<()> {
    let fault = |reason: String| Err(Error::data(folder, "", reason, "give the folder of the run to --resume with -o"));
    if !folder.exists() {
        return fault("no such folder".to_owned());
    }
    if Run::file(folder).is_file() {
        return Ok(());
    }
    let mut names: Vec<String> = match std::fs::read_dir(folder) {
        Ok(entries) => entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect(),
        Err(e) => return fault(format!("cannot be listed: {e}")),
    };
    names.sort();
    let holds = match names.len() {
        0 => "it is empty".to_owned(),
        1..=5 => format!("it holds {}", names.join(", ")),
        _ => format!("it holds {}, ...", names[..5].join(", ")),
    };
    fault(format!("is not the folder of a run: it has no run.json; {holds}"))
}

/// The settings of a run that was killed before its first checkpoint.
fn settings_of_a_run_without_checkpoint(folder: &Path, file: &Path) -> ivv::Result<Config> {
    // Both are written after the first checkpoint.
    if let Some(result) = ["train.jsonl", "scene.ply"].into_iter().find(|name| folder.join(name).exists()) {
        let checkpoints = folder.join("checkpoints");
        let reason = if checkpoints.is_dir() { "holds no checkpoint" } else { "no such folder" };
        let reason = format!("{reason}, but the run has got further: there is {result}");
        return Err(Error::data(&checkpoints, "", reason, "restore the checkpoints, or train again with --overwrite"));
    }
    read_json(file, "the run has no checkpoint either: train again with --overwrite")
}

/// The settings that the `file` of a run lacks because an earlier version did not have them; `None` if it has all.
fn new_since(file: &Path) -> Option<String> {
    let written: Value = read_json(file, "").ok()?;
    let lacking = all_settings().filter(|setting| setting.of(&written).is_none());
    let names: Vec<&str> = lacking.map(|setting| setting.name).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Refuses flags that ask for something else than the run has.
fn check_agreement(args: &Args, config: &Config, run: &Run) -> anyhow::Result<()> {
    let mut differ = args.settings.contradictions(config)?;
    differ.extend(args.read.differ_from(run));
    differ.extend(args.constants.contradictions(&run.constants));
    if differ.is_empty() {
        return Ok(());
    }
    let differ = differ.join("; ");
    bail!(
        "a resumed run keeps its settings but for its length, and flags contradict them: {differ}; leave these flags out"
    )
}
