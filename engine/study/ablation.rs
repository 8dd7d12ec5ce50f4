//! The paper's ablations: which settings are compared, by what, and how sure the differences are.

use crate::report::statistics::Estimate;
use crate::train::{Config, Init, LearningRates, Pace, Rate};

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
    /// Mean PSNR of the test camera farthest from the middle of all, dB.
    PsnrPeripheral,
    /// The same over what a training camera sees too, where the capture has co-visibility masks.
    PsnrPeripheralCovisible,
    /// Mean PSNR of the test views of all cameras but that one, dB.
    PsnrInner,
    /// The lowest PSNR of one of those views, dB.
    PsnrInnerWorst,
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

    /// Decimals that are shown.
    pub(super) fn decimals(self) -> usize {
        match self {
            Measure::FirstGaussians | Measure::LastGaussians | Measure::SceneBytes | Measure::Seconds => 0,
            Measure::Lpips => 4,
            Measure::StepTime => 1,
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
    /// Those that are given, with the weights and rates of the paper: LPIPS in the loss where there are weights for it.
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
const LPIPS_WEIGHT: f64 = 0.1;

/// The paper's rates: of velocities, times and tau its own, of all else those of 3DGS (Kerbl et al. 2023). It names none of
/// offsets and grids, which keep the defaults.
fn paper_rates() -> LearningRates {
    let constant = |rate: f64| Rate { start: rate, end: rate };
    LearningRates {
        pace: Pace { steps: 0, ..Pace::default() },
        position: Rate { start: 1.6e-4, end: 1.6e-6 },
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
const FULL: &str = "full";

/// The studies of the paper.
pub const STUDIES: [Study; 5] = [
    Study {
        name: "initialisation",
        title: "Initialisation",
        arms: &[
            Arm {
                name: "points of all frames",
                key: "concatenated",
                change: |config| config.init = Init::Concat,
                paper: &["2.48 M", "4.52 M", "", "", "", "", "33.13"],
            },
            Arm {
                name: "flow-guided, any view",
                key: "any-view",
                change: |config| config.init = Init::AnyView,
                paper: &["0.29 M", "2.50 M", "", "", "", "", "33.51"],
            },
            Arm {
                name: "flow-guided, two views",
                key: "flow-guided",
                change: |config| config.init = Init::Flow,
                paper: &[],
            },
        ],
        measures: &[
            Measure::FirstGaussians,
            Measure::LastGaussians,
            Measure::SceneBytes,
            Measure::Seconds,
            Measure::Lpips,
            Measure::PsnrCovisible,
            Measure::Psnr,
        ],
        equal_budgets: true,
    },
    Study {
        name: "offsets",
        title: "Time offsets of the cameras",
        arms: &[
            Arm { name: "none", key: "no-offsets", change: |config| config.offsets = false, paper: &["", "", "30.59"] },
            Arm {
                name: "lambda 0",
                key: "offsets-free",
                change: |config| config.loss.offset = 0.0,
                paper: &["", "", "29.93"],
            },
            Arm {
                name: "lambda 1e-2",
                key: "offsets-stiff",
                change: |config| config.loss.offset = 1e-2,
                paper: &["", "", "30.50"],
            },
            Arm { name: "lambda 1e-4", key: FULL, change: |_| (), paper: &["", "", "30.94"] },
        ],
        measures: &[Measure::OffsetError, Measure::Lpips, Measure::PsnrForeground],
        equal_budgets: false,
    },
    Study {
        name: "supervision",
        title: "Supervision by depth and flow",
        arms: &[
            Arm {
                name: "neither",
                key: "unsupervised",
                change: |config| (config.loss.depth, config.loss.flow) = (0.0, 0.0),
                paper: &["", "", "24.43"],
            },
            Arm { name: "flow", key: "flow-only", change: |config| config.loss.depth = 0.0, paper: &["", "", "30.03"] },
            Arm {
                name: "depth",
                key: "depth-only",
                change: |config| config.loss.flow = 0.0,
                paper: &["", "", "30.45"],
            },
            Arm { name: "both", key: FULL, change: |_| (), paper: &["", "", "30.98"] },
        ],
        measures: &[Measure::Lpips, Measure::PsnrInner, Measure::PsnrPeripheral, Measure::PsnrPeripheralCovisible],
        equal_budgets: false,
    },
    Study {
        name: "perceptual",
        title: "LPIPS in the loss",
        arms: &[
            Arm { name: "measured only", key: FULL, change: |_| (), paper: &[] },
            Arm {
                name: "in the loss",
                key: "lpips-loss",
                change: |config| config.loss.lpips = LPIPS_WEIGHT,
                paper: &[],
            },
        ],
        measures: &[Measure::LastGaussians, Measure::SceneBytes, Measure::Seconds, Measure::Psnr, Measure::Lpips],
        equal_budgets: false,
    },
    Study {
        name: "required",
        title: "Only what the scene requires",
        arms: &[
            Arm { name: "everything modelled", key: FULL, change: |_| (), paper: &[] },
            Arm { name: "reviewed", key: "reviewed", change: |config| config.required.reviews = REVIEWS, paper: &[] },
            Arm { name: "told apart by flow", key: "flow", change: |config| config.init_static_tau = 0.0, paper: &[] },
            Arm {
                name: "told apart by flow, reviewed",
                key: "flow-reviewed",
                change: |config| (config.init_static_tau, config.required.reviews) = (0.0, REVIEWS),
                paper: &[],
            },
        ],
        measures: &[
            Measure::LastGaussians,
            Measure::SceneBytes,
            Measure::StepTime,
            Measure::Lpips,
            Measure::PsnrPeripheral,
            Measure::PsnrInnerWorst,
            Measure::PsnrInner,
        ],
        equal_budgets: false,
    },
];

/// Reviews of what the scene requires.
const REVIEWS: u32 = 2;

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
pub(super) mod tests {
    use super::*;
    use crate::train::Loss;

    pub(in crate::study) fn result(values: [[f64; 3]; 4]) -> StudyResult<'static> {
        let arms = values.iter().zip(STUDIES[1].arms);
        let values = |v: &[f64; 3]| vec![vec![0.1; 3], Vec::new(), v.to_vec()];
        let arms = arms.map(|(v, arm)| ArmResult { name: arm.name.to_owned(), values: values(v) });
        StudyResult { study: &STUDIES[1], base: Base::Given, budget: None, trunk: None, arms: arms.collect() }
    }

    #[test]
    fn pairs_take_out_what_seeds_share() {
        // The seeds differ by 10 dB, the arms by 1 dB on each.
        let found = result([[10.0, 20.0, 30.0], [11.0, 21.0, 31.0], [9.0, 19.0, 29.5], [10.0; 3]]);
        let d = found.difference(1).unwrap();
        assert!((d.mean - 1.0).abs() < 1e-12 && d.half_width.unwrap() < 1e-9);
        assert!(found.difference(2).unwrap().mean < 0.0 && found.difference(4).is_none());
    }

    #[test]
    fn every_arm_changes_the_settings_or_is_the_full_method() {
        for arm in STUDIES.iter().flat_map(|study| study.arms) {
            let mut base = Config::default();
            Base::Given.apply(&mut base);
            let mut config = base.clone();
            (arm.change)(&mut config);
            assert_eq!(config == base, arm.key == FULL, "{}", arm.name);
        }
    }

    #[test]
    fn runs_are_shared_by_arms_of_equal_settings_and_budget_alone() {
        // What begins with different numbers of Gaussians has a budget of its own, so it shares no run with other studies.
        for study in &STUDIES {
            assert_eq!(study.equal_budgets, study.name == "initialisation");
            for arm in study.arms.iter().filter(|_| study.equal_budgets) {
                let others = STUDIES.iter().filter(|other| other.name != study.name).flat_map(|other| other.arms);
                assert!(others.into_iter().all(|other| other.key != arm.key), "{}", arm.key);
            }
        }
        let keys: Vec<String> = Base::ALL.iter().map(|base| base.key(&STUDIES[0].arms[0])).collect();
        assert_eq!(keys, ["concatenated", "paper-concatenated"]);
    }

    #[test]
    fn the_papers_weights_and_rates_are_its_own_whatever_is_given() {
        let mut config = Config::default();
        (config.loss.flow, config.loss.depth, config.loss.lpips) = (0.1, 0.3, 0.0);
        config.lr.position = Rate { start: 1.0, end: 0.5 };
        Base::Paper.apply(&mut config);
        let Loss { depth, flow, offset, lpips, .. } = config.loss;
        assert_eq!((depth, flow, offset, lpips), (1.0, 1.0, 1e-4, 0.1));
        let LearningRates { position, velocity, t_center, t_scale, .. } = config.lr;
        assert_eq!((position.start, position.end), (1.6e-4, 1.6e-6));
        assert_eq!((velocity.start, t_center.start, t_scale.start), (2e-3, 1e-5, 3e-2));
    }
}
