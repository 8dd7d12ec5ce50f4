//! The device side of training: forward, loss, backward and Adam in one recording, one image a step.
//!
//! A step is handed to the device before the one before has ended, and the host waits for none but the oldest. A step
//! whose lists do not fit leaves a mark that stops those after it; all are then run again in order with more room.

mod profile;
mod report;
mod shared;
mod state;
mod step;

pub use profile::ProfiledStep;
pub use report::StepReport;

use crate::error::Result;
use crate::gpu::generated::{AdamParams, Status};
use crate::gpu::{Buf, Gpu, Recording, Running, Staging};
use crate::scene::capture::{Asked, Picture};
use crate::scene::{Clearing, Cone, Splats, View};
use crate::settings::Constants;
use crate::stage::{
    AdamMode, Batch, Clearings, DensityRound, Lists, Moments, Optimiser, Purpose, Room, SceneBuffers, State,
    StepSettings, Workspace, adam_params, constants_on, lazy_sums,
};
use crate::train::config::{Config, Strategy};
use crate::train::density::{density_round, most_gaussians, regularisers};
use crate::train::images::{Loaded, Shot};
use crate::train::objective::{Objective, Report, Taken, Truth};
use crate::train::poses::Correction;
use crate::train::ranks::{Ranks, Shared};
use crate::train::schedule::rates;
use crate::train::setup::Setup;
use report::ImageReport;
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use tracing::debug_span;

/// Steps that the device has at a time: it works on one while the host prepares the next.
pub(in crate::train) const IN_FLIGHT: usize = 2;
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
    clearings: Option<Clearings>,
    work: Option<Workspace>,
    // Sums of gradients, where steps see several images; made for the scene at hand.
    batch: Option<Batch>,
    // Processes that see other images of a step.
    ranks: Option<Arc<dyn Ranks>>,
    shared: Shared,
    objective: Objective,
    staging: Staging,
    // Gaussians that cannot be drawn, counted once per step; density control removes them.
    n_undrawable: Buf<u32>,
    room: Room,
    // Rounds of the blend that the longest list so far needed.
    rounds: u32,
    in_flight: VecDeque<Step>,
    reports: Vec<StepReport>,
}

/// An image that a step is to see.
pub(in crate::train) struct Seen {
    /// The camera that took it.
    pub camera: usize,
    /// As that camera saw.
    pub view: View,
    /// The image; none where another process sees it.
    pub loaded: Option<Loaded>,
}

/// An image of a step.
struct Image {
    view: View,
    by: Taken,
    /// None where another process sees it.
    truth: Option<Truth>,
}

/// What a step needs, kept until it has ended well.
struct Inputs {
    step: u64,
    images: Vec<Image>,
}

impl Inputs {
    /// The images that this process sees.
    fn own(&self) -> Range<usize> {
        let is_own = |image: &Image| image.truth.is_some();
        let first = self.images.iter().position(is_own).unwrap_or(0);
        first..first + self.images.iter().filter(|image| is_own(image)).count()
    }

    fn truths(&self) -> impl Iterator<Item = &Truth> {
        self.images.iter().filter_map(|image| image.truth.as_ref())
    }
}

/// Where a step leaves its numbers.
struct Results {
    /// Tiles of its last image.
    n_tiles: u32,
    /// Pixels of that.
    n_pixels: u32,
    /// Lists of that; none of a step without images.
    lists: Option<Lists>,
    /// By image of this process.
    reports: Vec<Report>,
    /// What all processes' images left, where that is known already.
    known: Vec<ImageReport>,
}

/// A step on the device.
struct Step {
    inputs: Inputs,
    running: Running,
    results: Results,
}

impl Trainer {
    /// Uploads `splats` for a run of `total` steps on the capture that `setup` describes. Gaussians with a number that is
    /// not finite, or colours so bright that squares of them are not, are left out: no gradient would ever mend them.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] naming the buffer that does not fit; [`crate::Error::NoDevice`] when the device cannot do
    /// what the settings ask for.
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
        let accumulation = config.accumulation.on(gpu.caps());
        accumulation.check(gpu.caps())?;
        config.check_held()?;
        splats.refuse_spans(Path::new("the scene"), "training", "give one of the segments that it was joined of")?;
        let constants = constants_on(gpu.caps().kind, config.frame, constants);
        let mut scene = SceneBuffers::upload(&gpu, splats, &constants, Purpose::Training)?;
        scene.holds_static = config.holds_static;
        let zeros = splats.zeros();
        let state = vec![[0.0; 4]; splats.len()];
        let sums = match config.adam {
            AdamMode::Lazy => lazy_sums(|step| rates(&config, step, total, setup.extent.radius), total),
            AdamMode::Dense => vec![[0.0; 4]],
        };
        let moments = Moments::upload(&gpu, &scene, &zeros, &zeros, config.moment_bits)?;
        let state = upload_state(&gpu, &scene, &state)?;
        let optimiser = Optimiser::new(&gpu, moments, state, config.adam, &sums)?;
        let objective = Objective::new(&gpu, &config, &setup)?;
        let clearings = clearings(&gpu, &setup, scene.origin)?;
        let mut room = Room {
            active: 1,
            intersections: scene.n.saturating_mul(4).max(1 << 14),
            tiles: 1,
            pixels: 1,
            outputs: objective.outputs(),
            purpose: Purpose::Training,
            sums: accumulation,
            camera: objective.cameras.wants_gradient(),
            idle: config.adam == AdamMode::Dense && config.batch == 1,
            is_batched: config.batch > 1,
            depth_bits: constants.knobs.depth_bits,
        };
        room.active = room.active_of(scene.n, gpu.caps());
        room.intersections = room.intersections.min(room.max_intersections(&gpu));
        Ok(Trainer {
            objective,
            staging: Staging::new(&gpu),
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
            clearings,
            work: None,
            batch: None,
            ranks: None,
            shared: Shared::default(),
            room,
            rounds: 1,
            in_flight: VecDeque::new(),
            reports: Vec::new(),
        })
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

    /// What is learnt of the cameras' poses after the steps that were handed over, by camera, in the frame of training.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn poses(&mut self) -> Result<BTreeMap<usize, Correction>> {
        self.finish()?;
        let rows = self.objective.cameras.state(&self.gpu)?.poses;
        let cameras = self.setup.learns_pose.iter().zip(rows).enumerate();
        Ok(cameras.filter_map(|(camera, (center, rows))| center.map(|_| (camera, Correction::of(&rows)))).collect())
    }

    /// Ends the learning of the offsets of the cameras that `freeze` names, which become 0.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn freeze_offsets(&mut self, freeze: &[bool]) -> Result<()> {
        self.finish()?;
        self.objective.cameras.freeze(&self.gpu, freeze)
    }

    fn adam_params(&self, step: u64) -> AdamParams {
        let settings = StepSettings {
            // tau stays above half a frame.
            lowest_t_scale: (0.5 * self.setup.dt).ln(),
            ..regularisers(&self.config)
        };
        adam_params(&rates(&self.config, step, self.total, self.setup.extent.radius), &settings, step, self.scene.n)
    }

    /// Hands over one step on `picture`, which camera `camera` of the capture took as `view` says, after the density control
    /// due. Reports of the steps that have ended meanwhile come from [`Trainer::take_reports`].
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] when a picture's lists do not fit the device, [`crate::Error::DeviceLost`]; nothing moves
    /// then.
    #[tracing::instrument(level = "debug", name = "step", skip_all, fields(step = self.step + 1))]
    pub fn train(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<()> {
        let seen = self.seen(camera, view, picture)?;
        self.train_on(vec![seen])
    }

    /// An image of the step to come, which passes.
    fn seen(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<Seen> {
        Ok(Seen { camera, view: view.clone(), loaded: Some(self.load(view, Shot::Passes(picture))?) })
    }

    /// As [`Trainer::train`], on images that have been loaded before density control, for which those that stay may have to give
    /// way.
    pub(in crate::train) fn train_on(&mut self, images: Vec<Seen>) -> Result<()> {
        self.control_density()?;
        let inputs = self.inputs(images);
        self.start(inputs)?;
        while self.in_flight.len() >= IN_FLIGHT {
            self.end_oldest()?;
        }
        Ok(())
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

    /// Whether the images that it is trained on show the background.
    pub fn shows_background(&self) -> bool {
        self.setup.shows_background
    }

    /// Takes the steps to come together with other processes, which see other images of each.
    pub(in crate::train) fn join(&mut self, ranks: Option<Arc<dyn Ranks>>) {
        self.ranks = ranks;
    }

    /// Whether the picture of this name has stayed on the device, see [`Shot`].
    pub(in crate::train) fn has_image(&self, name: &Asked) -> bool {
        self.objective.images.has(name)
    }

    /// Bytes of the pictures that have stayed on the device.
    pub(in crate::train) fn image_bytes(&self) -> u64 {
        self.objective.images.kept_bytes()
    }

    /// Gives up the pictures that have stayed on the device.
    pub(in crate::train) fn release_images(&mut self) {
        self.objective.images.release();
    }

    /// Does `work`, and again where memory runs out while pictures stay on the device: they give way to it.
    fn with_memory<T>(&mut self, work: impl Fn(&mut Self) -> Result<T>) -> Result<T> {
        match work(self) {
            Err(error) if error.is_out_of_memory() && self.objective.images.release() => work(self),
            outcome => outcome,
        }
    }

    /// Reports of the steps that have ended since the last call, in order. That of a step after which density control is due comes
    /// once it has run.
    pub fn take_reports(&mut self) -> Vec<StepReport> {
        let is_owed = self.due_round().is_some() && self.controlled != self.step;
        let kept = usize::from(is_owed && self.reports.last().is_some_and(|report| report.step == self.step));
        let kept = self.reports.split_off(self.reports.len() - kept);
        std::mem::replace(&mut self.reports, kept)
    }

    /// Takes the steps that lazy Adam still owes.
    fn catch_up(&self) -> Result<()> {
        if self.config.adam != AdamMode::Lazy {
            return Ok(());
        }
        self.gpu.write(&self.optimiser.params, &[self.adam_params(self.step.max(1))])?;
        let status = self.gpu.upload("status", &[Status::default()])?;
        let mut rec = Recording::new();
        self.optimiser.record_catch_up_all(&mut rec, &self.scene, &status, self.step);
        self.gpu.run(&rec)
    }

    /// The round of density control that is due after the step handed over last.
    fn due_round(&self) -> Option<DensityRound> {
        let n_frames = (1.0 / self.setup.dt).round() as u32;
        let (n, n_trained, origin) = (self.scene.n, self.scene.n_trained(), self.scene.origin);
        let round =
            density_round(&self.config, (self.step, self.total), (n, n_trained), &self.setup.extent, origin, n_frames)?;
        Some(DensityRound { max_gaussians: self.most_gaussians(), ..round })
    }

    /// The most Gaussians that density control makes: the end of the run needs room, too.
    fn most_gaussians(&self) -> u32 {
        let backdrop = if self.shows_background() { 0 } else { self.config.backdrop };
        most_gaussians(&self.config, self.room.active_of(u32::MAX, self.gpu.caps()), backdrop)
    }

    /// How many Gaussians density control may add to those of now; none where it is to add no more.
    pub fn room_to_grow(&self) -> Option<u32> {
        let density = &self.config.density;
        let grows = density.strategy == Strategy::Adc && density.grows_after(self.step, self.total);
        grows.then(|| self.most_gaussians().saturating_sub(self.scene.n))
    }

    /// The density control due after the step handed over last, once.
    fn control_density(&mut self) -> Result<()> {
        let (Some(round), false) = (self.due_round(), self.controlled == self.step) else { return Ok(()) };
        let _controlling = debug_span!("density", step = self.step).entered();
        while !self.in_flight.is_empty() {
            self.end_oldest()?;
        }
        (self.work, self.batch) = (None, None);
        self.catch_up()?;
        let origin = self.scene.origin;
        let lenses: Vec<Cone> = self.setup.lenses.iter().map(|view| view.cone(origin)).collect();
        let grown = self.with_memory(|trainer| {
            let Trainer { gpu, scene, optimiser: Optimiser { moments, state, .. }, constants, .. } = trainer;
            round.run(gpu, scene, moments, state, &lenses, constants)
        })?;
        self.scene = grown.scene;
        (self.optimiser.moments, self.optimiser.state) = (grown.moments, grown.state);
        self.controlled = self.step;
        self.room.active = self.room.active_of(self.scene.n, self.gpu.caps());
        if let Some(report) = self.reports.last_mut() {
            report.density = Some(grown.counts);
        }
        Ok(())
    }
}

/// The spaces that `setup` keeps clear, relative to `origin`.
fn clearings(gpu: &Gpu, setup: &Setup, origin: [f64; 3]) -> Result<Option<Clearings>> {
    let relative = |clearing: &Clearing| {
        let place = std::array::from_fn(|k| (f64::from(clearing.place[k]) - origin[k]) as f32);
        Clearing { place, ..*clearing }
    };
    Clearings::upload(gpu, &setup.clearings.iter().map(relative).collect::<Vec<_>>())
}

/// State in the order of the scene's Gaussians, by group.
fn upload_state(gpu: &Gpu, scene: &SceneBuffers, state: &[[f32; 4]]) -> Result<Vec<State>> {
    scene.groups.iter().map(|g| gpu.upload("state", &state[g.start..g.start + g.n as usize])).collect()
}
