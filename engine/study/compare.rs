//! Finished runs side by side: what each came to, over its seeds, and how that changes from one time of measuring to the next.

use crate::error::{Error, Result};
use crate::files::read_file;
use crate::report::statistics::{mean, range};
use crate::report::{Axis, Chart, Mark, Panel, Row, Series, Table};
use crate::train::{Config, Preset, Run, merge};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Settings that are not listed: they have columns of their own, or the preset stands before all others.
const TOLD_APART: [&str; 4] = ["seed", "steps", "epochs", "preset"];

/// What a finished run came to.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RunResult {
    /// The folder of its capture, without those above it.
    pub capture: String,
    /// Its settings that are not the defaults, as for `--set`, in the order of their names; `defaults` where there is none.
    pub settings: String,
    /// Steps done.
    pub steps: u64,
    /// Its seed.
    pub seed: u64,
    /// Mean over the test images, dB.
    pub psnr: f64,
    /// The same after the affine map of colours that brings each view closest to its image, dB.
    pub psnr_aligned: f64,
    /// The test camera with the lowest mean PSNR.
    pub worst_camera: String,
    /// That PSNR, dB.
    pub worst_psnr: f64,
    /// Mean over the test images.
    pub ssim: f64,
    /// Mean over the test images; none of runs without weights for it.
    pub lpips: Option<f64>,
    /// The same of colours in [0, 1].
    pub lpips_unscaled: Option<f64>,
    /// Gaussians at the end.
    pub gaussians: u64,
    /// Bytes of their parameters.
    pub bytes: u64,
    /// From the start of the process until its scene is written, before it is scored; the first Gaussians and the compilation of
    /// kernels included. Of a run that was resumed, those of its last process.
    pub seconds: f64,
    /// The same of all processors together, where the system told.
    pub cpu_seconds: Option<f64>,
    /// Name of the device.
    pub device: String,
    /// Name and version of its driver.
    pub driver: String,
    /// The source that `ivv` was built from, as git names it; none where the build did not know.
    pub revision: Option<String>,
    /// The images that were trained on and scored, to tell them from others. Empty of those in a history.
    #[serde(skip)]
    pub images: String,
}

/// What is read of `train.json`.
#[derive(serde::Deserialize)]
struct Totals {
    steps: u64,
    gaussians: u64,
    scene_bytes: u64,
    seconds: f64,
    cpu_seconds: Option<f64>,
    device: Device,
    revision: Option<String>,
}

#[derive(serde::Deserialize)]
struct Device {
    name: String,
    driver: String,
}

/// What is read of `eval.json`.
#[derive(serde::Deserialize)]
struct Scored {
    psnr: f64,
    psnr_aligned: f64,
    ssim: f64,
    lpips: Option<f64>,
    lpips_unscaled: Option<f64>,
    views: Vec<ScoredView>,
}

#[derive(serde::Deserialize)]
struct ScoredView {
    camera: String,
    psnr: f64,
}

impl RunResult {
    /// Reads the folder of a run that has ended and has test images.
    ///
    /// # Errors
    /// [`Error::Data`] naming the file that is absent or not what `ivv train` writes.
    pub fn read(folder: &Path) -> Result<Self> {
        let run = Run::read(folder)?;
        let config: Config = read(folder, "config.json")?;
        let untested = |file| Error::data(&folder.join(file), "", "has no test image", "compare runs that have some");
        if run.held.test_images == 0 {
            return Err(untested("run.json"));
        }
        let totals: Totals = read(folder, "train.json")?;
        let scored: Scored = read(folder, "eval.json")?;
        let mut cameras: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        scored.views.iter().for_each(|view| cameras.entry(&view.camera).or_default().push(view.psnr));
        let means = cameras.iter().map(|(camera, psnr)| (*camera, mean(psnr.iter().copied()).unwrap_or(0.0)));
        let Some((worst_camera, worst_psnr)) = means.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Err(untested("eval.json"));
        };
        Ok(RunResult {
            capture: run.capture.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned()),
            settings: differences(&config),
            steps: totals.steps,
            seed: config.seed,
            psnr: scored.psnr,
            psnr_aligned: scored.psnr_aligned,
            worst_camera: worst_camera.to_owned(),
            worst_psnr,
            ssim: scored.ssim,
            lpips: scored.lpips,
            lpips_unscaled: scored.lpips_unscaled,
            gaussians: totals.gaussians,
            bytes: totals.scene_bytes,
            seconds: totals.seconds,
            cpu_seconds: totals.cpu_seconds,
            device: totals.device.name,
            driver: totals.device.driver,
            revision: totals.revision,
            images: serde_json::json!([run.capture, run.capture_settings, run.test_cameras, run.held]).to_string(),
        })
    }
}

fn read<T: serde::de::DeserializeOwned>(folder: &Path, name: &str) -> Result<T> {
    let (file, remedy) =
        (folder.join(name), "give folders of runs that have ended (`ivv train --resume -o RUN` ends one)");
    let fault = |reason: String| Error::data(&file, "", reason, remedy);
    let text = read_file(&file).map_err(|e| fault(format!("cannot be read: {e}")))?;
    serde_json::from_slice(&text).map_err(|e| fault(e.to_string()))
}

/// The settings of `config` that are not those of its preset or the defaults; the preset first.
fn differences(config: &Config) -> String {
    let value = |config: &Config| serde_json::to_value(config).unwrap_or(Value::Null);
    let mut base = value(&Config::default());
    let mut told = Vec::new();
    if let Some(id) = &config.preset {
        told.push(id.name.clone());
        // A preset of the user's own file is not at hand: its settings are listed.
        if let Ok(preset) = Preset::find(&id.name) {
            merge(&mut base, &preset.settings);
            // With the roundings that the run's settings went through.
            base = serde_json::from_value(base).map_or(Value::Null, |config| value(&config));
        }
    }
    let mut own = value(config);
    if !config.loss.has_lpips() {
        // LPIPS is measured at most.
        own["loss"]["lpips"] = base["loss"]["lpips"].clone();
        own["loss"]["lpips_weights"] = base["loss"]["lpips_weights"].clone();
    }
    list("", &base, &own, &mut told);
    if told.is_empty() { "defaults".to_owned() } else { told.join(" ") }
}

fn list(name: &str, base: &Value, own: &Value, told: &mut Vec<String>) {
    match (base, own) {
        (Value::Object(base), Value::Object(own)) => {
            for (key, value) in own {
                let full = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                if !TOLD_APART.contains(&full.as_str()) {
                    list(&full, base.get(key).unwrap_or(&Value::Null), value, told);
                }
            }
        }
        (base, own) if base != own => told.push(match own {
            Value::String(word) => format!("{name}={word}"),
            // Single precision has more digits than anyone wrote.
            own => match own.as_f64().filter(|number| f64::from(*number as f32) == *number) {
                Some(number) => format!("{name}={}", number as f32),
                None => format!("{name}={own}"),
            },
        }),
        _ => {}
    }
}

/// Runs that differ in their seeds alone.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RunGroup {
    /// As [`RunResult::capture`].
    pub capture: String,
    /// As [`RunResult::settings`].
    pub settings: String,
    /// Steps of each.
    pub steps: u64,
    /// The runs, by their seeds.
    #[serde(skip)]
    pub runs: Vec<RunResult>,
    /// Seeds.
    pub seeds: Vec<u64>,
    /// Mean, least and most over the runs, by the name of the score.
    pub scores: BTreeMap<&'static str, [f64; 3]>,
}

/// What is tabulated and drawn: name in JSON, heading, digits, and how to get it.
type Score = (&'static str, &'static str, usize, fn(&RunResult) -> Option<f64>);

const SCORES: [Score; 10] = [
    ("psnr", "PSNR, dB", 2, |run| Some(run.psnr)),
    ("psnr_aligned", "aligned", 2, |run| Some(run.psnr_aligned)),
    ("worst_psnr", "worst camera", 2, |run| Some(run.worst_psnr)),
    ("ssim", "SSIM", 4, |run| Some(run.ssim)),
    ("lpips", "LPIPS", 4, |run| run.lpips),
    ("lpips_unscaled", "LPIPS unscaled", 4, |run| run.lpips_unscaled),
    ("gaussians", "Gaussians", 0, |run| Some(run.gaussians as f64)),
    ("megabytes", "MB", 2, |run| Some(run.bytes as f64 / 1e6)),
    ("seconds", "seconds", 1, |run| Some(run.seconds)),
    ("cpu_seconds", "of processors", 1, |run| run.cpu_seconds),
];
/// Those of [`SCORES`] that are drawn: name and title.
const DRAWN: [(&str, &str); 3] = [("psnr", "PSNR, dB"), ("ssim", "SSIM"), ("lpips", "LPIPS (less is better)")];
/// What a history shows besides.
const TIMES: [(&str, &str); 2] = [("seconds", "seconds"), ("cpu_seconds", "seconds of processors")];

/// Runs by their groups.
#[derive(Clone, Debug, PartialEq)]
pub struct RunTable(pub Vec<RunGroup>);

impl RunGroup {
    /// A score's mean, of several runs with the least and the most; the worst camera with its name, where that is one.
    fn told(&self, name: &str, digits: usize) -> String {
        let Some([mean, least, most]) = self.scores.get(name) else { return "-".to_owned() };
        let mut told = format!("{mean:.digits$}");
        if self.runs.len() > 1 {
            told += &format!(" ({least:.digits$} to {most:.digits$})");
        }
        let worst: BTreeSet<&str> = self.runs.iter().map(|run| run.worst_camera.as_str()).collect();
        if name == "worst_psnr" && worst.len() == 1 {
            told.extend([" "].into_iter().chain(worst));
        }
        told
    }
}

impl RunTable {
    /// Groups `runs` that differ in their seeds alone, ordered by capture, settings (defaults first) and steps.
    pub fn new(runs: &[RunResult]) -> Self {
        let mut groups: BTreeMap<_, Vec<RunResult>> = BTreeMap::new();
        for run in runs {
            let told = (run.capture.as_str(), run.settings != "defaults", run.settings.as_str(), run.steps);
            let apart = (&run.images, &run.device, &run.driver, &run.revision);
            groups.entry((told, apart)).or_default().push(run.clone());
        }
        let group = |(((capture, _, settings, steps), _), mut runs): ((_, _), Vec<RunResult>)| {
            let (capture, settings): (&str, &str) = (capture, settings);
            runs.sort_by_key(|run| run.seed);
            let scores = SCORES.iter().filter_map(|(name, .., of)| {
                let values: Vec<f64> = runs.iter().filter_map(of).collect();
                let [least, most] = range(values.iter().copied());
                mean(values).map(|mean| (*name, [mean, least, most]))
            });
            RunGroup {
                capture: capture.to_owned(),
                settings: settings.to_owned(),
                steps,
                seeds: runs.iter().map(|run| run.seed).collect(),
                scores: scores.collect(),
                runs,
            }
        };
        let mut groups: Vec<RunGroup> = groups.into_iter().map(group).collect();
        let labels: Vec<_> = groups.iter().map(|g| (g.capture.clone(), g.settings.clone(), g.steps)).collect();
        let is_twin = |label: &_| labels.iter().filter(|other| *other == label).count() > 1;
        for (group, _) in groups.iter_mut().zip(&labels).filter(|(_, label)| is_twin(*label)) {
            let RunResult { device, driver, revision, .. } = &group.runs[0];
            group.settings += &format!("; {device}, {driver}, {}", revision.as_deref().unwrap_or("-"));
        }
        RunTable(groups)
    }

    /// The groups as a table of Markdown: means over the seeds, with the least and the most in brackets.
    pub fn markdown(&self) -> String {
        let row = |group: &RunGroup| {
            let seeds: Vec<String> = group.seeds.iter().map(u64::to_string).collect();
            let is_default = group.settings == "defaults";
            let settings = if is_default { group.settings.clone() } else { format!("`{}`", group.settings) };
            let mut row = vec![group.capture.clone(), settings, group.steps.to_string(), seeds.join(" ")];
            row.extend(SCORES.map(|(name, _, digits, _)| group.told(name, digits)));
            row
        };
        let heads = ["capture", "settings", "steps", "seeds"].into_iter().chain(SCORES.map(|(_, heading, ..)| heading));
        Table::new(&heads.collect::<Vec<_>>(), self.0.iter().map(row)).with_text(2).markdown()
    }

    /// The groups as a picture: a row a capture; scores against steps, seconds and seconds of processors; a line for each kind
    /// of settings, bars from the least to the most.
    pub fn svg(&self) -> String {
        let groups = &self.0;
        let captures: BTreeSet<&str> = groups.iter().map(|group| group.capture.as_str()).collect();
        let kinds: BTreeSet<&str> = groups.iter().map(|group| group.settings.as_str()).collect();
        let mut kinds: Vec<&str> = kinds.into_iter().collect();
        kinds.sort_by_key(|kind| *kind != "defaults");
        let mut rows = Vec::new();
        for capture in captures {
            let mut row = Vec::new();
            for (name, title) in DRAWN {
                for axis in ["steps", "seconds", "cpu_seconds"] {
                    let line = |(colour, kind): (usize, &&str)| {
                        let own = groups.iter().filter(|group| group.capture == capture && group.settings == *kind);
                        let point = |group: &RunGroup| {
                            let x = if axis == "steps" { group.steps as f64 } else { group.scores.get(axis)?[0] };
                            group.scores.get(name).map(|score| mark(x, &format!("{x:.0}"), *score))
                        };
                        Series { colour: Some(colour), is_joined: true, marks: own.filter_map(point).collect() }
                    };
                    let lines: Vec<Series> = kinds.iter().enumerate().map(line).collect();
                    let x = logarithmic(&axis.replace("cpu_seconds", "seconds of processors"), &lines);
                    row.extend(panel(title, x, lines));
                }
            }
            rows.push(Row { heading: capture.to_owned(), panels: row });
        }
        Chart { panel: PANEL, rows, legend: kinds.into_iter().map(str::to_owned).collect() }.svg()
    }
}

/// Width and height of a panel.
const PANEL: [f64; 2] = [250.0, 190.0];

/// A point with its mean, least and most, and its label.
fn mark(x: f64, name: &str, [mean, least, most]: [f64; 3]) -> Mark {
    let title = format!("{name}: {mean:.4} ({least:.4} to {most:.4})");
    Mark { at: [x, mean], range: Some([least, most]), radius: 3.0, title }
}

/// A logarithmic axis with ticks where points are, if these are few and whole numbers, else at powers of ten.
fn logarithmic(label: &str, lines: &[Series]) -> Axis {
    let mut values: Vec<f64> = lines.iter().flat_map(|line| &line.marks).map(|mark| mark.at[0]).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let powers: Vec<f64> = (-2..8).flat_map(|k| [1.0, 3.0].map(|m| m * 10f64.powi(k))).collect();
    let is_told = values.len() <= 6 && values.iter().all(|x| x.fract() == 0.0);
    Axis::log(label, values.iter().copied(), 1.1, if is_told { &values } else { &powers })
}

/// A panel, where there is anything to show.
fn panel(title: &str, x: Axis, series: Vec<Series>) -> Option<Panel> {
    let marks = || series.iter().flat_map(|line| &line.marks);
    // Changes of less than a hundredth look as small as they are.
    let largest = marks().map(|mark| mark.at[1].abs()).fold(1e-3, f64::max);
    let y = Axis::around("", marks().flat_map(|mark| mark.range).flatten(), 0.02 * largest);
    let (title, margin) = (title.to_owned(), [56.0, 24.0, 10.0, 42.0]);
    let is_shown = marks().next().is_some();
    is_shown.then(|| Panel { title, margin, x, y, series, notes: Vec::new(), list: Vec::new() })
}

/// One time of measuring, of a file of them.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Entry {
    /// Year-month-day, UTC.
    pub date: String,
    /// What was measured.
    pub runs: Vec<RunResult>,
}

/// A file of measurements, the oldest first.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct History(pub Vec<Entry>);

impl History {
    /// The entries as a picture: a row a capture and kind of settings, scores from the first entry to the last.
    pub fn svg(&self) -> String {
        let entries = &self.0;
        let revision = |entry: &Entry| entry.runs.iter().find_map(|run| run.revision.clone()).unwrap_or_default();
        let names: Vec<String> =
            entries.iter().map(|e| format!("{} {}", e.date, revision(e)).trim().to_owned()).collect();
        let measured: Vec<Vec<RunGroup>> = entries.iter().map(|entry| RunTable::new(&entry.runs).0).collect();
        // What one row follows must be alike but for the code.
        let kinds: BTreeSet<(&str, &str, u64)> =
            measured.iter().flatten().map(|group| (&*group.capture, &*group.settings, group.steps)).collect();
        let row = |(capture, settings, steps): (&str, &str, u64)| {
            let of = |(name, title): (&str, &str)| {
                let point = |((index, groups), entry): ((usize, &Vec<RunGroup>), &String)| {
                    let own =
                        groups.iter().find(|g| (&*g.capture, &*g.settings, g.steps) == (capture, settings, steps))?;
                    own.scores.get(name).map(|score| mark((index + 1) as f64, entry, *score))
                };
                let marks: Vec<Mark> = measured.iter().enumerate().zip(&names).filter_map(point).collect();
                let x = Axis::around("measurement", marks.iter().map(|mark| mark.at[0]), 1.0).in_whole_numbers();
                panel(title, x, vec![Series { colour: Some(0), is_joined: true, marks }])
            };
            let panels = DRAWN.into_iter().chain(TIMES).filter_map(of).collect();
            let heading = format!("{capture}, {steps} steps, {settings}");
            Row { heading, panels }
        };
        Chart { panel: PANEL, rows: kinds.into_iter().map(row).collect(), legend: Vec::new() }.svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn result(capture: &str, settings: &str, (steps, seed): (u64, u64), psnr: f64) -> RunResult {
        RunResult {
            capture: capture.to_owned(),
            settings: settings.to_owned(),
            steps,
            seed,
            psnr,
            psnr_aligned: psnr + 1.0,
            worst_camera: "a<b".to_owned(),
            worst_psnr: psnr - 2.0,
            ssim: 0.9,
            lpips: None,
            lpips_unscaled: None,
            gaussians: 1000,
            bytes: 236_000,
            seconds: steps as f64 / 10.0,
            cpu_seconds: None,
            device: "a device".to_owned(),
            driver: "1.0".to_owned(),
            revision: Some("abc".to_owned()),
            images: "all".to_owned(),
        }
    }

    #[test]
    fn settings_are_told_by_what_differs() {
        let mut config = Config { seed: 7, steps: 100, epochs: 2, ..Config::default() };
        assert_eq!(differences(&config), "defaults");
        // Weights that serve the score alone do not change the run.
        (config.loss.lpips, config.loss.lpips_weights) = (0.0, Some("weights.bin".into()));
        assert_eq!(differences(&config), "defaults");
        config.loss.lpips = 0.2;
        (config.lr.pace.steps, config.frame.alpha_cut) = (0, 0.0078);
        assert_eq!(
            differences(&config),
            "frame.alpha_cut=0.0078 loss.lpips=0.2 loss.lpips_weights=weights.bin lr.pace.steps=0"
        );
        let preset = Preset::find("fast").unwrap();
        let mut value = json!(Config::default());
        merge(&mut value, &preset.settings);
        let config = Config { preset: Some(preset.id), ..serde_json::from_value(value).unwrap() };
        assert_eq!(differences(&config), "fast");
    }

    #[test]
    fn runs_that_differ_in_their_seeds_share_a_row() {
        let runs = [
            result("fox", "lr.scale=1", (100, 1), 20.0),
            result("fox", "defaults", (200, 1), 27.0),
            result("fox", "defaults", (100, 2), 24.0),
            result("fox", "defaults", (100, 1), 23.0),
        ];
        let table = RunTable::new(&runs);
        let seeds: Vec<(&str, u64, &[u64])> = table.0.iter().map(|g| (&*g.settings, g.steps, &*g.seeds)).collect();
        assert_eq!(seeds, [("defaults", 100, &[1, 2][..]), ("defaults", 200, &[1]), ("lr.scale=1", 100, &[1])]);
        assert_eq!(table.0[0].scores["psnr"], [23.5, 23.0, 24.0]);
        let text = table.markdown();
        assert!(text.contains("| fox | defaults | 100 | 1 2 | 23.50 (23.00 to 24.00) |"), "{text}");
        assert!(
            text.contains(
                "| fox | `lr.scale=1` | 100 | 1 | 20.00 | 21.00 | 18.00 a<b | 0.9000 | - | - | 1000 | 0.24 | 10.0 | - |"
            ),
            "{text}"
        );
        let svg = table.svg();
        // Two scores, as nobody has LPIPS, against steps and seconds, three points each.
        assert_eq!((svg.matches("<circle").count(), svg.matches("<polyline").count()), (12, 8));
        assert!(
            svg.contains(">fox</text>")
                && svg.contains(">SSIM</text>")
                && !svg.contains("LPIPS")
                && !svg.contains("NaN"),
            "{svg}"
        );
    }

    #[test]
    fn a_history_follows_what_is_alike() {
        let entry = |date: &str, psnr| Entry {
            date: date.to_owned(),
            runs: vec![result("fox", "defaults", (500, 42), psnr), result("fox", "defaults", (100, 42), psnr)],
        };
        let history = History(vec![entry("2026-11-23", 29.0), entry("2026-11-24", 30.0)]);
        let svg = history.svg();
        assert!(svg.contains("fox, 100 steps, defaults") && svg.contains("2026-11-24 abc: 30.0000"), "{svg}");
        // PSNR, SSIM and seconds of two lengths, two points each.
        assert_eq!((svg.matches("<circle").count(), svg.contains("NaN")), (12, false));
        assert!(!History::default().svg().contains("NaN"));
    }
}
