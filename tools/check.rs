//! `ivv check`.

use crate::capture::{self, CaptureArgs};
use ivv::scene::capture::Report;
use std::path::PathBuf;

/// Options of `ivv check`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture: the project's own folder, plain COLMAP, transforms.json or Dynamic3DGaussians.
    capture: PathBuf,
    #[command(flatten)]
    read: CaptureArgs,
}

/// Files that are listed of faults of one kind, after the first.
const LISTED: usize = 3;

/// What [`run`] returns for a capture with faults, which it has printed.
#[derive(Debug)]
pub struct Faulty(pub u64);

impl std::fmt::Display for Faulty {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the capture has {} fault{}", self.0, if self.0 == 1 { "" } else { "s" })
    }
}

impl std::error::Error for Faulty {}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let report = capture::check(&args.capture, &args.read.settings());
    if json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print(&report);
    }
    if report.n_faults > 0 { Err(Faulty(report.n_faults).into()) } else { Ok(()) }
}

/// Prints a report as text.
pub fn print(report: &Report) {
    let format = if report.format.is_empty() { "unknown format" } else { &report.format };
    println!("{}: {format}", report.path.display());
    // Of what could not be read there is nothing to count.
    if report.n_images > 0 {
        print_counts(report);
    }
    for note in &report.notes {
        println!("note:    {note}");
    }
    for group in report.grouped() {
        println!("fault:   {}", group[0]);
        let others = group.iter().skip(1).map(|fault| {
            let file = fault.file.strip_prefix(&report.path).unwrap_or(&fault.file).display();
            if fault.place.is_empty() { file.to_string() } else { format!("{file}, {}", fault.place) }
        });
        match group.len() - 1 {
            0 => {}
            n if n <= LISTED => println!("         the same: {}", others.collect::<Vec<_>>().join("; ")),
            n => {
                let listed = others.take(LISTED).collect::<Vec<_>>().join("; ");
                println!("         the same {n} times more: {listed}; ...");
            }
        }
    }
    let n_left_out = report.n_faults - report.faults.len() as u64;
    if n_left_out > 0 {
        println!("and {n_left_out} more faults");
    }
}

/// Prints what a capture holds.
fn print_counts(report: &Report) {
    println!("cameras: {}, {} of them for testing", report.n_cameras, report.n_test_cameras);
    println!("frames:  {}, {} per second", report.n_frames, report.fps);
    let mib = report.bytes_decoded as f64 / f64::from(1 << 20);
    let (n, n_masks, n_foregrounds) = (report.n_images, report.n_masks, report.n_foregrounds);
    println!("images:  {n}, {n_masks} with a mask, {n_foregrounds} with a foreground mask; {mib:.1} MiB decoded");
    println!("priors:  {} images with flow, {} with depth", report.n_flows, report.n_depths);
    let per_frame = if report.has_frame_points { "; every frame has its own" } else { "" };
    println!("points:  {}{per_frame}", report.n_points);
}
