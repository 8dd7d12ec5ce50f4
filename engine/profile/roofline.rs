//! The roofline as a picture: every pass that computes, at its flops per byte and its speed, below what the device can do.

use super::limit::Bound;
use super::passes::{Line, Profile};
use crate::report::{Anchor, Axis, Chart, Look, Mark, Note, Panel, Series};

/// Width and height of the picture, and room left of the axes, above, right (for the list of passes) and below.
const SIZE: [f64; 2] = [980.0, 520.0];
const MARGIN: [f64; 4] = [64.0, 28.0, 420.0, 48.0];
/// Passes that are drawn, those that take most time.
const DRAWN: usize = 24;

impl Profile {
    pub fn roofline(&self) -> String {
        self.chart().svg()
    }

    pub(super) fn chart(&self) -> Chart {
        let peaks = &self.peaks;
        let drawn: Vec<_> = self
            .by_time()
            .into_iter()
            .filter(|line| line.cost.flops > 0.0 && line.cost.bytes > 0.0 && line.median_ms > 0.0)
            .take(DRAWN)
            .map(|line| (line, [line.cost.flops / line.cost.bytes, line.cost.flops / line.median_ms * 1e3]))
            .collect();
        let ridge = peaks.flops / peaks.bytes;
        let intensities = drawn.iter().map(|(_, at)| at[0]).chain([ridge / 10.0, ridge * 10.0]);
        let x = Axis::decades("flops per byte", intensities, |value| value.to_string());
        let y = Axis::decades("", drawn.iter().map(|(_, at)| at[1]).chain([peaks.flops]), si);
        let ([first, last], [lowest, _]) = (x.ends(), y.ends());
        // Where the slope enters the plot: at its left edge, or at its bottom.
        let enters = first.max(lowest / peaks.bytes);
        let corner = |at: [f64; 2]| Mark { at, ..Mark::default() };
        let roof = [[enters, enters * peaks.bytes], [ridge, peaks.flops], [last, peaks.flops]].map(corner);
        let circle = |(line, at): &(&Line, [f64; 2])| Mark {
            at: *at,
            range: None,
            radius: 5.0 + 22.0 * line.share.sqrt(),
            title: name(&line.label).to_owned(),
        };
        let note = |at, shift, anchor, look, text| Note { at, shift, anchor, look, text };
        let peak = format!("{}flop/s, {}B/s", si(peaks.flops), si(peaks.bytes));
        let mut notes = vec![note([last, peaks.flops], [0.0, -6.0], Anchor::End, Look::Plain, peak)];
        let mut list = vec!["pass: share of the time, of its limit, by".to_owned()];
        for (number, (line, at)) in (1..).zip(&drawn) {
            notes.push(note(*at, [0.0, 3.5], Anchor::Middle, Look::Number, number.to_string()));
            let (share, of_limit) = (100.0 * line.share, 100.0 * line.of_limit);
            let by = line.bound.map(Bound::name).unwrap_or_default();
            list.push(format!("{number} {}: {share:.1} %, {of_limit:.0} %, {by}", name(&line.label)));
        }
        let panel = Panel {
            title: "flop/s".to_owned(),
            margin: MARGIN,
            x,
            y,
            series: vec![
                Series { colour: Some(0), is_joined: false, marks: drawn.iter().map(circle).collect() },
                Series { colour: Some(1), is_joined: true, marks: roof.to_vec() },
            ],
            notes,
            list,
        };
        Chart::of(panel, SIZE)
    }
}

fn name(label: &str) -> &str {
    label.rsplit('/').next().unwrap_or_default()
}

/// A number with an SI prefix.
pub(super) fn si(value: f64) -> String {
    let units = [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")];
    let (unit, prefix) = units.into_iter().find(|(unit, _)| value >= 0.9999 * unit).unwrap_or((1.0, ""));
    let digits = usize::from(value / unit < 99.5);
    let text = format!("{:.digits$}", value / unit);
    format!("{} {prefix}", text.strip_suffix(".0").unwrap_or(&text))
}
