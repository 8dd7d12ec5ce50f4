//! Curves over time as an SVG.

use std::fmt::Write;

/// A curve with its own axis, below the one before it.
pub struct Panel {
    /// What and in which unit.
    pub title: &'static str,
    /// (seconds, value).
    pub points: Vec<(f64, f64)>,
}

const SIZE: (f64, f64) = (720.0, 150.0);
const LEFT: f64 = 60.0;
const TOP: f64 = 24.0;

/// Panels over one time axis.
pub fn plot(panels: &[Panel]) -> String {
    let ends = panels.iter().flat_map(|panel| &panel.points).map(|(t, _)| *t);
    let (from, to) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
    let x = |t: f64| LEFT + (t - from) / (to - from).max(1e-9) * (SIZE.0 - LEFT - 20.0);
    let mut svg = String::new();
    let height = panels.len() as f64 * (SIZE.1 + TOP) + 24.0;
    // A string takes all that is written into it.
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>",
        SIZE.0
    );
    for (index, Panel { title, points }) in panels.iter().enumerate() {
        let top = index as f64 * (SIZE.1 + TOP) + TOP;
        let reach = points.iter().map(|(_, value)| value.abs()).fold(1e-9, f64::max);
        let y = |value: f64| top + SIZE.1 * (0.5 - 0.45 * value / reach);
        let right = SIZE.0 - 20.0;
        let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"{}\">{title}</text>", top - 6.0);
        for value in [-reach, 0.0, reach] {
            let at = y(value);
            let _ = writeln!(
                svg,
                "<path d=\"M{LEFT} {at:.1}H{right}\" stroke=\"#ccc\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{value:.0}</text>",
                LEFT - 6.0,
                at + 4.0
            );
        }
        let dots: String = points
            .iter()
            .map(|(t, value)| {
                format!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.5\" fill=\"#1f5fa8\"/>", x(*t), y(*value))
            })
            .collect();
        let _ = writeln!(svg, "{dots}");
    }
    let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"{}\">{from:.1} s</text>", height - 8.0);
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{to:.1} s</text>\n</svg>",
        SIZE.0 - 20.0,
        height - 8.0
    );
    svg
}
