//! A training run: a capture's images in their order, with what is due between steps.

mod coming;
mod feed;
mod notice;
mod options;
mod order;
mod owed;
mod priors;

pub use notice::{Event, Notice, Phase, Watch};
pub use options::SessionOptions;
pub use order::{reduced_order, training_order};
pub use priors::Priors;

use crate::error::Result;
use crate::gpu::{Dispatch, Gpu};
use crate::scene::Splats;
use crate::scene::capture::Capture;
use crate::settings::Constants;
use crate::train::average::Average;
use crate::train::backdrop::{backdrop_of, put_before};
use crate::train::checkpoint::{Checkpoint, Owed};
use crate::train::config::Config;
use crate::train::init::initialise;
use crate::train::judge::judge_poses;
use crate::train::offsets::learnt_offsets;
use crate::train::plan::Plan;
use crate::train::require::{Due, MOST_IMAGES, review};
use crate::train::setup::Setup;
use crate::train::trainer::{ProfiledStep, Seen, Trainer};
use coming::Coming;
use notice::work;
use order::training_frames;
use std::cmp::Ordering;
use std::sync::Arc;
use std::time::Instant;
use tracing::debug_span;
use tracing::span::EnteredSpan;

/// A run under way.
///
/// ```no_run
/// # fn main() -> ivv::Result<()> {
/// use ivv::scene::capture::Capture;
/// use ivv::train::{Config, Session, SessionOptions};
///
/// let gpu = std::sync::Arc::new(ivv::gpu::Gpu::open(&Default::default())?);
/// let capture = Capture::open("captures/demo".as_ref())?;
/// // Training takes place in a frame where the cameras' extent is 3.
/// let world = capture.normalisation();
/// let capture = capture.transformed(&world);
/// let mut session = Session::begin(gpu, &capture, Config::default(), SessionOptions::default())?;
/// while session.step()? {}
/// let splats = world.inverse().splats(&session.finish()?);
/// ivv::formats::write_ply("scene.ply".as_ref(), &splats)?;
/// # Ok(())
/// # }
/// ```
pub struct Session<'a> {
    gpu: Arc<Gpu>,
    capture: &'a Capture,
    constants: Constants,
    config: Config,
    total: u64,
    frames: Vec<Image>,
    priors: Priors,
    plan: Plan,
    n_left_out: usize,
    trainer: Trainer,
    /// The images to come, in their order; made for the first step that needs it.
    coming: Option<Coming>,
    cache_bytes: u64,
    /// Bytes of images that stay on the device.
    image_bytes: u64,
    /// Images that are listed at a time.
    listed_images: u64,
    /// Seconds in which steps waited for those that were listed before.
    waited: f64,
    /// A step, and what is due after it and has not been done.
    owed: (u64, Owed),
    /// Of the scenes near the end.
    average: Average,
    events: Vec<Event>,
    seconds: f64,
    watch: Watch<'a>,
}

/// A camera and a frame.
type Image = (usize, u32);

impl<'a> Session<'a> {
    /// A run on the training images of `capture`, which is in the frame of training.
    ///
    /// # Errors
    /// Those of the capture's images; those of the device, such as [`crate::error::Error::OutOfMemory`].
    pub fn begin(gpu: Arc<Gpu>, capture: &'a Capture, config: Config, mut options: SessionOptions<'a>) -> Result<Self> {
        let frames = training_frames(capture)?;
        let setup = Setup::new(capture, &config);
        let memory = options.image_memory();
        let watch = &mut options.watch;
        let made;
        let first = options.first.take();
        let splats = if let Some(first) = &first {
            first
        } else {
            made = initialise(capture, &config, &mut work(watch, Phase::Initialisation))?;
            watch(Notice::Initialised(&made));
            &made.splats
        };
        let known = options.priors.take();
        let priors = known.map_or_else(|| Priors::read(capture, &config, &setup, watch), Ok)?;
        let plan = Plan::of(capture, &config, &setup, splats, &gpu, memory)?;
        watch(Notice::Planned(&plan));
        let total = options.total.unwrap_or_else(|| config.total(frames.len() as u64));
        let constants = options.constants;
        let trainer = Trainer::new(gpu.clone(), splats, constants, config.clone(), total, setup)?;
        let numbers = (total, priors, plan, splats.len());
        Ok(Self::of(gpu, (capture, frames, constants), config, trainer, numbers, options))
    }

    /// The run that `checkpoint` is of, on its capture. `options` say neither its length nor its first Gaussians.
    ///
    /// # Errors
    /// As [`Session::begin`].
    pub fn resume(
        gpu: Arc<Gpu>,
        capture: &'a Capture,
        checkpoint: &Checkpoint,
        mut options: SessionOptions<'a>,
    ) -> Result<Self> {
        let frames = training_frames(capture)?;
        let (config, splats) = (checkpoint.config.clone(), &checkpoint.params);
        let setup = Setup::new(capture, &config);
        let memory = options.image_memory();
        let (known, watch) = (options.priors.take(), &mut options.watch);
        let priors = known.map_or_else(|| Priors::read(capture, &config, &setup, watch), Ok)?;
        let plan = Plan::of(capture, &config, &setup, splats, &gpu, memory)?;
        watch(Notice::Planned(&plan));
        let constants = options.constants;
        let trainer = Trainer::resume(gpu.clone(), checkpoint, constants, setup)?;
        let numbers = (checkpoint.total, priors, plan, splats.len());
        let session = Self::of(gpu, (capture, frames, constants), config, trainer, numbers, options);
        Ok(Session { owed: (checkpoint.step, checkpoint.owed), average: checkpoint.average.clone(), ..session })
    }

    fn of(
        gpu: Arc<Gpu>,
        (capture, frames, constants): (&'a Capture, Vec<Image>, Constants),
        config: Config,
        mut trainer: Trainer,
        (total, priors, plan, n_first): (u64, Priors, Plan, usize),
        options: SessionOptions<'a>,
    ) -> Self {
        let SessionOptions { cache_bytes, listed_images, watch, ranks, .. } = options;
        trainer.join(ranks);
        Session {
            gpu,
            capture,
            constants,
            config,
            total,
            frames,
            priors,
            image_bytes: plan.image_bytes,
            plan,
            n_left_out: n_first.saturating_sub(trainer.n_gaussians() as usize),
            owed: (trainer.step(), Owed::default()),
            average: Average::default(),
            trainer,
            coming: None,
            cache_bytes,
            listed_images,
            waited: 0.0,
            events: Vec::new(),
            seconds: 0.0,
            watch,
        }
    }

    /// Goes on for as long as `config` and `total` say; returns what is due now.
    ///
    /// # Errors
    /// As [`Trainer::extend`].
    pub fn extend(&mut self, config: Config, total: u64) -> Result<Owed> {
        self.trainer.extend(config.clone(), total)?;
        self.owed.1 = self.owed.1.extended(&config, self.trainer.step(), [self.total, total]);
        (self.config, self.total, self.coming, self.average) = (config, total, None, Average::default());
        Ok(self.owed.1)
    }

    /// What is trained.
    pub fn trainer(&mut self) -> &mut Trainer {
        &mut self.trainer
    }

    /// How its pictures are rendered.
    pub fn constants(&self) -> Constants {
        self.constants
    }

    /// Steps that were handed to the device, in earlier sessions of the run too.
    pub fn steps(&self) -> u64 {
        self.trainer.step()
    }

    /// What the run needs.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The priors of its images.
    pub fn priors(&self) -> &Priors {
        &self.priors
    }

    /// First Gaussians that were left out: not finite, or too bright.
    pub fn n_left_out(&self) -> usize {
        self.n_left_out
    }

    /// Seconds of steps and reviews in this session.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Seconds in which steps waited for images.
    pub fn waited(&self) -> f64 {
        self.waited + self.coming.as_ref().map_or(0.0, |coming| coming.stats().waited.as_secs_f64())
    }

    /// What has happened since this was last asked, in order. Steps end while others are under way, so one that was handed over
    /// may be missing; [`Session::wait`] has it.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Hands the next step to the device, after what is due before it; false at the end of the run.
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

    /// As [`Session::step`], with the time of every pass; none at the end of the run. Not of a step that several processes share.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn profile(&mut self) -> Result<Option<ProfiledStep>> {
        self.settle()?;
        let _step = self.begun();
        let Some((images, begun)) = self.images()? else { return Ok(None) };
        let profiled = self.trainer.profile_on(images, begun)?;
        self.stepped(begun + profiled.counting())?;
        Ok(Some(profiled))
    }

    /// The next step's first dispatch of a kernel, with what it worked on; none where it has none, or the run has ended. It is a
    /// step that is not counted.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn dump(&mut self, kernel: &str) -> Result<Option<Dispatch>> {
        self.settle()?;
        let Some((images, _)) = self.images()? else { return Ok(None) };
        self.trainer.dump(images, kernel)
    }

    /// Waits until all steps that were handed over have ended.
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

    /// Does what is due after the last step, so that what follows sees it.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn settle(&mut self) -> Result<()> {
        let owed = self.owed.1;
        if owed.grids {
            self.review(Due::Grids)?;
        }
        self.owed.1.grids = false;
        if owed.review {
            self.review(Due::Gaussians)?;
        }
        self.owed.1.review = false;
        if owed.offsets {
            self.freeze()?;
        }
        self.owed.1.offsets = false;
        if owed.poses {
            let begun = Instant::now();
            let judged = judge_poses(&mut self.trainer, self.capture)?;
            self.seconds += begun.elapsed().as_secs_f64();
            self.events.extend(judged.map(|(pixels, are_learnt)| Event::Poses { pixels, are_learnt }));
        }
        self.owed.1.poses = false;
        if owed.average {
            let begun = Instant::now();
            self.average.add(self.trainer.splats()?);
            self.seconds += begun.elapsed().as_secs_f64();
        }
        self.owed.1.average = false;
        Ok(())
    }

    /// Everything that the run continues from, as of the last step.
    ///
    /// # Errors
    /// As [`Trainer::checkpoint`].
    pub fn checkpoint(&mut self) -> Result<Checkpoint> {
        let checkpoint = self.trainer.checkpoint()?;
        self.collect();
        Ok(Checkpoint { average: self.average.clone(), ..checkpoint })
    }

    /// As [`Session::checkpoint`], of a run that a fault ended: the last step that can be had, and what was due after it.
    ///
    /// # Errors
    /// As [`Trainer::rescue`].
    pub fn rescue(&mut self) -> Result<Checkpoint> {
        let rescued = self.trainer.rescue()?;
        let (step, owed) = self.owed;
        let owed = match rescued.step.cmp(&step) {
            Ordering::Less => Owed::default(),
            Ordering::Equal => owed,
            // It ended while it was rescued.
            Ordering::Greater => Owed::after(&self.config, rescued.step, self.total),
        };
        let owed = Owed { density: rescued.owed.density, ..owed };
        Ok(Checkpoint { owed, average: self.average.clone(), ..rescued })
    }

    /// Waits for the last step and what is due after it; gives the Gaussians, in the frame of training: near the end of the run
    /// their mean over its last steps, see [`Average`].
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn scene(&mut self) -> Result<Splats> {
        self.wait()?;
        self.settle()?;
        let scene = self.average.scene().map_or_else(|| self.trainer.splats(), |mean| Ok(mean.clone()))?;
        self.trainer.cleared(scene)
    }

    /// What a run ends with: [`Session::scene`] and the backdrop that the settings ask for.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn finish(&mut self) -> Result<Splats> {
        let scene = self.scene()?;
        self.with_backdrop(scene)
    }

    /// `scene`, in the frame of training, with the backdrop that the settings ask for, which comes first; without one where images
    /// show the background, where the background shows through the scene, and where there would be more than `max_gaussians`.
    ///
    /// # Errors
    /// Those of the capture's cameras.
    pub fn with_backdrop(&mut self, scene: Splats) -> Result<Splats> {
        if self.trainer.shows_background() {
            return Ok(scene);
        }
        let backdrop = backdrop_of(&scene, self.capture, self.config.backdrop as usize)?;
        let (n, is_added) = (backdrop.len(), backdrop.len() + scene.len() <= self.config.max_gaussians);
        if n > 0 {
            self.events.push(Event::Backdrop { n, is_added });
        }
        Ok(if n > 0 && is_added { put_before(scene, backdrop) } else { scene })
    }

    /// In traces, all that belongs to the next step, waiting for its images too.
    fn begun(&self) -> EnteredSpan {
        debug_span!("step", step = self.trainer.step() + 1).entered()
    }

    /// The images of the next step, taken to where the device can get them, and when that began: what was waited for to be decoded
    /// is not counted. None at the end of the run.
    fn images(&mut self) -> Result<Option<(Vec<Seen>, Instant)>> {
        loop {
            let mut coming = match self.coming.take() {
                Some(coming) => coming,
                None => {
                    self.trainer.release_images();
                    let bytes = (self.cache_bytes, self.image_bytes, self.listed_images);
                    let (settings, at) = ((&self.config, &self.priors.plan), (&self.trainer, self.total));
                    Coming::new(self.capture, &self.frames, settings, at, bytes)?
                }
            };
            let step = coming.next_step(self.capture, &mut self.trainer)?;
            let is_listed = step.as_ref().is_none_or(|(images, _)| !images.is_empty());
            if !is_listed && self.trainer.step() < self.total {
                self.waited += coming.stats().waited.as_secs_f64();
                continue;
            }
            let Some((images, spent)) = step else {
                // Images gave way to what needed the device's memory more. From here on as many stay as there are now.
                self.image_bytes = self.trainer.image_bytes();
                self.waited += coming.stats().waited.as_secs_f64();
                continue;
            };
            self.coming = Some(coming);
            let now = Instant::now();
            let begun = now.checked_sub(spent).unwrap_or(now);
            return Ok(Some((images, begun)).filter(|(images, _)| !images.is_empty()));
        }
    }

    /// Notes a step that was handed over, and waits for it where something is due after it.
    fn stepped(&mut self, begun: Instant) -> Result<()> {
        let step = self.trainer.step();
        self.owed = (step, Owed::after(&self.config, step, self.total));
        if self.owed.1 != Owed::default() {
            self.trainer.finish()?;
        }
        self.seconds += begun.elapsed().as_secs_f64();
        self.collect();
        Ok(())
    }

    fn collect(&mut self) {
        self.events.extend(self.trainer.take_reports().into_iter().map(Event::Step));
    }

    /// Reviews what the scene requires, and continues with that part.
    fn review(&mut self, due: Due) -> Result<()> {
        let begun = Instant::now();
        let mut looked = work(&mut self.watch, Phase::Review);
        let (gpu, capture, constants) = (&self.gpu, self.capture, self.constants);
        let review = review(&mut self.trainer, gpu, capture, constants, due, MOST_IMAGES, &mut looked)?;
        self.seconds += begun.elapsed().as_secs_f64();
        // Its Gaussians are others.
        self.average = Average::default();
        self.events.push(Event::Review(review));
        Ok(())
    }

    /// Fixes the time offsets at 0 that the images do not tell.
    fn freeze(&mut self) -> Result<()> {
        let mut looked = work(&mut self.watch, Phase::OffsetErrors);
        let fits = learnt_offsets(
            &mut self.trainer,
            (&self.gpu, self.capture),
            (self.constants, self.config.background),
            &mut looked,
        )?;
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
