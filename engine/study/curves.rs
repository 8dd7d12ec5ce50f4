use crate::report::statistics::{mean, range};
use crate::report::{Axis, Chart, Mark, Panel, Series, escape};
use std::fmt::Write;

/// Size of a plot in its own units, and margins left, above, right, below.
const SIZE: [f64; 2] = [440.0, 230.0];
const MARGIN: [f64; 4] = [52.0, 12.0, 14.0, 36.0];
/// Points of a line at most; more are averaged, which also calms a curve of single images.
const MAX_POINTS: usize = 240;

pub(super) struct Curve<'a> {
    pub name: &'a str,
    /// (step, value), by step.
    pub points: Vec<[f64; 2]>,
}

pub(super) struct Plot<'a> {
    pub id: &'a str,
    pub title: &'a str,
    pub from_zero: bool,
    /// Every point has a mark; lines are averaged otherwise.
    pub marked: bool,
}

impl Plot<'_> {
    pub fn figure(&self, curves: &[Curve]) -> String {
        let title = escape(self.title);
        let mark = |[step, value]: [f64; 2]| Mark {
            at: [step, value],
            range: None,
            radius: if self.marked { 4.0 } else { 0.0 },
            title: format!("step {step}: {value:.4}"),
        };
        let series = curves.iter().enumerate().map(|(index, Curve { points, .. })| {
            let points = if self.marked { points.clone() } else { thinned(points) };
            Series { colour: Some(index), is_joined: true, marks: points.into_iter().map(mark).collect() }
        });
        let series: Vec<Series> = series.collect();
        let points =
            || series.iter().flat_map(|s| &s.marks).map(|m| m.at).filter(|at| at[0].is_finite() && at[1].is_finite());
        if points().next().is_none() {
            return format!("<figure><figcaption>{title}</figcaption><p class=\"note\">No data.</p></figure>\n");
        }
        let [_, last] = range(points().map(|at| at[0]));
        let zero = self.from_zero.then_some(0.0);
        let panel = Panel {
            title: String::new(),
            margin: MARGIN,
            x: Axis::between("steps", 0.0, last.max(1.0)),
            y: Axis::rounded("", points().map(|at| at[1]).chain(zero)),
            series: series.clone(),
            notes: Vec::new(),
            list: Vec::new(),
        };
        let mut keys = String::new();
        for (index, curve) in curves.iter().enumerate().filter(|_| curves.len() > 1) {
            let _ = write!(keys, " <span class=\"of s{index}\">{}</span>", escape(curve.name));
        }
        let picture = Chart::of(panel, SIZE).inline(self.id, &format!("{} over steps", self.title));
        format!("<figure><figcaption>{title}{keys}</figcaption>\n{picture}</figure>\n")
    }
}

/// Means of neighbours, at most [`MAX_POINTS`].
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let parts = points.chunks(points.len().div_ceil(MAX_POINTS).max(1));
    parts.map(|part| [0, 1].map(|k| mean(part.iter().map(|point| point[k])).unwrap_or(f64::NAN))).collect()
}
