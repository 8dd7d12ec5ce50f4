//! Which techniques make the default better, judged by several captures.

use super::ablation::{Arm, FULL, Measure, Study};
use crate::report::Table;
use crate::report::statistics::Estimate;
use crate::train::{GridKind, PoseKind, Rate, Strategy};

/// On how many captures it must be better.
const SHOWN_ON: usize = 2;

/// When cameras are asked whether they need a colour grid, of the run.
pub(super) const GRIDS_AT: f64 = 0.3;

const MEASURES: &[Measure] = &[
    Measure::LastGaussians,
    Measure::SceneBytes,
    Measure::Seconds,
    Measure::Lpips,
    Measure::Ssim,
    Measure::Flicker,
    Measure::PsnrWorst,
    Measure::PsnrForeground,
    Measure::PsnrCovisible,
    Measure::PsnrAligned,
    Measure::Psnr,
];

const DEFAULT: Arm = Arm { name: "default", key: FULL, change: |_| (), paper: &[] };

/// The default, and techniques beside it that are settings.
pub(super) const QUALITY: Study = Study {
    name: "quality",
    is_of_clips: false,
    title: "Quality",
    arms: &[
        DEFAULT,
        Arm {
            name: "the scene of the last step, no mean of many",
            key: "last-scene",
            change: |config| config.average = 0.0,
            paper: &[],
        },
        Arm {
            name: "all rates fall to a tenth",
            key: "rates-anneal",
            change: |config| {
                let lr = &mut config.lr;
                for rate in [&mut lr.sh0, &mut lr.sh_rest, &mut lr.opacity, &mut lr.scale, &mut lr.rotation] {
                    rate.end = 0.1 * rate.start;
                }
                for rate in [&mut lr.velocity, &mut lr.t_center, &mut lr.t_scale] {
                    rate.end = 0.1 * rate.start;
                }
            },
            paper: &[],
        },
        Arm {
            name: "positions at one rate, whatever the size",
            key: "one-position-rate",
            change: |config| config.lr.position_size = 0.0,
            paper: &[],
        },
        Arm { name: "no backdrop", key: "no-backdrop", change: |config| config.backdrop = 0, paper: &[] },
        Arm {
            name: "the same background in every step",
            key: "one-background",
            change: |config| config.vary_background = false,
            paper: &[],
        },
        Arm {
            name: "density control of 3DGS-MCMC",
            key: "mcmc",
            change: |config| config.density.strategy = Strategy::Mcmc,
            paper: &[],
        },
        Arm {
            name: "first half on images of half the size",
            key: "coarse-to-fine",
            change: |config| config.resolution.reduction = 2,
            paper: &[],
        },
    ],
    measures: MEASURES,
    equal_budgets: false,
};

/// The same of what only clips of several cameras have.
pub(super) const CLIPS: Study = Study {
    name: "clips",
    is_of_clips: true,
    title: "Quality of clips",
    arms: &[
        DEFAULT,
        Arm {
            name: "velocities' rate falls to a hundredth",
            key: "velocity-anneals",
            change: |config| config.lr.velocity = Rate { end: 0.01 * config.lr.velocity.start, ..config.lr.velocity },
            paper: &[],
        },
        Arm {
            name: "a colour map for the cameras that need one",
            key: "required-grids",
            change: |config| config.required.grids_at = GRIDS_AT,
            paper: &[],
        },
        Arm {
            name: "a bilateral colour grid a camera",
            key: "bilateral",
            change: |config| config.grids = GridKind::Bilateral,
            paper: &[],
        },
        Arm { name: "no colour maps", key: "no-grids", change: |config| config.grids = GridKind::None, paper: &[] },
        Arm {
            name: "poses as the calibration has them",
            key: "poses-given",
            change: |config| config.poses = PoseKind::Given,
            paper: &[],
        },
        Arm { name: "told apart by flow", key: "flow", change: |config| config.init_static_tau = 0.0, paper: &[] },
    ],
    measures: MEASURES,
    equal_budgets: false,
};

/// What is known of a technique after several captures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Better on at least two captures, and on none worse by more than 0.1 dB, or 0.01 of LPIPS or SSIM: it stays.
    Shown,
    /// Not better on two captures: it goes.
    NotShown,
    /// Worse on a capture by more than that: it goes.
    Harmful,
}

impl Standing {
    /// By the differences of `measure` to the default, one for each capture. A technique is better where the interval lies on
    /// the better side of 0.
    pub fn of(measure: Measure, differences: &[Estimate]) -> Self {
        let gain = |d: &Estimate| if measure.is_less_better() { -d.mean } else { d.mean };
        let is_better = |d: &&Estimate| d.half_width.is_some_and(|half| gain(d) > half);
        if differences.iter().any(|d| gain(d) < -measure.harm()) {
            Standing::Harmful
        } else if differences.iter().filter(is_better).count() >= SHOWN_ON {
            Standing::Shown
        } else {
            Standing::NotShown
        }
    }

    fn words(self) -> &'static str {
        match self {
            Standing::Shown => "shown",
            Standing::NotShown => "not shown",
            Standing::Harmful => "harms",
        }
    }
}

/// Differences to the first arm by arm and capture, and what they show, in Markdown. `differences` has a row for every arm of
/// `study` but the first, and in it a number for each of `captures` that has one, all of the study's last measure.
pub fn standings(study: &Study, captures: &[&str], differences: &[Vec<Option<Estimate>>]) -> String {
    let measure = study.measures.last().copied().unwrap_or(Measure::Psnr);
    let side = if measure.is_less_better() { "below" } else { "above" };
    let heads: Vec<&str> = [""].into_iter().chain(captures.iter().copied()).chain(["all"]).collect();
    let rows = study.arms.iter().skip(1).zip(differences).map(|(arm, row)| {
        let known: Vec<Estimate> = row.iter().flatten().copied().collect();
        let cells = row.iter().map(|one| one.map_or("-".to_owned(), |one| one.signed(measure.decimals())));
        [arm.name.to_owned()]
            .into_iter()
            .chain(cells)
            .chain([Standing::of(measure, &known).words().to_owned()])
            .collect()
    });
    format!(
        "## {}: differences of {} to `{}`\n\n{}\nPaired by seed, with 95 % intervals. Shown: the interval lies {side} 0 on at \
         least {SHOWN_ON} captures, and no capture loses more than {}. Harms: one does.\n",
        study.title,
        measure.title(),
        study.arms.first().map_or("", |arm| arm.name),
        Table::new(&heads, rows).markdown(),
        measure.harm()
    )
}

#[cfg(test)]
mod tests {
    use super::super::studies::STUDIES;
    use super::*;

    fn estimate(mean: f64, half_width: f64) -> Estimate {
        Estimate { mean, half_width: Some(half_width) }
    }

    #[test]
    fn a_technique_is_shown_on_two_captures_and_by_harm_on_none() {
        let (better, level) = (estimate(0.4, 0.3), estimate(0.2, 0.3));
        assert_eq!(Standing::of(Measure::Psnr, &[better, better, estimate(-0.1, 0.5)]), Standing::Shown);
        assert_eq!(Standing::of(Measure::Psnr, &[better, level, level]), Standing::NotShown);
        assert_eq!(Standing::of(Measure::Psnr, &[better, better, estimate(-0.11, 0.5)]), Standing::Harmful);
        // One seed has no interval.
        assert_eq!(Standing::of(Measure::Psnr, &[Estimate { mean: 9.0, half_width: None }; 3]), Standing::NotShown);
    }

    #[test]
    fn where_less_is_better_a_technique_that_lowers_it_is_shown() {
        let (lower, higher) = (estimate(-0.006, 0.001), estimate(0.006, 0.001));
        assert_eq!(Standing::of(Measure::Lpips, &[lower, lower]), Standing::Shown);
        assert_eq!(Standing::of(Measure::Lpips, &[higher, higher]), Standing::NotShown);
        assert_eq!(Standing::of(Measure::Lpips, &[lower, lower, estimate(0.011, 0.02)]), Standing::Harmful);
        let study = STUDIES.iter().find(|study| study.measures.last() == Some(&Measure::Lpips)).unwrap();
        let text = standings(study, &["fox", "room"], &vec![vec![Some(lower); 2]; study.arms.len() - 1]);
        assert!(text.contains("| -0.0060 +- 0.0010 | -0.0060 +- 0.0010 | shown |"), "{text}");
        assert!(text.contains("the interval lies below 0 on at least 2 captures, and no capture loses more than 0.01"));
    }

    #[test]
    fn the_table_has_each_technique_with_each_capture() {
        let row = vec![Some(estimate(0.4, 0.3)), None, Some(estimate(0.5, 0.1))];
        let text = standings(&QUALITY, &["fox", "basketball", "room"], &vec![row; QUALITY.arms.len() - 1]);
        for arm in &QUALITY.arms[1..] {
            assert!(text.contains(arm.name), "{}: {text}", arm.name);
        }
        let cells = ["| fox | basketball | room | all |", "| +0.40 +- 0.30 | - | +0.50 +- 0.10 | shown |"];
        assert!(cells.iter().all(|cell| text.contains(cell)), "{text}");
    }
}
