//! The studies that `ivv ablate` knows.

use super::ablation::{Arm, FULL, LPIPS_WEIGHT, Measure, Study};
use super::quality::{CLIPS, GRIDS_AT, QUALITY};
use crate::train::{Config, Init};

/// The studies of the paper, and that of techniques which it does not have.
pub const STUDIES: [Study; 7] = [
    Study {
        name: "initialisation",
        is_of_clips: false,
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
        is_of_clips: false,
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
        is_of_clips: false,
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
        is_of_clips: false,
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
        is_of_clips: false,
        title: "Only what the scene requires",
        arms: &[
            Arm { name: "everything modelled", key: FULL, change: |_| (), paper: &[] },
            Arm { name: "reviewed", key: "reviewed", change: reviewed, paper: &[] },
            Arm { name: "told apart by flow", key: "flow", change: |config| config.init_static_tau = 0.0, paper: &[] },
            Arm {
                name: "told apart by flow, reviewed",
                key: "flow-reviewed",
                change: |config| {
                    config.init_static_tau = 0.0;
                    reviewed(config);
                },
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
    QUALITY,
    CLIPS,
];

/// Reviews of what the scene requires.
const REVIEWS: u32 = 2;

/// Only what the scene requires, colour grids among it.
fn reviewed(config: &mut Config) {
    (config.required.reviews, config.required.grids_at) = (REVIEWS, GRIDS_AT);
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::study::ablation::{ArmResult, Base, StudyResult};
    use crate::train::Config;

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
}
