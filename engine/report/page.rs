//! HTML pages in one file, and bars.

use super::plot::{Anchor, inline, text};
use std::fmt::Write;

/// Height of a bar with its distance to the next; where bars begin; the longest.
const BAR: f64 = 26.0;
const LEFT: f64 = 130.0;
const WIDTH: f64 = 190.0;

/// Text for HTML and SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// `header` and `body` are HTML.
pub fn page(title: &str, header: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{}{}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n{header}</header>\n{body}</body>\n</html>\n",
        include_str!("plot.css"),
        include_str!("style.css")
    )
}

pub fn section(heading: &str, body: &str) -> String {
    format!("<section>\n<h2>{}</h2>\n{body}</section>\n", escape(heading))
}

pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escape(text))
}

#[derive(Clone, Debug)]
pub struct Bar {
    pub label: String,
    pub ms: f64,
}

/// Horizontal bars.
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
        let value = format!("{ms:.2} ms, {:.0} %", 100.0 * ms / total);
        svg += &text([LEFT + long + 6.0, top + 16.0], Anchor::Start, "", &value);
    }
    let size = [LEFT + 2.0 * WIDTH, BAR * rows.len() as f64];
    let picture = inline(id, title, size, &svg);
    format!("<figure class=\"sections\"><figcaption>{}</figcaption>\n{picture}</figure>\n", escape(title))
}
