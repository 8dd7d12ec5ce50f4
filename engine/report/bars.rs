//! Horizontal bars of milliseconds.

use super::page::escape;
use super::plot::{Anchor, inline, text};
use std::fmt::Write;

/// Height of a bar with its distance to the next.
const BAR: f64 = 26.0;
/// Where the bars begin, how long the longest is, and the room for what is written behind it.
const LEFT: f64 = 130.0;
const WIDTH: f64 = 190.0;

/// A row of [`bars`].
#[derive(Clone, Debug)]
pub struct Bar {
    /// What took the time.
    pub label: String,
    /// Milliseconds.
    pub ms: f64,
    /// The ideal-limit model's milliseconds, where there is a model.
    pub limit_ms: Option<f64>,
}

/// A figure of horizontal bars of milliseconds, each with a tick at the model's time.
pub fn bars(id: &str, title: &str, rows: &[Bar]) -> String {
    let longest = rows.iter().flat_map(|row| [row.ms, row.limit_ms.unwrap_or(0.0)]).fold(1e-9, f64::max);
    let total: f64 = rows.iter().map(|row| row.ms).sum();
    let length = |ms: f64| WIDTH * ms / longest;
    let mut svg = String::new();
    for (index, Bar { label, ms, limit_ms }) in rows.iter().enumerate() {
        let top = BAR * index as f64;
        svg += &text([LEFT - 8.0, top + 16.0], Anchor::End, "", label);
        let (y, long) = (top + 5.0, length(*ms));
        let _ =
            writeln!(svg, "<rect class=\"key s0\" x=\"{LEFT}\" y=\"{y}\" width=\"{long:.1}\" height=\"14\" rx=\"2\"/>");
        let (mut end, mut model) = (long, String::new());
        if let Some(limit) = *limit_ms {
            end = end.max(length(limit));
            model = format!(", model {limit:.2}");
            let (x, y1, y2) = (LEFT + length(limit), top + 2.0, top + 22.0);
            let _ = writeln!(svg, "<line class=\"limit\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{y1}\" y2=\"{y2}\"/>");
        }
        let told = format!("{ms:.2} ms, {:.0} %{model}", 100.0 * ms / total);
        svg += &text([LEFT + end + 6.0, top + 16.0], Anchor::Start, "", &told);
    }
    let size = [LEFT + 2.0 * WIDTH, BAR * rows.len() as f64];
    let picture = inline(id, title, size, &svg);
    format!("<figure class=\"sections\"><figcaption>{}</figcaption>\n{picture}</figure>\n", escape(title))
}
