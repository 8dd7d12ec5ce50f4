//! All numbers of a training run, with their defaults (SPEC 6).

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
    /// Gaussians to begin with where they do not come from points; of a hull those that stand still.
    pub init_points: usize,
    /// Gaussians from the hull of one frame.
    pub init_moving_points: usize,
    /// Opacity of Gaussians that begin on surfaces found in the pictures.
    pub init_opacity: f64,
    /// Tau of Gaussians from hulls, in times between two hulls.
    pub init_tau: f64,
    /// Colour behind the scene.
    pub background: [f32; 3],
    /// Learning rate of positions at the start, in units of the scene's extent.
    pub lr_position: f64,
    /// The same at the end; exponential in between.
    pub lr_position_end: f64,
    /// Learning rate of the constant band.
    pub lr_sh0: f64,
    /// Learning rate of the higher bands.
    pub lr_sh_rest: f64,
    /// Learning rate of opacity logits.
    pub lr_opacity: f64,
    /// Learning rate of log-scales.
    pub lr_scale: f64,
    /// Learning rate of quaternions.
    pub lr_rotation: f64,
    /// Learning rate of velocities, scene units per unit of time.
    pub lr_velocity: f64,
    /// Learning rate of times of peak visibility.
    pub lr_t_center: f64,
    /// Learning rate of log tau.
    pub lr_t_scale: f64,
    /// Where Gaussians are added and removed.
    pub density: Density,
}

/// Where the first Gaussians come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Init {
    /// `Points` where the capture has some, else `Hull` where it says what moves, else `Frustum`.
    Auto,
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
            Init::Points => "points",
            Init::Hull => "hull",
            Init::Frustum => "frustum",
            Init::Random => "random",
        }
    }
}

/// Adaptive density control, as 3DGS has it (SPEC 6), over the training times.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Density {
    /// First step, as a fraction of the run, and at most [`Density::first_step`].
    pub start: f64,
    /// First step at the latest.
    pub first_step: u64,
    /// Last step, as a fraction of the run.
    pub stop: f64,
    /// Steps between two rounds, at most; shorter runs have at least ten rounds.
    pub every: u64,
    /// Mean norm of the projected centre's gradient, in half pictures, above which a Gaussian grows.
    pub gradient: f32,
    /// A round adds at most this fraction of the Gaussians, those that are pulled hardest: in short runs, far from
    /// convergence, almost all are.
    pub growth: f64,
    /// Standard deviation, in units of the extent, above which a Gaussian is split and below which it is cloned.
    pub split_above: f32,
    /// Base opacity below which a Gaussian is removed.
    pub prune_opacity: f32,
    /// Standard deviation, in units of the extent, above which a Gaussian is removed.
    pub prune_scale: f32,
    /// Steps between two resets of the opacities.
    pub reset_every: u64,
    /// Opacity that a reset leaves at most; far enough above alpha_min that small Gaussians keep a gradient.
    pub reset_to: f32,
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
            background: [0.0; 3],
            lr_position: 1.6e-4,
            lr_position_end: 1.6e-6,
            lr_sh0: 2.5e-3,
            lr_sh_rest: 1.25e-4,
            lr_opacity: 2.5e-2,
            lr_scale: 5e-3,
            lr_rotation: 1e-3,
            lr_velocity: 2e-3,
            lr_t_center: 1e-5,
            lr_t_scale: 3e-2,
            density: Density::default(),
        }
    }
}

impl Default for Density {
    fn default() -> Self {
        Density {
            start: 0.1,
            first_step: 500,
            stop: 0.5,
            every: 100,
            gradient: 2e-4,
            growth: 0.15,
            split_above: 0.01,
            prune_opacity: 0.005,
            prune_scale: 0.5,
            reset_every: 3000,
            reset_to: 0.05,
        }
    }
}

impl Density {
    /// Whether a round of density control follows step `step` (from 1) of `total`.
    pub fn is_due(&self, step: u64, total: u64) -> bool {
        let first = ((total as f64 * self.start) as u64).min(self.first_step);
        let last = (total as f64 * self.stop) as u64;
        let every = self.every.min((last.saturating_sub(first) / 10).max(1)).max(1);
        step >= first && step <= last && step > 0 && (step - first).is_multiple_of(every) && step != first
    }
}
