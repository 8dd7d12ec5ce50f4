//! All numbers of a training run, with their defaults (SPEC 6).

use crate::settings::Knobs;
use crate::stage::{Accumulation, AdamMode, DepthSpace};
use std::path::PathBuf;

/// A training run. Everything but the capture; two runs with equal settings on one machine give equal bits.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Passes over all training images.
    pub epochs: u32,
    /// Steps, instead of what the epochs give; 0 leaves it to them.
    pub steps: u64,
    /// Seed of the images' order, the initial points and density control.
    pub seed: u64,
    /// Highest degree of the spherical harmonics, 0 to 3; it grows by one every thirtieth of the run.
    pub sh_degree: u32,
    /// Gaussians never exceed this.
    pub max_gaussians: usize,
    /// Where the first Gaussians come from.
    pub init: Init,
    /// Most Gaussians from surfaces that the pictures show, or at random places; one for each 16 pixels of a frame's training
    /// pictures at most. Where the capture has more points, as many as it has.
    pub init_points: usize,
    /// Gaussians from the hull of one frame.
    pub init_moving_points: usize,
    /// Opacity of Gaussians that begin on surfaces found in the pictures.
    pub init_opacity: f64,
    /// Tau of Gaussians from hulls, in times between two hulls.
    pub init_tau: f64,
    /// `flow`: a point moves if the flow at it exceeds this in two views, or its only one; `any_view`: in any view; pixels per
    /// frame.
    pub init_flow_threshold: f64,
    /// `flow` and `concat`: tau of points that belong to their frame, in frames.
    pub init_point_tau: f64,
    /// `flow`: tau of points that stand still, in clips: what stands still at first may move later. 0 makes them static Gaussians,
    /// which never move or fade.
    pub init_static_tau: f64,
    /// Colour behind the scene.
    pub background: [f32; 3],
    /// Weights and forms of the loss's terms.
    pub loss: Loss,
    /// Whether the cameras' time offsets are learnt (SPEC 2).
    pub offsets: bool,
    /// Whether each camera has a bilateral grid of colour maps (SPEC 7).
    pub grids: bool,
    /// Learning rates.
    pub lr: LearningRates,
    /// Which Gaussians take a step: `dense` (all; the reference), `lazy` (those in view catch up first), `sparse`.
    pub adam: AdamMode,
    /// Bits of each of Adam's two moments of a number of a Gaussian: 32, or 16, rounded at random so that their means stay
    /// right: half the memory and traffic of the moments. The step itself is computed in 32.
    pub moment_bits: u32,
    /// How gradients are added up: `slots`, `fixed_point`, `float_atomics`, `compare_exchange`.
    pub accumulation: Accumulation,
    /// Where Gaussians are added and removed.
    pub density: Density,
    /// Whether the first part of the run sees smaller pictures.
    pub resolution: Resolution,
    /// How the frames of the run are computed; what is scored, and what others render of its scene, is exact.
    pub frame: Knobs,
    /// The preset that the settings began from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<PresetId>,
    /// What is kept of the model: everything, or only what the scene requires.
    pub required: Required,
}

/// Reviews of what the scene requires (SPEC 12). Without any, all that the settings ask for is modelled.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Required {
    /// How often the Gaussians are reviewed; 0 for a model of everything.
    pub reviews: u32,
    /// First review, as a fraction of the run.
    pub first: f64,
    /// Last review, as a fraction of the run.
    pub last: f64,
    /// Training images that a review looks at, at most: it chooses them so that Gaussians are seen, and ends when enough are.
    pub images: usize,
    /// Share of the Gaussians that may have been seen in too few of these images to be judged; they stay as they are.
    pub unseen: f64,
    /// What a number must be worth at most, in units of half the logarithm of the number of observations (Schwarz 1978).
    pub price: f64,
    /// PSNR of the training images that the reviews together may cost at the moment when they happen, dB; the price is lowered
    /// to that.
    pub margin: f64,
    /// Cameras get bilateral grids, where [`Config::grids`] allows any, after this fraction of the run, and only those that
    /// need one.
    pub grids_at: f64,
}

impl Default for Required {
    fn default() -> Self {
        Required {
            reviews: 0,
            first: 0.6,
            last: 0.8,
            images: 128,
            unseen: 0.02,
            price: 1.0,
            margin: 0.05,
            grids_at: 0.3,
        }
    }
}

/// A run may begin with reduced pictures, on which a step costs less: coarse to fine.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Resolution {
    /// Each pixel is the mean of `reduction` x `reduction`; 1 leaves pictures as they are.
    pub reduction: u32,
    /// The fraction of the run that sees them.
    pub until: f64,
}

impl Default for Resolution {
    fn default() -> Self {
        Resolution { reduction: 1, until: 0.5 }
    }
}

impl Resolution {
    /// That of step `step` (from 1) of `total`.
    pub fn reduction(&self, step: u64, total: u64) -> u32 {
        if ((step - 1) as f64) < self.until * total as f64 { self.reduction } else { 1 }
    }
}

/// The terms of the loss beside the photometric one, whose weight is 1 (SPEC 4). A term of weight 0, or without data,
/// costs nothing.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Loss {
    /// Weight of the mean error of the depth, where the capture has priors of it.
    pub depth: f64,
    /// The space in which depths are compared.
    pub depth_space: DepthSpace,
    /// Keeps the depth's error from changing opacities and shapes: it moves centres along the view alone.
    pub depth_detach_alpha: bool,
    /// Weight of the mean end-point error of the flow, pixels per frame.
    pub flow: f64,
    /// What the rendered flow is.
    pub flow_model: FlowChoice,
    /// Weight of the sum of the squared time offsets, frames.
    pub offset: f64,
    /// Weight of the total variation of the camera's bilateral grid.
    pub grid_variation: f64,
    /// SSIM in every n-th step alone, with n times the weight; the others have the absolute error.
    pub ssim_every: u64,
    /// SSIM at every pixel (1), or at every second of every second row with four times the weight (2).
    pub ssim_stride: u32,
    /// Weight of LPIPS, where there are [`Loss::lpips_weights`].
    pub lpips: f64,
    /// The weights of its trunk, as `tools/lpips_weights.py` writes them.
    pub lpips_weights: Option<PathBuf>,
    /// LPIPS of a square of this side alone, elsewhere in each step, pixels; 0 for the whole picture.
    pub lpips_crop: u32,
    /// LPIPS in every n-th step alone, with n times the weight.
    pub lpips_every: u64,
}

/// What the rendered flow is, see [`crate::scene::FlowModel`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FlowChoice {
    /// The displacement where a camera moves, whose flow the priors hold too; the velocity elsewhere.
    #[default]
    Auto,
    /// The projected velocity (paper).
    Velocity,
    /// The displacement, by the camera's motion too.
    Displacement,
}

impl Default for Loss {
    fn default() -> Self {
        Loss {
            depth: 1.0,
            depth_space: DepthSpace::Inverse,
            depth_detach_alpha: false,
            flow: 0.1,
            flow_model: FlowChoice::Auto,
            offset: 1e-4,
            grid_variation: 10.0,
            ssim_every: 1,
            ssim_stride: 1,
            lpips: 0.1,
            lpips_weights: None,
            lpips_crop: 0,
            lpips_every: 1,
        }
    }
}

/// Where the first Gaussians come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Init {
    /// All that the capture has: what moves from points and flow of every frame (`Flow`) or, without them, from foreground
    /// masks (`Hull`); what stands still from the surfaces that the pictures show (`Frustum`), joined with the points.
    Auto,
    /// What stands still from the points of the reference frame, what moves from those of every frame, told apart by the
    /// flow (SPEC 5).
    Flow,
    /// As `Flow`, but a point moves if the flow at it exceeds the threshold in any view that saw it: the paper's rule.
    #[serde(rename = "any_view")]
    AnyView,
    /// The points of every frame, each visible around its time.
    Concat,
    /// The capture's points.
    Points,
    /// The visual hull of what moves, frame by frame, and the rest as `Frustum`.
    Hull,
    /// Surfaces on which the cameras' pictures agree.
    Frustum,
    /// Grey points in the ball that the cameras are in.
    Random,
}

impl Init {
    /// Its name among the settings.
    pub fn name(self) -> &'static str {
        match self {
            Init::Auto => "auto",
            Init::Flow => "flow",
            Init::AnyView => "any_view",
            Init::Concat => "concat",
            Init::Points => "points",
            Init::Hull => "hull",
            Init::Frustum => "frustum",
            Init::Random => "random",
        }
    }
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

/// Density control (SPEC 6), over the training times.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Density {
    /// How Gaussians are added and removed.
    pub strategy: Strategy,
    /// First step, as a fraction of the run, and at most [`Density::first_step`].
    pub start: f64,
    /// First step at the latest.
    pub first_step: u64,
    /// Last step that adds any, as a fraction of the run; 0 for no density control.
    pub stop: f64,
    /// Steps between two rounds, at most. A shorter run has ten rounds that grow, but none sooner than eight steps after another.
    pub every: u64,
    /// `adc`: mean norm of the projected centre's gradient, in half pictures, above which a Gaussian grows.
    pub gradient: f32,
    /// `adc`: a round adds at most this fraction of the Gaussians, those that are pulled hardest: in short runs, far
    /// from convergence, almost all are.
    pub growth: f64,
    /// `adc`: a round may add this many even where they are more than that fraction: a capture may begin with few points.
    pub growth_least: u64,
    /// `adc`: standard deviation, in units of the extent, above which a Gaussian is split and below which it is cloned.
    pub split_above: f32,
    /// Opacity, the largest over the training times, below which a Gaussian is removed (`adc`) or relocated (`mcmc`).
    pub prune_opacity: f32,
    /// `adc`: standard deviation, in units of the extent, above which a Gaussian is removed as long as others are added.
    pub prune_scale: f32,
    /// Standard deviation, as a part of its depth before the lens of a training camera or of a view that `--viewpoints` names,
    /// above which a Gaussian is removed (`adc`) or relocated (`mcmc`): it would veil what is seen from there. Beside the cone
    /// that the lens sees, twice the distance to it counts as depth.
    pub prune_veil: f32,
    /// `adc`: steps between two resets of the opacities.
    pub reset_every: u64,
    /// Opacity that a reset leaves at most; far enough above alpha_min that small Gaussians keep a gradient.
    pub reset_to: f32,
    /// `mcmc`: a round adds this fraction of the Gaussians, until there are [`Config::max_gaussians`].
    pub mcmc_growth: f64,
    /// `mcmc`: size of the noise, in units of the positions' learning rate.
    pub mcmc_noise: f64,
    /// `mcmc`: weight of the mean opacity in the loss.
    pub opacity_reg: f64,
    /// `mcmc`: weight of the mean standard deviation in the loss, per scene unit.
    pub scale_reg: f64,
}

/// A learning rate that goes from `start` to `end` exponentially over the run; a number stands for both.
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
            RateForm::Constant(rate) => Rate { start: rate, end: rate },
            RateForm::Decay { start, end } => Rate { start, end },
        }
    }
}

impl Config {
    /// Steps of a run on `n_images` training images.
    pub fn total(&self, n_images: u64) -> u64 {
        if self.steps > 0 { self.steps } else { u64::from(self.epochs) * n_images }
    }
}

impl Rate {
    /// The rate when `done`, from 0 to 1, of the run is done.
    pub fn at(&self, done: f64) -> f64 {
        if self.start == self.end { self.start } else { self.start * (self.end / self.start).powf(done) }
    }
}

/// How learning rates follow the length of a run: they are written down for [`Pace::steps`] steps, and a shorter run, which
/// has less time to get as far, takes larger ones. A longer run takes them as they are.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pace {
    /// Steps of the run that the rates are written down for; 0 for rates that are the same in every run.
    pub steps: u64,
    /// A run of n steps begins with (steps / n)^start times the rates.
    pub start: f64,
    /// Steps from which on a run ends with the rates as they are: it has had the time to settle.
    pub settled: u64,
    /// A shorter one ends with (settled / n)^end times the rates.
    pub end: f64,
    /// They are never more than this many times what is written.
    pub most: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { steps: 30_000, start: 0.55, settled: 3000, end: 0.6, most: 16.0 }
    }
}

impl Pace {
    /// What the rates are multiplied by when `done`, from 0 to 1, of a run of `total` steps is done; at least 1.
    pub fn at(&self, done: f64, total: u64) -> f64 {
        let times = |steps: u64, power: f64| {
            let shorter = (steps as f64 / total.max(1) as f64).max(1.0);
            shorter.powf(power).min(self.most)
        };
        let settled = self.settled.min(self.steps);
        Rate { start: times(self.steps, self.start), end: times(settled, self.end) }.at(done)
    }
}

/// Learning rates by kind of parameter, as they are in a run of [`Pace::steps`] steps.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningRates {
    /// How much larger they are in a shorter run.
    pub pace: Pace,
    /// Of positions, in units of the scene's extent.
    pub position: Rate,
    /// Of the constant band.
    pub sh0: Rate,
    /// Of the higher bands.
    pub sh_rest: Rate,
    /// Of opacity logits.
    pub opacity: Rate,
    /// Of log-scales.
    pub scale: Rate,
    /// Of quaternions.
    pub rotation: Rate,
    /// Of velocities, scene units per unit of time.
    pub velocity: Rate,
    /// Of times of peak visibility.
    pub t_center: Rate,
    /// Of log tau.
    pub t_scale: Rate,
    /// Of the cameras' time offsets, frames.
    pub offset: Rate,
    /// Of the bilateral grids.
    pub grid: Rate,
}

impl Default for LearningRates {
    fn default() -> Self {
        let constant = |rate: f64| Rate { start: rate, end: rate };
        LearningRates {
            pace: Pace::default(),
            position: Rate { start: 1.6e-4, end: 1.6e-6 },
            sh0: constant(2.5e-3),
            sh_rest: constant(1.25e-4),
            opacity: constant(2.5e-2),
            scale: constant(5e-3),
            rotation: constant(1e-3),
            velocity: constant(2e-3),
            t_center: constant(1e-5),
            t_scale: constant(3e-2),
            offset: constant(1e-3),
            grid: constant(2e-3),
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Config {
            epochs: 30,
            steps: 0,
            seed: 42,
            sh_degree: 3,
            max_gaussians: 500_000,
            init: Init::Auto,
            init_points: 20_000,
            init_moving_points: 1500,
            init_opacity: 0.5,
            init_tau: 0.7,
            init_flow_threshold: 0.1,
            init_point_tau: 2.0,
            init_static_tau: 10.0,
            background: [0.0; 3],
            loss: Loss::default(),
            offsets: true,
            grids: true,
            lr: LearningRates::default(),
            adam: AdamMode::default(),
            moment_bits: 32,
            accumulation: Accumulation::default(),
            density: Density::default(),
            required: Required::default(),
            resolution: Resolution::default(),
            frame: Knobs::default(),
            preset: None,
        }
    }
}

impl Default for Density {
    fn default() -> Self {
        Density {
            strategy: Strategy::Adc,
            start: 0.1,
            first_step: 500,
            stop: 0.5,
            every: 100,
            gradient: 2e-4,
            growth: 0.05,
            growth_least: 1000,
            split_above: 0.01,
            prune_opacity: 0.005,
            prune_scale: 0.5,
            prune_veil: 0.33,
            reset_every: 3000,
            reset_to: 0.05,
            mcmc_growth: 0.05,
            mcmc_noise: 5e5,
            opacity_reg: 0.01,
            scale_reg: 0.01,
        }
    }
}

/// What a round of density control does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Round {
    /// Gaussians are added, removed and, by `mcmc`, relocated.
    Growth,
    /// Gaussians are removed: one that has grown before a lens since the others ended would stay there.
    Removal,
}

/// Steps between two rounds, at least, if the settings do not say less: what a round adds must come apart to be worth its time.
const LEAST_EVERY: u64 = 8;

impl Density {
    /// The round of density control that follows step `step` (from 1) of `total`: rounds at equal steps to the end of the run,
    /// of which those after [`Density::stop`] only remove. None where the rounds that grow are none.
    pub fn due(&self, step: u64, total: u64) -> Option<Round> {
        let first = ((total as f64 * self.start) as u64).min(self.first_step);
        let last = (total as f64 * self.stop) as u64;
        let every = self.every.min((last.saturating_sub(first) / 10).max(LEAST_EVERY)).max(1);
        let is_due = last > first && step > first && (step - first).is_multiple_of(every);
        is_due.then_some(if step <= last { Round::Growth } else { Round::Removal })
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
