//! A step: its inputs, its recording, and its results.

use super::report::ImageReport;
use super::{Image, Inputs, Results, Step, StepReport, Trainer};
use crate::error::{Error, Result};
use crate::gpu::Recording;
use crate::gpu::generated::{Status, ViewParams};
use crate::internals::train::cameras::Taken;
use crate::internals::train::density::noise;
use crate::internals::train::images::StepImage;
use crate::internals::train::objective::{Report, Truth};
use crate::random::Keyed;
use crate::scene::View;
use crate::stage::{
    AdamMode, Among, Batch, Optimiser, Outcome, Room, Size, Strip, Target, Workspace, record_mcmc_noise, view_params,
};
use bytemuck::bytes_of;
use tracing::debug_span;

/// Every so many steps Gaussians are removed from the spaces that are kept clear, before they get far into them.
const CLEAR_EVERY: u64 = 10;
/// Purpose of the random numbers for a step's background; a review has 4.
const BACKGROUND: u64 = 5;

/// An image of a step that this process sees.
struct OwnImage<'a> {
    step: u64,
    /// Its place among the images of the step.
    at: usize,
    view: &'a View,
    by: Taken,
    truth: &'a Truth,
}

impl Trainer {
    /// The reduction of pictures along each side in the next step.
    pub(super) fn reduction(&self, view: &View) -> u32 {
        let reduction = self.config.resolution.reduction(self.step + 1, self.total);
        reduction.min(view.intrinsics.width).min(view.intrinsics.height)
    }

    /// The inputs of the next step.
    pub(super) fn inputs(&mut self, images: Vec<StepImage>) -> Inputs {
        let step = self.step + 1;
        let flow_model = self.setup.flow_model;
        let of_image = |(index, StepImage { camera, view, resident }): (usize, StepImage)| {
            let background = self.background(step, index as u64);
            let reduction = self.reduction(&view);
            let by = self.objective.taken(camera);
            Image {
                view: View { background, flow_model, ..view.reduced(reduction) },
                by,
                truth: resident.map(|resident| self.objective.target(resident, by, step, reduction)),
            }
        };
        Inputs { step, images: images.into_iter().enumerate().map(of_image).collect() }
    }

    /// The colour behind the scene in image `index` of a step.
    fn background(&self, step: u64, index: u64) -> [f32; 3] {
        if !self.setup.varies_background {
            return self.config.background;
        }
        let numbers = Keyed::new(&[self.config.seed, step, BACKGROUND, index]);
        std::array::from_fn(|channel| numbers.uniform(channel as u64) as f32)
    }

    /// Submits a step.
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

    /// Reads the results of a step that has ended. False if it did nothing and needs the larger buffers of now: it is
    /// then no longer counted.
    pub(super) fn end(&mut self, inputs: &Inputs, results: &Results) -> Result<bool> {
        let mut images = Vec::new();
        if results.known.is_empty() {
            if !self.is_complete(inputs, &results.reports)? {
                return Ok(false);
            }
            for (truth, report) in inputs.truths().zip(&results.reports) {
                images.push(ImageReport::new(&self.gpu, &self.objective, truth, report)?);
            }
        } else {
            images.clone_from(&results.known);
        }
        inputs.images.iter().for_each(|image| self.objective.end(image.by));
        self.reports.push(StepReport::new(inputs.step, self.scene.n, &images, inputs.own().len()));
        Ok(true)
    }

    /// True if the lists of all images of a step, which has ended, fitted. If not, the next buffers are large enough.
    pub(super) fn is_complete(&mut self, inputs: &Inputs, reports: &[Report]) -> Result<bool> {
        let own = &inputs.images[inputs.own()];
        for (image, report) in own.iter().zip(reports) {
            let status: Status = self.gpu.peek(&report.status.slice())?.first().copied().unwrap_or_default();
            let Some(work) = &self.work else { return Ok(false) };
            match work.room.outcome(&self.gpu, &status, self.rounds) {
                Outcome::Complete => {}
                Outcome::Replay(room, rounds) => {
                    self.step = inputs.step - 1;
                    self.gpu.write(&work.status, &[Status::default()])?;
                    self.batch.as_ref().map_or(Ok(()), |batch| batch.clear(&self.gpu))?;
                    (self.room, self.rounds) = (room, rounds);
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

    /// Makes room for the images of a step, and records by `record` in the workspace that has it.
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

    /// A workspace with room for the images of a step: the one that there is, or a new one.
    fn fitted(&mut self, inputs: &Inputs) -> Result<Workspace> {
        let mut room = self.room;
        for image in &inputs.images[inputs.own()] {
            let (tiles_x, tiles_y) = Strip::whole(&image.view).tiles(&image.view);
            room.tiles = room.tiles.max(tiles_x * tiles_y);
            room.pixels = room.pixels.max(image.view.intrinsics.n_pixels() as usize);
        }
        if room.pixels > self.room.pixels || self.work.as_ref().is_some_and(|work| work.room != room) {
            // The mark of a failure is in the workspace of the failed step.
            while !self.in_flight.is_empty() {
                self.end_oldest()?;
            }
        }
        if room.pixels > self.room.pixels {
            self.with_memory(|trainer| {
                trainer.images.residents.fit(&trainer.gpu, room.pixels)?;
                trainer.objective.fit(&trainer.gpu, room.pixels)
            })?;
        }
        self.room = Room { tiles: room.tiles, pixels: room.pixels, ..self.room };
        let mut work = match self.work.take().filter(|work| work.room == self.room) {
            Some(work) => work,
            None => self.with_memory(|trainer| Workspace::new(&trainer.gpu, &trainer.scene, trainer.room))?,
        };
        work.view = self.optimiser.view.clone();
        if self.config.batch > 1 && self.batch.is_none() {
            self.batch = Some(self.with_memory(|trainer| Batch::new(&trainer.gpu, &trainer.scene))?);
        }
        Ok(work)
    }

    /// The passes of a step, and where its results will be; of a shared step, the passes of its own images.
    #[tracing::instrument(level = "debug", name = "record", skip_all)]
    pub(super) fn record(&mut self, inputs: &Inputs) -> Result<(Recording, Results)> {
        self.in_workspace(inputs, |trainer, work| {
            let mut rec = Recording::new();
            let mut results = Results { n_tiles: 0, n_pixels: 0, lists: None, reports: Vec::new(), known: Vec::new() };
            for (at, image) in inputs.images.iter().enumerate() {
                let Some(truth) = &image.truth else { continue };
                let of = OwnImage { step: inputs.step, at, view: &image.view, by: image.by, truth };
                trainer.record_image(&mut rec, work, &of, &mut results)?;
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

    /// Appends the passes of an image: its frame, the loss, and the way back, which ends in the step if it is the only
    /// image and in sums of gradients otherwise.
    fn record_image(
        &mut self,
        rec: &mut Recording,
        work: &Workspace,
        image: &OwnImage,
        results: &mut Results,
    ) -> Result<()> {
        let OwnImage { step, at, view, by, truth } = *image;
        self.record_inputs(rec, view, step)?;
        let Trainer { gpu, scene, optimiser, objective, images, batch, rounds, .. } = self;
        images.residents.record_upload(rec, &truth.resident);
        objective.cameras.record_view(rec, work, by.camera, step);
        let (tiles_x, tiles_y) = Strip::whole(view).tiles(view);
        let n_pixels = view.intrinsics.width * view.intrinsics.height;
        let size = Size { n_tiles: tiles_x * tiles_y, n_pixels, rounds: *rounds };
        let forward = debug_span!("forward").entered();
        let lists = work.record_forward(rec, scene, size, |rec| {
            optimiser.record_catch_up(rec, scene, Some(&work.cull), &work.status, step - 1);
        });
        drop(forward);
        debug_span!("loss").in_scope(|| objective.record_loss(gpu, rec, work, &images.residents, truth))?;
        // With a single image the last pass takes the step of the Gaussians in view.
        let target = batch.as_ref().map_or(Target::Step(optimiser), |batch| Target::Sums(batch, optimiser));
        debug_span!("backward").in_scope(|| work.record_backward(rec, scene, &lists, size, &target));
        if batch.is_some() {
            objective.cameras.record_keep(rec, work, by.grid, at);
        }
        (results.n_tiles, results.n_pixels, results.lists) = (size.n_tiles, size.n_pixels, Some(lists));
        Ok(())
    }

    /// Appends the step itself, after its images.
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
