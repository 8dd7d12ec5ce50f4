//! The roofline as a picture: every pass that computes, at its flops per byte and its speed, below what the device can do.

use super::Profile;
use crate::report::escape;
use std::fmt::Write;

/// The picture, the plot in it (left, top, right, bottom), and the legend's left edge and line height.
const SIZE: [f64; 2] = [980.0, 520.0];
const PLOT: [f64; 4] = [64.0, 24.0, 560.0, 464.0];
const LEGEND: [f64; 2] = [590.0, 18.0];
/// Passes that are drawn, those that take most time.
const DRAWN: usize = 24;
const STYLE: &str = "text{font:12px system-ui,sans-serif;fill:#333}.t{font-size:11px}.g{stroke:#ddd}\
    .roof{stroke:#222;stroke-width:2;fill:none}.p{fill:#2a6fbb;fill-opacity:.55;stroke:#1b4a80}\
    .n{font-size:10px;fill:#000;text-anchor:middle}\
    @media (prefers-color-scheme:dark){text{fill:#ccc}.g{stroke:#444}.roof{stroke:#ddd}.n{fill:#fff}}";

/// A logarithmic axis.
struct Axis {
    low: i32,
    high: i32,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values.fold((f64::INFINITY, 0f64), |(low, high), v| (low.min(v), high.max(v)));
        let low = low.log10().floor() as i32;
        Axis { low, high: (high.log10().ceil() as i32).max(low + 1), from, to }
    }

    fn at(&self, value: f64) -> f64 {
        let part = (value.log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        self.from + part.clamp(0.0, 1.0) * (self.to - self.from)
    }
}

/// The picture.
pub(super) fn svg(profile: &Profile) -> String {
    let [left, top, right, bottom] = PLOT;
    let peaks = &profile.peaks;
    let drawn: Vec<_> = profile
        .by_time()
        .into_iter()
        .filter(|line| line.cost.flops > 0.0 && line.cost.bytes > 0.0 && line.median_ms > 0.0)
        .take(DRAWN)
        .map(|line| (line, line.cost.flops / line.cost.bytes, line.cost.flops / line.median_ms * 1e3))
        .collect();
    let ridge = peaks.flops / peaks.bytes;
    let x = Axis::new(drawn.iter().map(|(_, x, _)| *x).chain([ridge / 10.0, ridge * 10.0]), left, right);
    let y = Axis::new(drawn.iter().map(|(.., y)| *y).chain([peaks.flops]), bottom, top);
    let [w, h] = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" id=\"roofline\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
         aria-label=\"roofline of {}\"><style>{STYLE}</style>\n",
        escape(&profile.subject)
    );
    for exponent in x.low..=x.high {
        let at = x.at(10f64.powi(exponent));
        let _ = writeln!(
            svg,
            "<line class=\"g\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{bottom}\"/>\
             <text class=\"t\" x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            bottom + 16.0,
            10f64.powi(exponent)
        );
    }
    for exponent in y.low..=y.high {
        let at = y.at(10f64.powi(exponent));
        let _ = writeln!(
            svg,
            "<line class=\"g\" x1=\"{left}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"t\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 6.0,
            at + 4.0,
            si(10f64.powi(exponent))
        );
    }
    let (lowest, furthest) = (10f64.powi(x.low), 10f64.powi(x.high));
    // Where the slope enters the plot: at its left edge, or at its bottom.
    let enters = lowest.max(10f64.powi(y.low) / peaks.bytes);
    let _ = writeln!(
        svg,
        "<polyline class=\"roof\" points=\"{:.1},{:.1} {:.1},{:.1} {:.1},{:.1}\"/>\
         <text x=\"{right}\" y=\"{:.1}\" text-anchor=\"end\">{}flop/s, {}B/s</text>",
        x.at(enters),
        y.at(enters * peaks.bytes),
        x.at(ridge),
        y.at(peaks.flops),
        x.at(furthest),
        y.at(peaks.flops),
        y.at(peaks.flops) - 6.0,
        si(peaks.flops),
        si(peaks.bytes)
    );
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">flops per byte</text>\
         <text x=\"{left}\" y=\"14\">flop/s</text>\
         <text x=\"{}\" y=\"14\">pass: share of the time, of its limit, by</text>",
        (left + right) / 2.0,
        bottom + 36.0,
        LEGEND[0]
    );
    for (index, (line, intensity, speed)) in drawn.iter().enumerate() {
        let (cx, cy, r) = (x.at(*intensity), y.at(*speed), 5.0 + 22.0 * line.share.sqrt());
        let (number, label) = (index + 1, escape(line.label.rsplit('/').next().unwrap_or_default()));
        let _ = writeln!(
            svg,
            "<circle class=\"p\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"{r:.1}\"><title>{label}</title></circle>\
             <text class=\"n\" x=\"{cx:.1}\" y=\"{:.1}\">{number}</text>\
             <text class=\"t\" x=\"{}\" y=\"{:.1}\">{number} {label}: {:.1} %, {:.0} %, {}</text>",
            cy + 3.5,
            LEGEND[0],
            36.0 + LEGEND[1] * index as f64,
            100.0 * line.share,
            100.0 * line.of_limit,
            line.bound.map_or("", super::Bound::name)
        );
    }
    svg + "</svg>\n"
}

/// A number with an SI prefix.
pub(super) fn si(value: f64) -> String {
    let units = [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")];
    let (unit, prefix) = units.into_iter().find(|(unit, _)| value >= 0.9999 * unit).unwrap_or((1.0, ""));
    let digits = usize::from(value / unit < 99.5);
    let text = format!("{:.digits$}", value / unit);
    format!("{} {prefix}", text.strip_suffix(".0").unwrap_or(&text))
}
