//! `ivv export`.

use crate::run::clip::setting;
use crate::run::export_clip::ClipArgs;
use crate::run::files::make_folder;
use crate::run::player;
use crate::run::source::Source;
use crate::run::views::clip_time;
use crate::ui::screen::{answer, say};
use anyhow::Context;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use ivv::internals::files::{folder_of, read_file, remove_temporaries, write_atomic};
use ivv::internals::formats::{self, Clip, FourDgs, Scene, WRITERS, WriteOptions, Writer, Written};
use ivv::internals::scene::Splats;
use std::path::{Path, PathBuf};

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

#[derive(Clone, Copy, Debug)]
enum Format {
    Web,
    Page,
    File(&'static Writer),
}

/// The formats with a player; the engine lists the others.
const WITH_PLAYER: [(&str, &str, Format); 2] = [
    ("web", "a folder with the player and the scene, for any host of files", Format::Web),
    ("page", "player and scene as one .html", Format::Page),
];

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let format = args.format.map_or_else(|| by_ending(&args.output), Ok)?;
    if let Format::File(writer) = format
        && !format.has_clip()
    {
        args.clip.refuse_without_clip(writer.name, writer.keeps.views)?;
    }
    let source = Source::open(&args.scene)?;
    // Killed exports left files here that are as large as their scenes.
    let file = scene_file(format, &args.output);
    let folder = folder_of(&file);
    if folder.is_dir() {
        remove_temporaries(folder, 0)?;
    }
    if args.time.is_none() && format.has_clip() && args.clip.is_as_it_is(&source)? {
        let bytes = read_file(&args.scene).with_context(|| args.scene.display().to_string())?;
        let (path, written) = (args.output.to_string_lossy(), write_clip(format, &args.output, &bytes)?);
        let line = serde_json::json!({ "path": path, "bytes": written });
        answer(json, &line, format_args!("{path}: the scene as it is, {written} bytes"));
        return Ok(());
    }
    if args.time.is_none()
        && let Some(written) = write_parts(args, format, &source)?
    {
        print(&args.output, &written, written.n + written.n_left_out, json);
        return Ok(());
    }
    let (splats, least) = (source.scene()?.splats, args.min_opacity);
    anyhow::ensure!((0.0..=1.0).contains(&least), "--min-opacity: expected a number from 0 to 1, found {least}");
    let n_read = splats.len();
    let is_still = args.time.is_some() || splats.motion.is_empty();
    let mut scene = Scene { splats, clip: clip(args, format, &source, is_still)?, notes: Vec::new() };
    let mut options = WriteOptions { time: args.time, min_opacity: least, ..WriteOptions::default() };
    if format.has_clip() {
        options = args.clip.options(&source, &scene, options)?;
    }
    let to = &args.output;
    let written = if let Format::File(writer) = format {
        options.format = Some(writer);
        formats::write(to, &scene, &options)?
    } else {
        let (bytes, written) = FourDgs::encode(source.path, &scene, &options)?;
        // A page takes several times the memory of its scene.
        scene.splats = Splats::default();
        Written { bytes: write_clip(format, to, &bytes)?, ..written }
    };
    written.notes.iter().for_each(|note| say!("{}: {note}", to.display()));
    print(to, &written, n_read, json);
    Ok(())
}

/// The data of a file of `source` beside its Gaussians.
fn clip(args: &Args, format: Format, source: &Source, is_still: bool) -> anyhow::Result<Clip> {
    if format.has_clip() {
        return args.clip.clip(source, is_still);
    }
    let world = source.clip.as_ref().and_then(FourDgs::world);
    let clip = Clip { world, constants: source.look.constants, background: source.look.background, ..Clip::default() };
    if !matches!(format, Format::File(writer) if writer.keeps.views) {
        return Ok(clip);
    }
    let Clip { clock, views, .. } = setting(source, args.clip.seconds, args.clip.cameras.as_deref())?.clip;
    Ok(Clip { clock, views, ..clip })
}

fn print(to: &Path, written: &Written, n_read: usize, json: bool) {
    let Written { n, n_dynamic, sh_degree, bytes, .. } = written;
    let path = to.to_string_lossy();
    let line = serde_json::json!({
        "path": path, "gaussians": n, "dynamic_gaussians": n_dynamic, "sh_degree": sh_degree, "bytes": bytes,
    });
    let text = format_args!("{path}: {n} of {n_read} Gaussians, {n_dynamic} of them dynamic, {bytes} bytes");
    answer(json, &line, text);
}

impl Format {
    /// True for a `.4dgs`, alone or with the player.
    fn has_clip(self) -> bool {
        !matches!(self, Format::File(writer) if !writer.keeps.sounds)
    }
}

fn format_parser() -> impl TypedValueParser<Value = Format> {
    let with_player = WITH_PLAYER.iter().map(|&(name, about, _)| PossibleValue::new(name).help(about));
    let files = WRITERS.iter().map(|writer| PossibleValue::new(writer.name).help(writer.about));
    PossibleValuesParser::new(files.chain(with_player)).try_map(|name| {
        let with_player = WITH_PLAYER.iter().find(|(own, _, _)| *own == name).map(|(_, _, format)| *format);
        let file = WRITERS.iter().find(|writer| writer.name == name).map(Format::File);
        with_player.or(file).ok_or("there is no such format")
    })
}

fn scene_file(format: Format, to: &Path) -> PathBuf {
    if matches!(format, Format::Web) { to.join(player::SCENE) } else { to.to_owned() }
}

/// Writes a clip in parts without having it in memory, where source and format allow.
fn write_parts(args: &Args, format: Format, source: &Source) -> anyhow::Result<Option<Written>> {
    if matches!(format, Format::Page) || !format.has_clip() || source.parts()?.is_none() {
        return Ok(None);
    }
    let is_web = matches!(format, Format::Web);
    if is_web {
        make_folder(&args.output)?;
    }
    let Some(mut written) = args.clip.write_parts(source, &scene_file(format, &args.output))? else { return Ok(None) };
    if is_web {
        player::write_player(&args.output)?;
        written.bytes += player::n_bytes();
    }
    Ok(Some(written))
}

fn write_clip(format: Format, to: &Path, scene: &[u8]) -> anyhow::Result<u64> {
    if matches!(format, Format::Web) {
        make_folder(to)?;
        write_atomic(&scene_file(format, to), |to| to.write_all(scene))?;
        player::write_player(to)?;
        return Ok(player::n_bytes() + scene.len() as u64);
    }
    let page = matches!(format, Format::Page).then(|| player::single_file(to, scene)).transpose()?;
    let bytes = page.as_ref().map_or(scene, |page| page.as_bytes());
    write_atomic(to, |to| to.write_all(bytes))?;
    Ok(bytes.len() as u64)
}

fn by_ending(file: &Path) -> ivv::Result<Format> {
    if file.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Ok(Format::Web);
    }
    if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("html")) {
        return Ok(Format::Page);
    }
    formats::by_ending(file).map(Format::File).ok_or_else(|| {
        let known = formats::endings().join(", ");
        let remedy = format!("use {known}, .html, a name that ends in a slash for a folder, or --format");
        ivv::Error::data(file, "", "unsupported scene format", remedy)
    })
}
