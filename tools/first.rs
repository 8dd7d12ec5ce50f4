//! The first Gaussians of a run alone: `ivv train --only-init`.

use crate::files::write_scene;
use crate::progress::Progress;
use crate::screen::out;
use crate::start;
use crate::verbs::train::Args;
use ivv::formats::Own;
use ivv::train::{Config, first_gaussians};
use std::path::Path;

/// Writes what the training that `args` ask for would begin with to `file`.
pub fn write(args: &Args, file: &Path, json: bool) -> anyhow::Result<()> {
    // Higher degrees are 0 at first, and make the file larger.
    let config = Config { sh_degree: 0, ..args.settings.resolve()? };
    let capture = start::shown(start::capture(args, &config)?, &config);
    let mut progress = Progress::new("initialisation", 0);
    let initial = first_gaussians(&capture, &config, &mut |done, total| {
        progress.reach(done, total, "frames, pictures or depths")
    })?;
    drop(progress);
    write_scene(file, &initial.splats, &capture.normalisation(), &Own::new())?;
    let bytes = std::fs::metadata(file).map_or(0, |file| file.len());
    if json {
        let line = serde_json::json!({
            "path": file.to_string_lossy(), "from": initial.from, "gaussians": initial.splats.len(),
            "dynamic_gaussians": initial.splats.motion.len(), "bytes": bytes, "counts": initial.counts,
            "ratio": initial.counts.map(|counts| counts.ratio()),
        });
        out!("{line}");
    } else {
        out!("{}: {initial}; {bytes} bytes", file.display());
    }
    Ok(())
}
