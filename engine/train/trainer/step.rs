//! A step: its inputs, its recording, and its results.

use super::report::ImageReport;
use super::{Image, Inputs, Results, Step, StepReport, Trainer};
use crate::error::{Error, Result};
use crate::gpu::Recording;
use crate::gpu::generated::{Status, ViewParams};
use crate::internals::train::cameras::Taken;
use crate::internals::train::images::StepImage;
use crate::internals::train::noise;
use crate::internals::train::objective::Report;
use crate::random::Keyed;
use crate::scene::View;
use crate::stage::{
    AdamMode, Among, Batch, Capacity, Lists, Optimiser, Outcome, Size, Strip, Target, Workspace, record_mcmc_noise,
    view_params,
};
use bytemuck::bytes_of;
use tracing::debug_span;

/// Steps between two removals of Gaussians from the spaces that are kept clear.
const CLEAR_EVERY: u64 = 10;
/// Purpose of the random numbers for a step's background; a review has 4.
const BACKGROUND: u64 = 5;

impl Trainer {
    /// The reduction of the next step's pictures along each side.
    pub(super) fn reduction(&self, view: &View) -> u32 {
        let reduction = self.config.resolution.reduction(self.step + 1, self.total);
        reduction.min(view.intrinsics.width).min(view.intrinsics.height)
    }

    pub(super) fn inputs(&mut self, images: Vec<StepImage>) -> Inputs {
        let step = self.step + 1;
        let flow_model = self.setup.flow_model;
        let of_image = |(index, StepImage { camera, view, resident }): (usize, StepImage)| {
            let background = self.background(step, index as u64);
            let reduction = self.reduction(&view);
            let by = Taken { camera, grid: self.objective.cameras.next(camera) };
            Image {
                view: View { background, flow_model, ..view.reduced(reduction) },
                by,
                truth: resident.map(|resident| self.objective.target(resident, by, step, reduction)),
            }
        };
        Inputs { step, images: images.into_iter().enumerate().map(of_image).collect() }
    }

    fn background(&self, step: u64, index: u64) -> [f32; 3] {
        if !self.setup.varies_background {
            return self.config.background;
        }
        let numbers = Keyed::new(&[self.config.seed, step, BACKGROUND, index]);
        std::array::from_fn(|channel| numbers.uniform(channel as u64) as f32)
    }

    pub(super) fn start(&mut self, inputs: Inputs) -> Result<()> {
        if let Some(ranks) = self.ranks.clone() {
            return self.start_shared(&*ranks, inputs);
        }
        let (rec, results) = self.record(&inputs)?;
        let running = self.gpu.start(&rec)?;
        self.step = inputs.step;
        self.in_flight.push_back(Step { inputs, running, results });
        Ok(())
    }

    /// Waits for the oldest step. If its lists did not fit, it and those behind it, which have done nothing, start
    /// again. One that cannot be waited for stays, since it may have changed the scene.
    pub(super) fn end_oldest(&mut self) -> Result<()> {
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
        // The first one alone until it fits.
        self.start(inputs)?;
        self.end_oldest()?;
        behind.into_iter().try_for_each(|inputs| self.start(inputs))
    }

    /// Reads the results of a step that has ended. False if it did nothing and needs larger buffers: it no longer counts.
    pub(super) fn end(&mut self, inputs: &Inputs, results: &Results) -> Result<bool> {
        if results.known.is_empty() && !self.is_complete(inputs, &results.reports)? {
            return Ok(false);
        }
        let mut images = results.known.clone();
        if images.is_empty() {
            for (truth, report) in inputs.truths().zip(&results.reports) {
                images.push(ImageReport::new(&self.gpu, &self.objective, truth, report)?);
            }
        }
        inputs.images.iter().for_each(|image| self.objective.cameras.end(image.by.grid));
        self.reports.push(StepReport::new(inputs.step, self.scene.n, &images, inputs.own().len()));
        Ok(true)
    }

    /// True if the lists of all images of a step fitted. If not, the next buffers are large enough.
    pub(super) fn is_complete(&mut self, inputs: &Inputs, reports: &[Report]) -> Result<bool> {
        let own = &inputs.images[inputs.own()];
        for (image, report) in own.iter().zip(reports) {
            let status: Status = self.gpu.peek(&report.status.slice())?.first().copied().unwrap_or_default();
            let Some(work) = &self.work else { return Ok(false) };
            match work.capacity.outcome(&self.gpu, &status, self.rounds) {
                Outcome::Complete => {}
                Outcome::Replay(capacity, rounds) => {
                    self.step = inputs.step - 1;
                    self.gpu.write(&work.status, &[Status::default()])?;
                    self.batch.as_ref().map_or(Ok(()), |batch| batch.clear(&self.gpu))?;
                    (self.capacity, self.rounds) = (capacity, rounds);
                    return Ok(false);
                }
                Outcome::TooMuch { what, needed, limit } => {
                    self.in_flight.clear();
                    self.step = inputs.step - 1;
                    return Err(Error::OutOfMemory {
                        what: format!("training view `{}`: {what}", image.view.name),
                        needed: u64::from(needed),
                        limit: u64::from(limit),
                        remedy: "train on smaller pictures, lower --max-gaussians, or choose another device".to_owned(),
                    });
                }
            }
        }
        Ok(true)
    }

    pub(super) fn in_workspace<T>(
        &mut self,
        inputs: &Inputs,
        record: impl FnOnce(&mut Self, &Workspace) -> Result<T>,
    ) -> Result<T> {
        let work = self.fitted(inputs)?;
        let recorded = record(self, &work);
        self.work = Some(work);
        recorded
    }

    /// A workspace with room for the images of a step.
    fn fitted(&mut self, inputs: &Inputs) -> Result<Workspace> {
        let mut capacity = self.capacity;
        for image in &inputs.images[inputs.own()] {
            let (tiles_x, tiles_y) = Strip::whole(&image.view).tiles(&image.view);
            capacity.tiles = capacity.tiles.max(tiles_x * tiles_y);
            capacity.pixels = capacity.pixels.max(image.view.intrinsics.n_pixels() as usize);
        }
        if capacity.pixels > self.capacity.pixels || self.work.as_ref().is_some_and(|work| work.capacity != capacity) {
            // The mark of a failure is in the workspace of the failed step.
            self.end_all()?;
        }
        if capacity.pixels > self.capacity.pixels {
            self.with_memory(|trainer| {
                trainer.images.residents.fit(&trainer.gpu, capacity.pixels)?;
                trainer.objective.fit(&trainer.gpu, capacity.pixels)
            })?;
        }
        self.capacity = Capacity { tiles: capacity.tiles, pixels: capacity.pixels, ..self.capacity };
        let mut work = match self.work.take().filter(|work| work.capacity == self.capacity) {
            Some(work) => work,
            None => self.with_memory(|trainer| Workspace::new(&trainer.gpu, &trainer.scene, trainer.capacity))?,
        };
        work.view = self.optimiser.view.clone();
        if self.config.batch > 1 && self.batch.is_none() {
            self.batch = Some(self.with_memory(|trainer| Batch::new(&trainer.gpu, &trainer.scene))?);
        }
        Ok(work)
    }

    /// The passes of a step, and where its results will be; of a shared step those of its own images.
    #[tracing::instrument(level = "debug", name = "record", skip_all)]
    pub(super) fn record(&mut self, inputs: &Inputs) -> Result<(Recording, Results)> {
        self.in_workspace(inputs, |trainer, work| {
            let mut rec = Recording::new();
            let mut results = Results { last: None, reports: Vec::new(), known: Vec::new() };
            for at in inputs.own() {
                results.last = trainer.record_image(&mut rec, work, inputs, at)?;
                if trainer.batch.is_some() {
                    results.reports.push(trainer.record_report(&mut rec, work)?);
                }
            }
            if trainer.ranks.is_none() {
                trainer.record_step(&mut rec, work, inputs)?;
            }
            if trainer.batch.is_none() {
                results.reports.push(trainer.record_report(&mut rec, work)?);
            }
            Ok((rec, results))
        })
    }

    fn record_report(&self, rec: &mut Recording, work: &Workspace) -> Result<Report> {
        rec.section("report");
        self.objective.record_report(rec, &self.staging, &work.status, &self.optimiser.n_bad)
    }

    /// Appends the upload of a view, as training sees it, and of the rates of the step.
    fn record_inputs(&self, rec: &mut Recording, view: &View, step: u64) -> Result<()> {
        let params: ViewParams = view_params(view, &self.constants, self.scene.origin, Strip::whole(view));
        let adam = self.adam_params(step);
        rec.section("upload");
        let parts = [(0, bytes_of(&params)), (Optimiser::PARAMS_AT, bytes_of(&adam))];
        let inputs = self.staging.staged_words("staged inputs of a step", self.optimiser.inputs.len(), &parts)?;
        rec.copy(inputs, self.optimiser.inputs.slice());
        Ok(())
    }

    /// Appends the passes of an image: frame, loss, and the way back, which ends in the step if it is the only image and
    /// in sums of gradients otherwise.
    fn record_image(
        &mut self,
        rec: &mut Recording,
        work: &Workspace,
        inputs: &Inputs,
        at: usize,
    ) -> Result<Option<(Lists, Size)>> {
        let Image { view, by, truth: Some(truth) } = &inputs.images[at] else { return Ok(None) };
        self.record_inputs(rec, view, inputs.step)?;
        let Trainer { gpu, scene, optimiser, objective, images, batch, rounds, .. } = self;
        images.residents.record_upload(rec, &truth.resident);
        objective.cameras.record_view(rec, work, by.camera, inputs.step);
        let (tiles_x, tiles_y) = Strip::whole(view).tiles(view);
        let n_pixels = view.intrinsics.width * view.intrinsics.height;
        let size = Size { n_tiles: tiles_x * tiles_y, n_pixels, rounds: *rounds };
        let forward = debug_span!("forward").entered();
        let lists = work.record_forward(rec, scene, size, |rec| {
            optimiser.record_catch_up(rec, scene, Some(&work.cull), &work.status, inputs.step - 1);
        });
        drop(forward);
        debug_span!("loss").in_scope(|| objective.record_loss(gpu, rec, work, &images.residents, truth))?;
        // With a single image the last pass takes the step of the Gaussians in view.
        let target = batch.as_ref().map_or(Target::Step(optimiser), |batch| Target::Sums(batch, optimiser));
        debug_span!("backward").in_scope(|| work.record_backward(rec, scene, &lists, size, &target));
        if batch.is_some() {
            objective.cameras.record_keep(rec, work, by.grid, at);
        }
        Ok(Some((lists, size)))
    }

    /// After its images.
    pub(super) fn record_step(&self, rec: &mut Recording, work: &Workspace, inputs: &Inputs) -> Result<()> {
        let _stepping = debug_span!("optimiser").entered();
        let Inputs { step, images } = inputs;
        let (scene, cameras) = (&self.scene, &self.objective.cameras);
        let needs_views = self.batch.is_some() && cameras.reads_view(*step);
        // The rates are still those of the images' passes.
        for (index, Image { view, by, .. }) in images.iter().enumerate() {
            if needs_views {
                self.record_inputs(rec, view, *step)?;
            }
            if index == 0 {
                match &self.batch {
                    Some(batch) => batch.record_step(rec, scene, &self.optimiser, &work.status),
                    None => self.optimiser.record_idle(rec, scene, &work.cull, &work.status),
                }
            }
            if self.batch.is_some() {
                cameras.record_take(rec, work, by.grid, index);
            }
            if needs_views {
                cameras.record_view(rec, work, by.camera, *step);
            }
            cameras.record_step(rec, work, *by, *step, index);
        }
        let noise = noise(&self.config, *step, self.total, self.setup.extent.radius);
        if let Some((rate, key)) = noise {
            record_mcmc_noise(rec, scene, &work.status, rate, key);
        }
        let clears = self.clearings.as_ref().filter(|_| step.is_multiple_of(CLEAR_EVERY));
        if let Some(clearings) = clears {
            clearings.record(rec, scene, &work.status);
        }
        let moves_all = self.config.adam == AdamMode::Dense || self.batch.is_some();
        let among = if moves_all || noise.is_some() || clears.is_some() { Among::All } else { Among::Live };
        scene.record_bounds(rec, &self.constants, &self.n_undrawable, among);
        Ok(())
    }
}
