//! A profile as a page and as Markdown: the same tables.

use super::limit::Bound;
use super::passes::{Line, Profile};
use super::probe::Probe;
use super::roofline::si;
use crate::report::{Table, note, page, section};
use std::fmt::Write;

/// The tables with their titles, passes that take most time first.
fn tables(profile: &Profile) -> [(String, Table); 4] {
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
        count("in blocks that live", counters.live),
        count("active", counters.active),
        count("visible", counters.visible),
        count("intersections", counters.intersections),
        count("tiles", counters.tiles),
        count("pixels", counters.pixels),
        count("pixel-splats evaluated", counters.evaluated),
        count("pixel-splats added", counters.added),
        vec![
            "pixels finished early".to_owned(),
            format!("{:.1} %", 100.0 * counters.finished / counters.pixels.max(1.0)),
        ],
    ];
    let heads = ["pass", "calls", "median, ms", "p95, ms", "share", "MB", "Mflop", "limit, ms", "of limit", "by"];
    let percent = |f: f64| if f < 0.095 { format!("{:.1} %", 100.0 * f) } else { format!("{:.0} %", 100.0 * f) };
    let row = |line: &Line| {
        vec![
            line.label.clone(),
            format!("{:.0}", line.dispatches),
            format!("{:.3}", line.median_ms),
            format!("{:.3}", line.p95_ms),
            percent(line.share),
            format!("{:.3}", (line.cost.bytes + line.cost.copied + line.cost.filled) / 1e6),
            format!("{:.3}", line.cost.flops / 1e6),
            format!("{:.3}", line.limit_ms),
            percent(line.of_limit),
            line.bound.map(Bound::name).unwrap_or_default(),
        ]
    };
    let costs = [
        vec![format!("{sample} with timestamps, host's clock"), format!("{:.2} ms", overhead.timed_ms)],
        vec![format!("{sample} without"), format!("{:.2} ms", overhead.plain_ms)],
        vec!["ratio, 95 % interval".to_owned(), overhead.ratio.to_string()],
    ];
    let passes = profile.by_time().into_iter().chain([&profile.total]).map(row);
    [
        (format!("Passes of a {sample}"), Table::new(&heads, passes)),
        (format!("What a {sample} had to do"), Table::new(&["count", "mean"], counter_rows)),
        ("What the device can do".to_owned(), Table::new(&["probe", "rate"], peak_rows)),
        ("What the measuring costs".to_owned(), Table::new(&["", ""], costs)),
    ]
}

fn told(profile: &Profile) -> String {
    let Profile { subject, samples, sample, device, total, barriers, shaders, .. } = profile;
    format!(
        "{subject}: {samples} {sample}s on {}, {}, subgroups of {}; {:.0} passes and {barriers:.0} barriers a {sample}; kernels \
         {shaders}",
        device.name, device.driver, device.subgroup_size, total.dispatches
    )
}

impl Profile {
    pub fn html(&self) -> String {
        let roofline = self.chart().inline("roofline", &format!("roofline of {}", self.subject));
        let mut body = section("Roofline", &(roofline + &note(MEANING)));
        body.extend(tables(self).iter().map(|(title, table)| section(title, &table.html())));
        page(&format!("Profile of {}", self.subject), &note(&told(self)), &body)
    }

    pub fn markdown(&self) -> String {
        let mut text = format!("{}.\n\n{MEANING}\n", told(self));
        for (title, table) in tables(self) {
            let _ = write!(text, "\n## {title}\n\n{}", table.markdown());
        }
        text
    }

    pub fn terminal(&self) -> String {
        tables(self).iter().map(|(title, table)| format!("{title}\n{}", table.plain())).collect()
    }
}

const MEANING: &str = "A circle's area grows with its pass's share of the time. The limit of a pass is the time that its \
    least bytes, scattered rows, flops, powers of two, shuffles or atomic additions take at the measured peaks, whichever \
    is longest, and its dispatches; the bytes are those that memory must move whatever the caches.";
