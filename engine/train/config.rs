//! The settings of a training run, with their defaults (SPEC 6).

use crate::recon::Init;
use crate::settings::{Knobs, Range, Setting, settings};
use crate::stage::{Accumulation, AdamMode, DepthSpace, MOST_IMAGES};
use std::path::PathBuf;

/// The most Gaussians that a run is asked to begin with.
const MOST_POINTS: u64 = 50_000_000;

/// All settings of a run, by group.
pub fn all_settings() -> impl Iterator<Item = &'static Setting> + Clone {
    let groups = [
        Config::SETTINGS,
        Loss::SETTINGS,
        LearningRates::SETTINGS,
        Pace::SETTINGS,
        Density::SETTINGS,
        Resolution::SETTINGS,
        Knobs::SETTINGS,
        Required::SETTINGS,
    ];
    groups.into_iter().flatten()
}

settings! {
    /// A training run. Everything but the capture; two runs with equal settings on one machine give equal bits.
    pub struct Config in "" {
        /// Passes over all training images. Used unless steps is set.
        epochs: u32 = 30, "passes", Range::Whole(0, u32::MAX as u64);
        /// Length of the run; 0 takes the length from epochs.
        steps: u64 = 0, "steps", Range::Whole(0, u64::MAX);
        /// Images of a step: their gradients are added up before the Gaussians move. Several processes share them (`mpirun`). Takes
        /// as much memory again as the moments and the parameters do.
        batch: u32 = 1, "images", Range::Whole(1, MOST_IMAGES);
        /// Seed of the image order, the random points, the backgrounds and density control.
        seed: u64 = 42, "", Range::Whole(0, u64::MAX);
        /// Highest degree of the spherical harmonics: how finely colours depend on the direction of view.
        sh_degree: u32 = 3, "", Range::Whole(0, 3);
        /// The scene of a run is the mean of the scenes in this last share of it, in which density control does nothing; 0 takes the scene of
        /// the last step alone.
        average: f64 = 0.1, "of the run", Range::SHARE;
        /// The number of Gaussians never exceeds this. A run that adds some (adc) begins with two thirds as many at most, of those that it finds.
        max_gaussians: usize = 500_000, "Gaussians", Range::COUNT;
        /// Where the first Gaussians come from.
        init: Init = Init::Auto, "",
            Range::Word(&["auto", "flow", "any_view", "concat", "points", "hull", "frustum", "random"]);
        /// Most Gaussians from surfaces found in the images. If the capture has more points, as many as it has points.
        init_points: usize = 20_000, "Gaussians", Range::Whole(1, MOST_POINTS);
        /// How long points at rest are visible with init=flow; 0 makes them static for good.
        init_static_tau: f64 = 10.0, "clips", Range::NOT_NEGATIVE;
        /// How many evenly spread directions are checked at the end of a run. Where no training camera sees one, but a camera sees close
        /// to it, a large static Gaussian is put behind the scene, in the colour seen next to it. 0 leaves black holes there. None where
        /// images show the background, where it shows through the scene, and where there would be more than max_gaussians; density control
        /// leaves room for it, a tenth of them at most.
        backdrop: u32 = 1000, "directions", Range::Whole(0, 10_000);
        /// Colour behind the scene.
        background: [f32; 3] = [0.0; 3], "", Range::Colour;
        /// Whether each image is compared with the scene over a background of another colour, so that the scene cannot use the background
        /// as a colour. Only where most cameras look inward, and never where images show the background.
        vary_background: bool = true, "", Range::Switch;
        /// Whether the time offsets of the cameras are learnt. Only in clips of several cameras.
        offsets: bool = true, "", Range::Switch;
        /// Whether the poses of the training cameras are learnt, one turn and one shift a camera for all its images. Auto learns them in
        /// a clip, and after 30 % of the run goes on only if the cameras turn out to stand elsewhere than the capture says.
        poses: PoseKind = PoseKind::Auto, "", Range::Word(&["auto", "learnt", "given"]);
        /// What corrects the colours of each training camera: a bilateral grid, one affine map for the whole image, or nothing. Only in
        /// clips of several cameras.
        grids: GridKind = GridKind::default(), "", Range::Word(&["bilateral", "affine", "none"]);
        /// Which Gaussians take a step: all, or those in view after catching up.
        adam: AdamMode = AdamMode::default(), "", Range::Word(&["dense", "lazy"]);
        /// Size of each of Adam's moments in memory.
        moment_bits: u32 = 16, "bits", Range::OneOf(&[16, 32]);
        /// How gradients are added up. Auto is slots on a CPU and fixed_point on a GPU. Both give the same bits in every run.
        accumulation: Accumulation = Accumulation::default(), "", Range::Word(&["auto", "slots", "fixed_point"]);
    } with {
        /// Weights and forms of the terms of the loss.
        loss: Loss,
        /// Learning rates.
        lr: LearningRates,
        /// Where Gaussians are added and removed.
        density: Density,
        /// Whether the first part of the run sees smaller images.
        resolution: Resolution,
        /// How the frames of the run are computed. What is scored, and what others render of its scene, is exact.
        frame: Knobs = Knobs { depth_bits: 24, temporal_cut: 0.0156, ..Knobs::default() },
        /// What is kept of the model: everything, or only what the scene requires.
        required: Required,
        /// No setting: true in a run on top of another (`--base`), which keeps that run's static Gaussians as they are.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        holds_static: bool,
        /// The preset that the settings began from.
        #[serde(skip_serializing_if = "Option::is_none")]
        preset: Option<PresetId>,
    }
}

settings! {
    /// Reviews of what the scene requires (SPEC 12). Without any, a run keeps all that it models.
    pub struct Required in "required." {
        /// How often Gaussians are reduced to what the images need; 0 never reduces them.
        reviews: u32 = 0, "reviews", Range::Whole(0, u32::MAX as u64);
        /// When it is decided which cameras need a colour map; 0 gives one to all from the start.
        grids_at: f64 = 0.0, "of the run", Range::BELOW_ONE;
    }
}

settings! {
    /// A run may begin with reduced images, on which a step costs less: coarse to fine. A pixel is then the mean of
    /// `reduction` x `reduction`.
    #[derive(Copy)]
    pub struct Resolution in "resolution." {
        /// The run begins on images reduced by this factor; 1 leaves them whole.
        reduction: u32 = 2, "pixels", Range::Whole(1, 8);
        /// How long the run sees reduced images.
        until: f64 = 0.4, "of the run", Range::SHARE;
    }
}

impl Resolution {
    /// That of step `step` (from 1) of `total`.
    #[doc(hidden)]
    pub fn reduction(&self, step: u64, total: u64) -> u32 {
        if ((step - 1) as f64) < self.until * total as f64 { self.reduction } else { 1 }
    }
}

settings! {
    /// The terms of the loss beside the photometric one, whose weight is 1 (SPEC 4). A term of weight 0, or without data,
    /// costs nothing.
    pub struct Loss in "loss." {
        /// Weight of the depth error, where the capture has depth priors.
        depth: f64 = 1.0, "", Range::NOT_NEGATIVE;
        /// Whether inverse depths or depths are compared.
        depth_space: DepthSpace = DepthSpace::Inverse, "", Range::Word(&["inverse", "metric"]);
        /// Weight of the flow error, where the capture has optical flow.
        flow: f64 = 0.1, "", Range::NOT_NEGATIVE;
        /// Weight of the squared time offsets.
        offset: f64 = 1e-4, "", Range::NOT_NEGATIVE;
        /// SSIM at every pixel (1), or at every second pixel of every second row (2).
        ssim_stride: u32 = 2, "pixels", Range::OneOf(&[1, 2]);
        /// Weight of LPIPS, where loss.lpips_weights names a file.
        lpips: f64 = 0.1, "", Range::NOT_NEGATIVE;
        /// The weights of LPIPS, as tools/lpips_weights.py writes them.
        lpips_weights: Option<PathBuf> = None, "", Range::Path;
        /// Side of the square that LPIPS looks at; 0 for the whole image.
        lpips_crop: u32 = 0, "pixels", Range::Whole(0, u32::MAX as u64);
    }
}

/// What corrects the colours of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GridKind {
    /// A grid of affine maps over the image and the luma.
    Bilateral,
    /// One affine map for the whole image: a grid whose cells agree.
    #[default]
    Affine,
    /// Nothing.
    None,
}

impl GridKind {
    /// Whether cameras have grids.
    #[doc(hidden)]
    pub fn is_some(self) -> bool {
        self != GridKind::None
    }
}

/// Whose poses cameras have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseKind {
    /// Learnt in a clip for 30 % of the run; then those, or the capture's where they hardly differ.
    #[default]
    Auto,
    /// Learnt.
    Learnt,
    /// The capture's.
    Given,
}

/// How Gaussians are added and removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// 3DGS: clones and splits those that are pulled, removes the faint and the huge, resets opacities.
    Adc,
    /// 3DGS-MCMC (Kheradmand et al. 2024): the faint become copies of others, and wander until then.
    Mcmc,
}

settings! {
    /// Density control (SPEC 6), over the training times.
    pub struct Density in "density." {
        /// How Gaussians are added and removed: as in 3DGS, or as in 3DGS-MCMC.
        strategy: Strategy = Strategy::Adc, "", Range::Word(&["adc", "mcmc"]);
        /// When the last Gaussians are added; 0 turns density control off.
        stop: f64 = 0.5, "of the run", Range::SHARE;
        /// Steps between two rounds, at most. Short runs have ten rounds that add, but at least eight steps apart.
        every: u64 = 100, "steps", Range::Whole(1, u64::MAX);
        /// Share of the Gaussians that one round may add.
        growth: f64 = 0.05, "of the Gaussians", Range::SHARE;
        /// adc: steps between two resets of the opacities; 0 never resets.
        reset_every: u64 = 3000, "steps", Range::Whole(0, u64::MAX);
    }
}

/// A learning rate that changes exponentially from `start` to `end` over the run; a number stands for both.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "RateForm")]
pub struct Rate {
    /// At the first step.
    pub start: f64,
    /// At the end of the run.
    pub end: f64,
}

/// How a rate may be written.
#[derive(serde::Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum RateForm {
    Constant(f64),
    Decay { start: f64, end: f64 },
}

impl From<RateForm> for Rate {
    fn from(form: RateForm) -> Self {
        match form {
            RateForm::Constant(rate) => Rate::constant(rate),
            RateForm::Decay { start, end } => Rate { start, end },
        }
    }
}

impl Config {
    /// Steps of a run on `n_images` training images.
    pub fn total(&self, n_images: u64) -> u64 {
        let images = u64::from(self.epochs) * n_images;
        if self.steps > 0 { self.steps } else { images.div_ceil(u64::from(self.batch)) }
    }
}

impl Rate {
    /// The same rate throughout.
    pub const fn constant(rate: f64) -> Rate {
        Rate { start: rate, end: rate }
    }

    /// The rate when `done`, from 0 to 1, of the run is done.
    pub fn at(&self, done: f64) -> f64 {
        if self.start == self.end { self.start } else { self.start * (self.end / self.start).powf(done) }
    }
}

/// A run of n steps begins with ([`Pace::steps`] / n)^this times the rates. This and the three below were measured together
/// (`assets/lab/schedule/compare.md`).
const PACE_START: f64 = 0.55;
/// Steps from which on a run ends with the rates as they are.
const SETTLED: u64 = 3000;
/// A shorter run ends with ([`SETTLED`] / n)^this times the rates.
const PACE_END: f64 = 0.6;
/// The rates are raised at most by this factor.
const MOST_PACE: f64 = 16.0;

settings! {
    /// How learning rates follow the length of a run: they are given for [`Pace::steps`] steps, and a shorter run, which
    /// has less time to get as far, takes larger ones. A longer run takes them as they are.
    #[derive(Copy)]
    pub struct Pace in "lr.pace." {
        /// Length of the run that the learning rates are given for; 0 uses the same rates in every run.
        steps: u64 = 30_000, "steps", Range::Whole(0, u64::MAX);
    }
}

impl Pace {
    /// What the rates are multiplied by when `done`, from 0 to 1, of a run of `total` steps is done; at least 1.
    pub fn at(&self, done: f64, total: u64) -> f64 {
        let times = |steps: u64, power: f64| {
            let shorter = (steps as f64 / total.max(1) as f64).max(1.0);
            shorter.powf(power).min(MOST_PACE)
        };
        let settled = SETTLED.min(self.steps);
        Rate { start: times(self.steps, PACE_START), end: times(settled, PACE_END) }.at(done)
    }
}

settings! {
    /// Learning rates by kind of parameter, as they are in a run of [`Pace::steps`] steps.
    #[derive(Copy)]
    pub struct LearningRates in "lr." {
        /// Learning rate of the position of a Gaussian of `lr.position_size`.
        position: Rate = Rate { start: 1.6e-4, end: 1.6e-6 }, "scene extents", Range::Rate;
        /// Longest standard deviation of a Gaussian whose position has the rate `lr.position`. Positions of others have theirs
        /// in proportion to the size, from a quarter to sixteen times. 0: all have the same, as in 3DGS.
        position_size: f64 = 0.012, "scene extents", Range::NOT_NEGATIVE;
        /// Learning rate of the constant colour. The higher spherical harmonics have a twentieth of it, as in 3DGS.
        sh: Rate = Rate::constant(2.5e-3), "", Range::Rate;
        /// Learning rate of opacities, as logits.
        opacity: Rate = Rate::constant(2.5e-2), "", Range::Rate;
        /// Learning rate of scales, as logarithms.
        scale: Rate = Rate::constant(5e-3), "", Range::Rate;
        /// Learning rate of rotations, as quaternions.
        rotation: Rate = Rate::constant(1e-3), "", Range::Rate;
        /// Learning rate of velocities.
        velocity: Rate = Rate::constant(2e-3), "scene units per clip", Range::Rate;
        /// Learning rate of the times of peak visibility.
        t_center: Rate = Rate::constant(1e-5), "clips", Range::Rate;
        /// Learning rate of how long Gaussians are visible, as logarithms.
        t_scale: Rate = Rate::constant(3e-2), "", Range::Rate;
    } with {
        /// How much larger they are in a shorter run.
        pace: Pace,
    }
}

/// What a round of density control does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Round {
    /// Gaussians are added, removed and, by `mcmc`, relocated.
    Growth,
    /// Those that have faded are removed.
    Removal,
}

/// Density control begins after this share of a run: before, the first Gaussians are still on their way to the surfaces.
const BEGINS: f64 = 0.1;
/// It begins after this step at the latest, as in 3DGS.
const BEGINS_AT_LATEST: u64 = 500;
/// Steps between two rounds, at least, if the settings do not say less: what a round adds must come apart to be worth its time.
const LEAST_EVERY: u64 = 8;

impl Density {
    /// The round of density control that follows step `step` (from 1) of `total`. Rounds come at equal steps to the end of the run.
    /// Those after [`Density::stop`] only remove, and so does one after which too few steps are left to fit what it would add.
    /// [`super::density_round`] leaves out those in steps that are averaged. None if there is no time for rounds that grow.
    #[doc(hidden)]
    pub fn due(&self, step: u64, total: u64) -> Option<Round> {
        let (first, last) = self.first_and_last(total);
        let every = self.every.min((last.saturating_sub(first) / 10).max(LEAST_EVERY)).max(1);
        let is_due = last > first && step > first && (step - first).is_multiple_of(every);
        let grows = step <= last && total.saturating_sub(step) >= every;
        is_due.then_some(if grows { Round::Growth } else { Round::Removal })
    }

    /// Whether a round of a run of `total` steps may add Gaussians after step `step`.
    #[doc(hidden)]
    pub fn grows_after(&self, step: u64, total: u64) -> bool {
        let (first, last) = self.first_and_last(total);
        last > first && step < last
    }

    /// The step before the rounds begin, and the last that adds Gaussians.
    fn first_and_last(&self, total: u64) -> (u64, u64) {
        (((total as f64 * BEGINS) as u64).min(BEGINS_AT_LATEST), (total as f64 * self.stop) as u64)
    }
}

/// Tells a preset from others, and from itself before a change.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PresetId {
    /// Its name, or the stem of its file.
    pub name: String,
    /// The first 16 digits of the SHA-256 of its file.
    pub hash: String,
}
