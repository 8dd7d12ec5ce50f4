//! `ivv export`.

use crate::export_clip::ClipArgs;
use crate::files::make_folder;
use crate::page;
use crate::screen::out;
use crate::shown::Source;
use crate::views::clip_time;
use ivv::files::write_atomic;
use ivv::formats::{SpzVersion, write_ftgs, write_glb, write_ply, write_splat, write_splatv, write_spz};
use std::path::{Path, PathBuf};

/// Options of `ivv export`.
#[derive(clap::Args)]
pub struct Args {
    /// A scene file, or the folder of a run: its scene.ply, or the newest checkpoint where it has not ended.
    scene: PathBuf,
    /// The file to write; a folder for `web`, whose name ends in a slash.
    #[arg(short, long)]
    output: PathBuf,
    /// Its format. By default from the name's ending. ply: 3DGS's, with the motion of dynamic Gaussians; 4dgs: with the clock and
    /// the cameras of the clip, for players; ftgs: FreeTimeGS's PLY (.ftgs.ply); splatv: antimatter15's of dynamic scenes, without
    /// view dependence; web: a folder with the player and the scene, for any host of files; page: both as one .html. Of one
    /// moment: spz: Niantic's, version 3; spz4: version 4; glb: glTF with KHR_gaussian_splatting; splat: antimatter15's, without
    /// view dependence.
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
    Ftgs,
    Splatv,
    Web,
    Page,
    Spz,
    Spz4,
    Glb,
    Splat,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let format = match args.format {
        Some(format) => format,
        None => by_ending(&args.output)?,
    };
    let source = Source::open(&args.scene)?;
    if args.time.is_none()
        && format.has_clip()
        && let Some(bytes) = args.clip.as_it_is(&source)?
    {
        let written = write_clip(format, &args.output, &bytes)?;
        if json {
            out!("{}", serde_json::json!({ "path": args.output, "bytes": written }));
        } else {
            out!("{}: the scene as it is, {written} bytes", args.output.display());
        }
        return Ok(());
    }
    let mut splats = source.scene(args.time)?.splats;
    let n_read = splats.len();
    if let Some(time) = args.time {
        anyhow::ensure!((0.0..=1.0).contains(&args.min_opacity), "--min-opacity must lie between 0 and 1");
        splats = splats.at(time, args.min_opacity);
    }
    let to = &args.output;
    let mut with_clip = None;
    match format {
        Format::FourDgs | Format::Web | Format::Page => {
            with_clip = Some(write_clip(format, to, &args.clip.bytes(&source, &splats)?)?);
        }
        Format::Ply => write_ply(to, &splats)?,
        Format::Ftgs => write_ftgs(to, &splats, args.clip.setting(&source)?.clock)?,
        Format::Splatv => write_splatv(to, &splats, &args.clip.setting(&source)?.views)?,
        Format::Spz => write_spz(to, &splats, SpzVersion::V3)?,
        Format::Spz4 => write_spz(to, &splats, SpzVersion::V4)?,
        Format::Glb => write_glb(to, &splats)?,
        Format::Splat => write_splat(to, &splats)?,
    }
    let bytes = with_clip.unwrap_or_else(|| std::fs::metadata(to).map_or(0, |m| m.len()));
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

impl Format {
    /// Whether it is a `.4dgs`, alone or with the player.
    fn has_clip(self) -> bool {
        matches!(self, Format::FourDgs | Format::Web | Format::Page)
    }
}

/// Writes a `.4dgs` alone, or with the player; says how many bytes.
fn write_clip(format: Format, to: &Path, scene: &[u8]) -> anyhow::Result<u64> {
    if format == Format::Web {
        make_folder(to)?;
        page::write_folder(to, scene)?;
        let player: usize = page::PARTS.iter().map(|part| part.text.len()).sum();
        return Ok((player + scene.len()) as u64);
    }
    let page = (format == Format::Page).then(|| page::single_file(scene));
    let bytes = page.as_ref().map_or(scene, |page| page.as_bytes());
    write_atomic(to, |to| to.write_all(bytes))?;
    Ok(bytes.len() as u64)
}

fn by_ending(file: &Path) -> ivv::Result<Format> {
    let name = file.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let endings = [
        (".ftgs.ply", Format::Ftgs),
        (".ply", Format::Ply),
        (".4dgs", Format::FourDgs),
        (".splatv", Format::Splatv),
        (".spz", Format::Spz),
        (".glb", Format::Glb),
        (".splat", Format::Splat),
        (".html", Format::Page),
    ];
    if file.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Ok(Format::Web);
    }
    endings.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| *format).ok_or_else(|| {
        let remedy = "use .ply, .4dgs, .ftgs.ply, .splatv, .html, .spz, .glb or .splat, a name that ends in a slash for a folder, or \
                      --format";
        ivv::Error::data(file, "", "unsupported scene format", remedy)
    })
}
