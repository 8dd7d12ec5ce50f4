//! Times of passes against those of kernels that are well written for a CPU driver, without measuring the device first.

use crate::screen::out;
use ivv::stage::PassReport;
use ivv::vk::{Caps, DeviceKind};

/// Cost of a dispatch with its barrier on lavapipe, nanoseconds, as measured with empty kernels.
const DISPATCH_NS: f64 = 14_000.0;

/// All passes with the same label.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct TimedPass {
    /// Section and kernel.
    pub label: String,
    /// Passes with this label.
    pub dispatches: f64,
    /// What the time grows with, in all.
    pub units: f64,
    /// Milliseconds in all.
    pub ms: f64,
    /// The model's milliseconds, where there is a model.
    pub limit_ms: Option<f64>,
    /// The fraction of the model's speed that is reached.
    pub of_limit: Option<f64>,
}

impl TimedPass {
    /// `report` against the model of the device.
    pub fn new(report: &PassReport, caps: &Caps) -> Self {
        // The unit costs are lavapipe's; `ivv profile` measures any device.
        let model_ns = |cores: f64| report.limit_ns / cores + DISPATCH_NS * report.dispatches as f64;
        let limit_ms = (caps.kind == DeviceKind::Cpu).then(|| model_ns(cpu_threads()) / 1e6);
        let (dispatches, units) = (report.dispatches as f64, report.units);
        let line =
            TimedPass { label: report.label.clone(), dispatches, units, ms: report.ns / 1e6, limit_ms, of_limit: None };
        line.times(1.0)
    }

    /// The same `factor` times.
    fn times(mut self, factor: f64) -> Self {
        self.dispatches *= factor;
        self.units *= factor;
        self.ms *= factor;
        self.limit_ms = self.limit_ms.map(|limit| limit * factor);
        self.of_limit = self.limit_ms.filter(|_| self.ms > 0.0).map(|limit| limit / self.ms);
        self
    }

    /// Adds `other` but for its label.
    fn add(&mut self, other: &TimedPass) {
        self.dispatches += other.dispatches;
        self.units += other.units;
        self.ms += other.ms;
        self.limit_ms = self.limit_ms.zip(other.limit_ms).map(|(a, b)| a + b);
    }
}

/// The mean of `n` profiles, by label in the order of their appearance.
pub fn mean(passes: impl IntoIterator<Item = TimedPass>, n: usize) -> Vec<TimedPass> {
    let mut sum: Vec<TimedPass> = Vec::new();
    for pass in passes {
        match sum.iter_mut().find(|line| line.label == pass.label) {
            Some(line) => line.add(&pass),
            None => sum.push(pass),
        }
    }
    sum.into_iter().map(|line| line.times(1.0 / n.max(1) as f64)).collect()
}

/// All passes as one line called `label`; none when there is no pass.
pub fn total(passes: &[TimedPass], label: &str) -> Option<TimedPass> {
    let (first, rest) = passes.split_first()?;
    let mut sum = TimedPass { label: label.to_owned(), ..first.clone() };
    rest.iter().for_each(|pass| sum.add(pass));
    Some(TimedPass { units: 0.0, ..sum.times(1.0) })
}

/// Prints the passes of one `what`, and their sum. The model is one of lavapipe that was measured on another machine, so a
/// pass may be faster.
pub fn print(passes: &[TimedPass], what: &str) {
    let Some(total) = total(passes, what) else { return };
    let (ms, units) = (format!("ms/{what}"), format!("units/{what}"));
    out!("{:<40} {:>6} {ms:>10} {:>7} {units:>12} {:>9}", "pass", "calls", "share", "model, ms");
    for line in passes.iter().chain([&total]) {
        let model = line.limit_ms.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
        let share = 100.0 * line.ms / total.ms;
        let TimedPass { label, dispatches, units, ms, .. } = line;
        out!("{label:<40} {dispatches:>6.0} {ms:>10.3} {share:>6.1}% {units:>12.0} {model:>9}");
    }
}

/// Threads that a CPU driver works with.
pub fn cpu_threads() -> f64 {
    let asked = std::env::var("LP_NUM_THREADS").ok().and_then(|n| n.parse::<usize>().ok()).filter(|n| *n > 0);
    asked.unwrap_or_else(ivv::parallel::threads) as f64
}
