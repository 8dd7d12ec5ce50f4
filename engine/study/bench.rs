use super::measure::{Files, Measure};
use super::plan::{Arm, Study};
use super::runs::{RunResult, read};
use crate::error::Result;
use crate::report::statistics::{Estimate, mean, range, standard_error};
use crate::report::{Axis, Chart, Mark, Panel, Row, Series, Table};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// Captures on which an arm must be better to be shown to help.
const SHOWN_ON: usize = 2;
const PANEL: [f64; 2] = [420.0, 300.0];
const MARGIN: [f64; 4] = [56.0, 30.0, 14.0, 44.0];
const TICKS: [f64; 14] = [1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0, 7200.0, 36000.0];
/// The scores of runs outside a study.
const SCORES: [Measure; 7] = [
    Measure::Psnr,
    Measure::PsnrAligned,
    Measure::PsnrWorst,
    Measure::Ssim,
    Measure::Lpips,
    Measure::SceneBytes,
    Measure::Seconds,
];

#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BenchRun {
    pub capture: String,
    /// Key of the arm.
    pub arm: String,
    /// 0 where epochs give it.
    pub steps: u64,
    pub seed: u64,
    pub scores: BTreeMap<Measure, f64>,
    /// Device, driver and revision.
    pub made_by: String,
    /// The trunk of LPIPS.
    pub trunk: Option<String>,
}

pub struct Bench {
    pub study: Study,
    pub date: String,
    pub settings: String,
    /// The most Gaussians by capture, where all arms have the same budget.
    pub budgets: BTreeMap<String, usize>,
    pub runs: Vec<BenchRun>,
}

/// The verdict on an arm by its differences to the baseline, one for each capture.
fn verdict(measure: Measure, differences: &[Estimate]) -> &'static str {
    let gain = |d: &Estimate| if measure.is_less_better() { -d.mean } else { d.mean };
    let is_better = |d: &&Estimate| d.half_width.is_some_and(|half| gain(d) > half);
    if differences.iter().any(|d| gain(d) < -measure.harm()) {
        "harms"
    } else if differences.iter().filter(is_better).count() >= SHOWN_ON {
        "shown"
    } else {
        "not shown"
    }
}

/// Where a run stands in a study.
pub struct RunOf<'a> {
    pub capture: &'a str,
    pub arm: &'a str,
    pub steps: u64,
    pub seed: u64,
}

impl BenchRun {
    /// `peripheral` is the camera of [`Measure::PsnrPeripheral`].
    pub fn read(folder: &Path, of: RunOf, peripheral: Option<&str>) -> Result<Self> {
        let RunOf { capture, arm, steps, seed } = of;
        let eval: Value = read(folder, "eval.json")?;
        let train: Value = read(folder, "train.json")?;
        let files = Files { eval: &eval, train: &train, peripheral };
        let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
        let [name, driver] = ["name", "driver"].map(|key| text(&train["device"][key]));
        Ok(BenchRun {
            capture: capture.to_owned(),
            arm: arm.to_owned(),
            steps,
            seed,
            scores: Measure::all().filter_map(|score| Some((score, score.of(&files)?))).collect(),
            made_by: format!("{name}, {driver}, commit {}", text(&train["revision"])),
            trunk: eval["lpips_trunk"].as_str().map(str::to_owned),
        })
    }
}

impl Bench {
    /// Runs that differ only in seed, device or revision are an arm.
    pub fn of_runs(found: &[(&Path, RunResult)], date: String) -> Result<Self> {
        let mut images: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        let mut runs = Vec::new();
        for (folder, result) in found {
            // Captures of one name with other images get a number.
            let known = images.entry(&result.capture).or_default();
            let index = known.iter().position(|other| *other == result.images).unwrap_or_else(|| {
                known.push(&result.images);
                known.len() - 1
            });
            let capture =
                if index > 0 { format!("{} ({})", result.capture, index + 1) } else { result.capture.clone() };
            let of = RunOf { capture: &capture, arm: &result.settings, steps: result.steps, seed: result.seed };
            runs.push(BenchRun::read(folder, of, None)?);
        }
        let made_by: BTreeSet<&str> = runs.iter().map(|run| run.made_by.as_str()).collect();
        if made_by.len() > 1 {
            runs.iter_mut().for_each(|run| run.arm = format!("{}; {}", run.arm, run.made_by));
        }
        // The defaults first.
        let mut keys: Vec<String> = runs.iter().map(|run| run.arm.clone()).collect();
        keys.sort_by_key(|key| (!key.starts_with("defaults"), key.clone()));
        keys.dedup();
        let arm = |key: &String| Arm { key: key.clone(), name: key.clone(), settings: json!({}), ..Arm::default() };
        let study = Study {
            title: "Runs".to_owned(),
            question: "How do these runs compare?".to_owned(),
            arms: keys.iter().map(arm).collect(),
            scores: SCORES.into_iter().filter(|score| runs.iter().any(|run| run.scores.contains_key(score))).collect(),
            seeds: runs.iter().map(|run| run.seed).collect::<BTreeSet<_>>().into_iter().collect(),
            steps: runs.iter().map(|run| run.steps).collect::<BTreeSet<_>>().into_iter().collect(),
            baseline: keys.first().cloned().unwrap_or_default(),
            ..Study::default()
        };
        Ok(Bench { study, date, settings: "named by each row".to_owned(), budgets: BTreeMap::new(), runs })
    }

    fn captures(&self) -> Vec<&str> {
        let mut captures: Vec<&str> = self.runs.iter().map(|run| run.capture.as_str()).collect();
        let mut seen = BTreeSet::new();
        captures.retain(|capture| seen.insert(*capture));
        captures
    }

    /// Arms of each length.
    fn rows(&self) -> impl Iterator<Item = (&Arm, u64)> {
        let steps = if self.study.steps.is_empty() { vec![0] } else { self.study.steps.clone() };
        self.study.arms.iter().flat_map(move |arm| steps.clone().into_iter().map(move |steps| (arm, steps)))
    }

    /// By seed.
    fn values(&self, capture: &str, arm: &str, steps: u64, score: Measure) -> BTreeMap<u64, f64> {
        let own = self.runs.iter().filter(|run| (&*run.capture, &*run.arm, run.steps) == (capture, arm, steps));
        own.filter_map(|run| Some((run.seed, *run.scores.get(&score)?))).collect()
    }

    /// Own minus baseline, paired by seed; of costs, own / baseline - 1.
    fn difference(&self, capture: &str, arm: &Arm, steps: u64, score: Measure) -> Option<Estimate> {
        let own = self.values(capture, &arm.key, steps, score);
        let first = self.values(capture, &self.study.baseline, steps, score);
        let pair = |(seed, own): (&u64, &f64)| {
            let first = first.get(seed)?;
            Some(if score.is_cost() { own / first - 1.0 } else { own - first })
        };
        let differences: Vec<f64> = own.iter().filter_map(pair).collect();
        (arm.key != self.study.baseline).then(|| Estimate::new(&differences)).flatten()
    }

    fn table(&self, heads: &[&str], cell: impl Fn(&Arm, u64, usize) -> String) -> String {
        let has_lengths = self.study.steps.len() > 1;
        let steps = ["steps"].into_iter().filter(|_| has_lengths);
        let all: Vec<&str> = [""].into_iter().chain(steps).chain(heads.iter().copied()).collect();
        let rows = self.rows().map(|(arm, steps)| {
            let cells: Vec<String> = (0..heads.len()).map(|index| cell(arm, steps, index)).collect();
            let is_empty = cells.iter().all(|cell| cell == "-");
            (!is_empty).then(|| {
                let steps = has_lengths.then(|| steps.to_string());
                [arm.name.clone()].into_iter().chain(steps).chain(cells).collect::<Vec<_>>()
            })
        });
        Table::new(&all, rows.flatten()).markdown()
    }

    fn head(&self) -> String {
        let Study { title, question, arms, scores, seeds, steps, .. } = &self.study;
        let listed = |numbers: &[u64]| numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
        let made_by: BTreeSet<&str> = self.runs.iter().map(|run| run.made_by.as_str()).collect();
        let lengths = if steps.is_empty() { "as epochs give".to_owned() } else { listed(steps) };
        let mut text = format!(
            "# {title}\n\n{question}\n\nMeans +- standard errors; seeds: {}; steps: {lengths}. Made by: {}; {}. Settings of all arms: {}.\n",
            listed(seeds),
            made_by.into_iter().collect::<Vec<_>>().join("; "),
            self.date,
            self.settings
        );
        if scores.contains(&Measure::Lpips) {
            let trunks: BTreeSet<&str> = self.runs.iter().filter_map(|run| run.trunk.as_deref()).collect();
            trunks.iter().for_each(|trunk| text += &format!("LPIPS is by {trunk}.\n"));
        }
        if arms.iter().any(|arm| !arm.paper.is_empty()) {
            text += "In brackets: the paper's figures, of another capture.\n";
        }
        let changed = |arm: &Arm| {
            let preset = arm.preset.iter().map(|preset| format!("preset `{preset}`"));
            let settings = arm.settings.as_object().filter(|settings| !settings.is_empty());
            preset.chain(settings.map(|_| format!("`{}`", arm.settings))).collect::<Vec<_>>().join(", ")
        };
        for (arm, changed) in arms.iter().map(|arm| (arm, changed(arm))).filter(|(_, changed)| !changed.is_empty()) {
            text += &format!("\n- {}: {changed}", arm.name);
        }
        text + "\n"
    }

    pub fn markdown(&self) -> String {
        let Study { arms, scores, baseline, .. } = &self.study;
        let mut text = self.head();
        let heads: Vec<&str> = scores.iter().map(|score| score.column().0).collect();
        for capture in self.captures() {
            let means = self.table(&heads, |arm, steps, index| {
                let values: Vec<f64> = self.values(capture, &arm.key, steps, scores[index]).into_values().collect();
                let paper = arm.paper.get(&scores[index]).map_or(String::new(), |paper| format!(" ({paper})"));
                mean_with_error(&values, scores[index].column().1) + &paper
            });
            let differences = self.table(&heads, |arm, steps, index| {
                self.difference(capture, arm, steps, scores[index])
                    .map_or("-".to_owned(), |d| signed(&d, scores[index]))
            });
            let _ = write!(text, "\n## {capture}\n\n{means}");
            if let Some(budget) = self.budgets.get(capture) {
                let _ = writeln!(text, "\nEach arm may have {budget} Gaussians, twice as many as the largest start.");
            }
            if arms.len() > 1 {
                let _ = write!(
                    text,
                    "\nAgainst `{baseline}`, paired by seed, with 95 % intervals; x: how many times as much.\n\n{differences}"
                );
            }
        }
        if self.captures().len() > 1 && arms.len() > 1 {
            text += &self.together();
        }
        text
    }

    /// Verdicts by the first score.
    fn together(&self) -> String {
        let (captures, score) = (self.captures(), self.study.scores[0]);
        let heads: Vec<&str> = captures.iter().copied().chain(["all"]).collect();
        let table = self.table(&heads, |arm, steps, index| {
            let of = |capture: &&str| self.difference(capture, arm, steps, score);
            match captures.get(index) {
                Some(capture) => of(capture).map_or("-".to_owned(), |d| signed(&d, score)),
                None if arm.key == self.study.baseline => "-".to_owned(),
                None => verdict(score, &captures.iter().filter_map(of).collect::<Vec<_>>()).to_owned(),
            }
        });
        format!(
            "\n## All captures: {} against `{}`\n\n{table}\nShown: the interval lies {} 0 on at least {SHOWN_ON} captures, and no capture \
             loses more than {}. Harms: one does.\n",
            score.column().0,
            self.study.baseline,
            if score.is_less_better() { "below" } else { "above" },
            score.harm()
        )
    }

    pub fn json(&self) -> Value {
        let arm_of = |capture: &str, (arm, steps): (&Arm, u64)| {
            let of = |score: Measure| {
                let values: Vec<f64> = self.values(capture, &arm.key, steps, score).into_values().collect();
                let difference = self.difference(capture, arm, steps, score);
                let all = json!({ "mean": mean(values.iter().copied())?, "standard_error": standard_error(&values), "difference": difference });
                Some((score, all))
            };
            let scores: BTreeMap<Measure, Value> = Measure::all().filter_map(of).collect();
            json!({ "capture": capture, "arm": arm.key, "steps": steps, "scores": scores })
        };
        let results: Vec<Value> =
            self.captures().into_iter().flat_map(|capture| self.rows().map(move |row| arm_of(capture, row))).collect();
        json!({
            "study": self.study, "date": self.date, "settings": self.settings, "max_gaussians": self.budgets,
            "results": results, "runs": self.runs,
        })
    }

    /// PSNR over seconds: a plot for each capture, a line for each arm, a mark for each length.
    pub fn svg(&self) -> String {
        let panel = |capture: &str| {
            let line = |(colour, arm): (usize, &Arm)| {
                let mark = |(_, steps): (&Arm, u64)| {
                    let of = |score| self.values(capture, &arm.key, steps, score).into_values();
                    let (seconds, psnr) = (mean(of(Measure::Seconds))?, mean(of(Measure::Psnr))?);
                    let title = format!("{}, {steps} steps, {seconds:.1} s: {psnr:.2} dB", arm.name);
                    Some(Mark { at: [seconds, psnr], range: Some(range(of(Measure::Psnr))), radius: 3.0, title })
                };
                let marks = self.rows().filter(|(other, _)| other.key == arm.key).filter_map(mark).collect();
                Series { colour: Some(colour), is_joined: true, marks }
            };
            let series: Vec<Series> = self.study.arms.iter().enumerate().map(line).collect();
            let marks = || series.iter().flat_map(|line| &line.marks);
            marks().next()?;
            let x = Axis::log("seconds of stepping", marks().map(|mark| mark.at[0]), 2.0, &TICKS);
            let y = Axis::around("", marks().filter_map(|mark| mark.range).flatten(), 1e-3);
            let title = "PSNR, dB".to_owned();
            Some(Panel { title, margin: MARGIN, x, y, series, notes: Vec::new(), list: Vec::new() })
        };
        let row = |capture: &str| Row { heading: capture.to_owned(), panels: panel(capture).into_iter().collect() };
        Chart {
            panel: PANEL,
            legend: self.study.arms.iter().map(|arm| arm.name.clone()).collect(),
            rows: self.captures().into_iter().map(row).collect(),
        }
        .svg()
    }
}

fn mean_with_error(values: &[f64], decimals: usize) -> String {
    let Some(mean) = mean(values.iter().copied()) else { return "-".to_owned() };
    let error = standard_error(values).map_or(String::new(), |error| format!(" +- {error:.decimals$}"));
    format!("{mean:.decimals$}{error}")
}

fn signed(difference: &Estimate, score: Measure) -> String {
    if !score.is_cost() {
        return difference.signed(score.column().1.max(2));
    }
    let half = difference.half_width.map_or(String::new(), |half| format!(" +- {half:.2}"));
    format!("x {:.2}{half}", 1.0 + difference.mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(capture: &str, arm: &str, seed: u64, psnr: f64, seconds: f64) -> BenchRun {
        let scores = [(Measure::Psnr, psnr), (Measure::Seconds, seconds)].into();
        let made_by = "a device, a driver, commit abc".to_owned();
        BenchRun { capture: capture.to_owned(), arm: arm.to_owned(), steps: 20, seed, scores, made_by, trunk: None }
    }

    fn bench(captures: &[&str]) -> Bench {
        let text = r#"{"title": "T", "question": "Which?", "scores": ["psnr", "lpips", "seconds"], "seeds": [1, 2, 3], "steps": 20,
                       "arms": [{"key": "exact", "paper": {"psnr": "33.1"}}, {"key": "fast", "preset": "fast"}]}"#;
        let study = Study::parse(Path::new("own.json"), text).unwrap();
        // The seeds differ by 10 dB, the arms by 1 dB on each.
        let of_seed = |capture: &str, seed: u64| {
            let psnr = 10.0 * seed as f64;
            [run(capture, "exact", seed, psnr, 2.0), run(capture, "fast", seed, psnr + 1.0, 0.5)]
        };
        let runs = captures.iter().flat_map(|capture| (1..=3).flat_map(|seed| of_seed(capture, seed))).collect();
        let budgets = [(captures[0].to_owned(), 500)].into();
        Bench { study, date: "2026-11-29".to_owned(), settings: "defaults".to_owned(), budgets, runs }
    }

    #[test]
    fn pairs_take_out_what_seeds_share() {
        let bench = bench(&["fox"]);
        let text = bench.markdown();
        for part in [
            "| exact | 20.00 +- 5.77 (33.1) | - | 2.0 +- 0.0 |",
            "| fast | +1.00 +- 0.00 | - | x 0.25 +- 0.00 |",
            "a device, a driver, commit abc; 2026-11-29",
            "may have 500 Gaussians",
        ] {
            assert!(text.contains(part), "{part}:\n{text}");
        }
        assert!(!text.contains("All captures"), "{text}");
        let fast = &bench.json()["results"][1];
        assert_eq!((&fast["arm"], fast["scores"]["psnr"]["difference"]["mean"].as_f64()), (&"fast".into(), Some(1.0)));
        let svg = bench.svg();
        assert_eq!((svg.matches("<circle").count(), svg.contains("NaN")), (2, false));
        assert!(svg.contains("fast, 20 steps, 0.5 s: 21.00 dB"), "{svg}");
    }

    #[test]
    fn an_arm_is_shown_on_two_captures_and_by_harm_on_none() {
        let text = bench(&["fox", "room"]).markdown();
        assert!(text.contains("| fast | +1.00 +- 0.00 | +1.00 +- 0.00 | shown |"), "{text}");
        let estimate = |mean: f64, half_width: f64| Estimate { mean, half_width: Some(half_width) };
        let (better, level) = (estimate(0.4, 0.3), estimate(0.2, 0.3));
        assert_eq!(verdict(Measure::Psnr, &[better, better, estimate(-0.1, 0.5)]), "shown");
        assert_eq!(verdict(Measure::Psnr, &[better, level, level]), "not shown");
        assert_eq!(verdict(Measure::Psnr, &[better, better, estimate(-0.11, 0.5)]), "harms");
        // One seed has no interval.
        assert_eq!(verdict(Measure::Psnr, &[Estimate { mean: 9.0, half_width: None }; 3]), "not shown");
        let (lower, higher) = (estimate(-0.006, 0.001), estimate(0.006, 0.001));
        assert_eq!(verdict(Measure::Lpips, &[lower, lower]), "shown");
        assert_eq!(verdict(Measure::Lpips, &[higher, higher]), "not shown");
    }
}
