//! `ivv export`.

use crate::export_clip::{ClipArgs, Losses};
use crate::files::make_folder;
use crate::look::list;
use crate::page;
use crate::screen::{out, say};
use crate::shown::Source;
use crate::views::clip_time;
use anyhow::Context;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use ivv::files::{folder_of, read_file, remove_temporaries, write_atomic};
use ivv::formats::{FourDgs, WRITERS, WriteScene, Writer, count_written};
use std::path::{Path, PathBuf};

/// Options of `ivv export`.
#[derive(clap::Args)]
pub struct Args {
    /// A scene file, or the folder of a run: its scene.ply, or the newest checkpoint where it has not ended.
    scene: PathBuf,
    /// The file to write; a folder for `web`, whose name ends in a slash.
    #[arg(short, long)]
    output: PathBuf,
    /// Its format. By default from the name's ending.
    #[arg(long, value_parser = format_parser())]
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

/// What a scene is written as.
#[derive(Clone, Copy, Debug)]
enum Format {
    /// A `.4dgs`.
    FourDgs,
    /// A folder with the player and a `.4dgs`.
    Web,
    /// Both in one file.
    Page,
    /// A format of the engine's list.
    Other(&'static Writer),
}

/// Names and meanings of the formats with a clip; the engine lists the others.
const WITH_CLIP: [(&str, &str, Format); 3] = [
    ("4dgs", "with the clock and the cameras of the clip, for players", Format::FourDgs),
    ("web", "a folder with the player and the scene, for any host of files", Format::Web),
    ("page", "player and scene as one .html", Format::Page),
];

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let format = match args.format {
        Some(format) => format,
        None => by_ending(&args.output)?,
    };
    if let Format::Other(writer) = format {
        args.clip.refuse_without_clip(writer.name, matches!(writer.write, WriteScene::WithClip(_)))?;
    }
    let source = Source::open(&args.scene)?;
    remove_left(format, &args.output)?;
    if args.time.is_none() && format.has_clip() && args.clip.is_as_it_is(&source)? {
        let bytes = read_file(&args.scene).with_context(|| args.scene.display().to_string())?;
        let written = write_clip(format, &args.output, &bytes)?;
        if json {
            out!("{}", serde_json::json!({ "path": args.output.to_string_lossy(), "bytes": written }));
        } else {
            out!("{}: the scene as it is, {written} bytes", args.output.display());
        }
        return Ok(());
    }
    if args.time.is_none()
        && let Some(written) = write_parts(args, format, &source)?
    {
        return written.tell(&args.output, json);
    }
    let mut splats = source.scene()?.splats;
    let n_read = splats.len();
    if let Some(time) = args.time {
        let least = args.min_opacity;
        anyhow::ensure!((0.0..=1.0).contains(&least), "--min-opacity: expected a number from 0 to 1, found {least}");
        splats = splats.at(time, least);
    }
    let to = &args.output;
    let mut with_clip = None;
    match format {
        Format::FourDgs | Format::Web | Format::Page => {
            with_clip = Some(write_clip(format, to, &args.clip.bytes(&source, &splats)?)?);
        }
        Format::Other(writer) => match writer.write {
            WriteScene::Alone(write) => write(to, &splats)?,
            WriteScene::WithOwn(write) => write(to, &splats, &source.look.unusual())?,
            WriteScene::InWorld(write) => write(to, &splats, source.clip.as_ref().and_then(FourDgs::world))?,
            WriteScene::WithClip(write) => {
                let setting = args.clip.setting(&source)?;
                write(to, &splats, setting.clock, &setting.views, &source.look.unusual())?;
            }
        },
    }
    if let Format::Other(Writer { name, keeps_constants: false, .. }) = format
        && let unusual = source.look.unusual()
        && !unusual.is_empty()
    {
        say!("{}: the format {name} has no place for {}; viewers use theirs", to.display(), list(&unusual));
    }
    let bytes = with_clip.unwrap_or_else(|| std::fs::metadata(to).map_or(0, |m| m.len()));
    let writer = if let Format::Other(writer) = format { Some(writer) } else { None };
    let [n_static, n_dynamic] = count_written(&splats, writer);
    Written { n_read, n: n_static + n_dynamic, n_dynamic, sh_degree: splats.sh_degree, bytes }.tell(to, json)
}

/// What was written.
struct Written {
    n_read: usize,
    n: usize,
    n_dynamic: usize,
    sh_degree: u32,
    bytes: u64,
}

impl Written {
    fn tell(&self, to: &Path, json: bool) -> anyhow::Result<()> {
        let Written { n_read, n, n_dynamic, sh_degree, bytes } = self;
        if json {
            out!(
                "{}",
                serde_json::json!({
                    "path": to.to_string_lossy(), "gaussians": n, "dynamic_gaussians": n_dynamic, "sh_degree": sh_degree,
                    "bytes": bytes,
                })
            );
        } else {
            out!("{}: {n} of {n_read} Gaussians, {n_dynamic} of them dynamic, {bytes} bytes", to.display());
        }
        Ok(())
    }
}

impl Format {
    /// Whether it is a `.4dgs`, alone or with the player.
    fn has_clip(self) -> bool {
        !matches!(self, Format::Other(_))
    }
}

/// Takes the name of a format.
fn format_parser() -> impl TypedValueParser<Value = Format> {
    let with_clip = WITH_CLIP.iter().map(|&(name, about, _)| PossibleValue::new(name).help(about));
    let others = WRITERS.iter().map(|writer| PossibleValue::new(writer.name).help(writer.about));
    PossibleValuesParser::new(with_clip.chain(others)).try_map(|name| {
        let with_clip = WITH_CLIP.iter().find(|(own, _, _)| *own == name).map(|(_, _, format)| *format);
        let other = WRITERS.iter().find(|writer| writer.name == name).map(Format::Other);
        with_clip.or(other).ok_or("there is no such format")
    })
}

/// The `.4dgs` of an export that has one as a file of its own.
fn scene_file(format: Format, to: &Path) -> PathBuf {
    if matches!(format, Format::Web) { to.join(page::SCENE) } else { to.to_owned() }
}

/// Removes what killed exports left where this one writes: files as large as its own.
fn remove_left(format: Format, to: &Path) -> ivv::Result<()> {
    let file = scene_file(format, to);
    let folder = folder_of(&file);
    if folder.is_dir() { remove_temporaries(folder, 0) } else { Ok(()) }
}

/// Writes a clip in parts without having it in memory, where source and format allow.
fn write_parts(args: &Args, format: Format, source: &Source) -> anyhow::Result<Option<Written>> {
    let is_web = matches!(format, Format::Web);
    if !is_web && !matches!(format, Format::FourDgs) {
        return Ok(None);
    }
    let Some((_, clip)) = source.parts()? else { return Ok(None) };
    if is_web {
        make_folder(&args.output)?;
    }
    let file = scene_file(format, &args.output);
    let Some(Losses { n, n_dynamic, n_left_out, .. }) = args.clip.write_parts(source, &file)? else { return Ok(None) };
    if is_web {
        page::write_player(&args.output)?;
    }
    let bytes = std::fs::metadata(&file).map_or(0, |m| m.len()) + if is_web { page::n_bytes() } else { 0 };
    Ok(Some(Written { n_read: n + n_left_out, n, n_dynamic, sh_degree: clip.sh_degree(), bytes }))
}

/// Writes a `.4dgs` alone, or with the player; says how many bytes.
fn write_clip(format: Format, to: &Path, scene: &[u8]) -> anyhow::Result<u64> {
    if matches!(format, Format::Web) {
        make_folder(to)?;
        write_atomic(&scene_file(format, to), |to| to.write_all(scene))?;
        page::write_player(to)?;
        return Ok(page::n_bytes() + scene.len() as u64);
    }
    let page = matches!(format, Format::Page).then(|| page::single_file(to, scene)).transpose()?;
    let bytes = page.as_ref().map_or(scene, |page| page.as_bytes());
    write_atomic(to, |to| to.write_all(bytes))?;
    Ok(bytes.len() as u64)
}

fn by_ending(file: &Path) -> ivv::Result<Format> {
    let name = file.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if file.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Ok(Format::Web);
    }
    let mut endings = vec![(".4dgs", Format::FourDgs), (".html", Format::Page)];
    endings.extend(WRITERS.iter().filter_map(|writer| Some((writer.ending?, Format::Other(writer)))));
    // `.ftgs.ply` is a `.ply` too.
    endings.sort_by_key(|(ending, _)| std::cmp::Reverse(ending.len()));
    endings.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| *format).ok_or_else(|| {
        let known: Vec<&str> = endings.iter().map(|(ending, _)| *ending).collect();
        let remedy = format!("use {}, a name that ends in a slash for a folder, or --format", known.join(", "));
        ivv::Error::data(file, "", "unsupported scene format", &remedy)
    })
}
