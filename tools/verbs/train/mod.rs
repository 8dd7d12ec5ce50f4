//! `ivv train`.

mod args;
mod initial_scene;
mod list_settings;
mod plan;
mod setup;

pub use args::Args;

use crate::run::appearance::Appearance;
use crate::run::background::{BackgroundWriter, in_parallel};
use crate::run::camera_poses;
use crate::run::files::{write_json, write_scene};
use crate::run::ranks::Team;
use crate::run::rescue;
use crate::run::review;
use crate::run::schedule::Schedule;
use crate::run::scoring::{SampleScores, Scorer};
use crate::run::time_offsets;
use crate::run::totals::{ProfiledStep, TimedPass, cpu_seconds, totals};
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::progress::{TrainingProgress, watch};
use crate::ui::screen::{alert, be_quiet, out, print_json, say};
use crate::verbs::serve::{BackgroundServer, LatestLine};
use crate::verbs::train::setup::TrainingSetup;
use ivv::internals::scene::Splats;
use ivv::internals::scene::capture::share_of_memory;
use ivv::internals::stage::Renderer;
use ivv::internals::train::{
    Checkpoint, Evaluation, Event, Fall, Kind, Log, SceneScores, SceneSize, Session, SessionOptions, StepReport, spread,
};
use ivv::internals::vk::DeviceKind;
use ivv::internals::words::count;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;
use std::time::Instant;

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    if let Some(done) = instead(args, json) {
        return done;
    }
    let begun = Instant::now();
    let stop = Stop::listen()?;
    let team = Team::join(&stop)?;
    if !team.leads() {
        be_quiet();
    }
    let setup = TrainingSetup::new(args, team.leads())?;
    team.check(&setup.config)?;
    // All processes read their input before one of them writes.
    team.any(false)?;
    let TrainingSetup { gpu, run, capture, config, total, output, checkpoints, resumed, .. } = &setup;
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
    setup.replace()?;
    setup.extend(&mut session)?;
    if !team.leads() {
        return follow(session, *total, &Schedule::new(&args.schedule, *total), &team, &stop);
    }
    let before = session.steps();
    setup.warn(&mut session);
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
        say!("the images show the background, so it does not vary and the scene gets no backdrop");
    }
    if team.size() > 1 {
        let own = config.batch as usize / team.size();
        say!("{} processes, each of which sees {own} of the {} images of a step", team.size(), config.batch);
    }
    let log = Log::open(output, before);
    let latest_line = LatestLine::default();
    let _server = args.view.map(|port| BackgroundServer::new(output, port, latest_line.clone())).transpose()?;
    std::thread::scope(|scope| {
        let mut training = Training {
            writer: BackgroundWriter::new(scope),
            args,
            output,
            scorer: Scorer { gpu, capture: &capture, run, config },
            session,
            team: team.clone(),
            total: *total,
            checkpoints: checkpoints.clone(),
            some_test: spread(&test, args.schedule.eval_images),
            schedule: Schedule::new(&args.schedule, *total),
            progress: TrainingProgress::new(*total, before, test.len()),
            start: begun,
            seconds_before: log.series(Kind::Step, "seconds").last().map_or(0.0, |[_, seconds]| *seconds),
            log,
            latest_line,
        };
        training.train(&stop).and_then(|()| training.finish(json)).map_err(|error| training.failed(error))
    })
}

fn instead(args: &Args, json: bool) -> Option<anyhow::Result<()>> {
    let Args { plan, list_settings, only_init, .. } = args;
    match (list_settings, plan, only_init) {
        (Some(name), _, _) => Some(list_settings::print(name.as_deref().unwrap_or_default(), json)),
        (_, Some(frames), _) => Some(plan::print(args, *frames, json)),
        (_, _, Some(file)) => Some(initial_scene::write(args, file, json)),
        _ => None,
    }
}

/// Takes the steps of a run whose folder another process writes.
fn follow(mut session: Session, total: u64, schedule: &Schedule, team: &Team, stop: &Stop) -> anyhow::Result<()> {
    session.settle()?;
    while session.steps() < total {
        session.step()?;
        session.take_events();
        session.settle()?;
        if team.any(stop.is_asked())? {
            // A launcher kills the others as soon as one has ended, so all wait for the checkpoint. None leaves MPI: a launcher that was
            // asked to end no longer answers such a process, and kills it before it has printed how to continue.
            team.meet();
            return Err(Interrupted("the first process wrote a checkpoint; continue with --resume").into());
        }
        if schedule.is_checkpoint_due(session.steps()) {
            team.agree(&session.trainer().splats()?, session.steps())?;
        }
    }
    team.finish();
    Ok(())
}

struct Training<'scope, 'env> {
    args: &'env Args,
    output: &'env Path,
    scorer: Scorer<'env>,
    session: Session<'env>,
    team: Team,
    /// Of checkpoints and reports.
    writer: BackgroundWriter<'scope, 'env>,
    total: u64,
    checkpoints: PathBuf,
    /// The test images that are scored during the run.
    some_test: Vec<(usize, u32)>,
    schedule: Schedule<'env>,
    progress: TrainingProgress,
    log: Log,
    /// For the page of --view.
    latest_line: LatestLine,
    start: Instant,
    /// Seconds of steps in processes before this one.
    seconds_before: f64,
}

impl Training<'_, '_> {
    fn train(&mut self, stop: &Stop) -> anyhow::Result<()> {
        if self.session.steps() == 0 {
            // From here on there is always a checkpoint to resume.
            self.write(None, true)?;
            self.writer.wait()?;
        }
        self.settle()?;
        while self.session.steps() < self.total {
            if self.team.size() == 1 && self.schedule.is_profile_due(self.session.steps() + 1) {
                self.profile()?;
            } else {
                self.session.step()?;
            }
            let step = self.session.steps();
            let is_checkpoint_due = self.schedule.is_checkpoint_due(step);
            if self.schedule.is_evaluation_due(step) || is_checkpoint_due {
                self.session.wait()?;
            }
            self.settle()?;
            let is_stopped = self.team.any(stop.is_asked())?;
            if !is_stopped && is_checkpoint_due && self.team.size() > 1 {
                self.team.agree(&self.session.trainer().splats()?, step)?;
            }
            let scored = if is_stopped { None } else { self.evaluate(step)? };
            if scored.is_some() || is_checkpoint_due || is_stopped {
                self.write(scored, is_checkpoint_due || is_stopped)?;
            }
            if is_stopped {
                self.writer.wait()?;
                self.team.meet();
                return Err(Interrupted("a checkpoint was written; continue with --resume").into());
            }
        }
        Ok(())
    }

    fn profile(&mut self) -> anyhow::Result<()> {
        let Some(profiled) = self.session.profile()? else { return Ok(()) };
        let passes = profiled.passes.iter().map(TimedPass::from).collect();
        let (step, bytes_by_buffer) = (self.session.steps(), self.scorer.gpu.device().memory().0);
        Ok(self.log.push(Kind::Profile, &ProfiledStep { step, passes, bytes_by_buffer })?)
    }

    /// Starts to write `scored`, and a checkpoint if it `is_due` or the scores are the best so far.
    fn write(&mut self, scored: Option<(Splats, SampleScores)>, is_due: bool) -> ivv::Result<()> {
        // After this the best checkpoint so far is on the disk.
        self.writer.wait()?;
        let psnr = scored.as_ref().map(|(_, sample)| sample.evaluation.mean.psnr);
        let best = Checkpoint::best(&self.checkpoints)?.map(|(_, psnr)| psnr);
        let best = psnr.filter(|psnr| best.is_none_or(|best| *psnr > best));
        let checkpoint = if is_due || best.is_some() { Some(self.session.checkpoint()?) } else { None };
        let (scorer, log, step, total) = (self.scorer, self.log.clone(), self.session.steps(), self.total);
        let (folder, output) = (self.checkpoints.clone(), self.output.to_owned());
        self.writer.start(move || {
            let save = || {
                if let Some(checkpoint) = checkpoint {
                    checkpoint.write(&folder)?;
                    log.write()?;
                }
                best.map_or(Ok(()), |psnr| Checkpoint::keep_best(&folder, step, psnr))
            };
            let show = || {
                scored.map_or(Ok(()), |(splats, sample)| {
                    scorer.write_progress(&splats, sample, step, total, &log, &output)
                })
            };
            in_parallel(save, show)
        })?;
        // The steps of a CPU driver need the cores.
        if scorer.gpu.caps().kind == DeviceKind::Cpu { self.writer.wait() } else { Ok(()) }
    }

    /// Saves what is left of a run that `error` ends, and adds to the error what is saved and how to continue.
    fn failed(&mut self, error: anyhow::Error) -> anyhow::Error {
        if error.downcast_ref::<Interrupted>().is_some() {
            return error;
        }
        // An error of the writer did not end the run.
        let _ = self.writer.wait();
        let is_lost = matches!(error.downcast_ref(), Some(ivv::Error::DeviceLost { .. }));
        let ended = self.session.trainer().ended();
        // Nothing follows the last step but scores.
        let is_kept = ended == self.total && Checkpoint::file(&self.checkpoints, self.total).exists();
        if !is_lost
            && !is_kept
            && let Ok(rescued) = self.session.rescue()
            && rescued.write(&self.checkpoints).is_ok()
        {
            // The log is not needed to resume.
            let _ = self.log.write();
        }
        rescue::describe(error, self.session.trainer().ended(), &self.checkpoints, self.output)
    }

    /// Does the work that is due after the last step, and reports the events.
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
                    let text = review::describe(&review);
                    if !text.is_empty() {
                        say!("{text}");
                    }
                    self.log.push(Kind::Review, &review)?;
                }
                Event::Poses { pixels, are_learnt } => say!("{}", camera_poses::verdict(pixels, are_learnt)),
                Event::Backdrop { n, is_added: true } => {
                    say!("added {} behind the scene, out of view of the training cameras", count(n, "Gaussian"));
                }
                Event::Backdrop { n, .. } => alert!(
                    "no backdrop: with its {} the scene would have more than max_gaussians, {}; what no training camera \
                     sees stays empty. Train with a larger --max-gaussians, or silence this with --set backdrop=0",
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

    /// Shows a step, and logs it if that is due or density control followed.
    fn note(&mut self, report: &StepReport) -> anyhow::Result<()> {
        self.progress.show(report);
        let is_due = self.schedule.is_checkpoint_due(report.step) || report.step.is_multiple_of(self.args.log_every);
        if is_due || report.density.is_some() {
            let mut line = serde_json::to_value(report)?;
            line["seconds"] = (self.seconds_before + self.session.seconds()).into();
            line["waited_for_images_s"] = self.session.waited().into();
            self.latest_line.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&line);
            self.log.push(Kind::Step, &line)?;
        }
        Ok(())
    }

    fn evaluate(&mut self, step: u64) -> anyhow::Result<Option<(Splats, SampleScores)>> {
        if !self.schedule.is_evaluation_due(step) {
            return Ok(None);
        }
        let begun = Instant::now();
        let splats = self.session.trainer().splats()?;
        let Some(sample) = self.scorer.score_sample(&splats, &self.some_test, step)? else { return Ok(None) };
        let Evaluation { mean, views, .. } = &sample.evaluation;
        self.progress.scored(step, mean.psnr, mean.ssim, views.len(), begun.elapsed().as_secs_f64());
        self.log.push(Kind::Evaluation, &sample.evaluation)?;
        self.warn_of_a_fall()?;
        Ok(Some((splats, sample)))
    }

    /// The last point of the curve from the scores of all test images: the same images as those before it.
    fn last_of(&self, scores: &SceneScores) -> Option<Evaluation> {
        let cameras = &self.scorer.capture.cameras;
        let is_one =
            |name: &str, frame: u32| self.some_test.iter().any(|at| cameras[at.0].name == name && at.1 == frame);
        scores.evaluation.of(is_one)
    }

    /// Warns, after an evaluation, when the scores have begun to fall.
    fn warn_of_a_fall(&mut self) -> ivv::Result<()> {
        let Some(fall) = Fall::of_log(&self.log, self.scorer.config, self.total) else { return Ok(()) };
        alert!("warning: {fall}");
        self.log.push(Kind::Fall, &fall)
    }

    fn finish(&mut self, json: bool) -> anyhow::Result<()> {
        let output = self.output;
        self.writer.wait()?;
        self.team.finish();
        let trained = self.session.scene()?;
        let splats = self.session.finish_with(trained.clone())?;
        self.note_events()?;
        let (scene, world, step) = (output.join("scene.ply"), self.scorer.run.world, self.session.steps());
        let own = Appearance::new(self.scorer.run, self.scorer.config).unusual();
        write_scene(&scene, &splats, &world, &own)?;
        // Score the scene of the file.
        let splats = world.splats(&splats);
        let (seconds, cpu_seconds) = (self.start.elapsed().as_secs_f64(), cpu_seconds());
        let stepping = self.seconds_before + self.session.seconds();
        let per_step = stepping / step.max(1) as f64;
        let fits = if self.args.schedule.fit_offsets { self.scorer.fitted_offsets(&splats)? } else { BTreeMap::new() };
        let offsets = time_offsets::table(self.session.trainer(), &self.scorer, &fits, output)?;
        let poses = camera_poses::table(self.session.trainer(), &self.scorer, output)?;
        let mut totals = totals(&self.scorer, step, &splats, &self.log)?;
        let agreement = time_offsets::agreement(&offsets);
        for (name, value) in [
            ("seconds", json!(seconds)),
            ("cpu_seconds", json!(cpu_seconds)),
            // In steps and density control, since the run began.
            ("seconds_stepping", json!(stepping)),
            ("seconds_per_step", json!(per_step)),
            ("waited_for_images_s", json!(self.session.waited())),
            ("reviews", self.log.lines(Kind::Review).cloned().collect()),
            ("plan", json!(self.session.plan())),
            ("depth_priors", json!(self.session.priors().depth)),
            ("backdrop", json!(splats.len() - trained.len())),
            ("offsets", json!(offsets)),
            ("poses", json!(poses)),
            ("offset_error", json!(agreement.map(|agreement| agreement.rms_error))),
            ("offset_correlation", json!(agreement.and_then(|agreement| agreement.correlation))),
        ] {
            totals[name] = value;
        }
        if self.team.size() > 1 {
            totals["ranks"] = json!(self.session.trainer().shared());
        }
        write_json(&output.join("train.json"), &totals)?;
        let renderer = Renderer::new(self.scorer.gpu.clone(), &splats, self.scorer.run.constants)?;
        let (scores, examples) =
            self.scorer.score_all(renderer, SceneSize::of(&splats), &scene, &fits, step, output)?;
        if let Some(scores) = &scores {
            let has_backdrop = splats.len() > trained.len();
            let last = if has_backdrop { self.scorer.score_sample(&trained, &self.some_test, step)? } else { None };
            if let Some(some) = last.map_or_else(|| self.last_of(scores), |sample| Some(sample.evaluation)) {
                self.log.push(Kind::Evaluation, &some)?;
                self.warn_of_a_fall()?;
                Checkpoint::keep_best(&self.checkpoints, some.step, some.mean.psnr)?;
            }
        }
        self.log.write()?;
        let report = self.scorer.report(scores.as_ref(), &examples, output, output)?;
        if json {
            return print_json(&totals);
        }
        let quality = match &scores {
            Some(SceneScores { evaluation: Evaluation { mean, views, .. }, .. }) => {
                format!("{}: PSNR {:.2} dB, SSIM {:.4}", count(views.len(), "test image"), mean.psnr, mean.ssim)
            }
            None => {
                "no test images that count (name some with --test-cameras; an image that its mask hides has no score)"
                    .into()
            }
        };
        if !offsets.is_empty() {
            time_offsets::print(&offsets);
        }
        camera_poses::print(&poses);
        let step = if per_step < 0.1 { format!("{:.2} ms", 1e3 * per_step) } else { format!("{per_step:.3} s") };
        out!("{quality}; {}, {step} a step; {}", count(splats.len(), "Gaussian"), report.display());
        Ok(())
    }
}
