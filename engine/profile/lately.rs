//! How long recent frames took, for a display that is drawn beside them.

use crate::report::statistics::quantile;
use crate::stage::FrameReport;
use std::collections::VecDeque;

/// Part of a pass's mean that its newest time is.
const NEWEST: f64 = 0.1;
/// Mean milliseconds of a pass that is not run any more, below which it is forgotten.
const FORGOTTEN_MS: f64 = 1e-4;

/// The last [`FrameTimes::FRAMES`] frames, the oldest first.
#[derive(Clone, Debug, Default)]
pub struct FrameTimes {
    /// Milliseconds that each took.
    pub ms: VecDeque<f64>,
    /// Milliseconds from each of them to the next, where both were shown.
    pub between: VecDeque<f64>,
    pub report: FrameReport,
    /// Mean milliseconds of passes over about the last ten frames, by label.
    passes: Vec<(String, f64)>,
}

impl FrameTimes {
    pub const FRAMES: usize = 240;

    /// Adds a frame that took `ms` milliseconds, `between` after the one before, if there was one.
    pub fn add(&mut self, ms: f64, between: Option<f64>, report: FrameReport) {
        for (all, new) in [(&mut self.ms, Some(ms)), (&mut self.between, between)] {
            all.extend(new);
            all.drain(..all.len().saturating_sub(Self::FRAMES));
        }
        self.passes.iter_mut().for_each(|(_, mean)| *mean *= 1.0 - NEWEST);
        let n_known = self.passes.len();
        for time in &report.times {
            let ms = 1e-6 * time.ns;
            match self.passes.iter().position(|(label, _)| *label == time.label) {
                Some(k) => self.passes[k].1 += if k < n_known { NEWEST * ms } else { ms },
                // The first of its kind is its own mean.
                None => self.passes.push((time.label.clone(), ms)),
            }
        }
        self.passes.retain(|(_, mean)| *mean > FORGOTTEN_MS);
        self.report = report;
    }

    pub fn rate(&self) -> f64 {
        let sum: f64 = self.between.iter().sum();
        if sum > 0.0 { 1e3 * self.between.len() as f64 / sum } else { 0.0 }
    }

    /// The `q`-quantile, 0 to 1, of the milliseconds that frames took; NaN before the first.
    pub fn quantile(&self, q: f64) -> f64 {
        quantile(&self.ms.iter().copied().collect::<Vec<_>>(), q)
    }

    pub fn slowest(&self, n: usize) -> Vec<(&str, f64)> {
        let mut passes: Vec<(&str, f64)> = self.passes.iter().map(|(label, ms)| (label.as_str(), *ms)).collect();
        passes.sort_by(|a, b| b.1.total_cmp(&a.1));
        passes.truncate(n);
        passes
    }
}
