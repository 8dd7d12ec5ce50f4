//! The state of a run, read as a checkpoint or as Gaussians, and restored.

use super::{Step, Trainer, clearings, upload_state};
use crate::error::Result;
use crate::gpu::generated::Status;
use crate::gpu::{Gpu, Recording};
use crate::internals::train::checkpoint::placed;
use crate::internals::train::{Average, Checkpoint, Config, DueEvents, Setup, StepCapacity, rates};
use crate::scene::{Similarity, Splats};
use crate::settings::Constants;
use crate::stage::{AdamMode, Moments, Optimiser, Purpose, SceneBuffers, lazy_sums};
use std::sync::Arc;

impl Trainer {
    /// Goes on from `checkpoint`: the steps that follow have the same bits as without it.
    pub fn resume(gpu: Arc<Gpu>, checkpoint: &Checkpoint, constants: Constants, setup: Setup) -> Result<Self> {
        let Checkpoint { step, total, config, origin, params, first, second, state, cameras, due, room, .. } =
            checkpoint;
        let setup = Setup { has_grid: cameras.has_grid.clone(), ..setup };
        let mut trainer = Self::begin(gpu, params, constants, config.clone(), *total, setup)?;
        trainer.objective.cameras.restore(&trainer.gpu, cameras)?;
        trainer.capacity.camera = trainer.objective.cameras.wants_gradient();
        if room.intersections > 0 {
            trainer.capacity.intersections = room.intersections.min(trainer.capacity.max_intersections(&trainer.gpu));
            trainer.rounds = room.rounds.clamp(1, trainer.capacity.max_rounds());
        }
        trainer.scene.origin = *origin;
        trainer.clearings = clearings(&trainer.gpu, &trainer.setup, *origin)?;
        trainer.optimiser.moments = Moments::upload(&trainer.gpu, &trainer.scene, first, second, config.moment_bits)?;
        trainer.optimiser.state = upload_state(&trainer.gpu, &trainer.scene, state)?;
        // Density control that is still due runs before the next step.
        (trainer.step, trainer.controlled) = (*step, if due.density { step.saturating_sub(1) } else { *step });
        Ok(trainer)
    }

    /// All that [`Trainer::resume`] needs, after the submitted steps and the density control due. The caller sets its
    /// `world`.
    #[tracing::instrument(level = "info", name = "checkpoint", skip_all)]
    pub fn checkpoint(&mut self) -> Result<Checkpoint> {
        self.finish()?;
        self.snapshot()
    }

    /// The state after the last step that ended well, with what was due after it, when an error has left the device
    /// alive. Only for a trainer that is dropped or replaced next.
    pub fn rescue(&mut self) -> Result<Checkpoint> {
        while let Some(step) = self.in_flight.front() {
            step.running.wait()?;
            let Some(Step { inputs, results, .. }) = self.in_flight.pop_front() else { break };
            if !matches!(self.end(&inputs, &results), Ok(true)) {
                // The steps behind it have done nothing.
                self.step = inputs.step - 1;
                self.in_flight.clear();
            }
        }
        (self.work, self.batch) = (None, None);
        let due =
            DueEvents { density: self.due_round().is_some() && self.controlled != self.step, ..DueEvents::default() };
        Ok(Checkpoint { due, ..self.snapshot()? })
    }

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
            due: DueEvents::default(),
            room: StepCapacity { intersections: self.capacity.intersections, rounds: self.rounds },
            average: Average::default(),
        })
    }

    /// See `Optimiser::state`.
    fn state(&self) -> Result<Vec<[f32; 4]>> {
        let mut all = Vec::with_capacity(self.scene.n as usize);
        for (group, buffer) in self.scene.groups.iter().zip(&self.optimiser.state) {
            all.extend_from_slice(&self.gpu.read(buffer)?[..group.n as usize]);
        }
        Ok(all)
    }

    /// The Gaussians after the submitted steps and the density control due, in the frame of training.
    pub fn splats(&mut self) -> Result<Splats> {
        self.finish()?;
        Ok(placed(self.download_current()?, self.scene.origin))
    }

    /// `splats`, in the frame of training, without Gaussians in the spaces that are kept clear.
    pub fn cleared(&self, splats: Splats) -> Result<Splats> {
        let mut scene = SceneBuffers::upload(&self.gpu, &splats, &self.constants, Purpose::Training)?;
        scene.holds_static = self.scene.holds_static;
        let Some(clearings) = clearings(&self.gpu, &self.setup, scene.origin)? else { return Ok(splats) };
        let mut rec = Recording::new();
        clearings.record(&mut rec, &scene, &self.gpu.upload("status", &[Status::default()])?);
        self.gpu.run(&rec)?;
        Ok(placed(scene.download(&self.gpu, scene.groups.iter().map(|g| &g.params))?, scene.origin))
    }

    /// The parameters after catching up with lazy Adam, on a copy, so that the bits of the run do not change.
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
        self.catch_up_on(&copy, &scene)?;
        scene.download(&self.gpu, scene.groups.iter().map(|g| &g.params))
    }

    /// Goes on from `checkpoint`, one of this run at its present step with other Gaussians or cameras.
    pub fn replace(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        let reports = std::mem::take(&mut self.reports);
        let n_bad = self.gpu.read(&self.optimiser.n_bad)?;
        // The device need not have memory for two scenes.
        (self.work, self.batch) = (None, None);
        let mut other = Self::resume(self.gpu.clone(), checkpoint, self.constants, self.setup.clone())?;
        other.images.inherit(&mut self.images);
        // The count goes on.
        other.optimiser.n_bad = self.gpu.upload("bad gradients", &n_bad)?;
        *self = Trainer { reports, ranks: self.ranks.take(), shared: self.shared, ..other };
        Ok(())
    }

    /// Continues to `total` steps with the settings `config`. All that depends on the share of the run is from here on as
    /// at this step of a run of `total` steps.
    pub fn extend(&mut self, config: Config, total: u64) -> Result<()> {
        self.finish()?;
        self.images.restart();
        // Steps that were put off have the rates so far.
        self.catch_up()?;
        let checkpoint = Checkpoint { config, total, ..self.checkpoint()? };
        self.replace(&checkpoint)
    }
}
