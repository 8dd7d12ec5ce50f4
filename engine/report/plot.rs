//! Plots of the report: SVG as text, coloured by the page's style sheet.

use std::fmt::Write;

/// Size of a plot, in units of its own; the page scales it.
const SIZE: [f64; 2] = [440.0, 230.0];
/// Room left, right, above and below the axes.
const MARGIN: [f64; 4] = [52.0, 14.0, 12.0, 36.0];
/// Points of a line at most; more are averaged, which also calms a curve of single images.
const MAX_POINTS: usize = 240;
/// Height of a bar with its distance to the next.
const BAR: f64 = 26.0;

/// A curve.
pub(crate) struct Series<'a> {
    /// For the legend; a plot of one series has none.
    pub name: &'a str,
    /// (x, y), in order of x.
    pub points: Vec<[f64; 2]>,
}

/// How a plot is drawn.
pub(crate) struct Plot<'a> {
    /// Its id in the page.
    pub id: &'a str,
    /// What the vertical axis shows.
    pub title: &'a str,
    /// Whether the vertical axis begins at 0.
    pub from_zero: bool,
    /// Whether every point has a mark, with its value as tooltip; lines are averaged otherwise.
    pub marked: bool,
}

impl Plot<'_> {
    /// A figure with the series over the steps; without any point, with a note instead.
    pub fn figure(&self, series: &[Series]) -> String {
        let title = escape(self.title);
        let series: Vec<(&str, Vec<[f64; 2]>)> =
            series.iter().map(|s| (s.name, if self.marked { s.points.clone() } else { thinned(&s.points) })).collect();
        let finite = series.iter().flat_map(|(_, p)| p).filter(|p| p[0].is_finite() && p[1].is_finite());
        let Some(bounds) = Bounds::of(finite, self.from_zero) else {
            return format!("<figure><figcaption>{title}</figcaption><p class=\"note\">No data.</p></figure>\n");
        };
        let mut svg = String::new();
        bounds.axes(&mut svg);
        for (index, (_, points)) in series.iter().enumerate() {
            let at: Vec<String> =
                points.iter().map(|p| format!("{:.1},{:.1}", bounds.x(p[0]), bounds.y(p[1]))).collect();
            let _ = writeln!(svg, "<polyline class=\"line s{index}\" points=\"{}\"/>", at.join(" "));
            for [x, y] in points.iter().filter(|_| self.marked) {
                let (cx, cy) = (bounds.x(*x), bounds.y(*y));
                let _ = writeln!(
                    svg,
                    "<circle class=\"mark s{index}\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"4\">\
                     <title>step {x}: {y:.4}</title></circle>"
                );
            }
        }
        let keys = series.iter().enumerate().filter(|_| series.len() > 1);
        let keys = keys.map(|(index, (name, _))| format!(" <span class=\"key s{index}\">{}</span>", escape(name)));
        let [w, h] = SIZE;
        format!(
            "<figure><figcaption>{title}{}</figcaption>\n\
             <svg id=\"{}\" viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{title} over steps\">\n\
             {svg}</svg></figure>\n",
            keys.collect::<String>(),
            self.id
        )
    }
}

/// What the axes span.
struct Bounds {
    x: [f64; 2],
    y: [f64; 2],
    /// Distance of ticks.
    step: [f64; 2],
}

impl Bounds {
    fn of<'a>(points: impl Iterator<Item = &'a [f64; 2]>, from_zero: bool) -> Option<Self> {
        let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for point in points {
            for (span, value) in span.iter_mut().zip(point) {
                *span = [span[0].min(*value), span[1].max(*value)];
            }
        }
        let [[_, x1], [y0, y1]] = span;
        if x1 == f64::NEG_INFINITY {
            return None;
        }
        let y0 = if from_zero { y0.min(0.0) } else { y0 };
        // A constant still needs an axis of some length.
        let height = if y1 > y0 { y1 - y0 } else { 1e-3 * y1.abs().max(1.0) };
        let step = [round_step(x1.max(1.0) / 5.0), round_step(height / 4.0)];
        let y = [(y0 / step[1]).floor() * step[1], ((y0 + height) / step[1]).ceil() * step[1]];
        Some(Bounds { x: [0.0, x1.max(1.0)], y, step })
    }

    fn x(&self, x: f64) -> f64 {
        MARGIN[0] + (x - self.x[0]) / (self.x[1] - self.x[0]) * (SIZE[0] - MARGIN[0] - MARGIN[1])
    }

    fn y(&self, y: f64) -> f64 {
        SIZE[1] - MARGIN[3] - (y - self.y[0]) / (self.y[1] - self.y[0]) * (SIZE[1] - MARGIN[2] - MARGIN[3])
    }

    fn axes(&self, svg: &mut String) {
        let (left, right) = (MARGIN[0], SIZE[0] - MARGIN[1]);
        let bottom = SIZE[1] - MARGIN[3];
        for tick in ticks(self.y, self.step[1]) {
            let y = self.y(tick);
            let text = number(tick, self.step[1]);
            let _ = writeln!(svg, "<line class=\"grid\" x1=\"{left}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>");
            let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>", left - 6.0, y + 4.0);
        }
        for tick in ticks(self.x, self.step[0]) {
            let text = number(tick, self.step[0]);
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{text}</text>",
                self.x(tick),
                bottom + 16.0
            );
        }
        let _ = writeln!(svg, "<line class=\"axis\" x1=\"{left}\" x2=\"{right}\" y1=\"{bottom}\" y2=\"{bottom}\"/>");
        let _ = writeln!(svg, "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">steps</text>", bottom + 32.0);
    }
}

/// A row of [`bars`].
pub(crate) struct Bar {
    /// What took the time.
    pub label: String,
    /// Milliseconds.
    pub ms: f64,
    /// The ideal-limit model's milliseconds, where there is a model.
    pub limit_ms: Option<f64>,
}

/// Horizontal bars of milliseconds, each with a tick at the model's time.
pub(crate) fn bars(id: &str, title: &str, rows: &[Bar]) -> String {
    let longest = rows.iter().flat_map(|row| [row.ms, row.limit_ms.unwrap_or(0.0)]).fold(1e-9, f64::max);
    let total: f64 = rows.iter().map(|row| row.ms).sum();
    let (left, width) = (130.0, 190.0);
    let mut svg = String::new();
    for (index, row) in rows.iter().enumerate() {
        let top = BAR * index as f64;
        let model = row.limit_ms.map_or(String::new(), |limit| format!(", model {limit:.2}"));
        let length = width * row.ms / longest;
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n\
             <rect class=\"bar\" x=\"{left}\" y=\"{}\" width=\"{length:.1}\" height=\"14\" rx=\"2\"/>",
            left - 8.0,
            top + 16.0,
            escape(&row.label),
            top + 5.0
        );
        let mut end = left + length;
        if let Some(limit) = row.limit_ms {
            let x = left + width * limit / longest;
            end = end.max(x);
            let (y1, y2) = (top + 2.0, top + 22.0);
            let _ = writeln!(svg, "<line class=\"limit\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{y1}\" y2=\"{y2}\"/>");
        }
        let share = 100.0 * row.ms / total;
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\">{:.2} ms, {share:.0} %{model}</text>",
            end + 6.0,
            top + 16.0,
            row.ms
        );
    }
    let (w, h) = (left + width + 190.0, BAR * rows.len() as f64);
    let title = escape(title);
    format!(
        "<figure class=\"stages\"><figcaption>{title}</figcaption>\n\
         <svg id=\"{id}\" viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{title}\">\n{svg}</svg></figure>\n"
    )
}

/// The mean of each of at most [`MAX_POINTS`] runs of neighbours.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mean = |part: &[[f64; 2]], k: usize| part.iter().map(|p| p[k]).sum::<f64>() / part.len() as f64;
    points.chunks(points.len().div_ceil(MAX_POINTS).max(1)).map(|part| [mean(part, 0), mean(part, 1)]).collect()
}

/// The smallest of 1, 2 or 5 times a power of ten that is not below `least`.
pub(crate) fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|step| *step >= 0.999_999 * least).unwrap_or(10.0 * power)
}

/// The multiples of `step` from the first to the last.
pub(crate) fn ticks([first, last]: [f64; 2], step: f64) -> impl Iterator<Item = f64> {
    let begin = (first / step).ceil();
    let n = ((last / step + 1e-6).floor() - begin) as i64;
    (0..=n).map(move |k| (begin + k as f64) * step)
}

/// A tick's number with as many digits as `step` asks for.
pub(crate) fn number(value: f64, step: f64) -> String {
    for (unit, suffix) in [(1e6, "M"), (1e3, "k")] {
        if step >= unit / 10.0 && value.abs() >= unit {
            let decimals = usize::from(step < unit);
            return format!("{:.decimals$}{suffix}", value / unit);
        }
    }
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// Text for HTML and SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
