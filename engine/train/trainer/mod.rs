//! The device side of training: forward, loss, backward and Adam in one recording.
//!
//! A step is submitted before the one before has ended, and the host waits for the oldest only. A step whose lists do
//! not fit leaves a mark that stops those after it; all are then run again in order with larger buffers.

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
use crate::internals::train::cameras::Taken;
use crate::internals::train::density::most_gaussians;
use crate::internals::train::images::{ImageStore, Source, StepImage, StepImages, Steps};
use crate::internals::train::objective::{Objective, Report, Truth};
use crate::internals::train::{Config, Correction, Ranks, Setup, Shared, Strategy, density_round, rates, regularisers};
use crate::scene::capture::Picture;
use crate::scene::{Clearing, Cone, Splats, View};
use crate::settings::Constants;
use crate::stage::{
    AdamMode, Batch, Capacity, Clearings, DensityRound, Lists, Moments, Optimiser, Purpose, SceneBuffers, Size, State,
    StepSettings, Workspace, adam_params, constants_on, lazy_sums,
};
use report::ImageReport;
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use tracing::debug_span;

/// Steps on the device at a time: it runs one while the host prepares the next.
pub(in crate::internals::train) const IN_FLIGHT: usize = 2;
/// Largest coefficient of a colour that training begins with: SSIM takes fourth powers, which must stay finite.
const BRIGHTEST: f32 = 1e4;

/// A scene being trained: its Gaussians with their moments, on the device.
pub struct Trainer {
    gpu: Arc<Gpu>,
    constants: Constants,
    config: Config,
    total: u64,
    setup: Setup,
    step: u64,
    // The step after which density control ran last, or was found not to be due.
    controlled: u64,
    scene: SceneBuffers,
    optimiser: Optimiser,
    clearings: Option<Clearings>,
    work: Option<Workspace>,
    // Sums of gradients, if a step has several images; made for the present scene.
    batch: Option<Batch>,
    // Processes that see other images of a step.
    ranks: Option<Arc<dyn Ranks>>,
    shared: Shared,
    objective: Objective,
    pub(in crate::internals::train) images: ImageStore,
    staging: Arc<Staging>,
    // Gaussians that cannot be drawn, counted once per step; density control removes them.
    n_undrawable: Buf<u32>,
    capacity: Capacity,
    // Rounds of the blend that the longest list so far needed.
    rounds: u32,
    in_flight: VecDeque<Step>,
    reports: Vec<StepReport>,
}

struct Image {
    view: View,
    by: Taken,
    /// None if another process sees it.
    truth: Option<Truth>,
}

/// The inputs of a step.
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

struct Results {
    /// Lists and size of its last image; none without images.
    last: Option<(Lists, Size)>,
    /// By image of this process.
    reports: Vec<Report>,
    /// Reports of all processes' images, if they are known already.
    known: Vec<ImageReport>,
}

struct Step {
    inputs: Inputs,
    running: Running,
    results: Results,
}

impl Trainer {
    /// Uploads `splats` for a run of `total` steps on the capture that `setup` describes. Gaussians that are not finite,
    /// or so bright that their squares are not, are left out: no gradient would mend them.
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
        let objective = Objective::new(&gpu, &config, &setup, total)?;
        let staging = Arc::new(Staging::new(&gpu));
        let images = ImageStore::new(gpu.clone(), staging.clone(), setup.data)?;
        let clearings = clearings(&gpu, &setup, scene.origin)?;
        let mut capacity = Capacity {
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
        capacity.active = capacity.active_of(scene.n, gpu.caps());
        capacity.intersections = capacity.intersections.min(capacity.max_intersections(&gpu));
        Ok(Trainer {
            objective,
            images,
            staging,
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
            capacity,
            rounds: 1,
            in_flight: VecDeque::new(),
            reports: Vec::new(),
        })
    }

    /// Limits the first buffers; a step that needs more is run again.
    pub fn limit_intersections(&mut self, n: u32) {
        self.capacity.intersections = n.max(1);
    }

    /// Submitted steps.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Submitted steps that have ended.
    pub fn ended(&self) -> u64 {
        self.step - self.in_flight.len() as u64
    }

    pub fn n_gaussians(&self) -> u32 {
        self.scene.n
    }

    /// The cameras' time offsets after all submitted steps, frames, and which of them are learnt; empty if none are.
    pub fn offsets(&mut self) -> Result<(Vec<f64>, Vec<bool>)> {
        self.finish()?;
        let state = self.objective.cameras.state(&self.gpu)?;
        Ok((state.clocks.iter().map(|clock| f64::from(clock[0])).collect(), state.learns_offset))
    }

    /// The learnt corrections of poses after all submitted steps, by camera, in the frame of training.
    pub fn poses(&mut self) -> Result<BTreeMap<usize, Correction>> {
        self.finish()?;
        let rows = self.objective.cameras.state(&self.gpu)?.poses;
        let cameras = self.setup.learns_pose.iter().zip(rows).enumerate();
        Ok(cameras.filter_map(|(camera, (center, rows))| center.map(|_| (camera, Correction::of(&rows)))).collect())
    }

    /// Fixes the offsets of the cameras that `freeze` names at 0.
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

    /// Submits a step on `picture`, which camera `camera` of the capture took as `view`, after the density control
    /// due. On a fault the scene is unchanged.
    #[tracing::instrument(level = "debug", name = "step", skip_all, fields(step = self.step + 1))]
    pub fn train(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<()> {
        let image = self.passing(camera, view, picture)?;
        self.train_on(vec![image])
    }

    /// `picture`, on the device for the next step alone.
    fn passing(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<StepImage> {
        let reduction = self.reduction(view);
        let is_whole = [picture.width, picture.height] == [view.intrinsics.width, view.intrinsics.height];
        let reduced = (reduction > 1 && is_whole).then(|| picture.reduced(reduction));
        let resident = self.images.residents.pass(&self.gpu, &self.staging, reduced.as_ref().unwrap_or(picture))?;
        Ok(StepImage { camera, view: view.clone(), resident: Some(resident) })
    }

    /// The images of the next step; none at the end of the run.
    pub(in crate::internals::train) fn next_images(&mut self, source: &Source) -> Result<StepImages> {
        let own = self.own_images(self.config.batch as usize);
        let steps = Steps { config: &self.config, done: self.step, total: self.total, own };
        self.images.next(source, &steps)
    }

    /// As [`Trainer::train`], on images that were loaded before density control, for which kept ones may give way.
    pub(in crate::internals::train) fn train_on(&mut self, images: Vec<StepImage>) -> Result<()> {
        self.control_density()?;
        let inputs = self.inputs(images);
        self.start(inputs)?;
        while self.in_flight.len() >= IN_FLIGHT {
            self.end_oldest()?;
        }
        Ok(())
    }

    /// Waits for all submitted steps.
    fn end_all(&mut self) -> Result<()> {
        while !self.in_flight.is_empty() {
            self.end_oldest()?;
        }
        Ok(())
    }

    /// Waits for all submitted steps, and runs the density control due.
    pub fn finish(&mut self) -> Result<()> {
        self.end_all()?;
        self.control_density()
    }

    pub fn shows_background(&self) -> bool {
        self.setup.shows_background
    }

    pub(in crate::internals::train) fn join(&mut self, ranks: Option<Arc<dyn Ranks>>) {
        self.ranks = ranks;
    }

    /// Does `work`. If memory runs out, frees the pictures that stay on the device and tries again.
    fn with_memory<T>(&mut self, work: impl Fn(&mut Self) -> Result<T>) -> Result<T> {
        match work(self) {
            Err(error) if error.is_out_of_memory() && self.images.residents.release() => work(self),
            outcome => outcome,
        }
    }

    /// Reports of the steps that have ended since the last call, in order. A step's density control is in its report.
    pub fn take_reports(&mut self) -> Vec<StepReport> {
        let is_due = self.due_round().is_some() && self.controlled != self.step;
        let kept = usize::from(is_due && self.reports.last().is_some_and(|report| report.step == self.step));
        let kept = self.reports.split_off(self.reports.len() - kept);
        std::mem::replace(&mut self.reports, kept)
    }

    /// Catches up with the steps that lazy Adam has put off.
    fn catch_up(&self) -> Result<()> {
        if self.config.adam == AdamMode::Lazy { self.catch_up_on(&self.optimiser, &self.scene) } else { Ok(()) }
    }

    fn catch_up_on(&self, optimiser: &Optimiser, scene: &SceneBuffers) -> Result<()> {
        self.gpu.write(&optimiser.params, &[self.adam_params(self.step.max(1))])?;
        let status = self.gpu.upload("status", &[Status::default()])?;
        let mut rec = Recording::new();
        optimiser.record_catch_up(&mut rec, scene, None, &status, self.step);
        self.gpu.run(&rec)
    }

    /// Density control that is due after the last submitted step.
    fn due_round(&self) -> Option<DensityRound> {
        let n_frames = (1.0 / self.setup.dt).round() as u32;
        let (n, n_trained, origin) = (self.scene.n, self.scene.n_trained(), self.scene.origin);
        let round =
            density_round(&self.config, (self.step, self.total), (n, n_trained), &self.setup.extent, origin, n_frames)?;
        Some(DensityRound { max_gaussians: self.most_gaussians(), ..round })
    }

    /// Leaves room for the backdrop at the end.
    fn most_gaussians(&self) -> u32 {
        let backdrop = if self.shows_background() { 0 } else { self.config.backdrop };
        most_gaussians(&self.config, self.capacity.active_of(u32::MAX, self.gpu.caps()), backdrop)
    }

    /// Gaussians that density control may still add; none once it adds no more.
    pub fn room_to_grow(&self) -> Option<u32> {
        let density = &self.config.density;
        let grows = density.strategy == Strategy::Adc && density.grows_after(self.step, self.total);
        grows.then(|| self.most_gaussians().saturating_sub(self.scene.n))
    }

    fn control_density(&mut self) -> Result<()> {
        let (Some(round), false) = (self.due_round(), self.controlled == self.step) else { return Ok(()) };
        let _controlling = debug_span!("density", step = self.step).entered();
        self.end_all()?;
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
        self.capacity.active = self.capacity.active_of(self.scene.n, self.gpu.caps());
        if let Some(report) = self.reports.last_mut() {
            report.density = Some(grown.counts);
        }
        Ok(())
    }
}

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
