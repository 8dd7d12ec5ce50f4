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
}

/// A figure of horizontal bars of milliseconds.
pub fn bars(id: &str, title: &str, rows: &[Bar]) -> String {
    let longest = rows.iter().map(|row| row.ms).fold(1e-9, f64::max);
    let total: f64 = rows.iter().map(|row| row.ms).sum();
    let mut svg = String::new();
    for (index, Bar { label, ms }) in rows.iter().enumerate() {
        let top = BAR * index as f64;
        svg += &text([LEFT - 8.0, top + 16.0], Anchor::End, "", label);
        let (y, long) = (top + 5.0, WIDTH * ms / longest);
        let _ =
            writeln!(svg, "<rect class=\"key s0\" x=\"{LEFT}\" y=\"{y}\" width=\"{long:.1}\" height=\"14\" rx=\"2\"/>");
        let told = format!("{ms:.2} ms, {:.0} %", 100.0 * ms / total);
        svg += &text([LEFT + long + 6.0, top + 16.0], Anchor::Start, "", &told);
    }
    let size = [LEFT + 2.0 * WIDTH, BAR * rows.len() as f64];
    let picture = inline(id, title, size, &svg);
    format!("<figure class=\"sections\"><figcaption>{}</figcaption>\n{picture}</figure>\n", escape(title))
}
