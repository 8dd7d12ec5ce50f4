//! The device side of training: forward, loss, backward and Adam in one recording, one image a step.
//!
//! A step is handed to the device before the one before has ended, and the host waits for none but the oldest. A step
//! whose lists do not fit leaves a mark that stops those after it; all are then run again in order with more room.

use super::checkpoint::{Checkpoint, Owed};
use super::config::Config;
use super::density::{density_round, noise, regularisers};
use super::objective::{Objective, Sums, Truth};
use super::schedule::rates;
use super::setup::Setup;
use crate::error::{Error, Result};
use crate::gpu::generated::{AdamParams, Status, ViewParams};
use crate::gpu::{Buf, Dispatch, Gpu, PassTime, Recording, Running, Slice};
use crate::scene::capture::Picture;
use crate::scene::{Cone, Similarity, Splats, View};
use crate::settings::Constants;
use crate::stage::{
    AdamMode, Counters, Counts, DensityRound, Lists, Moments, Optimiser, PassReport, Purpose, Room, SceneBuffers, Size,
    State, StepSettings, Strip, Target, Verdict, Workspace, adam_params, add_passes, lazy_sums, record_mcmc_noise,
    view_params,
};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;
use tracing::debug_span;

/// Steps that the device has at a time: it works on one while the host prepares the next.
const IN_FLIGHT: usize = 2;
/// Largest coefficient of a colour that training begins with: fourth powers of ten times as much are still finite, which
/// SSIM takes.
const BRIGHTEST: f32 = 1e4;

/// A scene being trained: its Gaussians with their moments, on the device.
pub struct Trainer {
    gpu: Arc<Gpu>,
    constants: Constants,
    config: Config,
    total: u64,
    setup: Setup,
    // Steps handed over.
    step: u64,
    // The step after which density control ran last, or was found not to be due.
    controlled: u64,
    scene: SceneBuffers,
    optimiser: Optimiser,
    work: Option<Workspace>,
    objective: Objective,
    // Gaussians that cannot be drawn, counted once per step; density control removes them.
    n_undrawable: Buf<u32>,
    room: Room,
    // Rounds of the blend that the longest list so far needed.
    rounds: u32,
    in_flight: VecDeque<Step>,
    reports: Vec<StepReport>,
}

/// What a step needs, kept until it has ended well.
struct Inputs {
    step: u64,
    view: View,
    truth: Truth,
}

/// Where a step leaves its numbers.
struct Results {
    n_tiles: u32,
    lists: Lists,
    status: Slice,
    sums: Sums,
    n_bad: Slice,
}

/// A step on the device.
struct Step {
    inputs: Inputs,
    running: Running,
    results: Results,
}

/// What one step did.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Value of the loss.
    pub loss: f64,
    /// What the terms log, by key: those of [`super::logged`] that the step has.
    #[serde(flatten)]
    pub terms: BTreeMap<&'static str, f64>,
    /// Gaussians.
    pub gaussians: u32,
    /// Gaussians in the view's time and frustum.
    pub active: u32,
    /// Gaussians that touch the picture.
    pub visible: u32,
    /// Pairs of a Gaussian and a tile.
    pub intersections: u32,
    /// Gradients that were not finite and changed nothing, since the start.
    pub bad_gradients: u32,
    /// The round of density control after the step, if there was one.
    pub density: Option<Counts>,
}

impl StepReport {
    /// A number that a term logs, where the step has it.
    pub fn term(&self, key: &str) -> Option<f64> {
        self.terms.get(key).copied()
    }
}

/// A step whose passes were timed.
pub struct ProfiledStep {
    /// Its passes, by label, in the order of their first.
    pub passes: Vec<PassReport>,
    /// Each pass.
    pub times: Vec<PassTime>,
    /// What the passes had to do.
    pub counters: Counters,
    /// What the host did: name, when it began, seconds.
    pub host: Vec<(&'static str, Instant, f64)>,
}

impl Trainer {
    /// Uploads `splats` for a run of `total` steps on the capture that `setup` describes. Gaussians with a number that is
    /// not finite, or colours so bright that squares of them are not, are left out: no gradient would ever mend them.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit; [`Error::NoDevice`] when the device cannot do what the
    /// settings ask for.
    pub fn new(
        gpu: Arc<Gpu>,
        splats: &Splats,
        constants: Constants,
        config: Config,
        total: u64,
        setup: Setup,
    ) -> Result<Self> {
        let k = splats.n_coefficients();
        let is_bearable = |x: &f32| x.abs() <= BRIGHTEST;
        let sound = splats
            .kept(|i| splats.is_finite(i) && splats.sh[i * k..(i + 1) * k].as_flattened().iter().all(is_bearable));
        Self::begin(gpu, &sound, constants, config, total, setup)
    }

    #[tracing::instrument(level = "info", name = "upload scene", skip_all)]
    fn begin(
        gpu: Arc<Gpu>,
        splats: &Splats,
        constants: Constants,
        config: Config,
        total: u64,
        setup: Setup,
    ) -> Result<Self> {
        config.accumulation.check(&gpu)?;
        let constants = config.frame.on(constants);
        let scene = SceneBuffers::upload(&gpu, splats, &constants, Purpose::Training)?;
        let zeros = zeros_like(splats);
        let state = vec![[0.0; 4]; splats.len()];
        let sums = match config.adam {
            AdamMode::Lazy => lazy_sums(|step| rates(&config, step, total, setup.extent.radius), total),
            AdamMode::Dense | AdamMode::Sparse => vec![[0.0; 4]],
        };
        let moments = Moments::upload(&gpu, &scene, &zeros, &zeros, config.moment_bits)?;
        let state = upload_state(&gpu, &scene, &state)?;
        let optimiser = Optimiser::new(&gpu, moments, state, config.adam, &sums)?;
        let objective = Objective::new(&gpu, &config, &setup)?;
        let room = Room {
            active: scene.n.max(1),
            intersections: scene.n.saturating_mul(4).max(1 << 14),
            tiles: 1,
            pixels: 1,
            outputs: objective.outputs(),
            purpose: Purpose::Training,
            accumulation: config.accumulation,
            camera: objective.cameras.wants_gradient(),
            depth_bits: constants.knobs.depth_bits,
        };
        Ok(Trainer {
            objective,
            n_undrawable: gpu.upload("undrawable Gaussians", &[0u32])?,
            gpu,
            constants,
            config,
            total,
            setup,
            step: 0,
            controlled: 0,
            scene,
            optimiser,
            work: None,
            room,
            rounds: 1,
            in_flight: VecDeque::new(),
            reports: Vec::new(),
        })
    }

    /// Goes on from `checkpoint`; the steps that follow give the bits that they would have given without it.
    ///
    /// # Errors
    /// As [`Trainer::new`].
    pub fn resume(gpu: Arc<Gpu>, checkpoint: &Checkpoint, constants: Constants, setup: Setup) -> Result<Self> {
        let Checkpoint { step, total, config, origin, params, first, second, state, cameras, owed, .. } = checkpoint;
        let setup = Setup { has_grid: cameras.has_grid.clone(), ..setup };
        let mut trainer = Self::begin(gpu, params, constants, config.clone(), *total, setup)?;
        trainer.objective.cameras.restore(&trainer.gpu, cameras)?;
        trainer.scene.origin = *origin;
        trainer.optimiser.moments = Moments::upload(&trainer.gpu, &trainer.scene, first, second, config.moment_bits)?;
        trainer.optimiser.state = upload_state(&trainer.gpu, &trainer.scene, state)?;
        // Density control that is still due runs before the next step.
        (trainer.step, trainer.controlled) = (*step, if owed.density { step.saturating_sub(1) } else { *step });
        Ok(trainer)
    }

    /// Everything that [`Trainer::resume`] needs, after the steps that were handed over and the density control due.
    /// Its `world` is the caller's to set.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    #[tracing::instrument(level = "info", name = "checkpoint", skip_all)]
    pub fn checkpoint(&mut self) -> Result<Checkpoint> {
        self.finish()?;
        self.snapshot()
    }

    /// After an error that left the device alive: everything after the last step that ended well, with what was due
    /// after it and has not been done. Frees the memory of a step first, for the reading. To be used once, as the last
    /// thing before the trainer is dropped or replaced.
    ///
    /// # Errors
    /// Those of the device, which may be lost or still without memory.
    pub fn rescue(&mut self) -> Result<Checkpoint> {
        while let Some(step) = self.in_flight.front() {
            step.running.wait()?;
            let Some(Step { inputs, results, .. }) = self.in_flight.pop_front() else { break };
            if !matches!(self.end(&inputs, &results), Ok(true)) {
                // Those behind it have done nothing.
                self.step = inputs.step - 1;
                self.in_flight.clear();
            }
        }
        self.work = None;
        let owed = Owed { density: self.due_round().is_some() && self.controlled != self.step, ..Owed::default() };
        Ok(Checkpoint { owed, ..self.snapshot()? })
    }

    /// What the device holds.
    fn snapshot(&self) -> Result<Checkpoint> {
        let (first, second) = self.optimiser.moments.download(&self.gpu, &self.scene)?;
        Ok(Checkpoint {
            step: self.step,
            total: self.total,
            config: self.config.clone(),
            world: Similarity::default(),
            origin: self.scene.origin,
            params: self.scene.download(&self.gpu, self.scene.groups.iter().map(|g| &g.params))?,
            first,
            second,
            state: self.state()?,
            cameras: self.objective.cameras.state(&self.gpu)?,
            owed: Owed::default(),
        })
    }

    /// State of every Gaussian, see [`Optimiser::state`].
    fn state(&self) -> Result<Vec<[f32; 4]>> {
        let mut all = Vec::with_capacity(self.scene.n as usize);
        for (group, buffer) in self.scene.groups.iter().zip(&self.optimiser.state) {
            all.extend_from_slice(&self.gpu.read(buffer)?[..group.n as usize]);
        }
        Ok(all)
    }

    /// Begins with room for so few intersections; the first step that needs more is run again.
    pub fn limit_intersections(&mut self, n: u32) {
        self.room.intersections = n.max(1);
    }

    /// Steps handed over.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Steps that are known to have ended.
    pub fn ended(&self) -> u64 {
        self.step - self.in_flight.len() as u64
    }

    /// Gaussians.
    pub fn n_gaussians(&self) -> u32 {
        self.scene.n
    }

    /// The Gaussians after the steps that were handed over and the density control due, in the frame of the views it is trained on.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn splats(&mut self) -> Result<Splats> {
        self.finish()?;
        let mut splats = self.download_current()?;
        let origin = self.scene.origin;
        for p in &mut splats.position {
            *p = std::array::from_fn(|k| (f64::from(p[k]) + origin[k]) as f32);
        }
        Ok(splats)
    }

    /// The parameters, caught up with the steps that lazy Adam still owes. On a copy: when the run is looked at must not
    /// change its bits.
    fn download_current(&self) -> Result<Splats> {
        let splats = self.scene.download(&self.gpu, self.scene.groups.iter().map(|g| &g.params))?;
        if self.config.adam != AdamMode::Lazy {
            return Ok(splats);
        }
        let (first, second) = self.optimiser.moments.download(&self.gpu, &self.scene)?;
        let scene = SceneBuffers::upload(&self.gpu, &splats, &self.constants, Purpose::Training)?;
        let moments = Moments::upload(&self.gpu, &scene, &first, &second, self.config.moment_bits)?;
        let state = upload_state(&self.gpu, &scene, &self.state()?)?;
        let sums = lazy_sums(|step| rates(&self.config, step, self.total, self.setup.extent.radius), self.total);
        let copy = Optimiser::new(&self.gpu, moments, state, AdamMode::Lazy, &sums)?;
        self.gpu.write(&copy.params, &[self.adam_params(self.step.max(1))])?;
        let mut rec = Recording::new();
        copy.record_catch_up_all(&mut rec, &scene, &self.gpu.upload("status", &[Status::default()])?, self.step);
        self.gpu.run(&rec)?;
        scene.download(&self.gpu, scene.groups.iter().map(|g| &g.params))
    }

    /// The cameras' time offsets after the steps that were handed over, frames, by camera, and which of them are learnt; empty
    /// where none are.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn offsets(&mut self) -> Result<(Vec<f64>, Vec<bool>)> {
        self.finish()?;
        let state = self.objective.cameras.state(&self.gpu)?;
        Ok((state.clocks.iter().map(|clock| f64::from(clock[0])).collect(), state.learns_offset))
    }

    /// Ends the learning of the offsets of the cameras that `freeze` names, which become 0.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn freeze_offsets(&mut self, freeze: &[bool]) -> Result<()> {
        self.finish()?;
        self.objective.cameras.freeze(&self.gpu, freeze)
    }

    /// Goes on from `checkpoint`, one of this run at its present step whose Gaussians or cameras have been changed.
    ///
    /// # Errors
    /// As [`Trainer::new`].
    pub fn replace(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        let reports = std::mem::take(&mut self.reports);
        // Two scenes need not fit the device.
        self.work = None;
        *self = Self::resume(self.gpu.clone(), checkpoint, self.constants, self.setup.clone())?;
        self.reports = reports;
        Ok(())
    }

    /// Goes on to `total` steps with the settings `config`. All that depends on how far the run is (learning rates, the degree of
    /// the spherical harmonics, density control, the pictures' size, reviews) is from here on as at this step of a run of
    /// `total` steps.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn extend(&mut self, config: Config, total: u64) -> Result<()> {
        self.finish()?;
        if self.config.adam == AdamMode::Lazy {
            // The steps that are owed are of the rates so far.
            self.gpu.write(&self.optimiser.params, &[self.adam_params(self.step.max(1))])?;
            let mut rec = Recording::new();
            let status = self.gpu.upload("status", &[Status::default()])?;
            self.optimiser.record_catch_up_all(&mut rec, &self.scene, &status, self.step);
            self.gpu.run(&rec)?;
        }
        let checkpoint = Checkpoint { config, total, ..self.checkpoint()? };
        self.replace(&checkpoint)
    }

    fn adam_params(&self, step: u64) -> AdamParams {
        let settings = StepSettings {
            // tau stays above half a frame.
            lowest_t_scale: (0.5 * self.setup.dt).ln(),
            ..regularisers(&self.config)
        };
        adam_params(&rates(&self.config, step, self.total, self.setup.extent.radius), &settings, step, self.scene.n)
    }

    /// Hands over one step on `picture`, which camera `camera` of the capture took as `view` says, after the density control due. Reports of the steps that have
    /// ended meanwhile come from [`Trainer::take_reports`].
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when a picture's lists do not fit the device, [`Error::DeviceLost`]; nothing moves then.
    #[tracing::instrument(level = "debug", name = "step", skip_all, fields(step = self.step + 1))]
    pub fn train(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<()> {
        self.control_density()?;
        let inputs = self.inputs(camera, view, picture)?;
        self.start(inputs)?;
        while self.in_flight.len() >= IN_FLIGHT {
            self.end_oldest()?;
        }
        Ok(())
    }

    /// As [`Trainer::train`], but waits for the end and gives the time of every pass; the counting that follows is not in
    /// the times.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    #[tracing::instrument(level = "debug", name = "step", skip_all, fields(step = self.step + 1))]
    pub fn profile(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<ProfiledStep> {
        self.finish()?;
        let mut host = Vec::new();
        let mut begun = Instant::now();
        let mut done = |what| {
            host.push((what, begun, begun.elapsed().as_secs_f64()));
            begun = Instant::now();
        };
        let mut inputs = self.inputs(camera, view, picture)?;
        done("stage images");
        loop {
            let (rec, results) = self.record(&inputs)?;
            done("record");
            let step = Step { inputs, running: self.gpu.start_timed(&rec)?, results };
            self.step = step.inputs.step;
            let times = match step.running.wait() {
                Ok(times) => times,
                Err(error) => {
                    // It may have moved the scene.
                    self.in_flight.push_back(step);
                    return Err(error);
                }
            };
            done("submit and wait");
            let is_complete = self.end(&step.inputs, &step.results)?;
            done("read back");
            inputs = step.inputs;
            if !is_complete {
                continue;
            }
            let n_pixels = view.width * view.height;
            let Results { lists, n_tiles, .. } = &step.results;
            let counters = match &self.work {
                Some(work) => Counters::read(&self.gpu, work, &self.scene, lists, *n_tiles, n_pixels)?,
                None => Counters::default(),
            };
            let passes = add_passes(Vec::new(), &rec, &times, &counters);
            return Ok(ProfiledStep { passes, times, counters, host });
        }
    }

    /// As [`Trainer::train`], but waits for the end and gives the step's first dispatch of a kernel, with what it worked on.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn capture(&mut self, camera: usize, view: &View, picture: &Picture, kernel: &str) -> Result<Option<Dispatch>> {
        self.finish()?;
        let inputs = self.inputs(camera, view, picture)?;
        loop {
            let (rec, results) = self.record(&inputs)?;
            let dispatch = self.gpu.run_capturing(rec, kernel)?;
            if self.end(&inputs, &results)? {
                self.step = inputs.step;
                return Ok(dispatch);
            }
        }
    }

    /// Waits for all steps that were handed over, and runs the density control due.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn finish(&mut self) -> Result<()> {
        while !self.in_flight.is_empty() {
            self.end_oldest()?;
        }
        self.control_density()
    }

    /// Reports of the steps that have ended since the last call, in order.
    pub fn take_reports(&mut self) -> Vec<StepReport> {
        std::mem::take(&mut self.reports)
    }

    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    fn inputs(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<Inputs> {
        let (background, flow_model) = (self.config.background, self.setup.flow_model);
        let step = self.step + 1;
        let reduction = self.config.resolution.reduction(step, self.total).min(view.width).min(view.height);
        let reduced = (reduction > 1).then(|| picture.reduced(reduction));
        let picture = reduced.as_ref().unwrap_or(picture);
        Ok(Inputs {
            step,
            view: View { background, flow_model, ..view.reduced(reduction) },
            truth: self.objective.stage(&self.gpu, picture, camera, step, reduction)?,
        })
    }

    /// Hands a step to the device.
    fn start(&mut self, inputs: Inputs) -> Result<()> {
        let (rec, results) = self.record(&inputs)?;
        let running = self.gpu.start(&rec)?;
        self.step = inputs.step;
        self.in_flight.push_back(Step { inputs, running, results });
        Ok(())
    }

    /// Waits for the oldest step. When its lists did not fit, it and those behind it, which have done nothing, start anew. One
    /// that cannot be waited for stays: it may have moved the scene.
    fn end_oldest(&mut self) -> Result<()> {
        let Some(step) = self.in_flight.front() else { return Ok(()) };
        step.running.wait()?;
        let Some(Step { inputs, results, .. }) = self.in_flight.pop_front() else { return Ok(()) };
        if self.end(&inputs, &results)? {
            return Ok(());
        }
        let mut behind = Vec::new();
        for step in std::mem::take(&mut self.in_flight) {
            step.running.wait()?;
            behind.push(step.inputs);
        }
        // The first one alone, until it fits.
        self.start(inputs)?;
        self.end_oldest()?;
        behind.into_iter().try_for_each(|inputs| self.start(inputs))
    }

    /// Reads what a step that has ended left. `false` when it moved nothing and needs the room that is there now: it is then
    /// no longer counted.
    fn end(&mut self, inputs: &Inputs, results: &Results) -> Result<bool> {
        let status: Status = self.gpu.peek(&results.status)?.first().copied().unwrap_or_default();
        let Some(work) = &self.work else { return Ok(false) };
        match work.room.verdict(&self.gpu, &status, self.rounds) {
            Verdict::Complete => {}
            Verdict::Replay(room, rounds) => {
                self.step = inputs.step - 1;
                self.gpu.write(&work.status, &[Status::default()])?;
                (self.room, self.rounds) = (room, rounds);
                return Ok(false);
            }
            Verdict::TooMuch { what, needed, limit } => {
                self.in_flight.clear();
                self.step = inputs.step - 1;
                return Err(Error::OutOfMemory {
                    what: format!("training view `{}`: {what}", inputs.view.name),
                    needed: u64::from(needed),
                    limit: u64::from(limit),
                    remedy: "train on smaller pictures, lower --max-gaussians, or choose another device".to_owned(),
                });
            }
        }
        let values = self.objective.values(&self.gpu, &inputs.truth, &results.sums)?;
        self.reports.push(StepReport {
            step: inputs.step,
            loss: values.loss,
            terms: values.logged,
            gaussians: self.scene.n,
            active: status.n_active,
            visible: status.n_visible,
            intersections: status.n_intersections,
            bad_gradients: self.gpu.peek(&results.n_bad)?.first().copied().unwrap_or(0),
            density: None,
        });
        Ok(true)
    }

    /// The passes of a step, and where its numbers will be.
    #[tracing::instrument(level = "debug", name = "record", skip_all)]
    fn record(&mut self, inputs: &Inputs) -> Result<(Recording, Results)> {
        let Inputs { step, view, truth } = inputs;
        let strip = Strip::whole(view);
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_tiles = tiles_x * tiles_y;
        let n_pixels = view.width * view.height;
        let room =
            Room { tiles: self.room.tiles.max(n_tiles), pixels: self.room.pixels.max(n_pixels as usize), ..self.room };
        if room.pixels > self.room.pixels || self.work.as_ref().is_some_and(|work| work.room != room) {
            // A failure stays in the workspace that it happened in.
            while !self.in_flight.is_empty() {
                self.end_oldest()?;
            }
        }
        if room.pixels > self.room.pixels {
            self.objective.fit(&self.gpu, room.pixels)?;
        }
        self.room = Room { tiles: room.tiles, pixels: room.pixels, ..self.room };
        let mut params: ViewParams = view_params(view, &self.constants, self.scene.origin, strip);
        self.objective.adjust(&mut params);
        let adam = self.adam_params(*step);
        let (gpu, scene, optimiser, rounds) = (&self.gpu, &self.scene, &self.optimiser, self.rounds);
        let work = Workspace::fit(&mut self.work, gpu, scene, self.room)?;
        let mut rec = Recording::new();
        rec.stage("upload");
        rec.copy(gpu.stage("staged view", &[params])?, work.view.slice());
        rec.copy(gpu.stage("staged adam parameters", &[adam])?, optimiser.params.slice());
        self.objective.record_upload(&mut rec, work, truth);
        let status = &work.status;
        let is_lazy = self.config.adam == AdamMode::Lazy;
        let size = Size { n_tiles, n_pixels, rounds };
        let forward = debug_span!("forward").entered();
        let lists = work.record_forward(&mut rec, scene, size, |rec| {
            optimiser.record_catch_up(rec, scene, &work.cull, status, step - 1);
            if is_lazy {
                scene.record_halves(rec);
            }
        });
        drop(forward);
        if work.backward.is_some() {
            debug_span!("loss").in_scope(|| self.objective.record_loss(gpu, &mut rec, work, truth))?;
            // Gaussians in view take their step with the last pass of it.
            let target = Target::Step(optimiser);
            debug_span!("backward").in_scope(|| work.record_backward(&mut rec, scene, &lists, size, &target));
            let _stepping = debug_span!("optimiser").entered();
            optimiser.record_idle(&mut rec, scene, &work.cull, status);
            self.objective.record_step(&mut rec, work, truth, *step, self.total);
            if let Some((rate, key)) = noise(&self.config, *step, self.total, self.setup.extent.radius) {
                record_mcmc_noise(&mut rec, scene, status, rate, key);
            }
            scene.record_bounds(&mut rec, &self.constants, &self.n_undrawable);
        }
        rec.stage("report");
        let results = Results {
            n_tiles,
            lists,
            status: gpu.readback::<Status>("status of a step", 1)?,
            sums: self.objective.record_report(&mut rec, gpu, truth)?,
            n_bad: gpu.readback::<u32>("bad gradients of a step", 1)?,
        };
        rec.copy(status.slice(), results.status.clone());
        rec.copy(optimiser.n_bad.slice(), results.n_bad.clone());
        Ok((rec, results))
    }

    /// The round of density control that is due after the step handed over last.
    fn due_round(&self) -> Option<DensityRound> {
        let n_frames = (1.0 / self.setup.dt).round() as u32;
        let SceneBuffers { n, origin, .. } = self.scene;
        density_round(&self.config, (self.step, self.total), n, &self.setup.extent, origin, n_frames)
    }

    /// The density control due after the step handed over last, once.
    fn control_density(&mut self) -> Result<()> {
        let (Some(round), false) = (self.due_round(), self.controlled == self.step) else { return Ok(()) };
        let _controlling = debug_span!("density", step = self.step).entered();
        while !self.in_flight.is_empty() {
            self.end_oldest()?;
        }
        self.work = None;
        if self.config.adam == AdamMode::Lazy {
            self.gpu.write(&self.optimiser.params, &[self.adam_params(self.step)])?;
            let status = self.gpu.upload("status", &[Status::default()])?;
            let mut rec = Recording::new();
            self.optimiser.record_catch_up_all(&mut rec, &self.scene, &status, self.step);
            self.gpu.run(&rec)?;
        }
        let (moments, state) = (&self.optimiser.moments, &self.optimiser.state);
        let origin = self.scene.origin;
        let lenses: Vec<Cone> = self.setup.lenses.iter().map(|view| view.cone(origin)).collect();
        let grown = round.run(&self.gpu, &self.scene, moments, state, &lenses, &self.constants)?;
        self.scene = grown.scene;
        (self.optimiser.moments, self.optimiser.state) = (grown.moments, grown.state);
        self.controlled = self.step;
        self.room.active = self.scene.n.max(1);
        if let Some(report) = self.reports.last_mut() {
            report.density = Some(grown.counts);
        }
        Ok(())
    }
}

/// Zeros in the shapes of `splats`.
fn zeros_like(splats: &Splats) -> Splats {
    let n = splats.len();
    Splats {
        n_static: splats.n_static,
        position: vec![[0.0; 3]; n],
        rotation: vec![[0.0; 4]; n],
        scale: vec![[0.0; 3]; n],
        opacity: vec![0.0; n],
        sh: vec![[0.0; 3]; splats.sh.len()],
        motion: vec![bytemuck::Zeroable::zeroed(); splats.motion.len()],
        degree: splats.degree.clone(),
        source_row: splats.source_row.clone(),
        ..Splats::new(splats.sh_degree)
    }
}

/// State in the order of the scene's Gaussians, by group.
fn upload_state(gpu: &Gpu, scene: &SceneBuffers, state: &[[f32; 4]]) -> Result<Vec<State>> {
    scene.groups.iter().map(|g| gpu.upload("state", &state[g.start..g.start + g.n as usize])).collect()
}
