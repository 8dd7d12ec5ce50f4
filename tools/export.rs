//! `ivv export`.

use crate::export_clip::ClipArgs;
use crate::screen::out;
use crate::shown;
use crate::views::clip_time;
use ivv::scene::{write_ply, write_splat, write_spz};
use std::path::{Path, PathBuf};

/// Options of `ivv export`.
#[derive(clap::Args)]
pub struct Args {
    /// A scene file, or the folder of a run: its scene.ply, or the newest checkpoint where it has not ended.
    scene: PathBuf,
    /// The file to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Its format. By default from the name's ending. ply: 3DGS's, with the motion of dynamic Gaussians; 4dgs: with the clock and
    /// the cameras of the clip, for `ivv serve` and other players; spz: Niantic's, version 3; splat: antimatter15's, without view
    /// dependence.
    #[arg(long)]
    format: Option<Format>,
    /// The scene at this normalised time, 0 to 1, as static Gaussians that every viewer shows.
    #[arg(long, value_parser = clip_time, allow_negative_numbers = true)]
    time: Option<f64>,
    /// With --time: leaves out Gaussians less opaque than this.
    #[arg(long, requires = "time", default_value_t = ivv::Constants::default().alpha_min)]
    min_opacity: f32,
    #[command(flatten)]
    clip: ClipArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Ply,
    #[value(name = "4dgs")]
    FourDgs,
    Spz,
    Splat,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let format = match args.format {
        Some(format) => format,
        None => by_ending(&args.output)?,
    };
    let mut splats = shown::open_at(&args.scene, args.time)?.splats;
    let n_read = splats.len();
    if let Some(time) = args.time {
        anyhow::ensure!((0.0..=1.0).contains(&args.min_opacity), "--min-opacity must lie between 0 and 1");
        splats = splats.at(time, args.min_opacity);
    }
    match format {
        Format::Ply => write_ply(&args.output, &splats)?,
        Format::FourDgs => drop(args.clip.write(&args.scene, &splats, &args.output)?),
        Format::Spz => write_spz(&args.output, &splats)?,
        Format::Splat => write_splat(&args.output, &splats)?,
    }
    let bytes = std::fs::metadata(&args.output).map_or(0, |m| m.len());
    if json {
        out!(
            "{}",
            serde_json::json!({
                "path": args.output, "gaussians": splats.len(), "dynamic_gaussians": splats.motion.len(),
                "sh_degree": splats.sh_degree, "bytes": bytes,
            })
        );
        return Ok(());
    }
    out!(
        "{}: {} of {n_read} Gaussians, {} of them dynamic, {bytes} bytes",
        args.output.display(),
        splats.len(),
        splats.motion.len()
    );
    Ok(())
}

fn by_ending(file: &Path) -> ivv::Result<Format> {
    let ending = file.extension().map(|ending| ending.to_ascii_lowercase());
    match ending.as_ref().and_then(|ending| ending.to_str()) {
        Some("ply") => Ok(Format::Ply),
        Some("4dgs") => Ok(Format::FourDgs),
        Some("spz") => Ok(Format::Spz),
        Some("splat") => Ok(Format::Splat),
        _ => Err(ivv::Error::data(
            file,
            "",
            "unsupported scene format",
            "use .ply, .4dgs, .spz or .splat, or give --format",
        )),
    }
}
