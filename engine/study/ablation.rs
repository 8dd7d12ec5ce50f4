//! The paper's ablations: which settings are compared, by what, and how sure the differences are.

use crate::report::escape;
use crate::train::{Config, Init, LearningRates, Pace, Rate};
use crate::words::count;
use std::fmt::Write;

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

    fn decimals(self) -> usize {
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

/// A mean with the half-width of its interval of 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Student's interval is the mean plus and minus this; none for less than two values.
    pub half_width: Option<f64>,
}

impl Estimate {
    /// That of `values`; none when there is no value.
    pub fn new(values: &[f64]) -> Option<Self> {
        // Student's t at 0.975 for 1 to 9 degrees of freedom; above, 1.96 + 2.5 / dof is within 1 %.
        const T: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
        let n = values.len() as f64;
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let t = T.get(values.len().wrapping_sub(2)).copied().unwrap_or(1.96 + 2.5 / (n - 1.0));
        Some(Estimate { mean, half_width: (values.len() > 1).then(|| t * (variance / n).sqrt()) })
    }
}

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

    /// A table in Markdown, the paper's figures in brackets.
    pub fn markdown(&self) -> String {
        let Study { title, measures, arms, .. } = self.study;
        let n_seeds = self.arms.iter().flat_map(|arm| &arm.values).map(Vec::len).max().unwrap_or(0);
        let heads: Vec<&str> = measures.iter().map(|measure| measure.title()).collect();
        let of = if self.base == Base::Paper { ", the paper's weights and rates" } else { "" };
        let mut text = format!(
            "### {title}{of}\n\n| | {} | difference |\n|---|{}---|\n",
            heads.join(" | "),
            "---|".repeat(heads.len())
        );
        let decimals = measures.last().map_or(2, |measure| measure.decimals().max(2));
        for (index, (arm, result)) in arms.iter().zip(&self.arms).enumerate() {
            let _ = write!(text, "| {} |", arm.name);
            for (k, measure) in measures.iter().enumerate() {
                let own = result.values.get(k).and_then(|values| Estimate::new(values));
                let own = own.map_or("-".to_owned(), |own| format!("{:.*}", measure.decimals(), own.mean));
                let paper = arm.paper.get(k).filter(|paper| !paper.is_empty());
                let paper = paper.map_or(String::new(), |paper| format!(" ({paper})"));
                let _ = write!(text, " {own}{paper} |");
            }
            let difference = self.difference(index).filter(|_| index > 0);
            let difference = difference.map_or(String::new(), |d| match d.half_width {
                Some(half) => format!("{:+.decimals$} +- {half:.decimals$}", d.mean),
                None => format!("{:+.decimals$}", d.mean),
            });
            let _ = writeln!(text, " {difference} |");
        }
        let _ = writeln!(
            text,
            "\nMeans over {}; in brackets the paper's, of another capture. The difference is to the first row, \
             paired by seed, with its 95 % interval.",
            count(n_seeds, "seed")
        );
        if let Some(budget) = self.budget {
            let _ = writeln!(text, "Each arm may have {budget} Gaussians, twice as many as the largest start.");
        }
        if let (Some(trunk), true) = (&self.trunk, measures.contains(&Measure::Lpips)) {
            let _ = writeln!(text, "LPIPS is by {trunk}; the paper's is by AlexNet.");
        }
        text
    }

    /// The last measure of every arm as a picture: a dot per seed and a bar at the mean.
    pub fn svg(&self) -> String {
        let (measure, decimals) =
            self.study.measures.last().map_or(("", 2), |measure| (measure.title(), measure.decimals()));
        let all = self.arms.iter().filter_map(|arm| arm.values.last()).flatten();
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        let (low, high) = if high > low { (low, high) } else { (low - 0.5, low + 0.5) };
        let (left, width, row) = (170.0, 360.0, 30.0);
        let x = |value: f64| left + width * (value - low) / (high - low);
        let mut body = String::new();
        for (index, (arm, result)) in self.study.arms.iter().zip(&self.arms).enumerate() {
            let y = 44.0 + row * index as f64;
            let name = escape(arm.name);
            let _ = writeln!(body, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text>", left - 14.0, y + 4.0);
            let values = result.values.last().map_or(&[][..], |values| values);
            for value in values {
                let _ = writeln!(body, "<circle cx=\"{:.1}\" cy=\"{y}\" r=\"4\"/>", x(*value));
            }
            if let Some(Estimate { mean, .. }) = Estimate::new(values) {
                let (at, top, bottom) = (x(mean), y - 9.0, y + 9.0);
                let _ = writeln!(body, "<line x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{bottom}\"/>");
                let _ =
                    writeln!(body, "<text x=\"{}\" y=\"{}\">{mean:.decimals$}</text>", left + width + 16.0, y + 4.0);
            }
        }
        let (w, h) = (left + width + 70.0, 44.0 + row * self.arms.len() as f64);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\">\n\
             <style>text {{ font: 13px sans-serif; fill: #555 }} circle {{ fill: #2a78c2; fill-opacity: 0.45 }} \
             line {{ stroke: #2a78c2; stroke-width: 3 }}</style>\n\
             <text x=\"14\" y=\"20\">{}: {}</text>\n{body}</svg>\n",
            escape(self.study.title),
            escape(measure)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Loss;

    fn result(values: [[f64; 3]; 4]) -> StudyResult<'static> {
        let arms = values.iter().zip(STUDIES[1].arms);
        let values = |v: &[f64; 3]| vec![vec![0.1; 3], Vec::new(), v.to_vec()];
        let arms = arms.map(|(v, arm)| ArmResult { name: arm.name.to_owned(), values: values(v) });
        StudyResult { study: &STUDIES[1], base: Base::Given, budget: None, trunk: None, arms: arms.collect() }
    }

    #[test]
    fn intervals_are_students_and_pairs_take_out_what_seeds_share() {
        let e = Estimate::new(&[1.0, 2.0, 3.0]).unwrap();
        assert!((e.mean - 2.0).abs() < 1e-12 && (e.half_width.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-9);
        assert_eq!(Estimate::new(&[5.0]).unwrap(), Estimate { mean: 5.0, half_width: None });
        assert!(Estimate::new(&[]).is_none());
        // The seeds differ by 10 dB, the arms by 1 dB on each.
        let found = result([[10.0, 20.0, 30.0], [11.0, 21.0, 31.0], [9.0, 19.0, 29.5], [10.0; 3]]);
        let d = found.difference(1).unwrap();
        assert!((d.mean - 1.0).abs() < 1e-12 && d.half_width.unwrap() < 1e-9);
        assert!(found.difference(2).unwrap().mean < 0.0 && found.difference(4).is_none());
    }

    #[test]
    fn tables_and_pictures_hold_every_arm() {
        let found = result([[10.0, 11.0, 12.0], [11.0; 3], [12.0; 3], [13.0; 3]]);
        let (table, svg) = (found.markdown(), found.svg());
        for arm in STUDIES[1].arms {
            assert!(table.contains(arm.name) && svg.contains(arm.name), "{}", arm.name);
        }
        assert!(table.contains("11.00 (29.93)") && table.contains("3 seeds"), "{table}");
        assert_eq!(svg.matches("<circle").count(), 12);
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

    #[test]
    fn the_table_says_the_budget_of_all_arms_and_whose_features_lpips_compares() {
        let mut found = result([[10.0, 11.0, 12.0], [11.0; 3], [12.0; 3], [13.0; 3]]);
        (found.base, found.budget, found.trunk) = (Base::Paper, Some(48_000), Some("SqueezeNet 1.1".to_owned()));
        let table = found.markdown();
        for part in ["the paper's weights and rates", "48000 Gaussians", "LPIPS is by SqueezeNet 1.1"] {
            assert!(table.contains(part), "{part} is not in {table}");
        }
    }
}
