//! The paper's ablations: which settings are compared, by what, and how sure the differences are.

use super::config::{Config, Init};
use super::report_plot::escape;
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
            Measure::SceneBytes => "bytes",
            Measure::StepTime => "ms a step",
            Measure::OffsetError => "error of the offsets, frames",
        }
    }

    fn decimals(self) -> usize {
        match self {
            Measure::FirstGaussians | Measure::LastGaussians | Measure::SceneBytes => 0,
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
}

/// The full method's runs.
const FULL: &str = "full";

/// The studies of the paper.
pub const STUDIES: [Study; 4] = [
    Study {
        name: "initialisation",
        title: "Initialisation",
        arms: &[
            Arm {
                name: "points of all frames",
                key: "concatenated",
                change: |config| config.init = Init::Concat,
                paper: &["2.48 M", "4.52 M", "33.13"],
            },
            Arm { name: "flow-guided", key: FULL, change: |_| (), paper: &["0.29 M", "2.50 M", "33.51"] },
        ],
        measures: &[Measure::FirstGaussians, Measure::LastGaussians, Measure::Psnr, Measure::PsnrCovisible],
    },
    Study {
        name: "offsets",
        title: "Time offsets of the cameras",
        arms: &[
            Arm { name: "none", key: "no-offsets", change: |config| config.offsets = false, paper: &["", "30.59"] },
            Arm {
                name: "lambda 0",
                key: "offsets-free",
                change: |config| config.loss.offset = 0.0,
                paper: &["", "29.93"],
            },
            Arm {
                name: "lambda 1e-2",
                key: "offsets-stiff",
                change: |config| config.loss.offset = 1e-2,
                paper: &["", "30.50"],
            },
            Arm { name: "lambda 1e-4", key: FULL, change: |_| (), paper: &["", "30.94"] },
        ],
        measures: &[Measure::OffsetError, Measure::PsnrForeground],
    },
    Study {
        name: "supervision",
        title: "Supervision by depth and flow",
        arms: &[
            Arm {
                name: "neither",
                key: "unsupervised",
                change: |config| (config.loss.depth, config.loss.flow) = (0.0, 0.0),
                paper: &["", "24.43"],
            },
            Arm { name: "flow", key: "flow-only", change: |config| config.loss.depth = 0.0, paper: &["", "30.03"] },
            Arm { name: "depth", key: "depth-only", change: |config| config.loss.flow = 0.0, paper: &["", "30.45"] },
            Arm { name: "both", key: FULL, change: |_| (), paper: &["", "30.98"] },
        ],
        measures: &[Measure::PsnrInner, Measure::PsnrPeripheral, Measure::PsnrPeripheralCovisible],
    },
    Study {
        name: "required",
        title: "Only what the scene requires",
        arms: &[
            Arm {
                name: "everything modelled",
                key: "everything",
                change: |config| config.init_static_tau = LONG_TAU,
                paper: &[],
            },
            Arm {
                name: "reviewed",
                key: "reviewed",
                change: |config| (config.init_static_tau, config.required.reviews) = (LONG_TAU, REVIEWS),
                paper: &[],
            },
            Arm { name: "told apart by flow", key: FULL, change: |_| (), paper: &[] },
            Arm {
                name: "told apart by flow, reviewed",
                key: "flow-reviewed",
                change: |config| config.required.reviews = REVIEWS,
                paper: &[],
            },
        ],
        measures: &[
            Measure::LastGaussians,
            Measure::SceneBytes,
            Measure::StepTime,
            Measure::PsnrPeripheral,
            Measure::PsnrInnerWorst,
            Measure::PsnrInner,
        ],
    },
];

/// Tau of points that stand still where everything is modelled, clips.
const LONG_TAU: f64 = 10.0;
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
        let mut text = format!(
            "### {title}\n\n| | {} | difference |\n|---|{}---|\n",
            heads.join(" | "),
            "---|".repeat(heads.len())
        );
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
                Some(half) => format!("{:+.2} +- {half:.2}", d.mean),
                None => format!("{:+.2}", d.mean),
            });
            let _ = writeln!(text, " {difference} |");
        }
        let _ = writeln!(
            text,
            "\nMeans over {}; in brackets the paper's, of another capture. The difference is to the first row, \
             paired by seed, with its 95 % interval.",
            count(n_seeds, "seed")
        );
        text
    }

    /// The last measure of every arm as a picture: a dot per seed and a bar at the mean.
    pub fn svg(&self) -> String {
        let measure = self.study.measures.last().map_or("", |measure| measure.title());
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
                let _ = writeln!(body, "<text x=\"{}\" y=\"{}\">{mean:.2}</text>", left + width + 16.0, y + 4.0);
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

    fn result(values: [[f64; 3]; 4]) -> StudyResult<'static> {
        let arms = values.iter().zip(STUDIES[1].arms);
        let arms = arms.map(|(v, arm)| ArmResult { name: arm.name.to_owned(), values: vec![vec![0.1; 3], v.to_vec()] });
        StudyResult { study: &STUDIES[1], arms: arms.collect() }
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
            let mut config = Config::default();
            (arm.change)(&mut config);
            assert_eq!(config == Config::default(), arm.key == FULL, "{}", arm.name);
        }
    }
}
