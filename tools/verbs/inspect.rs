//! `ivv inspect`.

use crate::run::files::totals;
use crate::run::review;
use crate::run::source::{LoadedScene, Source, is_run};
use crate::run::views::ViewArgs;
use crate::ui::screen::{answer, out, print_json, say};
use ivv::internals::formats::FourDgs;
use ivv::internals::scene::{Quantiles, Summary, write_views};
use ivv::internals::train::Review;
use ivv::internals::words::count;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(mut_args(of_cameras))]
pub struct Args {
    /// A scene file of any format, or the folder of a run: its scene.ply, or its newest checkpoint. With --cameras a capture or a
    /// run.
    #[arg(value_name = "SCENE|RUN|CAPTURE")]
    scene: PathBuf,
    /// Instead writes the views of the capture, or of the run's capture, to this file (JSON).
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// Where the run's capture is now, if it has moved.
    #[arg(long)]
    capture: Option<PathBuf>,
    #[command(flatten)]
    views: ViewArgs,
}

fn of_cameras(arg: clap::Arg) -> clap::Arg {
    if ["scene", "cameras"].contains(&arg.get_id().as_str()) { arg } else { arg.requires("cameras") }
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    if let Some(file) = &args.cameras {
        return cameras(args, file, json);
    }
    if FourDgs::is(&args.scene) {
        return clip(&args.scene, json);
    }
    let LoadedScene { file: scene, splats, checkpoint_step, notes } = Source::open(&args.scene)?.scene()?;
    let reviews = reviews(&scene);
    let summary = splats.by_degree().summary();
    if json {
        let mut value = serde_json::to_value(&summary)?;
        if let Some(step) = checkpoint_step {
            value["checkpoint_step"] = step.into();
        }
        value["reviews"] = serde_json::to_value(&reviews)?;
        value["notes"] = serde_json::to_value(&notes)?;
        return print_json(&value);
    }
    print(&scene, &summary);
    for review in &reviews {
        out!("{}", review::describe(review));
    }
    Ok(())
}

fn cameras(args: &Args, file: &Path, json: bool) -> anyhow::Result<()> {
    let source = &args.scene;
    let views = if is_run(source) {
        args.views.of_run(source, args.capture.as_deref(), None)?
    } else {
        anyhow::ensure!(
            args.capture.is_none(),
            "--capture: expected a run, found {}, which is none; leave it out",
            source.display()
        );
        args.views.of_capture(source, None)?
    };
    write_views(file, &views)?;
    let line = serde_json::json!({ "path": file.to_string_lossy(), "views": views.len() });
    answer(json, &line, format_args!("{}: {}", file.display(), count(views.len(), "view")));
    Ok(())
}

/// Inspects a `.4dgs`. Its contents are printed even if its Gaussians cannot be converted to ours.
fn clip(scene: &Path, json: bool) -> anyhow::Result<()> {
    let file = FourDgs::read(scene)?;
    let (contents, notes) = (file.summary(), file.notes());
    let summary = file.splats().map(|splats| splats.by_degree().summary());
    if json {
        let mut value = summary.as_ref().map_or_else(|_| Ok(serde_json::json!({})), serde_json::to_value)?;
        value["fourdgs"] = serde_json::to_value(&contents)?;
        value["notes"] = serde_json::to_value(&notes)?;
        return print_json(&value);
    }
    match &summary {
        Ok(summary) => print(scene, summary),
        Err(fault) => {
            out!("{}: {} Gaussians, SH degree {}", scene.display(), contents.gaussian_count, contents.sh_degree);
            out!("at one moment: {fault}");
        }
    }
    notes.iter().for_each(|note| say!("{}: {note}", scene.display()));
    let (seconds, cutoff) = (contents.duration_sec, contents.cutoff);
    let (chunks, library) = (count(contents.chunk_intervals.len(), "chunk"), &contents.library);
    out!("clip:          {seconds:.3} s in {chunks}, by {library}; temporal factors from {cutoff:.4}");
    for source in file.sounds().sources() {
        let kind = if source.spatial { "from a place" } else { "from everywhere" };
        out!("sound:         `{}`, {:.3} s of {}, {kind}", source.name, source.duration_sec, source.codec);
    }
    Ok(())
}

fn print(scene: &Path, summary: &Summary) {
    let mib = |bytes: u64| format!("{:.1}", bytes as f64 / f64::from(1 << 20));
    let Summary { n, n_static, n_dynamic, sh_degree, .. } = summary;
    let n = count(*n, "Gaussian");
    out!("{}: {n}, {n_static} static and {n_dynamic} dynamic, SH degree {sh_degree}", scene.display());
    let degrees = [summary.static_by_degree, summary.dynamic_by_degree];
    let [of_static, of_dynamic] = degrees.map(|counts| counts.map(|n| n.to_string()).join(" / "));
    let parameters = mib(summary.parameter_bytes);
    out!(
        "modelled:      {parameters} MiB of parameters; SH degree 0 / 1 / 2 / 3: {of_static} static, {of_dynamic} dynamic"
    );
    out!("as PLY:        {} bytes each, {} MiB in all", summary.ply_bytes_per_gaussian, mib(summary.ply_bytes));
    let [total, geometry, motion] = [summary.device.total, summary.device.geometry, summary.device.motion].map(mib);
    let bands = summary.device.sh_bands.iter().map(|bytes| mib(*bytes)).collect::<Vec<_>>().join(" + ");
    out!("on the device: {total} MiB: geometry {geometry}, motion {motion}, SH by band {bands}");
    if let Some(b) = &summary.bounds {
        out!("extent:        {:?} to {:?}; 98 % within {:?} to {:?}", b.min, b.max, b.p01, b.p99);
    }
    let line = |q: &Quantiles| format!("{:.4} / {:.4} / {:.4}", q.p01, q.p50, q.p99);
    if let (Some(opacity), Some(scale)) = (&summary.opacity, &summary.scale) {
        out!("1 % / median / 99 %: opacity {}, standard deviation {}", line(opacity), line(scale));
    }
    if let Some([first, last]) = summary.time_range {
        out!("time:          peaks from {first} to {last}");
    }
    if summary.n_non_finite > 0 {
        out!("not finite:    {}, never drawn", count(summary.n_non_finite, "Gaussian"));
    }
}

/// The reviews of the run of `scene`; empty for another file.
fn reviews(scene: &Path) -> Vec<Review> {
    let totals = totals(scene.parent().unwrap_or(scene));
    serde_json::from_value(totals["reviews"].clone()).unwrap_or_default()
}
