//! The passes of frames or steps, against what the device was measured to do.

use super::limit::{Bound, Peaks};
use crate::gpu::table::Cost;
use crate::report::statistics::{Ratio, mean, median, paired_ratio, quantile};
use crate::stage::{Counters, PassReport};
use crate::vk::Caps;
use serde::Serialize;

/// A frame or a step whose passes were timed.
#[derive(Clone, Debug)]
pub struct Sample {
    pub passes: Vec<PassReport>,
    pub counters: Counters,
    pub barriers: usize,
}

/// All passes with one label, over the samples that have it; what is not said otherwise is a mean of the samples.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    pub label: String,
    pub samples: usize,
    pub dispatches: f64,
    /// Median and 95th percentile of the samples' times, milliseconds.
    pub median_ms: f64,
    pub p95_ms: f64,
    /// Part of all passes' time.
    pub share: f64,
    pub units: f64,
    pub cost: Cost,
    pub limit_ms: f64,
    pub of_limit: f64,
    /// Its limit; nothing alone limits a whole sample.
    pub bound: Option<Bound>,
}

/// The cost of timestamps: steps with them and steps without, in turns.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Overhead {
    /// Medians, milliseconds of the host's clock, without timestamps and with.
    pub plain_ms: f64,
    pub timed_ms: f64,
    /// Time with over time without.
    pub ratio: Ratio,
}

#[derive(Clone, Debug, Serialize)]
pub struct Profile {
    pub subject: String,
    /// A step or a view.
    pub sample: &'static str,
    pub samples: usize,
    pub device: Caps,
    pub shaders: String,
    pub peaks: Peaks,
    pub counters: Counters,
    /// The passes, in the order of their first.
    pub lines: Vec<Line>,
    pub total: Line,
    /// Barriers of a sample, mean of the samples.
    pub barriers: f64,
    pub overhead: Overhead,
}

impl Profile {
    /// The profile of at least one sample, measured on the device with `caps`.
    pub fn new(
        subject: String,
        sample: &'static str,
        caps: &Caps,
        peaks: Peaks,
        samples: &[Sample],
        overhead: Overhead,
    ) -> Self {
        let n = samples.len().max(1) as f64;
        let mut counters = Counters::default();
        samples.iter().for_each(|sample| counters.add(&sample.counters));
        let passes = || samples.iter().flat_map(|sample| &sample.passes);
        let sum: f64 = passes().map(|pass| pass.ns).sum();
        let mut labels: Vec<&str> = Vec::new();
        for pass in passes() {
            if !labels.contains(&pass.label.as_str()) {
                labels.push(&pass.label);
            }
        }
        let line = |label: &str| {
            let of: Vec<&PassReport> = passes().filter(|pass| pass.label == label).collect();
            Line::new(label, &of, &peaks, sum)
        };
        let lines: Vec<Line> = labels.into_iter().map(line).collect();
        let times: Vec<f64> =
            samples.iter().map(|sample| sample.passes.iter().map(|pass| pass.ns).sum::<f64>() / 1e6).collect();
        Profile {
            total: Line::total(sample, &lines, &times),
            subject,
            sample,
            samples: samples.len(),
            device: caps.clone(),
            shaders: crate::gpu::shaders_hash(),
            peaks,
            counters: counters.over(n),
            lines,
            barriers: samples.iter().map(|sample| sample.barriers as f64).sum::<f64>() / n,
            overhead,
        }
    }

    pub fn by_time(&self) -> Vec<&Line> {
        let mut lines: Vec<&Line> = self.lines.iter().collect();
        lines.sort_by(|a, b| b.share.total_cmp(&a.share));
        lines
    }
}

impl Line {
    fn new(label: &str, passes: &[&PassReport], peaks: &Peaks, sum: f64) -> Self {
        let n = passes.len().max(1) as f64;
        let mean = |f: &dyn Fn(&PassReport) -> f64| mean(passes.iter().map(|pass| f(pass))).unwrap_or(0.0);
        let ms: Vec<f64> = passes.iter().map(|pass| pass.ns / 1e6).collect();
        let mut cost = Cost::default();
        passes.iter().for_each(|pass| cost.add(&pass.cost, 1.0 / n));
        let dispatches = mean(&|pass| pass.dispatches as f64);
        // Copies and fills are no dispatches.
        let is_kernel = cost.copied + cost.filled == 0.0;
        let dispatched = if is_kernel { dispatches } else { 0.0 };
        let (limit_ns, bound) = peaks.limit(&cost, dispatched);
        let median_ms = median(&ms);
        let limit_ms = limit_ns / 1e6;
        Line {
            label: label.to_owned(),
            samples: passes.len(),
            dispatches,
            median_ms,
            p95_ms: quantile(&ms, 0.95),
            share: passes.iter().map(|pass| pass.ns).sum::<f64>() / sum,
            units: mean(&|pass| pass.units),
            cost,
            limit_ms,
            of_limit: if median_ms > 0.0 { limit_ms / median_ms } else { 0.0 },
            bound: Some(bound),
        }
    }

    fn total(sample: &str, lines: &[Line], ms: &[f64]) -> Self {
        let limit_ms: f64 = lines.iter().map(|line| line.limit_ms).sum();
        let median_ms = median(ms);
        let mut cost = Cost::default();
        lines.iter().for_each(|line| cost.add(&line.cost, 1.0));
        Line {
            label: sample.to_owned(),
            samples: ms.len(),
            dispatches: lines.iter().map(|line| line.dispatches).sum(),
            median_ms,
            p95_ms: quantile(ms, 0.95),
            share: 1.0,
            units: 1.0,
            cost,
            limit_ms,
            of_limit: limit_ms / median_ms,
            bound: None,
        }
    }
}

impl Overhead {
    /// Of steps with timestamps and steps without, milliseconds, in pairs.
    pub fn new(timed: &[f64], plain: &[f64]) -> Self {
        Overhead { plain_ms: median(plain), timed_ms: median(timed), ratio: paired_ratio(timed, plain) }
    }
}
