//! A profile as a page and as Markdown: the same tables.

use super::probe::Probe;
use super::roofline::si;
use super::{Line, Profile};
use crate::report::escape;
use std::fmt::Write;

/// A table: its title, its heads, its rows; the first column is text.
pub(super) struct Table {
    pub title: String,
    pub heads: Vec<&'static str>,
    pub rows: Vec<Vec<String>>,
}

/// The tables, with the passes of `lines`.
fn tables(profile: &Profile, lines: &[&Line]) -> Vec<Table> {
    let Profile { peaks, counters, overhead, sample, .. } = profile;
    let mut peak_rows: Vec<Vec<String>> = Probe::ALL
        .into_iter()
        .filter(|probe| peaks.of(*probe) > 0.0)
        .map(|probe| vec![probe.name().to_owned(), format!("{}{}", si(peaks.of(probe)), probe.unit())])
        .collect();
    peak_rows.push(vec!["empty dispatch, between timestamps".to_owned(), format!("{:.2} us", peaks.dispatch_ns / 1e3)]);
    let whole = format!("{:.2} us", peaks.dispatch_and_barrier_ns / 1e3);
    peak_rows.push(vec!["the same with barrier and label".to_owned(), whole]);
    let count = |what: &str, n: f64| vec![what.to_owned(), format!("{n:.0}")];
    let counter_rows = vec![
        count("Gaussians", counters.gaussians),
        count("active", counters.active),
        count("visible", counters.visible),
        count("intersections", counters.intersections),
        count("tiles", counters.tiles),
        count("pixels", counters.pixels),
        count("pixel-splats evaluated", counters.evaluated),
        count("pixel-splats added", counters.added),
        vec!["pixels finished early".to_owned(), format!("{:.1} %", 100.0 * profile.early_stop_rate())],
    ];
    let has_units = profile.total.of_unit_limit.is_some();
    let mut heads =
        vec!["pass", "calls", "median, ms", "p95, ms", "share", "MB", "Mflop", "limit, ms", "of limit", "by"];
    heads.extend(has_units.then_some("of unit time"));
    let percent = |f: f64| if f < 0.095 { format!("{:.1} %", 100.0 * f) } else { format!("{:.0} %", 100.0 * f) };
    let row = |line: &Line| {
        let mut row = vec![
            line.label.clone(),
            format!("{:.0}", line.dispatches),
            format!("{:.3}", line.median_ms),
            format!("{:.3}", line.p95_ms),
            percent(line.share),
            format!("{:.3}", (line.cost.bytes + line.cost.copied + line.cost.filled) / 1e6),
            format!("{:.3}", line.cost.flops / 1e6),
            format!("{:.3}", line.limit_ms),
            percent(line.of_limit),
            line.bound.map_or("", super::Bound::name).to_owned(),
        ];
        row.extend(has_units.then(|| line.of_unit_limit.map_or(String::new(), percent)));
        row
    };
    let ratio = overhead.ratio;
    vec![
        Table {
            title: format!("Passes of a {sample}"),
            heads,
            rows: lines.iter().copied().chain([&profile.total]).map(row).collect(),
        },
        Table { title: format!("What a {sample} had to do"), heads: vec!["count", "mean"], rows: counter_rows },
        Table { title: "What the device can do".to_owned(), heads: vec!["probe", "rate"], rows: peak_rows },
        Table {
            title: "What the measuring costs".to_owned(),
            heads: vec!["", ""],
            rows: vec![
                vec![format!("{sample} with timestamps, host's clock"), format!("{:.2} ms", overhead.timed_ms)],
                vec![format!("{sample} without"), format!("{:.2} ms", overhead.plain_ms)],
                vec!["ratio, 95 % interval".to_owned(), ratio.to_string()],
            ],
        },
    ]
}

/// What was measured, where and of which kernels.
fn told(profile: &Profile) -> String {
    let device = &profile.device;
    format!(
        "{}: {} {}s on {}, {}, subgroups of {}; kernels {}",
        profile.subject,
        profile.samples,
        profile.sample,
        device.name,
        device.driver,
        device.subgroup_size,
        profile.shaders
    )
}

pub(super) fn html(profile: &Profile) -> String {
    let title = escape(&profile.subject);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Profile of {title}</title>\n\
         <style>\n{}</style>\n</head>\n<body>\n<header>\n<h1>Profile of {title}</h1>\n\
         <p class=\"note\">{}</p>\n</header>\n<section>\n<h2>Roofline</h2>\n{}\
         <p class=\"note\">{}</p>\n",
        crate::report::STYLE,
        escape(&told(profile)),
        profile.roofline(),
        MEANING
    );
    if profile.total.of_unit_limit.is_some() {
        let _ = writeln!(page, "<p class=\"note\">{}</p>", UNITS.replace('`', ""));
    }
    page += "</section>\n";
    for Table { title, heads, rows } in tables(profile, &profile.by_time()) {
        let class = |column: usize| if column == 0 { "" } else { " class=\"n\"" };
        let heads: String = heads.iter().enumerate().map(|(k, head)| format!("<th{}>{head}</th>", class(k))).collect();
        let _ = writeln!(page, "<section>\n<h2>{title}</h2>\n<div class=\"scroll\"><table>\n<tr>{heads}</tr>");
        for row in rows {
            let cells = row.iter().enumerate().map(|(k, cell)| format!("<td{}>{}</td>", class(k), escape(cell)));
            let _ = writeln!(page, "<tr>{}</tr>", cells.collect::<String>());
        }
        let _ = writeln!(page, "</table></div>\n</section>");
    }
    page + "</body>\n</html>\n"
}

const MEANING: &str = "A circle's area grows with its pass's share of the time. The limit of a pass is the time that its \
    least bytes, scattered rows, flops, powers of two, shuffles or atomic additions take at the measured peaks, whichever \
    is longest, and its dispatches; the bytes are those that memory must move whatever the caches.";

/// What the last column says, where there is one.
const UNITS: &str = "The last column is another measure, for CPU drivers alone: the unit times of `shaders-glsl/table.rs`, \
    what kernels took that were written for lavapipe and nothing else, over the time measured.";

pub(super) fn markdown(profile: &Profile) -> String {
    let units = if profile.total.of_unit_limit.is_some() { UNITS } else { "" };
    let mut text = format!("{}.\n\n{MEANING} {units}\n", told(profile));
    for Table { title, heads, rows } in tables(profile, &profile.by_time()) {
        let rule: Vec<&str> = heads.iter().enumerate().map(|(k, _)| if k == 0 { "---" } else { "---:" }).collect();
        let _ = writeln!(text, "\n## {title}\n\n| {} |\n| {} |", heads.join(" | "), rule.join(" | "));
        for row in rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
    }
    text
}

pub(super) fn terminal(profile: &Profile) -> String {
    plain(&tables(profile, &profile.by_time()))
}

/// Tables for a terminal.
pub(super) fn plain(tables: &[Table]) -> String {
    let mut text = String::new();
    for Table { title, heads, rows } in tables {
        let heads: Vec<String> = heads.iter().map(|head| (*head).to_owned()).collect();
        let width =
            |column: usize| rows.iter().chain([&heads]).map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..heads.len()).map(width).collect();
        let _ = writeln!(text, "{title}");
        for row in [&heads].into_iter().chain(rows) {
            let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, width))| {
                if column == 0 { format!("{cell:<width$}") } else { format!("  {cell:>width$}") }
            });
            let _ = writeln!(text, "  {}", cells.collect::<String>().trim_end());
        }
    }
    text
}
