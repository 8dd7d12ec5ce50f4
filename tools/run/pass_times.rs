//! Times of passes, by label.

use crate::ui::screen::print_table;
use ivv::internals::stage::PassReport;

/// All passes with the same label.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct TimedPass {
    /// Section and kernel.
    pub label: String,
    pub dispatches: f64,
    /// Units of work in all.
    pub units: f64,
    /// Milliseconds in all.
    pub ms: f64,
}

impl From<&PassReport> for TimedPass {
    fn from(report: &PassReport) -> Self {
        let (dispatches, ms) = (report.dispatches as f64, report.ns / 1e6);
        TimedPass { label: report.label.clone(), dispatches, units: report.units, ms }
    }
}

impl TimedPass {
    fn times(mut self, factor: f64) -> Self {
        self.dispatches *= factor;
        self.units *= factor;
        self.ms *= factor;
        self
    }

    fn add(&mut self, other: &TimedPass) {
        self.dispatches += other.dispatches;
        self.units += other.units;
        self.ms += other.ms;
    }
}

/// The mean of `n` profiles, by label in order of appearance.
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

/// Prints the passes of a view, and their sum.
pub fn print(passes: &[TimedPass]) {
    let Some((first, rest)) = passes.split_first() else { return };
    let mut total = TimedPass { label: "view".to_owned(), ..first.clone() };
    rest.iter().for_each(|pass| total.add(pass));
    total.units = 0.0;
    let row = |TimedPass { label, dispatches, units, ms }: &TimedPass| {
        let share = format!("{:.1}%", 100.0 * ms / total.ms);
        vec![label.clone(), format!("{dispatches:.0}"), format!("{ms:.3}"), share, format!("{units:.0}")]
    };
    print_table(&["pass", "calls", "ms/view", "share", "units/view"], passes.iter().chain([&total]).map(row));
}
