//! `ivv eval`.

use crate::run::device::DeviceArgs;
use crate::run::files::{config_of, make_folder, totals};
use crate::run::scoring::{Scorer, warn_of_shared_pictures};
use crate::run::source::{Gaussians, Source};
use crate::ui::screen::{alert, out, print_json, print_table};
use anyhow::Context;
use ivv::internals::scene::Mapped;
use ivv::internals::stage::Renderer;
use ivv::internals::train::{Evaluation, METRICS_OF, Run, SceneScores, SceneSize, Scores};
use ivv::internals::words::count;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// The folder of a run of `ivv train`. If it has not ended, its newest checkpoint is scored, into RUN/eval/step-STEP.
    run: PathBuf,
    /// Another scene to score, with the rendering constants of its file or the usual ones. The scores go to RUN/eval/NAME.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Where the run's capture is now, if it has moved.
    #[arg(long)]
    capture: Option<PathBuf>,
    /// Fits the time offset of every test camera to its own images, and also scores at these offsets.
    #[arg(long)]
    fit_offsets: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The name of the scores of `scene`, from its folder or file, and the steps of its run, or 0.
fn own_name(scene: &Path) -> anyhow::Result<(OsString, u64)> {
    let path = std::fs::canonicalize(scene).with_context(|| format!("{}: cannot be found", scene.display()))?;
    let of_folder = path.file_name() == Some(OsStr::new("scene.ply"));
    let folder = if of_folder { path.parent() } else { path.is_dir().then_some(&*path) };
    let name = folder.map_or(path.file_name(), Path::file_name);
    let steps = folder.and_then(|folder| totals(folder)["steps"].as_u64());
    Ok((name.unwrap_or(OsStr::new("scene")).to_owned(), steps.unwrap_or(0)))
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let mut run = Run::read(&args.run)?;
    let config = config_of(&args.run)?;
    let (capture, changes) = run.compare_capture(args.capture.as_deref())?;
    let capture = run.in_training(capture);
    if !changes.is_empty() {
        alert!(
            "warning: {} differs from what the run was trained on: {changes}. The scores are for its present state",
            capture.path.display()
        );
    }
    warn_of_shared_pictures(&run);
    let source = Source::open(args.scene.as_ref().unwrap_or(&args.run))?;
    if args.scene.is_some() {
        // Score what other viewers draw, which do not know the run's constants.
        run.constants = run.constants_of_training(source.look.constants);
    }
    let loaded = source.seen()?;
    let scores = args.run.join("eval");
    let (output, steps) = match (&args.scene, loaded.checkpoint_step) {
        (Some(scene), _) => own_name(scene).map(|(name, steps)| (scores.join(name), steps))?,
        (None, Some(step)) => (scores.join(format!("step-{step:08}")), step),
        (None, None) => (args.run.clone(), totals(&args.run)["steps"].as_u64().unwrap_or(0)),
    };
    make_folder(&output)?;
    let gpu = args.device.open()?;
    let scorer = Scorer { gpu: &gpu, capture: &capture, run: &run, config: &config };
    let step = loaded.checkpoint_step.unwrap_or(steps);
    let mut fits = BTreeMap::new();
    let (renderer, size) = match loaded.splats {
        Gaussians::Whole(splats) => {
            let splats = run.world.splats(&splats.by_degree());
            if args.fit_offsets {
                fits = scorer.fitted_offsets(&splats)?;
            }
            (Renderer::new(gpu.clone(), &splats, run.constants)?, SceneSize::of(&splats))
        }
        Gaussians::Parts(mut clip) => {
            anyhow::ensure!(
                !args.fit_offsets,
                "--fit-offsets does not support joined clips; give the run folder of a segment"
            );
            let (size, world) = (SceneSize::of_parts(&mut *clip)?, run.world);
            let clip = Box::new(Mapped::new(clip, move |splats| world.splats(&splats)));
            (Renderer::of_parts(gpu.clone(), clip, run.constants)?, size)
        }
    };
    let (scores, examples) = scorer.score_all(renderer, size, &loaded.file, &fits, step, &output)?;
    let Some(scores) = scores else {
        let (reason, remedy) = ("no test camera has an image that shows anything", "train again with --test-cameras");
        return Err(ivv::Error::data(&Run::file(&args.run), "test_cameras", reason, remedy).into());
    };
    let report = scorer.report(Some(&scores), &examples, &args.run, &output)?;
    if json {
        return print_json(&scores);
    }
    print(&scores);
    out!("{}", report.display());
    Ok(())
}

fn print(scores: &SceneScores) {
    let Evaluation { views, mean, .. } = &scores.evaluation;
    let mut means = vec![("mean", mean)];
    means.extend(scores.mean_at_fitted_offsets.iter().map(|scores| ("mean at fitted time offsets", scores)));
    if let Some([seams, elsewhere]) = &scores.mean_at_seams_and_elsewhere {
        means.extend([("mean at seams", seams), ("mean elsewhere", elsewhere)]);
    }
    let number = |value: Option<f64>, decimals| value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"));
    let row = |(view, s): (&str, &Scores)| {
        let psnr =
            [Some(s.psnr), Some(s.psnr_aligned), s.psnr_foreground, s.psnr_covisible].map(|psnr| number(psnr, 3));
        let others = [Some(s.ssim), s.lpips, s.lpips_unscaled].map(|score| number(score, 4));
        let flicker = s.flicker.zip(s.flicker_true);
        let flicker = flicker.map_or("-".to_owned(), |(own, truth)| format!("{own:.4} ({truth:.4})"));
        [vec![view.to_owned()], psnr.to_vec(), others.to_vec(), vec![number(Some(s.l1), 5), flicker]].concat()
    };
    let psnr = ["view", "PSNR, dB", "aligned", "foreground", "covisible"];
    let others = ["SSIM", "LPIPS", "LPIPS unscaled", "L1", "flicker (true)"];
    let rows = views.iter().map(|v| (v.view.as_str(), &v.scores)).chain(means).map(row);
    print_table(&[psnr, others].concat(), rows);
    for (name, definition) in &scores.metrics {
        out!("{name}: {definition}");
    }
    match &scores.lpips_trunk {
        Some(trunk) => out!("LPIPS compares features of {trunk}"),
        None => out!("LPIPS is not measured: the run has no weights for it (`--set loss.lpips_weights=FILE`)"),
    }
    out!("of {METRICS_OF}");
    let SceneScores { sh_degree, bytes, frames_per_second, device, .. } = scores;
    let n = count(scores.gaussians, "Gaussian");
    out!("{n} of SH degree {sh_degree}, {bytes} bytes; {frames_per_second:.1} frames per second on {device}");
}
