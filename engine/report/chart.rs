//! Small plots in rows: SVG as text.

use super::plot::{escape, number, round_step, ticks};
use std::fmt::Write;

/// A panel with its margins, and the part of it that lies within the axes (left, top, right, bottom).
const SIZE: [f64; 2] = [250.0, 190.0];
const PLOT: [f64; 4] = [56.0, 24.0, 240.0, 148.0];
/// Height of a line of the legend, and of what stands above a row.
const LEGEND: f64 = 18.0;
const HEADING: f64 = 24.0;
const COLOURS: [&str; 8] = ["#2a78c2", "#c9822b", "#2e9e6b", "#b3453f", "#7a5bb0", "#8a8a2a", "#3aa6b0", "#b0508f"];

/// Panels in rows below a legend.
pub(crate) struct Chart {
    pub rows: Vec<Row>,
    /// What the colours mean, from the first on; may be empty.
    pub legend: Vec<String>,
}

/// Panels side by side.
pub(crate) struct Row {
    /// What they all show.
    pub heading: String,
    pub panels: Vec<Panel>,
}

/// A plot.
pub(crate) struct Panel {
    pub title: String,
    /// What the horizontal axis shows.
    pub axis: String,
    /// Whether the horizontal axis is logarithmic.
    pub is_log: bool,
    /// Names of x = 1, 2 and so on, shown with the value of a point; may be empty.
    pub names: Vec<String>,
    pub lines: Vec<Line>,
}

/// A line of a panel.
pub(crate) struct Line {
    pub colour: usize,
    /// x, and mean, least and most of y.
    pub points: Vec<(f64, [f64; 3])>,
}

impl Chart {
    pub fn svg(&self) -> String {
        let columns = self.rows.iter().map(|row| row.panels.len()).max().unwrap_or(0).max(1);
        let top = 8.0 + LEGEND * self.legend.len() as f64;
        let (w, h) = (SIZE[0] * columns as f64, top + (HEADING + SIZE[1]) * self.rows.len() as f64);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\">\n\
             <style>text {{ font: 11px sans-serif; fill: #555 }} .t {{ font-weight: bold }} .h {{ font-size: 14px }} .g {{ stroke: #8884 }} \
             polyline {{ fill: none; stroke-width: 2 }}</style>\n"
        );
        for (index, name) in self.legend.iter().enumerate() {
            let y = 6.0 + LEGEND * index as f64;
            let _ = writeln!(
                svg,
                "<rect x=\"10\" y=\"{y}\" width=\"12\" height=\"12\" fill=\"{}\"/><text x=\"28\" y=\"{}\">{}</text>",
                colour(index),
                y + 10.0,
                escape(name)
            );
        }
        for (y, row) in self.rows.iter().enumerate() {
            let y = top + (HEADING + SIZE[1]) * y as f64;
            let _ = writeln!(svg, "<text class=\"h\" x=\"10\" y=\"{}\">{}</text>", y + 16.0, escape(&row.heading));
            for (x, panel) in row.panels.iter().enumerate() {
                let at = [SIZE[0] * x as f64, y + HEADING];
                let _ = write!(svg, "<g transform=\"translate({} {})\">\n{}</g>\n", at[0], at[1], panel.svg());
            }
        }
        svg + "</svg>\n"
    }
}

fn colour(index: usize) -> &'static str {
    COLOURS[index % COLOURS.len()]
}

impl Panel {
    fn svg(&self) -> String {
        let [left, top, right, bottom] = PLOT;
        let place = |x: f64| if self.is_log { x.max(1e-9).ln() } else { x };
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let span = |values: &mut dyn Iterator<Item = f64>, least: f64| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let middle = low.midpoint(high);
            let half = 0.56 * (high - low).max(least);
            (middle - half, middle + half)
        };
        let (x0, x1) = span(&mut points().map(|(x, _)| place(*x)), 0.1);
        // Changes of less than a hundredth look as small as they are.
        let largest = points().map(|(_, y)| y[0].abs()).fold(1e-3, f64::max);
        let (y0, y1) = span(&mut points().flat_map(|(_, y)| *y), 0.02 * largest);
        let x = |value: f64| left + (place(value) - x0) / (x1 - x0) * (right - left);
        let y = |value: f64| bottom - (value - y0) / (y1 - y0) * (bottom - top);
        let mut svg = format!("<text class=\"t\" x=\"{left}\" y=\"16\">{}</text>\n", escape(&self.title));
        let step = round_step((y1 - y0) / 4.0);
        for value in ticks([y0, y1], step) {
            let (at, text) = (y(value), number(value, step));
            let _ = writeln!(
                svg,
                "<line class=\"g\" x1=\"{left}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                left - 5.0,
                at + 4.0
            );
        }
        for value in self.ticks() {
            let at = x(value);
            if (left..=right).contains(&at) {
                let _ = writeln!(
                    svg,
                    "<line class=\"g\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{bottom}\"/>\
                     <text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{value}</text>",
                    bottom + 14.0
                );
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            bottom + 28.0,
            escape(&self.axis)
        );
        for line in &self.lines {
            let colour = colour(line.colour);
            let at: Vec<String> = line.points.iter().map(|(px, py)| format!("{:.1},{:.1}", x(*px), y(py[0]))).collect();
            let _ = writeln!(svg, "<polyline stroke=\"{colour}\" points=\"{}\"/>", at.join(" "));
            for (px, [mean, least, most]) in &line.points {
                let (cx, named) = (x(*px), self.names.get((*px as usize).wrapping_sub(1)));
                let named = named.map_or(format!("{px:.0}"), |name| escape(name));
                let _ = writeln!(
                    svg,
                    "<line stroke=\"{colour}\" x1=\"{cx:.1}\" x2=\"{cx:.1}\" y1=\"{:.1}\" y2=\"{:.1}\"/>\
                     <circle fill=\"{colour}\" cx=\"{cx:.1}\" cy=\"{:.1}\" r=\"3\"><title>{named}: {mean:.4} \
                     ({least:.4} to {most:.4})</title></circle>",
                    y(*most),
                    y(*least),
                    y(*mean)
                );
            }
        }
        svg
    }

    /// Values of the horizontal axis that are written: of a logarithmic one, those that have points, or powers of ten; else whole
    /// numbers.
    fn ticks(&self) -> Vec<f64> {
        let mut values: Vec<f64> = self.lines.iter().flat_map(|line| &line.points).map(|(x, _)| *x).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let (Some(first), Some(last)) = (values.first().copied(), values.last().copied()) else { return Vec::new() };
        match self.is_log {
            true if values.len() <= 6 && values.iter().all(|x| x.fract() == 0.0) => values,
            true => (-2..8).flat_map(|k| [1.0, 3.0].map(|m| m * 10f64.powi(k))).collect(),
            false => {
                let step = round_step((last - first) / 5.0).max(1.0);
                (0..=5).map(|k| first + step * f64::from(k)).filter(|x| *x <= last).collect()
            }
        }
    }
}
