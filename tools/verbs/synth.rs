//! `ivv synth`.

use crate::run::files::word;
use crate::ui::progress::Progress;
use crate::ui::screen::answer;
use ivv::internals::synth::{Options, Preset, Rig, write_capture};
use ivv::internals::words::count;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// The folder for the capture: a new or empty one, or an earlier capture of `ivv synth`, which is replaced.
    #[arg(short, long)]
    output: PathBuf,
    /// tiny (6 cameras, 64 x 48, 8 frames), small (10, 128 x 96, 12), outward, study (small with --offsets), room (20, 480 x 360,
    /// 60), or hard: small with --offsets, --colors, --masks and noise.
    #[arg(long, default_value = "small", value_parser = word::<Preset>)]
    preset: Preset,
    /// Seed of colours, textures, speeds and all noise.
    #[arg(long, default_value_t = 42)]
    seed: u64,
    /// Shifts each training camera's clock by a fraction of a frame.
    #[arg(long)]
    offsets: bool,
    /// Gives each training camera its own colour transform.
    #[arg(long)]
    colors: bool,
    /// Covers a corner of the images of every second training camera, and writes masks of it.
    #[arg(long)]
    masks: bool,
    /// Writes a calibration in which each training camera is turned by 0.2 degrees and shifted by 10 mm.
    #[arg(long)]
    bent: bool,
    /// The placement of the cameras: inward on an arc, outward on a hemisphere of 0.5 m, or moving outward. By default the
    /// preset's.
    #[arg(long, value_parser = word::<Rig>, value_name = "inward|outward|moving")]
    rig: Option<Rig>,
    /// Cameras in all, instead of the preset's.
    #[arg(long)]
    cameras: Option<u32>,
    /// Frames, instead of the preset's.
    #[arg(long)]
    frames: Option<u32>,
    /// Photographs of the static room, taken around the place of an outward rig, looking outward. They go to photos/ of the capture.
    #[arg(long)]
    photos: Option<u32>,
    /// WIDTHxHEIGHT of an image in pixels, instead of the preset's.
    #[arg(long, value_parser = size)]
    size: Option<(u32, u32)>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let options = options(args);
    let mut progress = Progress::new("synth", 0);
    let threads = ivv::internals::parallel::threads();
    let summary = write_capture(&args.output, &options, threads, &mut |done, total| {
        progress.reach(done, total, "pictures, point clouds and recordings");
    })?;
    let path = args.output.to_string_lossy();
    let (cameras, n_tests, frames) =
        (count(summary.cameras, "camera"), summary.test_cameras, count(summary.frames, "frame"));
    let (images, Options { width, height, .. }) = (count(summary.images, "image"), &options);
    let (points, outliers) = (count(summary.points, "point"), summary.outliers);
    let text = format!(
        "{path}: {cameras} ({n_tests} for testing), {frames}, {images} of {width} x {height}, {points} ({outliers} outliers)"
    );
    answer(json, &serde_json::json!({ "path": path, "options": options, "summary": summary }), text);
    Ok(())
}

fn options(args: &Args) -> Options {
    let mut options = args.preset.options(args.seed);
    options.offsets |= args.offsets;
    options.colors |= args.colors;
    options.masks |= args.masks;
    options.bent = args.bent;
    options.rig = args.rig.unwrap_or(options.rig);
    options.cameras = args.cameras.unwrap_or(options.cameras);
    options.frames = args.frames.unwrap_or(options.frames);
    options.photos = args.photos;
    (options.width, options.height) = args.size.unwrap_or((options.width, options.height));
    options
}

/// WIDTHxHEIGHT.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let number = |text: &str| text.parse::<u32>().map_err(|e| format!("{text}: {e}"));
    let (width, height) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, for example 128x96")?;
    Ok((number(width)?, number(height)?))
}
