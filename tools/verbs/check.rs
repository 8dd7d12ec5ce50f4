//! `ivv check`.

use crate::run::capture::{self, CaptureArgs};
use crate::ui::fault::{self, FaultyCapture};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// A capture: the project's own folder, plain COLMAP, transforms.json, LLFF, OpenSfM or Dynamic3DGaussians.
    capture: PathBuf,
    #[command(flatten)]
    read: CaptureArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let report = capture::check(&args.capture, &args.read.settings());
    let faulty = FaultyCapture::of(report.n_faults);
    if json {
        fault::results(&report, faulty.as_ref())?;
    } else {
        capture::print_report(&report);
    }
    faulty.map_or(Ok(()), Err)
}
