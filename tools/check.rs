//! `ivv check`.

use crate::fault;
use crate::screen::out;
use ivv::scene::capture::{CaptureSettings, Report, check_capture};
use ivv::words::count;
use std::path::PathBuf;

/// Options of `ivv check`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture: the project's own folder, plain COLMAP, transforms.json or Dynamic3DGaussians.
    capture: PathBuf,
    /// Names of the test cameras, instead of those that the capture declares.
    #[arg(long, value_delimiter = ',')]
    test_cameras: Option<Vec<String>>,
    /// Every n-th image is a test image where the capture declares none; 0 for none.
    #[arg(long, default_value_t = CaptureSettings::default().test_every)]
    test_every: usize,
    /// Uses only the first frames of the clip.
    #[arg(long)]
    max_frames: Option<u32>,
    /// Leaves out images whose file is missing, which are faults otherwise.
    #[arg(long)]
    skip_missing: bool,
    /// Folder of the images of a plain COLMAP project, relative to the capture.
    #[arg(long, default_value = "images")]
    images: PathBuf,
    /// Scales the calibration to the size of the images. Without it a different size is a fault.
    #[arg(long)]
    rescale: bool,
    /// Also uses the foreground masks of Dynamic3DGaussians as masks.
    #[arg(long)]
    foreground_masks: bool,
}

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
    let settings = CaptureSettings {
        test_cameras: args.test_cameras.clone(),
        test_every: args.test_every,
        max_frames: args.max_frames,
        skip_missing: args.skip_missing,
        images: args.images.clone(),
        rescale: args.rescale,
        foreground_masks: args.foreground_masks,
        ..CaptureSettings::default()
    };
    let report = check_capture(&args.capture, &settings);
    let faulty = (report.n_faults > 0).then(|| anyhow::Error::from(Faulty(report.n_faults)));
    if json {
        fault::results(&report, faulty.as_ref())?;
    } else {
        print(&report);
    }
    faulty.map_or(Ok(()), Err)
}

/// Prints a report as text.
pub fn print(report: &Report) {
    let format = if report.format.is_empty() { "unknown format" } else { &report.format };
    out!("{}: {format}", report.path.display());
    out!("cameras: {}, of which {} for testing", report.n_cameras, report.n_test_cameras);
    out!("frames:  {}, {} per second", report.n_frames, report.fps);
    let mib = report.bytes_decoded as f64 / f64::from(1 << 20);
    let (n, n_masks, n_foregrounds) = (report.n_images, report.n_masks, report.n_foregrounds);
    out!("images:  {n}, {n_masks} with a mask, {n_foregrounds} with a foreground mask; {mib:.1} MiB decoded");
    out!("priors:  {} images with flow, {} with depth", report.n_flows, report.n_depths);
    let per_frame = if report.has_frame_points { "; every frame has its own" } else { "" };
    out!("points:  {}{per_frame}", report.n_points);
    for note in &report.notes {
        out!("note:    {note}");
    }
    for fault in &report.faults {
        out!("fault:   {fault}");
    }
    let n_left_out = report.n_faults - report.faults.len() as u64;
    if n_left_out > 0 {
        out!("and {} more", count(n_left_out, "fault"));
    }
}
