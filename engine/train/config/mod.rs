//! All numbers of a training run, with their defaults (SPEC 6).

mod density;
mod init;
mod loss;
mod rates;

pub use density::{Density, Round, Strategy};
pub use init::Init;
pub use loss::{FlowChoice, Loss};
pub use rates::{LearningRates, Pace, Rate};

use crate::settings::Knobs;
use crate::stage::{Accumulation, AdamMode};

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

impl Config {
    /// Steps of a run on `n_images` training images.
    pub fn total(&self, n_images: u64) -> u64 {
        if self.steps > 0 { self.steps } else { u64::from(self.epochs) * n_images }
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

/// Tells a preset from others, and from itself before a change.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PresetId {
    /// Its name, or the stem of its file.
    pub name: String,
    /// The first 16 digits of the SHA-256 of its file.
    pub hash: String,
}
