//! `ivv train --only-init`: the first Gaussians of a run.

use crate::run::files::write_scene;
use crate::ui::progress::Progress;
use crate::ui::screen::answer;
use crate::verbs::train::args::Args;
use crate::verbs::train::setup;
use ivv::internals::formats::Own;
use ivv::internals::train::{Config, first_gaussians};
use std::path::Path;

pub fn write(args: &Args, file: &Path, json: bool) -> anyhow::Result<()> {
    // Higher degrees are 0 at first, and make the file larger.
    let config = Config { sh_degree: 0, ..args.settings.resolve()? };
    let capture = setup::training_capture(setup::capture(args, &config)?, &config);
    let mut progress = Progress::new("initialisation", 0);
    let initial = first_gaussians(&capture, &config, &mut |done, total| {
        progress.reach(done, total, "frames, pictures or depths")
    })?;
    drop(progress);
    write_scene(file, &initial.splats, &capture.normalisation(), &Own::new())?;
    let bytes = std::fs::metadata(file).map_or(0, |file| file.len());
    let line = serde_json::json!({
        "path": file.to_string_lossy(), "from": initial.from, "gaussians": initial.splats.len(),
        "dynamic_gaussians": initial.splats.motion.len(), "bytes": bytes, "counts": initial.counts,
        "ratio": initial.counts.map(|counts| counts.ratio()),
    });
    answer(json, &line, format_args!("{}: {initial}; {bytes} bytes", file.display()));
    Ok(())
}
