//! Results of finished runs, and their history.

use crate::error::{Error, Result};
use crate::files::read_file;
use crate::report::statistics::{mean, range};
use crate::report::{Axis, Chart, Mark, Panel, Row, Series};
use crate::train::{Config, Preset, Run, merge};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// They have columns of their own.
const TOLD_APART: [&str; 4] = ["seed", "steps", "epochs", "preset"];

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RunResult {
    /// Name of the folder.
    pub capture: String,
    /// As [`differences`].
    pub settings: String,
    pub steps: u64,
    pub seed: u64,
    /// Mean over test images, dB.
    pub psnr: f64,
    pub ssim: f64,
    pub lpips: Option<f64>,
    /// Wall clock of the last process until its scene is written, first Gaussians and compilation included.
    pub seconds: f64,
    pub cpu_seconds: Option<f64>,
    pub device: String,
    pub revision: Option<String>,
    /// The images, to tell captures of one name apart. Empty in a history.
    #[serde(skip)]
    pub images: String,
}

/// Of `train.json`.
#[derive(serde::Deserialize)]
struct Totals {
    steps: u64,
    seconds: f64,
    cpu_seconds: Option<f64>,
    device: Device,
    revision: Option<String>,
}

#[derive(serde::Deserialize)]
struct Device {
    name: String,
}

/// Of `eval.json`.
#[derive(serde::Deserialize)]
struct Scored {
    psnr: f64,
    ssim: f64,
    lpips: Option<f64>,
}

impl RunResult {
    pub fn read(folder: &Path) -> Result<Self> {
        let run = Run::read(folder)?;
        let config: Config = read(folder, "config.json")?;
        if run.held.test_images == 0 {
            let remedy = "compare runs that have some";
            return Err(Error::data(&folder.join("run.json"), "", "has no test image", remedy));
        }
        let Totals { steps, seconds, cpu_seconds, device, revision } = read(folder, "train.json")?;
        let Scored { psnr, ssim, lpips } = read(folder, "eval.json")?;
        Ok(RunResult {
            capture: run.capture.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned()),
            settings: differences(&config),
            steps,
            seed: config.seed,
            psnr,
            ssim,
            lpips,
            seconds,
            cpu_seconds,
            device: device.name,
            revision,
            images: serde_json::json!([run.capture, run.capture_settings, run.test_cameras, run.held]).to_string(),
        })
    }
}

pub(super) fn read<T: serde::de::DeserializeOwned>(folder: &Path, name: &str) -> Result<T> {
    let (file, remedy) =
        (folder.join(name), "give folders of runs that have ended (`ivv train --resume -o RUN` ends one)");
    let fault = |reason: String| Error::data(&file, "", reason, remedy);
    let text = read_file(&file).map_err(|e| fault(format!("cannot be read: {e}")))?;
    serde_json::from_slice(&text).map_err(|e| fault(e.to_string()))
}

/// The preset, and settings that differ from it or the defaults, as for `--set`; or `defaults`.
pub fn differences(config: &Config) -> String {
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
        // Then LPIPS is only measured.
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

const PANEL: [f64; 2] = [250.0, 190.0];

type Score = fn(&RunResult) -> Option<f64>;
const SHOWN: [(&str, Score); 5] = [
    ("PSNR, dB", |run| Some(run.psnr)),
    ("SSIM", |run| Some(run.ssim)),
    ("LPIPS (less is better)", |run| run.lpips),
    ("seconds", |run| Some(run.seconds)),
    ("seconds of processors", |run| run.cpu_seconds),
];

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Entry {
    /// Year-month-day, UTC.
    pub date: String,
    pub runs: Vec<RunResult>,
}

/// The oldest first.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct History(pub Vec<Entry>);

impl History {
    /// A row for each capture and kind of settings.
    pub fn svg(&self) -> String {
        // Runs of a row differ in the code alone.
        let kind = |run: &RunResult| (run.capture.clone(), run.settings.clone(), run.steps);
        let kinds: BTreeSet<_> = self.0.iter().flat_map(|entry| &entry.runs).map(kind).collect();
        let row = |own: (String, String, u64)| {
            let panels = SHOWN.iter().filter_map(|(title, of)| self.panel(title, *of, |run| kind(run) == own));
            Row { heading: format!("{}, {} steps, {}", own.0, own.2, own.1), panels: panels.collect() }
        };
        Chart { panel: PANEL, rows: kinds.into_iter().map(row).collect(), legend: Vec::new() }.svg()
    }

    /// Mean and range over the entries; none if no run has the score.
    fn panel(&self, title: &str, of: Score, is_own: impl Fn(&RunResult) -> bool) -> Option<Panel> {
        let point = |(index, entry): (usize, &Entry)| {
            let values: Vec<f64> = entry.runs.iter().filter(|run| is_own(run)).filter_map(of).collect();
            let (mean, [least, most]) = (mean(values.iter().copied())?, range(values));
            let revision = entry.runs.iter().find_map(|run| run.revision.clone()).unwrap_or_default();
            let title = format!("{} {revision}: {mean:.4} ({least:.4} to {most:.4})", entry.date);
            Some(Mark { at: [(index + 1) as f64, mean], range: Some([least, most]), radius: 3.0, title })
        };
        let marks: Vec<Mark> = self.0.iter().enumerate().filter_map(point).collect();
        // Changes of less than a hundredth look as small as they are.
        let largest = marks.iter().map(|mark| mark.at[1].abs()).reduce(f64::max)?.max(1e-3);
        Some(Panel {
            title: title.to_owned(),
            margin: [56.0, 24.0, 10.0, 42.0],
            x: Axis::around("measurement", marks.iter().map(|mark| mark.at[0]), 1.0).in_whole_numbers(),
            y: Axis::around("", marks.iter().filter_map(|mark| mark.range).flatten(), 0.02 * largest),
            series: vec![Series { colour: Some(0), is_joined: true, marks }],
            notes: Vec::new(),
            list: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn result(capture: &str, steps: u64, psnr: f64) -> RunResult {
        RunResult {
            capture: capture.to_owned(),
            settings: "defaults".to_owned(),
            steps,
            seed: 42,
            psnr,
            ssim: 0.9,
            lpips: None,
            seconds: steps as f64 / 10.0,
            cpu_seconds: None,
            device: "a device".to_owned(),
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
    fn a_history_follows_what_is_alike() {
        let entry = |date: &str, psnr| Entry {
            date: date.to_owned(),
            runs: vec![result("fox", 500, psnr), result("fox", 100, psnr)],
        };
        let history = History(vec![entry("2026-11-23", 29.0), entry("2026-11-24", 30.0)]);
        let svg = history.svg();
        assert!(svg.contains("fox, 100 steps, defaults") && svg.contains("2026-11-24 abc: 30.0000"), "{svg}");
        // PSNR, SSIM and seconds of two lengths, two points each.
        assert_eq!((svg.matches("<circle").count(), svg.contains("NaN")), (12, false));
        assert!(!History::default().svg().contains("NaN"));
    }
}
