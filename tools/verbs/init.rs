//! `ivv init`.

use crate::files::write_scene;
use crate::progress::Progress;
use crate::screen::out;
use ivv::formats::Own;
use ivv::scene::capture::Capture;
use ivv::train::{Config, Init, initialise};
use std::path::PathBuf;

/// Options of `ivv init`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture folder with points of every frame and, for `--mode flow`, optical flow.
    capture: PathBuf,
    /// The scene to write, a PLY in the capture's own frame.
    #[arg(short, long)]
    output: PathBuf,
    /// flow: static Gaussians from the points of the reference frame, dynamic ones from the moving points of every frame.
    /// concat: every point of every frame.
    #[arg(long, default_value = "flow")]
    mode: Mode,
    /// With --mode flow: a point moves if its flow exceeds this in two views, or in its only one; pixels per frame.
    #[arg(long, default_value_t = Config::default().init_flow_threshold)]
    threshold: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Mode {
    Flow,
    Concat,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let threshold = args.threshold;
    anyhow::ensure!(threshold >= 0.0, "--threshold: expected pixels per frame, 0 or more, found {threshold}");
    let capture = Capture::open(&args.capture)?;
    let world = capture.normalisation();
    let capture = capture.transformed(&world);
    let init = if args.mode == Mode::Flow { Init::Flow } else { Init::Concat };
    let settings = Config { init, init_flow_threshold: threshold, sh_degree: 0, ..Config::default() };
    // A scene of all points is what is asked for; a run from it has a budget.
    let config = Config { max_gaussians: usize::MAX, ..settings };
    let mut progress = Progress::new("initialisation", 0);
    let initial =
        initialise(&capture, &config, &mut |done, total| progress.reach(done, total, "frames, pictures or depths"))?;
    drop(progress);
    write_scene(&args.output, &initial.splats, &world, &Own::new())?;
    let bytes = std::fs::metadata(&args.output).map_or(0, |file| file.len());
    if json {
        let line = serde_json::json!({
            "path": args.output.to_string_lossy(), "from": initial.from, "gaussians": initial.splats.len(),
            "dynamic_gaussians": initial.splats.motion.len(), "bytes": bytes, "counts": initial.counts,
            "ratio": initial.counts.map(|counts| counts.ratio()),
        });
        out!("{line}");
    } else {
        out!("{}: {initial}; {bytes} bytes", args.output.display());
    }
    Ok(())
}
