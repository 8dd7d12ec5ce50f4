//! A step: what it needs, its recording, and what it leaves.

use super::{Inputs, Results, Step, StepReport, Trainer};
use crate::error::{Error, Result};
use crate::gpu::Recording;
use crate::gpu::generated::{Status, ViewParams};
use crate::scene::View;
use crate::scene::capture::Picture;
use crate::stage::{
    AdamMode, Among, Optimiser, Outcome, Room, Size, Strip, Target, Workspace, record_mcmc_noise, view_params,
};
use crate::train::density::noise;
use crate::train::images::{Loaded, Shot};
use bytemuck::bytes_of;
use tracing::debug_span;

impl Trainer {
    /// Pixels along each side that become one in the step to come.
    fn reduction(&self, view: &View) -> u32 {
        let reduction = self.config.resolution.reduction(self.step + 1, self.total);
        reduction.min(view.intrinsics.width).min(view.intrinsics.height)
    }

    /// Takes the picture of the step to come to where the device can get it.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub(super) fn load(&mut self, view: &View, shot: Shot) -> Result<Loaded> {
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
    pub(super) fn inputs(&mut self, camera: usize, view: &View, loaded: Loaded) -> Inputs {
        let (background, flow_model) = (self.config.background, self.setup.flow_model);
        let (step, reduction) = (self.step + 1, self.reduction(view));
        Inputs {
            step,
            view: View { background, flow_model, ..view.reduced(reduction) },
            truth: self.objective.target(loaded, camera, step, reduction),
        }
    }

    /// Hands a step to the device.
    pub(super) fn start(&mut self, inputs: Inputs) -> Result<()> {
        let (rec, results) = self.record(&inputs)?;
        let running = self.gpu.start(&rec)?;
        self.objective.keep(&inputs.truth);
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
        let status: Status = self.gpu.peek(&results.report.status.slice())?.first().copied().unwrap_or_default();
        let Some(work) = &self.work else { return Ok(false) };
        match work.room.outcome(&self.gpu, &status, self.rounds) {
            Outcome::Complete => {}
            Outcome::Replay(room, rounds) => {
                self.step = inputs.step - 1;
                self.gpu.write(&work.status, &[Status::default()])?;
                (self.room, self.rounds) = (room, rounds);
                return Ok(false);
            }
            Outcome::TooMuch { what, needed, limit } => {
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
        let values = self.objective.values(&self.gpu, &inputs.truth, &results.report)?;
        self.reports.push(StepReport {
            step: inputs.step,
            loss: values.loss,
            terms: values.logged,
            gaussians: self.scene.n,
            active: status.n_active,
            visible: status.n_visible,
            intersections: status.n_intersections,
            bad_gradients: self.gpu.peek(&results.report.n_bad.slice())?.first().copied().unwrap_or(0),
            density: None,
        });
        Ok(true)
    }

    /// The passes of a step, and where its numbers will be.
    #[tracing::instrument(level = "debug", name = "record", skip_all)]
    pub(super) fn record(&mut self, inputs: &Inputs) -> Result<(Recording, Results)> {
        let Inputs { step, view, truth } = inputs;
        let strip = Strip::whole(view);
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_tiles = tiles_x * tiles_y;
        let n_pixels = view.intrinsics.width * view.intrinsics.height;
        let room =
            Room { tiles: self.room.tiles.max(n_tiles), pixels: self.room.pixels.max(n_pixels as usize), ..self.room };
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
        let mut params: ViewParams = view_params(view, &self.constants, self.scene.origin, strip);
        self.objective.adjust(&mut params);
        let adam = self.adam_params(*step);
        let (gpu, staging, scene, optimiser) = (&self.gpu, &self.staging, &self.scene, &self.optimiser);
        let rounds = self.rounds;
        let work = Workspace::fit(&mut self.work, gpu, scene, self.room)?;
        let mut rec = Recording::new();
        rec.section("upload");
        let parts = [(0, bytes_of(&params)), (Optimiser::PARAMS_AT, bytes_of(&adam))];
        let inputs = staging.staged_words("staged inputs of a step", optimiser.inputs.len(), &parts)?;
        rec.copy(inputs, optimiser.inputs.slice());
        self.objective.record_upload(&mut rec, work, truth, self.total);
        let status = &work.status;
        let is_lazy = self.config.adam == AdamMode::Lazy;
        let size = Size { n_tiles, n_pixels, rounds };
        let forward = debug_span!("forward").entered();
        let lists = work.record_forward(&mut rec, scene, size, |rec| {
            optimiser.record_catch_up(rec, scene, &work.cull, status, step - 1);
            if is_lazy {
                scene.record_halves(rec, Among::Live);
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
            let noise = noise(&self.config, *step, self.total, self.setup.extent.radius);
            if let Some((rate, key)) = noise {
                record_mcmc_noise(&mut rec, scene, status, rate, key);
            }
            let moves_all = self.config.adam == AdamMode::Dense;
            let moved = |all: bool| if all { Among::All } else { Among::Live };
            scene.record_bounds(&mut rec, &self.constants, &self.n_undrawable, moved(moves_all || noise.is_some()));
            // The next step that sees them catches up first.
            if !is_lazy {
                scene.record_halves(&mut rec, moved(moves_all));
            }
        }
        rec.section("report");
        let results = Results {
            n_tiles,
            lists,
            report: self.objective.record_report(&mut rec, staging, (status, &optimiser.n_bad))?,
        };
        Ok((rec, results))
    }
}
