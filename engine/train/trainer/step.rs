//! A step: what it needs, its recording, and what it leaves.

use super::report::ImageReport;
use super::{Image, Inputs, Results, Seen, Step, StepReport, Trainer};
use crate::error::{Error, Result};
use crate::gpu::Recording;
use crate::gpu::generated::{Status, ViewParams};
use crate::random::Keyed;
use crate::scene::View;
use crate::scene::capture::Picture;
use crate::stage::{
    AdamMode, Among, Batch, Optimiser, Outcome, Room, Size, Strip, Target, Workspace, record_mcmc_noise, view_params,
};
use crate::train::density::noise;
use crate::train::images::{Loaded, Shot};
use crate::train::objective::Report;
use bytemuck::bytes_of;
use tracing::debug_span;

/// Steps after which Gaussians leave the spaces that are kept clear: few enough that they do not get far into them.
const CLEAR_EVERY: u64 = 10;
/// Purpose of the random numbers of a step that are its background; a review has 4.
const BACKGROUND: u64 = 5;

impl Trainer {
    /// Pixels along each side that become one in the step to come.
    fn reduction(&self, view: &View) -> u32 {
        let reduction = self.config.resolution.reduction(self.step + 1, self.total);
        reduction.min(view.intrinsics.width).min(view.intrinsics.height)
    }

    /// Takes the picture of the step to come to where the device can get it.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub(in crate::train) fn load(&mut self, view: &View, shot: Shot) -> Result<Loaded> {
        let reduction = self.reduction(view);
        // A session's cache brings it reduced; others bring it whole.
        let is_whole =
            |picture: &Picture| (picture.width, picture.height) == (view.intrinsics.width, view.intrinsics.height);
        let reduced;
        let shot = match shot {
            Shot::Passes(picture) if reduction > 1 && is_whole(picture) => {
                reduced = picture.reduced(reduction);
                Shot::Passes(&reduced)
            }
            shot => shot,
        };
        let loaded = self.objective.images.load(&self.gpu, &self.staging, shot)?;
        let Some(loaded) = loaded else { unreachable!("callers ask Trainer::has_image first") };
        Ok(loaded)
    }

    /// What the step to come needs.
    pub(super) fn inputs(&mut self, images: Vec<Seen>) -> Inputs {
        let (step, flow_model) = (self.step + 1, self.setup.flow_model);
        let of_image = |(index, Seen { camera, view, loaded }): (usize, Seen)| {
            let background = self.background(step, index as u64);
            let reduction = self.reduction(&view);
            let by = self.objective.taken(camera);
            Image {
                view: View { background, flow_model, ..view.reduced(reduction) },
                by,
                truth: loaded.map(|loaded| self.objective.target(loaded, by, step, reduction)),
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

    /// Hands a step to the device.
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

    /// Waits for the oldest step. When its lists did not fit, it and those behind it, which have done nothing, start anew. One
    /// that cannot be waited for stays: it may have moved the scene.
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
        // The first one alone, until it fits.
        self.start(inputs)?;
        self.end_oldest()?;
        behind.into_iter().try_for_each(|inputs| self.start(inputs))
    }

    /// Reads what a step that has ended left. `false` when it moved nothing and needs the room that is there now: it is then
    /// no longer counted.
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

    /// Whether all images of a step, which have ended, fitted. If not, there is room from now on.
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

    /// Makes room for the images of a step.
    fn fit(&mut self, inputs: &Inputs) -> Result<()> {
        let mut room = self.room;
        for image in &inputs.images[inputs.own()] {
            let (tiles_x, tiles_y) = Strip::whole(&image.view).tiles(&image.view);
            room.tiles = room.tiles.max(tiles_x * tiles_y);
            room.pixels = room.pixels.max(image.view.intrinsics.n_pixels() as usize);
        }
        if room.pixels > self.room.pixels || self.work.as_ref().is_some_and(|work| work.room != room) {
            // A failure stays in the workspace that it happened in.
            while !self.in_flight.is_empty() {
                self.end_oldest()?;
            }
        }
        if room.pixels > self.room.pixels {
            self.with_memory(|trainer| trainer.objective.fit(&trainer.gpu, room.pixels))?;
        }
        self.room = Room { tiles: room.tiles, pixels: room.pixels, ..self.room };
        self.with_memory(|trainer| {
            Workspace::fit(&mut trainer.work, &trainer.gpu, &trainer.scene, trainer.room).map(drop)
        })?;
        if let Some(work) = &mut self.work {
            work.view = self.optimiser.view.clone();
        }
        if self.config.batch > 1 && self.batch.is_none() {
            self.with_memory(|trainer| {
                trainer.batch = Some(Batch::new(&trainer.gpu, &trainer.scene)?);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The passes of a step, and where its numbers will be. Of one that several processes take, the passes of its own images.
    #[tracing::instrument(level = "debug", name = "record", skip_all)]
    pub(super) fn record(&mut self, inputs: &Inputs) -> Result<(Recording, Results)> {
        self.fit(inputs)?;
        let mut rec = Recording::new();
        let mut results = Results { n_tiles: 0, n_pixels: 0, lists: None, reports: Vec::new(), known: Vec::new() };
        for at in inputs.own() {
            let size = self.record_image(&mut rec, inputs, at, &mut results)?;
            (results.n_tiles, results.n_pixels) = (size.n_tiles, size.n_pixels);
            if self.batch.is_some() {
                results.reports.push(self.record_report(&mut rec)?);
            }
        }
        if self.ranks.is_none() {
            self.record_step(&mut rec, inputs)?;
        }
        if self.batch.is_none() {
            results.reports.push(self.record_report(&mut rec)?);
        }
        Ok((rec, results))
    }

    fn record_report(&mut self, rec: &mut Recording) -> Result<Report> {
        let Some(work) = &self.work else { unreachable!("it fits the step") };
        rec.section("report");
        self.objective.record_report(rec, &self.staging, (&work.status, &self.optimiser.n_bad))
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

    /// Appends what image `at` of a step needs: its frame, the loss, and the way back, which ends in the step where it is the only
    /// one and in sums of gradients otherwise.
    fn record_image(&mut self, rec: &mut Recording, inputs: &Inputs, at: usize, results: &mut Results) -> Result<Size> {
        let (step, Image { view, by, truth }) = (inputs.step, &inputs.images[at]);
        self.record_inputs(rec, view, step)?;
        let Trainer { gpu, scene, optimiser, objective, work: Some(work), batch, rounds, .. } = self else {
            unreachable!("there is room for the step")
        };
        let Some(truth) = truth else { unreachable!("it is one of this process") };
        objective.record_upload(rec, work, truth, self.total);
        let status = &work.status;
        let (tiles_x, tiles_y) = Strip::whole(view).tiles(view);
        let n_pixels = view.intrinsics.width * view.intrinsics.height;
        let size = Size { n_tiles: tiles_x * tiles_y, n_pixels, rounds: *rounds };
        let forward = debug_span!("forward").entered();
        let lists = work.record_forward(rec, scene, size, |rec| {
            optimiser.record_catch_up(rec, scene, &work.cull, status, step - 1);
        });
        drop(forward);
        debug_span!("loss").in_scope(|| objective.record_loss(gpu, rec, work, truth))?;
        // Of a single image Gaussians in view take their step with the last pass of it.
        let target = batch.as_ref().map_or(Target::Step(optimiser), |batch| Target::Sums(batch, optimiser));
        debug_span!("backward").in_scope(|| work.record_backward(rec, scene, &lists, size, &target));
        if batch.is_some() {
            objective.record_keep(rec, work, *by, at);
        }
        results.lists = Some(lists);
        Ok(size)
    }

    /// Appends the step itself, after its images.
    pub(super) fn record_step(&mut self, rec: &mut Recording, inputs: &Inputs) -> Result<()> {
        let _stepping = debug_span!("optimiser").entered();
        let Inputs { step, images } = inputs;
        let at = (*step, self.total);
        let needs_views = self.batch.is_some() && self.objective.cameras.reads_view(at);
        // The rates are those that the images' passes had.
        for (index, Image { view, by, .. }) in images.iter().enumerate() {
            if needs_views {
                self.record_inputs(rec, view, *step)?;
            }
            let (Some(work), scene, optimiser) = (&self.work, &self.scene, &self.optimiser) else {
                unreachable!("there is room for the step")
            };
            if index == 0 {
                match &self.batch {
                    Some(batch) => batch.record_step(rec, scene, optimiser, &work.status),
                    None => optimiser.record_idle(rec, scene, &work.cull, &work.status),
                }
            }
            if self.batch.is_some() {
                self.objective.record_take(rec, work, *by, index);
            }
            if needs_views {
                self.objective.record_view(rec, work, *by, at);
            }
            self.objective.record_step(rec, work, *by, at, index);
        }
        let Some(work) = &self.work else { unreachable!("there is room for the step") };
        let noise = noise(&self.config, *step, self.total, self.setup.extent.radius);
        if let Some((rate, key)) = noise {
            record_mcmc_noise(rec, &self.scene, &work.status, rate, key);
        }
        let clears = self.clearings.as_ref().filter(|_| step.is_multiple_of(CLEAR_EVERY));
        if let Some(clearings) = clears {
            clearings.record(rec, &self.scene, &work.status);
        }
        let moves_all = self.config.adam == AdamMode::Dense || self.batch.is_some();
        let among = if moves_all || noise.is_some() || clears.is_some() { Among::All } else { Among::Live };
        self.scene.record_bounds(rec, &self.constants, &self.n_undrawable, among);
        Ok(())
    }
}
