//! The paper's ablations: which settings are compared, by what, and how sure the differences are.

use crate::report::statistics::Estimate;
use crate::train::{Config, LearningRates, Pace, Rate};

/// A quantity that runs are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Gaussians at the beginning.
    FirstGaussians,
    /// Gaussians at the end.
    LastGaussians,
    /// Mean PSNR of the test views, dB.
    Psnr,
    /// The same over what moves, where the capture has foreground masks.
    PsnrForeground,
    /// The same over what a training camera sees too, where the capture has co-visibility masks.
    PsnrCovisible,
    /// The lowest PSNR of a test view, dB.
    PsnrWorst,
    /// Mean PSNR after the affine map of colours that brings each view closest to its image, dB.
    PsnrAligned,
    /// Mean PSNR of the test camera farthest from the middle of all, dB.
    PsnrPeripheral,
    /// The same over what a training camera sees too, where the capture has co-visibility masks.
    PsnrPeripheralCovisible,
    /// Mean PSNR of the test views of all cameras but that one, dB.
    PsnrInner,
    /// The lowest PSNR of one of those views, dB.
    PsnrInnerWorst,
    /// Mean SSIM of the test views.
    Ssim,
    /// Change from a frame to the next where nothing moves, over that of the images, which is their noise.
    Flicker,
    /// Mean LPIPS of the test views, where the runs have weights for it.
    Lpips,
    /// Seconds of stepping, reviews included; of a machine that was left alone.
    Seconds,
    /// Bytes of the numbers of the scene, see [`crate::scene::Summary::parameter_bytes`].
    SceneBytes,
    /// Milliseconds a step, reviews included; of a machine that was left alone.
    StepTime,
    /// Root mean square error of the learnt time offsets, frames, where the capture knows the true ones.
    OffsetError,
}

impl Measure {
    /// The head of its column.
    pub fn title(self) -> &'static str {
        match self {
            Measure::FirstGaussians => "first Gaussians",
            Measure::LastGaussians => "last Gaussians",
            Measure::Psnr => "PSNR, dB",
            Measure::PsnrForeground => "PSNR of what moves, dB",
            Measure::PsnrCovisible => "PSNR where co-visible, dB",
            Measure::PsnrWorst => "PSNR of the worst view, dB",
            Measure::PsnrAligned => "PSNR, colours aligned, dB",
            Measure::Ssim => "SSIM",
            Measure::Flicker => "flicker over the images' own",
            Measure::PsnrPeripheral => "PSNR of the peripheral camera, dB",
            Measure::PsnrPeripheralCovisible => "peripheral PSNR where co-visible, dB",
            Measure::PsnrInner => "PSNR of the other test cameras, dB",
            Measure::PsnrInnerWorst => "of their worst view, dB",
            Measure::Lpips => "LPIPS",
            Measure::Seconds => "seconds",
            Measure::SceneBytes => "bytes",
            Measure::StepTime => "ms a step",
            Measure::OffsetError => "error of the offsets, frames",
        }
    }

    /// Whether a technique that lowers it is better.
    pub(super) fn is_less_better(self) -> bool {
        match self {
            Measure::FirstGaussians | Measure::LastGaussians | Measure::SceneBytes | Measure::Flicker => true,
            Measure::Lpips | Measure::Seconds | Measure::StepTime | Measure::OffsetError => true,
            Measure::Psnr | Measure::PsnrForeground | Measure::PsnrCovisible | Measure::PsnrWorst => false,
            Measure::PsnrAligned | Measure::PsnrPeripheral | Measure::PsnrPeripheralCovisible => false,
            Measure::PsnrInner | Measure::PsnrInnerWorst | Measure::Ssim => false,
        }
    }

    /// By how much a technique may worsen it on a capture, in its unit, where a study judges by it.
    pub(super) fn harm(self) -> f64 {
        match self {
            Measure::Lpips | Measure::Ssim | Measure::OffsetError => 0.01,
            _ => 0.1,
        }
    }

    /// Decimals that are shown.
    pub(super) fn decimals(self) -> usize {
        match self {
            Measure::FirstGaussians | Measure::LastGaussians | Measure::SceneBytes | Measure::Seconds => 0,
            Measure::Lpips | Measure::Ssim => 4,
            Measure::StepTime => 2,
            Measure::OffsetError => 3,
            _ => 2,
        }
    }
}

/// A setting that is compared with others.
pub struct Arm {
    /// For tables.
    pub name: &'static str,
    /// Names its runs; arms of equal settings share them.
    pub key: &'static str,
    /// Makes the settings of the full method this arm's.
    pub change: fn(&mut Config),
    /// The paper's figures (arXiv 2604.09473, ablation tables), in the order of the study's measures; may be fewer.
    pub paper: &'static [&'static str],
}

/// Settings that are compared with each other; the first is what the others are compared with.
pub struct Study {
    /// On the command line.
    pub name: &'static str,
    /// Whether it is about what only clips have that several cameras took; other captures are left out.
    pub is_of_clips: bool,
    /// For tables.
    pub title: &'static str,
    /// What is compared.
    pub arms: &'static [Arm],
    /// By what; differences are of the last.
    pub measures: &'static [Measure],
    /// Arms begin with different numbers of Gaussians: each may have twice as many as the one that begins with most, so that none
    /// is kept from growing.
    pub equal_budgets: bool,
}

/// The settings that the arms of a study change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Base {
    /// Those that are given; LPIPS is measured and no part of the loss.
    Given,
    /// Those that are given, with the weights and rates of the paper, one background and no backdrop: LPIPS in the loss where there are
    /// weights for it.
    Paper,
}

impl Base {
    /// Both.
    pub const ALL: [Base; 2] = [Base::Given, Base::Paper];

    /// On the command line.
    pub fn name(self) -> &'static str {
        match self {
            Base::Given => "given",
            Base::Paper => "paper",
        }
    }

    /// Changes `config` to it.
    pub fn apply(self, config: &mut Config) {
        config.loss.lpips = 0.0;
        if self == Base::Paper {
            let loss = &mut config.loss;
            (loss.depth, loss.flow, loss.offset, loss.lpips) = (1.0, 1.0, 1e-4, LPIPS_WEIGHT);
            config.lr = paper_rates();
            (config.backdrop, config.vary_background) = (0, false);
        }
    }

    /// The key of an arm's runs.
    pub fn key(self, arm: &Arm) -> String {
        match self {
            Base::Given => arm.key.to_owned(),
            Base::Paper => format!("paper-{}", arm.key),
        }
    }
}

/// The paper's weight of LPIPS.
pub(super) const LPIPS_WEIGHT: f64 = 0.1;

/// The paper's rates: of velocities, times and tau its own, of all else those of 3DGS (Kerbl et al. 2023). It names none of
/// offsets and grids, which keep the defaults.
fn paper_rates() -> LearningRates {
    let constant = |rate: f64| Rate { start: rate, end: rate };
    LearningRates {
        pace: Pace { steps: 0 },
        position: Rate { start: 1.6e-4, end: 1.6e-6 },
        position_size: 0.0,
        sh0: constant(2.5e-3),
        sh_rest: constant(1.25e-4),
        opacity: constant(2.5e-2),
        scale: constant(5e-3),
        rotation: constant(1e-3),
        velocity: constant(2e-3),
        t_center: constant(1e-5),
        t_scale: constant(3e-2),
        ..LearningRates::default()
    }
}

/// The full method's runs.
pub(super) const FULL: &str = "full";

/// What the runs of an arm came to, by measure of the study: one number per seed, the same seeds for all arms.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ArmResult {
    /// As [`Arm::name`].
    pub name: String,
    /// By measure, by seed; a measure that the capture does not allow is empty.
    pub values: Vec<Vec<f64>>,
}

/// The numbers of a study: by arm.
pub struct StudyResult<'a> {
    /// What was compared.
    pub study: &'a Study,
    /// The settings that its arms changed.
    pub base: Base,
    /// The Gaussians that each arm might have, where all have the same budget.
    pub budget: Option<usize>,
    /// The trunk of LPIPS, where there were weights.
    pub trunk: Option<String>,
    /// By arm.
    pub arms: Vec<ArmResult>,
}

impl StudyResult<'_> {
    /// How much higher the last measure of arm `index` is than that of the first, paired by seed.
    pub fn difference(&self, index: usize) -> Option<Estimate> {
        let (first, own) = (self.arms.first()?.values.last()?, self.arms.get(index)?.values.last()?);
        let differences: Vec<f64> = own.iter().zip(first).map(|(own, first)| own - first).collect();
        Estimate::new(&differences)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Loss;

    #[test]
    fn the_papers_weights_and_rates_are_its_own_whatever_is_given() {
        let mut config = Config::default();
        (config.loss.flow, config.loss.depth, config.loss.lpips) = (0.1, 0.3, 0.0);
        config.lr.position = Rate { start: 1.0, end: 0.5 };
        Base::Paper.apply(&mut config);
        let Loss { depth, flow, offset, lpips, .. } = config.loss;
        assert_eq!((depth, flow, offset, lpips), (1.0, 1.0, 1e-4, 0.1));
        let LearningRates { position, position_size, velocity, t_center, t_scale, .. } = config.lr;
        assert_eq!((position.start, position.end, position_size), (1.6e-4, 1.6e-6, 0.0));
        assert_eq!((velocity.start, t_center.start, t_scale.start), (2e-3, 1e-5, 3e-2));
    }
}
