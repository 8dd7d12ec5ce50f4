//! The report of a capture, as text.

use crate::ui::screen::out;
use ivv::internals::scene::capture::{Fault, Report};
use ivv::internals::words::count;

/// Most files in a line of equal faults.
const NAMED: usize = 3;

fn one_line(faults: &[&Fault]) -> String {
    let [first, _, ..] = faults else { return faults.iter().map(|fault| fault.to_string()).collect() };
    let place = |fault: &&Fault| match fault.place.as_str() {
        "" => fault.file.display().to_string(),
        place => format!("{} ({place})", fault.file.display()),
    };
    let named: Vec<String> = faults.iter().take(NAMED).map(place).collect();
    let more = if faults.len() > NAMED { ", ..." } else { "" };
    // Numbers in them may differ.
    let as_one = if faults.iter().all(|fault| fault.reason == first.reason) { ":" } else { ", as:" };
    format!("{} times{as_one} {}; {}: {}{more}", faults.len(), first.reason, first.remedy, named.join(", "))
}

pub fn print(report: &Report) {
    let format = if report.format.is_empty() { "unknown format" } else { &report.format };
    out!("{}: {format}", report.path.display());
    if report.n_cameras > 0 {
        print_contents(report);
    }
    for note in &report.notes {
        out!("note:    {note}");
    }
    for faults in report.grouped() {
        out!("fault:   {}", one_line(&faults));
    }
    let n_left_out = report.n_faults - report.faults.len() as u64;
    if n_left_out > 0 {
        out!("and {} more", count(n_left_out, "fault"));
    }
}

fn print_contents(report: &Report) {
    let n_tests = report.n_test_cameras;
    let for_testing = if n_tests > 0 { format!(", of which {n_tests} for testing") } else { String::new() };
    out!("cameras: {}{for_testing}", report.n_cameras);
    if report.n_photos > 0 {
        out!("photos:  {} of the static scene, taken at another time", report.n_photos);
    }
    out!("frames:  {}, {} per second", report.n_frames, report.fps);
    let mib = report.bytes_decoded as f64 / f64::from(1 << 20);
    let masks = [(report.n_masks, "a mask"), (report.n_foregrounds, "a foreground mask")];
    let parts = masks.into_iter().chain([(report.n_flows, "flow"), (report.n_depths, "depth")]);
    let with: String = parts.filter(|(n, _)| *n > 0).map(|(n, what)| format!(", {n} with {what}")).collect();
    out!("images:  {}{with}; {mib:.1} MiB decoded", report.n_images);
    if report.n_sounds > 0 {
        out!("sound:   {}", count(report.n_sounds as u64, "file"));
    }
    let per_frame = if report.has_frame_points { "; every frame has its own" } else { "" };
    if report.n_points > 0 || report.has_frame_points {
        out!("points:  {}{per_frame}", report.n_points);
    }
}
