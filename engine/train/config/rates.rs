//! Learning rates: their settings, and how they follow a run and its length.

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
