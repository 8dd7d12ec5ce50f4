//! A training run: steps on a capture's images in their order, and the events between them.

mod due;
mod judge;
mod notice;
mod options;

pub use notice::{Event, Notice, Phase, Watch};
pub use options::{Priors, SessionOptions};

use crate::error::Result;
use crate::gpu::{Dispatch, Gpu};
use crate::internals::train::backdrop::{backdrop_of, put_before};
use crate::internals::train::images::{ImageLimits, Source, StepImage, StepImages, training_frames};
use crate::internals::train::require::MOST_IMAGES;
use crate::internals::train::{
    Average, Checkpoint, Config, Due, DueEvents, ImageMemory, OffsetImages, Plan, ProfiledStep, Setup, Trainer,
    initialise, learnt_offsets, review,
};
use crate::scene::capture::Capture;
use crate::scene::{Similarity, Splats};
use crate::settings::Constants;
use judge::judge_poses;
pub(super) use notice::work;
use std::borrow::Cow;
use std::cmp::Ordering;
use std::sync::Arc;
use std::time::Instant;
use tracing::debug_span;
use tracing::span::EnteredSpan;

/// A run under way. It takes captures and gives scenes in the capture's own world.
pub struct Session<'a> {
    gpu: Arc<Gpu>,
    capture: Arc<Capture>,
    world: Similarity,
    constants: Constants,
    config: Config,
    total: u64,
    /// Camera and frame of the images that are trained on.
    frames: Vec<(usize, u32)>,
    priors: Priors,
    plan: Plan,
    n_left_out: usize,
    trainer: Trainer,
    due_after: u64,
    /// Events that are due after step `due_after` and have not happened.
    due: DueEvents,
    average: Average,
    events: Vec<Event>,
    seconds: f64,
    watch: Watch<'a>,
}

impl<'a> Session<'a> {
    /// Begins a run on the training images of `capture`, which is in its own world.
    ///
    /// # Errors
    /// Those of the capture's images; those of the device, such as [`crate::error::Error::OutOfMemory`].
    pub fn begin(gpu: Arc<Gpu>, capture: &Capture, config: Config, options: SessionOptions<'a>) -> Result<Self> {
        let world = options.world.unwrap_or_else(|| capture.normalisation());
        Self::open(gpu, capture, world, config, options, None)
    }

    /// Goes on with the run of `checkpoint` on its capture, which is in its own world. `options` say neither its length,
    /// nor its first Gaussians, nor its frame.
    ///
    /// # Errors
    /// As [`Session::begin`].
    pub fn resume(
        gpu: Arc<Gpu>,
        capture: &Capture,
        checkpoint: &Checkpoint,
        options: SessionOptions<'a>,
    ) -> Result<Self> {
        Self::open(gpu, capture, checkpoint.world, checkpoint.config.clone(), options, Some(checkpoint))
    }

    fn open(
        gpu: Arc<Gpu>,
        capture: &Capture,
        world: Similarity,
        config: Config,
        options: SessionOptions<'a>,
        checkpoint: Option<&Checkpoint>,
    ) -> Result<Self> {
        let SessionOptions { constants, cache_bytes, listed_images, mut watch, .. } = options;
        let frames = training_frames(capture)?;
        let capture = capture.clone().transformed(&world);
        let setup = Setup::new(&capture, &config);
        let splats = match (checkpoint, options.first) {
            (Some(checkpoint), _) => Cow::Borrowed(&checkpoint.params),
            (None, Some(first)) => Cow::Owned(world.splats(&first)),
            (None, None) => {
                let made = initialise(&capture, &config, &mut work(&mut watch, Phase::Initialisation))?;
                watch(Notice::Initialised(&made));
                Cow::Owned(made.splats)
            }
        };
        let total = checkpoint.map(|checkpoint| checkpoint.total).or(options.total);
        let total = total.unwrap_or_else(|| config.total(frames.len() as u64));
        let priors = options.priors.map_or_else(|| Priors::read(&capture, &config, &setup, &mut watch), Ok)?;
        let memory = ImageMemory { cache_bytes, device_bytes: options.device_image_bytes };
        let plan = Plan::of(&capture, &config, &setup, &splats, &gpu, memory)?;
        watch(Notice::Planned(&plan));
        let mut trainer = match checkpoint {
            Some(checkpoint) => Trainer::resume(gpu.clone(), checkpoint, constants, setup)?,
            None => Trainer::new(gpu.clone(), &splats, constants, config.clone(), total, setup)?,
        };
        trainer.join(options.ranks);
        trainer.images.limits = ImageLimits { cache_bytes, device_bytes: plan.image_bytes, listed: listed_images };
        Ok(Session {
            gpu,
            capture: Arc::new(capture),
            world,
            constants,
            config,
            total,
            frames,
            priors,
            plan,
            n_left_out: splats.len().saturating_sub(trainer.n_gaussians() as usize),
            due_after: trainer.step(),
            due: checkpoint.map_or_else(DueEvents::default, |checkpoint| checkpoint.due),
            average: checkpoint.map_or_else(Average::default, |checkpoint| checkpoint.average.clone()),
            trainer,
            events: Vec::new(),
            seconds: 0.0,
            watch,
        })
    }

    /// Continues to `total` steps with the settings `config`; returns the events that are due now.
    ///
    /// # Errors
    /// As [`Trainer::extend`].
    pub fn extend(&mut self, config: Config, total: u64) -> Result<DueEvents> {
        self.trainer.extend(config.clone(), total)?;
        self.due = self.due.extended(&config, self.trainer.step(), self.total, total);
        (self.config, self.total, self.average) = (config, total, Average::default());
        Ok(self.due)
    }

    /// The capture, in the frame of training.
    pub fn capture(&self) -> &Arc<Capture> {
        &self.capture
    }

    /// In the frame of training.
    #[doc(hidden)]
    pub fn trainer(&mut self) -> &mut Trainer {
        &mut self.trainer
    }

    /// The rendering constants.
    pub fn constants(&self) -> Constants {
        self.constants
    }

    /// Submitted steps, with those of earlier sessions of the run.
    pub fn steps(&self) -> u64 {
        self.trainer.step()
    }

    /// The memory plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The priors of its images.
    pub fn priors(&self) -> &Priors {
        &self.priors
    }

    /// First Gaussians that were left out: not finite, or too bright.
    #[doc(hidden)]
    pub fn n_left_out(&self) -> usize {
        self.n_left_out
    }

    /// Seconds of steps and reviews in this session.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Seconds in which steps waited for images.
    #[doc(hidden)]
    pub fn waited(&self) -> f64 {
        self.trainer.images.waited_s()
    }

    /// Events since the last call, in order, of steps that have ended; [`Session::wait`] waits for the others.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Submits the next step, after the events that are due before it; false at the end of the run.
    ///
    /// # Errors
    /// Those of the device and of the images.
    pub fn step(&mut self) -> Result<bool> {
        self.settle()?;
        let _step = self.begun();
        let Some((images, begun)) = self.images()? else { return Ok(false) };
        self.trainer.train_on(images)?;
        self.stepped(begun)?;
        Ok(true)
    }

    /// As [`Session::step`], with the time of every pass. Not for steps that several processes share.
    #[doc(hidden)]
    pub fn profile(&mut self) -> Result<Option<ProfiledStep>> {
        self.settle()?;
        let _step = self.begun();
        let Some((images, begun)) = self.images()? else { return Ok(None) };
        let profiled = self.trainer.profile_on(images, begun)?;
        self.stepped(begun + profiled.counting())?;
        Ok(Some(profiled))
    }

    /// The next step's first dispatch of a kernel, with its data; none if it has none, or the run has ended. The step
    /// is not counted.
    #[doc(hidden)]
    pub fn dump(&mut self, kernel: &str) -> Result<Option<Dispatch>> {
        self.settle()?;
        let Some((images, _)) = self.images()? else { return Ok(None) };
        self.trainer.dump(images, kernel)
    }

    /// Waits until all submitted steps have ended.
    ///
    /// # Errors
    /// [`crate::error::Error::DeviceLost`].
    pub fn wait(&mut self) -> Result<()> {
        let begun = Instant::now();
        self.trainer.finish()?;
        self.seconds += begun.elapsed().as_secs_f64();
        self.collect();
        Ok(())
    }

    /// Runs the events that are due after the last step, so that the next reader sees their result.
    #[doc(hidden)]
    pub fn settle(&mut self) -> Result<()> {
        let due = self.due;
        if due.grids {
            self.review(Due::Grids)?;
        }
        self.due.grids = false;
        if due.review {
            self.review(Due::Gaussians)?;
        }
        self.due.review = false;
        if due.offsets {
            self.freeze()?;
        }
        self.due.offsets = false;
        if due.poses {
            let begun = Instant::now();
            let judged = judge_poses(&mut self.trainer, &self.capture)?;
            self.seconds += begun.elapsed().as_secs_f64();
            self.events.extend(judged.map(|(pixels, are_learnt)| Event::Poses { pixels, are_learnt }));
        }
        self.due.poses = false;
        if due.average {
            let begun = Instant::now();
            self.average.add(self.trainer.splats()?);
            self.seconds += begun.elapsed().as_secs_f64();
        }
        self.due.average = false;
        Ok(())
    }

    /// A checkpoint of the last step.
    ///
    /// # Errors
    /// As [`Trainer::checkpoint`].
    pub fn checkpoint(&mut self) -> Result<Checkpoint> {
        let checkpoint = self.trainer.checkpoint()?;
        self.collect();
        Ok(Checkpoint { world: self.world, average: self.average.clone(), ..checkpoint })
    }

    /// As [`Session::checkpoint`], for a run that a fault has ended: of the last step that can be read.
    #[doc(hidden)]
    pub fn rescue(&mut self) -> Result<Checkpoint> {
        let rescued = self.trainer.rescue()?;
        let due = match rescued.step.cmp(&self.due_after) {
            Ordering::Less => DueEvents::default(),
            Ordering::Equal => self.due,
            // The step ended during the rescue.
            Ordering::Greater => DueEvents::after(&self.config, rescued.step, self.total),
        };
        let due = DueEvents { density: rescued.due.density, ..due };
        Ok(Checkpoint { world: self.world, due, average: self.average.clone(), ..rescued })
    }

    /// The scene after the last step, in the frame of training: near the end of the run the mean over its last steps.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn scene(&mut self) -> Result<Splats> {
        self.wait()?;
        self.settle()?;
        let scene = self.average.scene().map_or_else(|| self.trainer.splats(), |mean| Ok(mean.clone()))?;
        self.trainer.cleared(scene)
    }

    /// The scene that the run ends with, in the capture's world: [`Session::scene`] and the backdrop.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn finish(&mut self) -> Result<Splats> {
        let scene = self.scene()?;
        self.finish_with(scene)
    }

    /// As [`Session::finish`], from the `scene` that [`Session::scene`] gave.
    ///
    /// # Errors
    /// Those of the capture's cameras.
    pub fn finish_with(&mut self, scene: Splats) -> Result<Splats> {
        Ok(self.world.inverse().splats(&self.with_backdrop(scene)?))
    }

    /// `scene` after the backdrop; without one if images show the background, or if the sum exceeds `max_gaussians`.
    fn with_backdrop(&mut self, scene: Splats) -> Result<Splats> {
        if self.trainer.shows_background() {
            return Ok(scene);
        }
        let backdrop = backdrop_of(&scene, &self.capture, self.config.backdrop as usize)?;
        let n = backdrop.len();
        let is_added = backdrop.len() + scene.len() <= self.config.max_gaussians;
        if n > 0 {
            self.events.push(Event::Backdrop { n, is_added });
        }
        Ok(if n > 0 && is_added { put_before(scene, backdrop) } else { scene })
    }

    /// With the wait for its images.
    fn begun(&self) -> EnteredSpan {
        debug_span!("step", step = self.trainer.step() + 1).entered()
    }

    /// The images of the next step, and when the work on them began, without the wait for their decoding.
    fn images(&mut self) -> Result<Option<(Vec<StepImage>, Instant)>> {
        let source = Source { capture: &self.capture, frames: &self.frames, priors: &self.priors.plan };
        let StepImages { images, loading } = self.trainer.next_images(&source)?;
        let now = Instant::now();
        let begun = now.checked_sub(loading).unwrap_or(now);
        Ok((!images.is_empty()).then_some((images, begun)))
    }

    /// Waits for the step if events are due after it.
    fn stepped(&mut self, begun: Instant) -> Result<()> {
        let step = self.trainer.step();
        self.due_after = step;
        self.due = DueEvents::after(&self.config, step, self.total);
        if self.due != DueEvents::default() {
            self.trainer.finish()?;
        }
        self.seconds += begun.elapsed().as_secs_f64();
        self.collect();
        Ok(())
    }

    fn collect(&mut self) {
        self.events.extend(self.trainer.take_reports().into_iter().map(Event::Step));
    }

    fn review(&mut self, due: Due) -> Result<()> {
        let begun = Instant::now();
        let mut looked = work(&mut self.watch, Phase::Review);
        let (gpu, constants) = (&self.gpu, self.constants);
        let review = review(&mut self.trainer, gpu, &self.capture, constants, due, MOST_IMAGES, &mut looked)?;
        self.seconds += begun.elapsed().as_secs_f64();
        // The mean was of other Gaussians.
        self.average = Average::default();
        self.events.push(Event::Review(review));
        Ok(())
    }

    /// Fixes time offsets at 0 that the images do not determine.
    fn freeze(&mut self) -> Result<()> {
        let mut looked = work(&mut self.watch, Phase::OffsetErrors);
        let (constants, background) = (self.constants, self.config.background);
        let images = OffsetImages { gpu: &self.gpu, capture: &self.capture, constants, background };
        let fits = learnt_offsets(&mut self.trainer, &images, &mut looked)?;
        let cameras = &self.capture.cameras;
        let is_lost = |camera: usize| fits.get(&camera).is_some_and(|fit| !fit.is_identifiable());
        let lost: Vec<bool> = (0..cameras.len()).map(is_lost).collect();
        let names = cameras.iter().zip(&lost).filter(|(_, lost)| **lost).map(|(camera, _)| camera.name.clone());
        let names: Vec<String> = names.collect();
        if !names.is_empty() {
            self.trainer.freeze_offsets(&lost)?;
            self.events.push(Event::Frozen(names));
        }
        Ok(())
    }
}
