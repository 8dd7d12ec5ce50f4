//! `ivv train`.

use crate::behind::{Behind, both};
use crate::capture::CaptureArgs;
use crate::device::DeviceArgs;
use crate::due::{Due, DueArgs};
use crate::files::{write_json, write_scene};
use crate::instead::{self, InsteadArgs};
use crate::interrupt::{Interrupted, Stop};
use crate::kept;
use crate::look::Look;
use crate::offsets;
use crate::passes::{self, TimedPass};
use crate::poses;
use crate::progress::{Steps, watch};
use crate::ranks::Team;
use crate::require;
use crate::screen::{alert, be_quiet, out, say};
use crate::settings::SettingArgs;
use crate::start::Start;
use crate::totals::{ProfiledStep, Seconds, cpu_seconds, totals};
use crate::verbs::eval::Scorer;
use crate::verbs::render::ConstantArgs;
use crate::verbs::serve::{Beside, Said};
use ivv::scene::Splats;
use ivv::scene::capture::share_of_memory;
use ivv::stage::Renderer;
use ivv::study::Example;
use ivv::train::{
    Checkpoint, Evaluation, Event, Fall, Kind, Log, SceneScores, SceneSize, Session, SessionOptions, StepReport, spread,
};
use ivv::vk::DeviceKind;
use ivv::words::count;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;
use std::time::Instant;

/// Options of `ivv train`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture: the project's own folder, COLMAP, transforms.json or Dynamic3DGaussians; see `ivv check`. With --resume
    /// only where it has moved.
    #[arg(required_unless_present_any = ["resume", "list_settings"])]
    pub capture: Option<PathBuf>,
    /// The run folder: run.json, config.json, train.jsonl, train.json, checkpoints, scene.ply, eval.json, renders,
    /// report.html.
    #[arg(short, long, required_unless_present_any = ["list_settings", "only_init"])]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Bytes of images to decode ahead; by default a quarter of the machine's memory, divided by the processes of the run on it.
    #[arg(long)]
    pub cache_bytes: Option<u64>,
    /// Bytes of images to keep in the device's memory, where steps on them need neither decoding nor a copy. By default three
    /// quarters of what the memory plan leaves, or none where that is the machine's own memory.
    #[arg(long)]
    pub device_image_bytes: Option<u64>,
    /// Steps between two lines of train.jsonl.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    log_every: u64,
    #[command(flatten)]
    pub read: CaptureArgs,
    /// A cameras file (JSON) of views, in the capture's world, that the scene will be seen from: training keeps clear what lies
    /// just before them. run.json and the report name them; do not give the cameras that you test on.
    #[arg(long, conflicts_with = "resume")]
    pub viewpoints: Option<PathBuf>,
    /// Continues the run in the run folder from its newest checkpoint, with its settings, cameras and constants. With --steps
    /// or --epochs it goes on for as long as these say, an ended run too: learning rates and density control are then those
    /// of a run of that length, which may raise the rates and lower the scores for a while.
    #[arg(long)]
    pub resume: bool,
    /// Trains what moves on top of another run on the same cameras, which has ended: its static Gaussians stay as they are, and so
    /// does what it learnt of clocks and poses. The run starts with its dynamic Gaussians that live in this part of the clip, and with
    /// new ones of what moves in the images.
    #[arg(long, value_name = "RUN", conflicts_with = "resume")]
    pub base: Option<PathBuf>,
    /// Replaces the run in the run folder, with all that `ivv` wrote there for it. It stays until capture and settings are
    /// known to be good and the first Gaussians are there.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    #[command(flatten)]
    due: DueArgs,
    #[command(flatten)]
    pub instead: InsteadArgs,
    /// Print the mean time of every pass of a step.
    #[arg(long)]
    profile: bool,
    /// Shows the training in a browser, at this port of this machine: its course, test views, and the scene as of the newest
    /// checkpoint, to walk in.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8080")]
    view: Option<u16>,
    #[command(flatten)]
    pub constants: ConstantArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    if instead::of_training(args, json)? {
        return Ok(());
    }
    let begun = Instant::now();
    let stop = Stop::listen()?;
    let team = Team::join(&stop)?;
    if !team.leads() {
        be_quiet();
    }
    let start = Start::new(args, team.leads())?;
    team.check(&start.config)?;
    // All have read what they begin with before one of them writes.
    team.any(false)?;
    let Start { gpu, run, capture, config, total, output, checkpoints, resumed, .. } = &start;
    if config.loss.lacks_lpips_weights() {
        say!("LPIPS is off: it needs weights, given by --set loss.lpips_weights=FILE");
    }
    let options = SessionOptions {
        constants: run.constants,
        world: Some(run.world),
        total: Some(*total),
        cache_bytes: args.cache_bytes.unwrap_or_else(|| share_of_memory() / team.local_size() as u64),
        device_image_bytes: args.device_image_bytes,
        ranks: team.ranks(),
        watch: watch(),
        ..SessionOptions::default()
    };
    let mut session = match resumed {
        Some(checkpoint) => Session::resume(gpu.clone(), capture, checkpoint, options)?,
        None => Session::begin(gpu.clone(), capture, config.clone(), options)?,
    };
    let capture = session.capture().clone();
    start.replace(output)?;
    start.extend(&mut session)?;
    if !team.leads() {
        return follow(session, (*total, &args.due), &team, &stop);
    }
    let before = session.steps();
    start.warn(&mut session);
    let (test, steps) = (capture.test_frames(), format!("steps {} to {total}", before + 1));
    say!(
        "{}, {}, {}, {}, SH degree {}",
        count(capture.training_frames().len(), "training image"),
        count(test.len(), "test image"),
        count(session.trainer().n_gaussians(), "Gaussian"),
        if before < *total { steps } else { format!("all {total} steps done") },
        config.sh_degree
    );
    if session.trainer().shows_background() && (config.vary_background || config.backdrop > 0) {
        say!("the images show the background: it stays as it is, and the scene gets no backdrop");
    }
    if team.size() > 1 {
        let own = config.batch as usize / team.size();
        say!("{} processes, each of which sees {own} of the {} images of a step", team.size(), config.batch);
    }
    let log = Log::open(output, before);
    let said = Said::default();
    let _beside = args.view.map(|port| Beside::new(output, port, said.clone())).transpose()?;
    std::thread::scope(|scope| {
        let mut training = Training {
            behind: Behind::new(scope),
            args,
            output,
            scorer: Scorer { gpu, capture: &capture, run, config },
            session,
            team: team.clone(),
            total: *total,
            checkpoints: checkpoints.clone(),
            some_test: spread(&test, args.due.eval_images),
            due: Due::new(&args.due, *total),
            progress: Steps::new(*total, before, test.len()),
            start: begun,
            seconds_before: log.series(Kind::Step, "seconds").last().map_or(0.0, |[_, seconds]| *seconds),
            log,
            said,
        };
        training.train(&stop).and_then(|()| training.finish(json)).map_err(|error| training.failed(error))
    })
}

/// Takes the steps of a run that another process leads.
fn follow(mut session: Session, (total, due): (u64, &DueArgs), team: &Team, stop: &Stop) -> anyhow::Result<()> {
    let due = Due::new(due, total);
    session.settle()?;
    while session.steps() < total {
        session.step()?;
        session.take_events();
        session.settle()?;
        if team.any(stop.is_asked())? {
            // A launcher kills the others as soon as one has ended, so all wait for the checkpoint. None leaves MPI then: a launcher
            // that was asked to end no longer answers those who do, and kills them before they have said what is left.
            team.meet();
            return Err(Interrupted("the process that leads wrote a checkpoint; continue with --resume").into());
        }
        if due.checkpoint(session.steps()) {
            let (splats, step) = (session.trainer().splats()?, session.steps());
            team.agree(&splats, step)?;
        }
    }
    team.finish();
    Ok(())
}

/// An evaluation during the run, and what is shown of it.
struct Scored {
    splats: Splats,
    evaluation: Evaluation,
    examples: Vec<Example>,
}

/// A run under way, with its folder.
struct Training<'scope, 'env> {
    args: &'env Args,
    output: &'env Path,
    scorer: Scorer<'env>,
    session: Session<'env>,
    /// The processes that share its steps.
    team: Team,
    /// Where checkpoints and reports are written.
    behind: Behind<'scope, 'env>,
    total: u64,
    checkpoints: PathBuf,
    /// What is scored during the run.
    some_test: Vec<(usize, u32)>,
    due: Due<'env>,
    progress: Steps,
    log: Log,
    /// What a page that shows the run receives.
    said: Said,
    start: Instant,
    /// Of stepping, in processes before this one.
    seconds_before: f64,
}

impl Training<'_, '_> {
    /// Steps to the end.
    fn train(&mut self, stop: &Stop) -> anyhow::Result<()> {
        if self.session.steps() == 0 {
            // Whatever happens from here on, there is a checkpoint to go on from.
            self.write(None, true)?;
            self.behind.wait()?;
        }
        self.settle()?;
        while self.session.steps() < self.total {
            if self.team.size() == 1 && self.due.profile(self.session.steps() + 1) {
                self.profile()?;
            } else {
                self.session.step()?;
            }
            let step = self.session.steps();
            if self.due.evaluation(step) || self.due.checkpoint(step) {
                self.session.wait()?;
            }
            self.settle()?;
            let is_stopped = self.team.any(stop.is_asked())?;
            if !is_stopped && self.due.checkpoint(step) && self.team.size() > 1 {
                let splats = self.session.trainer().splats()?;
                self.team.agree(&splats, step)?;
            }
            let scored = if is_stopped { None } else { self.evaluate(step)? };
            if scored.is_some() || self.due.checkpoint(step) || is_stopped {
                self.write(scored, self.due.checkpoint(step) || is_stopped)?;
            }
            if is_stopped {
                self.behind.wait()?;
                self.team.meet();
                return Err(Interrupted("a checkpoint was written; continue with --resume").into());
            }
        }
        Ok(())
    }

    /// A step whose passes are timed.
    fn profile(&mut self) -> anyhow::Result<()> {
        let Some(profiled) = self.session.profile()? else { return Ok(()) };
        let gpu = self.scorer.gpu;
        let passes = profiled.passes.iter().map(TimedPass::from).collect();
        let line = ProfiledStep { step: self.session.steps(), passes, bytes_by_buffer: gpu.device().memory().0 };
        self.log.push(Kind::Profile, &line)?;
        Ok(())
    }

    /// Begins to write a checkpoint, where it `is_due` or the scores are the best so far, and what `scored` shows.
    fn write(&mut self, scored: Option<Scored>, is_due: bool) -> ivv::Result<()> {
        // All before is written then, the best checkpoint so far among it.
        self.behind.wait()?;
        let psnr = scored.as_ref().map(|scored| scored.evaluation.mean.psnr);
        let best = Checkpoint::best(&self.checkpoints)?.map(|(_, psnr)| psnr);
        let best = psnr.filter(|psnr| best.is_none_or(|best| *psnr > best));
        let checkpoint = if is_due || best.is_some() { Some(self.session.checkpoint()?) } else { None };
        let (scorer, log, at) = (self.scorer, self.log.clone(), (self.session.steps(), self.total));
        let (folder, output) = (self.checkpoints.clone(), self.output.to_owned());
        self.behind.begin(move || {
            let save = || {
                if let Some(checkpoint) = checkpoint {
                    checkpoint.write(&folder)?;
                    log.write()?;
                }
                if let Some(psnr) = best {
                    Checkpoint::keep_best(&folder, at.0, psnr)?;
                }
                Ok(())
            };
            let show = || match scored {
                Some(Scored { splats, evaluation, examples }) => {
                    scorer.progress((&splats, evaluation, &examples), at, &log, &output)
                }
                None => Ok(()),
            };
            both(save, show)
        })?;
        // A CPU driver's steps would share their cores with it.
        if scorer.gpu.caps().kind == DeviceKind::Cpu { self.behind.wait() } else { Ok(()) }
    }

    /// Keeps what can be kept of a run that `error` ends, and adds to the error what that is and how to go on: the last step
    /// where the device still answers, the newest checkpoint otherwise.
    fn failed(&mut self, error: anyhow::Error) -> anyhow::Error {
        if error.downcast_ref::<Interrupted>().is_some() {
            return error;
        }
        // A fault of what is still being written is not what ended the run.
        let _ = self.behind.wait();
        let is_lost = matches!(error.downcast_ref(), Some(ivv::Error::DeviceLost { .. }));
        let ended = self.session.trainer().ended();
        // Nothing follows the last step but scores.
        let is_kept = ended == self.total && Checkpoint::file(&self.checkpoints, self.total).exists();
        if !is_lost
            && !is_kept
            && let Ok(rescued) = self.session.rescue()
        {
            let written = rescued.write(&self.checkpoints);
            if written.is_ok() {
                // The lines of the log are not needed to go on.
                let _ = self.log.write();
            }
        }
        kept::told(error, self.session.trainer().ended(), &self.checkpoints, self.output)
    }

    /// Does what is due after the last step, and notes what has happened.
    fn settle(&mut self) -> anyhow::Result<()> {
        self.note_events()?;
        self.session.settle()?;
        self.note_events()
    }

    fn note_events(&mut self) -> anyhow::Result<()> {
        for event in self.session.take_events() {
            match event {
                Event::Step(report) => self.note(&report)?,
                Event::Review(review) => {
                    let told = require::told(&review);
                    if !told.is_empty() {
                        say!("{told}");
                    }
                    self.log.push(Kind::Review, &review)?;
                }
                Event::Poses { pixels, are_learnt } => say!("{}", poses::judged(pixels, are_learnt)),
                Event::Backdrop { n, is_added: true } => {
                    say!("added {} behind the scene, where no training camera looks", count(n, "Gaussian"));
                }
                Event::Backdrop { n, .. } => alert!(
                    "no backdrop: with its {} the scene would have more than max_gaussians, {}; what no training camera \
                     looks at stays empty. Train with a larger --max-gaussians, or silence this with --set backdrop=0",
                    count(n, "Gaussian"),
                    self.scorer.config.max_gaussians
                ),
                Event::Frozen(cameras) => {
                    alert!("could not estimate time offsets from the images; fixed at 0 for {}", cameras.join(", "))
                }
            }
        }
        Ok(())
    }

    /// Shows what a step did, and logs it where that is due or density control followed.
    fn note(&mut self, report: &StepReport) -> anyhow::Result<()> {
        self.progress.show(report);
        let is_due = self.due.checkpoint(report.step) || report.step.is_multiple_of(self.args.log_every);
        if is_due || report.density.is_some() {
            let mut line = serde_json::to_value(report)?;
            line["seconds"] = (self.seconds_before + self.session.seconds()).into();
            line["waited_for_images_s"] = self.session.waited().into();
            self.said.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&line);
            self.log.push(Kind::Step, &line)?;
        }
        Ok(())
    }

    /// Scores some test views where that is due.
    fn evaluate(&mut self, step: u64) -> anyhow::Result<Option<Scored>> {
        if !self.due.evaluation(step) {
            return Ok(None);
        }
        let begun = Instant::now();
        let splats = self.session.trainer().splats()?;
        let Some((evaluation, examples)) = self.scorer.some(&splats, &self.some_test, step)? else { return Ok(None) };
        let Evaluation { mean, views, .. } = &evaluation;
        self.progress.scored(step, mean.psnr, mean.ssim, views.len(), begun.elapsed().as_secs_f64());
        self.log.push(Kind::Evaluation, &evaluation)?;
        self.warn_of_a_fall()?;
        Ok(Some(Scored { splats, evaluation, examples }))
    }

    /// The last point of the curve from the scores of all test images: the same images as those before it.
    fn last_of(&self, scores: &SceneScores) -> Option<Evaluation> {
        let name = |(camera, frame): &(usize, u32)| (self.scorer.capture.cameras[*camera].name.as_str(), *frame);
        let some: Vec<(&str, u32)> = self.some_test.iter().map(name).collect();
        scores.evaluation.of(|camera, frame| some.contains(&(camera, frame)))
    }

    /// Warns, after an evaluation, when the scores have begun to fall.
    fn warn_of_a_fall(&mut self) -> ivv::Result<()> {
        let Some(fall) = Fall::of_log(&self.log, self.scorer.config, self.total) else { return Ok(()) };
        alert!("warning: {fall}");
        self.log.push(Kind::Fall, &fall)
    }

    /// Writes the scene, the totals, all scores and the report.
    fn finish(&mut self, json: bool) -> anyhow::Result<()> {
        let output = self.output;
        self.behind.wait()?;
        self.team.finish();
        let trained = self.session.scene()?;
        let splats = self.session.finish_with(trained.clone())?;
        self.note_events()?;
        let (scene, world, step) = (output.join("scene.ply"), self.scorer.run.world, self.session.steps());
        let own = Look::new(self.scorer.run, self.scorer.config).unusual();
        write_scene(&scene, &splats, &world, &own)?;
        // What the file holds is scored.
        let splats = world.splats(&splats);
        let seconds_stepping = self.seconds_before + self.session.seconds();
        let seconds = Seconds {
            seconds: self.start.elapsed().as_secs_f64(),
            cpu_seconds: cpu_seconds(),
            seconds_stepping,
            seconds_per_step: seconds_stepping / step.max(1) as f64,
            waited_for_images_s: self.session.waited(),
        };
        let fits = if self.args.due.fit_offsets { self.scorer.fitted_offsets(&splats)? } else { BTreeMap::new() };
        let offsets = offsets::table(self.session.trainer(), &self.scorer, &fits, output)?;
        let poses = poses::table(self.session.trainer(), &self.scorer, output)?;
        let Scorer { gpu, run, config, .. } = self.scorer;
        let mut totals = totals(gpu, step, &splats, (run, config), &self.log, &seconds)?;
        totals["reviews"] = self.log.lines(Kind::Review).cloned().collect();
        if self.team.size() > 1 {
            totals["ranks"] = serde_json::to_value(self.session.trainer().shared())?;
        }
        totals["plan"] = serde_json::to_value(self.session.plan())?;
        totals["depth_priors"] = serde_json::to_value(&self.session.priors().depth)?;
        totals["backdrop"] = (splats.len() - trained.len()).into();
        totals["offsets"] = serde_json::to_value(&offsets)?;
        totals["poses"] = serde_json::to_value(&poses)?;
        let agreement = offsets::agreement(&offsets);
        totals["offset_error"] = agreement.map(|agreement| agreement.rms_error).into();
        totals["offset_correlation"] = agreement.and_then(|agreement| agreement.correlation).into();
        write_json(&output.join("train.json"), &totals)?;
        let seen = (Renderer::new(gpu.clone(), &splats, run.constants)?, SceneSize::of(&splats));
        let (scores, examples) = self.scorer.all(seen, &scene, &fits, step, output)?;
        if let Some(scores) = &scores {
            let has_backdrop = splats.len() > trained.len();
            let last = if has_backdrop { self.scorer.some(&trained, &self.some_test, step)? } else { None };
            if let Some(some) = last.map_or_else(|| self.last_of(scores), |(some, _)| Some(some)) {
                self.log.push(Kind::Evaluation, &some)?;
                self.warn_of_a_fall()?;
                Checkpoint::keep_best(&self.checkpoints, some.step, some.mean.psnr)?;
            }
        }
        self.log.write()?;
        let report = self.scorer.report(scores.as_ref(), &examples, output, output)?;
        if json {
            out!("{}", serde_json::to_string_pretty(&totals)?);
            return Ok(());
        }
        let quality = scores.as_ref().map_or(
            "no test images that count (name some with --test-cameras; an image that its mask hides has no score)"
                .to_owned(),
            |scores| {
                let Evaluation { mean, views, .. } = &scores.evaluation;
                format!("{}: PSNR {:.2} dB, SSIM {:.4}", count(views.len(), "test image"), mean.psnr, mean.ssim)
            },
        );
        if !offsets.is_empty() {
            offsets::print(&offsets);
        }
        poses::print(&poses);
        let (n, step) = (splats.len(), seconds.seconds_per_step);
        let step = if step < 0.1 { format!("{:.2} ms", 1e3 * step) } else { format!("{step:.3} s") };
        out!("{quality}; {}, {step} a step; {}", count(n, "Gaussian"), report.display());
        if self.args.profile {
            let passes = totals["profile"]["passes"].clone();
            passes::print(&serde_json::from_value::<Vec<TimedPass>>(passes)?, "step");
        }
        Ok(())
    }
}
