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

/// The sum of all passes, called `label`; `None` if there is no pass.
pub fn total(passes: &[TimedPass], label: &str) -> Option<TimedPass> {
    let (first, rest) = passes.split_first()?;
    let mut sum = TimedPass { label: label.to_owned(), ..first.clone() };
    rest.iter().for_each(|pass| sum.add(pass));
    Some(TimedPass { units: 0.0, ..sum })
}

pub fn print(passes: &[TimedPass], what: &str) {
    let Some(total) = total(passes, what) else { return };
    let (ms, units) = (format!("ms/{what}"), format!("units/{what}"));
    let row = |TimedPass { label, dispatches, units, ms }: &TimedPass| {
        let share = format!("{:.1}%", 100.0 * ms / total.ms);
        vec![label.clone(), format!("{dispatches:.0}"), format!("{ms:.3}"), share, format!("{units:.0}")]
    };
    print_table(&["pass", "calls", &ms, "share", &units], passes.iter().chain([&total]).map(row));
}
