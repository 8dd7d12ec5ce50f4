//! Two profiles side by side, pass by pass, from the files that `ivv profile` wrote; no device is needed.

use crate::error::{Error, Result};
use crate::files::{as_text, read_file};
use crate::report::Table;
use crate::stage::Counters;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Largest file that is read, bytes: a profile has some ten kilobytes.
const MAX_BYTES: u64 = 16 << 20;
/// A change counts from this many standard errors of the difference of two medians.
const STANDARD_ERRORS: f64 = 3.0;
/// A change counts from this part of the larger time; less is not worth a mark.
const LEAST_CHANGE: f64 = 0.02;
/// With fewer samples of a pass its spread is not known.
const LEAST_SAMPLES: usize = 5;
/// Standard deviations of a normal distribution from its median to its 95th percentile.
const SIGMAS_TO_P95: f64 = 1.645;
/// Standard error of a median of many normal values over that of their mean.
const MEDIAN_OVER_MEAN: f64 = 1.2533;
/// Means of what the samples had to do, and rates of the device, are told apart from this ratio.
const OTHER_WORK: f64 = 1.01;
const OTHER_RATE: f64 = 1.1;

/// The part of a `profile.json` that is compared; older files have it too.
#[derive(Clone, Debug, Deserialize)]
pub struct Recorded {
    subject: String,
    sample: String,
    samples: usize,
    device: RecordedDevice,
    shaders: String,
    peaks: RecordedPeaks,
    pub counters: Counters,
    lines: Vec<RecordedLine>,
    total: RecordedLine,
    overhead: RecordedOverhead,
}

#[derive(Clone, Debug, Deserialize)]
struct RecordedDevice {
    name: String,
    driver: String,
    subgroup_size: u32,
}

#[derive(Clone, Debug, Deserialize)]
struct RecordedPeaks {
    bytes: f64,
    flops: f64,
    rows: f64,
    exp2: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct RecordedLine {
    label: String,
    /// Samples that have the pass; in older files all.
    #[serde(default)]
    samples: usize,
    median_ms: f64,
    p95_ms: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct RecordedOverhead {
    plain_ms: f64,
}

impl Recorded {
    pub fn read(path: &Path) -> Result<Self> {
        let file = if path.is_dir() { path.join("profile.json") } else { path.to_owned() };
        let fault = |place: &str, reason: String| {
            Error::data(&file, place, reason, "give a profile.json of `ivv profile`, or the folder that holds it")
        };
        if let Some(bytes) = std::fs::metadata(&file).ok().map(|about| about.len()).filter(|bytes| *bytes > MAX_BYTES) {
            return Err(fault("", format!("expected a profile of at most {MAX_BYTES} bytes, found {bytes}")));
        }
        let text = read_file(&file).map_err(|e| fault("", format!("cannot be read: {e}")))?;
        let mut read: Recorded =
            serde_json::from_slice(&text).map_err(|e| fault("", format!("expected a profile: {e}")))?;
        // Older profiles are of an engine that culled all Gaussians.
        if read.counters.live == 0.0 {
            read.counters.live = read.counters.gaussians;
        }
        read.lines
            .iter_mut()
            .chain([&mut read.total])
            .filter(|line| line.samples == 0)
            .for_each(|line| line.samples = read.samples);
        let mut labels = HashSet::new();
        for (line, is_pass) in read.lines.iter().map(|line| (line, true)).chain([(&read.total, false)]) {
            let RecordedLine { label, median_ms, p95_ms, .. } = line;
            let place = format!("`{}`", label.escape_debug());
            if !(*median_ms >= 0.0 && p95_ms >= median_ms && p95_ms.is_finite()) {
                let reason = "expected a time of 0 or more and a 95th percentile that is not below it";
                return Err(fault(&place, format!("{reason}, found {median_ms} and {p95_ms}")));
            }
            if is_pass && !labels.insert(label) {
                return Err(fault(&place, "expected each pass once, found this one twice".to_owned()));
            }
        }
        Ok(read)
    }

    fn line(&self, label: &str) -> Option<&RecordedLine> {
        self.lines.iter().find(|line| line.label == label)
    }

    fn told(&self) -> String {
        format!("{}, {}s: {}", shown(&self.subject), shown(&self.sample), self.samples)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    Slower,
    Faster,
    Same,
    New,
    Gone,
    TooFew,
}

impl Change {
    fn name(self) -> &'static str {
        match self {
            Change::Slower => "slower",
            Change::Faster => "faster",
            Change::Same => "",
            Change::New => "new",
            Change::Gone => "gone",
            Change::TooFew => "too few samples",
        }
    }

    /// Compares two medians. Their standard errors come from the 95th percentiles, so a long tail makes them large.
    fn of(a: &RecordedLine, b: &RecordedLine) -> Self {
        if a.samples.min(b.samples) < LEAST_SAMPLES {
            return Change::TooFew;
        }
        let error = |line: &RecordedLine| {
            MEDIAN_OVER_MEAN * (line.p95_ms - line.median_ms) / SIGMAS_TO_P95 / (line.samples as f64).sqrt()
        };
        let (a_ms, b_ms) = (a.median_ms, b.median_ms);
        let least = (STANDARD_ERRORS * error(a).hypot(error(b))).max(LEAST_CHANGE * a_ms.max(b_ms));
        match b_ms - a_ms {
            change if change > least => Change::Slower,
            change if -change > least => Change::Faster,
            _ => Change::Same,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    pub label: String,
    /// Medians, milliseconds.
    pub a_ms: Option<f64>,
    pub b_ms: Option<f64>,
    /// The second less the first; a pass that is absent takes 0.
    pub change_ms: f64,
    pub ratio: Option<f64>,
    #[serde(rename = "verdict")]
    pub change: Option<Change>,
}

impl Compared {
    fn new(label: &str, a_ms: Option<f64>, b_ms: Option<f64>, change: Option<Change>) -> Self {
        let ratio = a_ms.zip(b_ms).filter(|(a, _)| *a > 0.0).map(|(a, b)| b / a);
        let change_ms = b_ms.unwrap_or(0.0) - a_ms.unwrap_or(0.0);
        Compared { label: label.to_owned(), a_ms, b_ms, change_ms, ratio, change }
    }

    fn of(label: &str, a: Option<&RecordedLine>, b: Option<&RecordedLine>) -> Self {
        let change = match (a, b) {
            (Some(a), Some(b)) => Change::of(a, b),
            (Some(_), None) => Change::Gone,
            (None, _) => Change::New,
        };
        let ms = |line: Option<&RecordedLine>| line.map(|line| line.median_ms);
        Compared::new(label, ms(a), ms(b), Some(change))
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Other {
    pub what: &'static str,
    pub a: String,
    pub b: String,
    /// Times can differ for this alone, so that ratios do not show what a change of the kernels did.
    pub spoils: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    #[serde(serialize_with = "as_text")]
    pub a: PathBuf,
    #[serde(serialize_with = "as_text")]
    pub b: PathBuf,
    /// True if both are of the same thing on the same device.
    pub is_comparable: bool,
    pub differences: Vec<Other>,
    /// The passes, the largest change of time first.
    pub passes: Vec<Compared>,
    pub total: Compared,
    pub host: Compared,
    #[serde(skip)]
    told: [String; 2],
}

impl Comparison {
    pub fn new((a_path, a): (&Path, &Recorded), (b_path, b): (&Path, &Recorded)) -> Self {
        let gone = a.lines.iter().filter(|line| b.line(&line.label).is_none());
        let labels = b.lines.iter().chain(gone).map(|line| line.label.as_str());
        let mut passes: Vec<Compared> = labels.map(|label| Compared::of(label, a.line(label), b.line(label))).collect();
        passes.sort_by(|x, y| y.change_ms.abs().total_cmp(&x.change_ms.abs()));
        let differences = differences(a, b);
        Comparison {
            a: a_path.to_owned(),
            b: b_path.to_owned(),
            is_comparable: !differences.iter().any(|other| other.spoils),
            differences,
            passes,
            total: Compared::of("all passes", Some(&a.total), Some(&b.total)),
            host: Compared::new("host's clock", Some(a.overhead.plain_ms), Some(b.overhead.plain_ms), None),
            told: [a.told(), b.told()],
        }
    }

    pub fn terminal(&self) -> String {
        let mut text = String::new();
        for (name, path, told) in [("A", &self.a, &self.told[0]), ("B", &self.b, &self.told[1])] {
            text += &format!("{name}: {} ({told})\n", path.display());
        }
        if !self.differences.is_empty() {
            let rows =
                self.differences.iter().map(|other| vec![other.what.to_owned(), shown(&other.a), shown(&other.b)]);
            text += &format!("What differs beside the times\n{}", Table::new(&["", "A", "B"], rows).plain());
        }
        let spoils: Vec<&str> = self.differences.iter().filter(|other| other.spoils).map(|other| other.what).collect();
        if !spoils.is_empty() {
            text += &format!(
                "These ratios do not show what a change of the kernels did: A and B differ in {}.\n",
                spoils.join(", ")
            );
        }
        let row = |line: &Compared| {
            let ms = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
            vec![
                shown(&line.label),
                ms(line.a_ms),
                ms(line.b_ms),
                format!("{:+.3}", line.change_ms),
                line.ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.3}")),
                line.change.map_or("", Change::name).to_owned(),
            ]
        };
        let ratio = if spoils.is_empty() { "B / A" } else { "(B / A)" };
        let rows = self.passes.iter().chain([&self.total, &self.host]).map(row);
        let table = Table::new(&["pass", "A, ms", "B, ms", "B - A, ms", ratio, ""], rows);
        text + "Medians of the passes, the largest change first\n" + &table.plain()
    }
}

/// Text of a file without characters that would steer the terminal.
fn shown(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

fn differences(a: &Recorded, b: &Recorded) -> Vec<Other> {
    let words = [
        ("device", a.device.name.clone(), b.device.name.clone(), true),
        ("driver", a.device.driver.clone(), b.device.driver.clone(), true),
        ("subgroup size", a.device.subgroup_size.to_string(), b.device.subgroup_size.to_string(), true),
        ("subject", a.subject.clone(), b.subject.clone(), true),
        ("sample", a.sample.clone(), b.sample.clone(), true),
        ("samples", a.samples.to_string(), b.samples.to_string(), false),
        ("kernels (hash)", a.shaders.clone(), b.shaders.clone(), false),
    ];
    let told = words.into_iter().filter(|(_, a, b, _)| a != b);
    let mut found: Vec<Other> = told.map(|(what, a, b, spoils)| Other { what, a, b, spoils }).collect();
    let is_other = |a: f64, b: f64, least: f64| a.max(b) > least * a.min(b);
    let work = [
        ("Gaussians", a.counters.gaussians, b.counters.gaussians, true),
        ("pixels", a.counters.pixels, b.counters.pixels, true),
        // Other kernels may find fewer of them.
        ("intersections", a.counters.intersections, b.counters.intersections, false),
        ("pixel-splats evaluated", a.counters.evaluated, b.counters.evaluated, false),
    ];
    for (what, a, b, spoils) in work.into_iter().filter(|(_, a, b, _)| is_other(*a, *b, OTHER_WORK)) {
        found.push(Other { what, a: format!("{a:.0}"), b: format!("{b:.0}"), spoils });
    }
    // The same device is slower where others use it too.
    let rates = [
        ("measured GB/s", 1e9, a.peaks.bytes, b.peaks.bytes),
        ("measured Gflop/s", 1e9, a.peaks.flops, b.peaks.flops),
        ("measured Mrows/s", 1e6, a.peaks.rows, b.peaks.rows),
        ("measured Gexp2/s", 1e9, a.peaks.exp2, b.peaks.exp2),
    ];
    for (what, unit, a, b) in rates.into_iter().filter(|(.., a, b)| is_other(*a, *b, OTHER_RATE)) {
        found.push(Other { what, a: format!("{:.2}", a / unit), b: format!("{:.2}", b / unit), spoils: false });
    }
    found
}
