//! Settings of density control, and the steps after which it runs.

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
    /// Floaters before the camera: standard deviation, as a part of its depth before the lens of a training camera or of a view
    /// that `--viewpoints` names, above which a Gaussian is removed (`adc`) or relocated (`mcmc`). Beside the cone that the lens
    /// sees, twice the distance to it counts as depth.
    pub prune_veil: f32,
    /// `adc`: steps between two resets of the opacities.
    pub reset_every: u64,
    /// Opacity that a reset leaves at most; far enough above alpha_min that small Gaussians keep a gradient.
    pub reset_to: f32,
    /// `mcmc`: a round adds this fraction of the Gaussians, until there are [`crate::train::Config::max_gaussians`].
    pub mcmc_growth: f64,
    /// `mcmc`: size of the noise, in units of the positions' learning rate.
    pub mcmc_noise: f64,
    /// `mcmc`: weight of the mean opacity in the loss.
    pub opacity_reg: f64,
    /// `mcmc`: weight of the mean standard deviation in the loss, per scene unit.
    pub scale_reg: f64,
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
