//! Pictures that are neither PNG nor JPEG: read through ffmpeg where it can, else named with what converts them.

use std::collections::HashMap;
use std::ffi::OsString;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, ImageReader};

use super::program::{FFMPEG, FFPROBE};
use crate::error::{Error, Result};
use crate::scene::capture::{self, is_hidden, is_image};
use crate::video::picture;
use crate::words::count;

/// Endings of pictures that ffmpeg reads, or some versions of it.
const CONVERTED: [&str; 11] = ["tif", "tiff", "webp", "dpx", "exr", "bmp", "jp2", "jxl", "avif", "heic", "heif"];
/// Endings of what cameras write for a developer of raw pictures.
const RAW: [&str; 11] = ["arw", "cr2", "cr3", "dng", "nef", "nrw", "orf", "raf", "raw", "rw2", "srw"];
/// Bytes that decoding a picture takes beyond its pixels, at most.
const SLACK: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Own,
    /// Through ffmpeg.
    Converted,
    /// Not at all: it must be developed first.
    Raw,
    Other,
}

pub(super) fn kind(path: &Path) -> Kind {
    let ending = ending(path).unwrap_or_default().to_lowercase();
    match ending.as_str() {
        _ if is_hidden(path) => Kind::Other,
        _ if is_image(path) => Kind::Own,
        ending if CONVERTED.contains(&ending) => Kind::Converted,
        ending if RAW.contains(&ending) => Kind::Raw,
        _ => Kind::Other,
    }
}

fn ending(path: &Path) -> Option<&str> {
    path.extension()?.to_str()
}

/// Files by their endings, as they are first spelled, in the order of the first of each.
fn by_ending(files: &[PathBuf]) -> Vec<(String, Vec<&PathBuf>)> {
    let mut groups: Vec<(String, Vec<&PathBuf>)> = Vec::new();
    for file in files {
        let own = match ending(file) {
            _ if file.is_dir() => "/",
            own => own.unwrap_or_default(),
        };
        match groups.iter_mut().find(|(ending, _)| ending.eq_ignore_ascii_case(own)) {
            Some((_, files)) => files.push(file),
            None => groups.push((own.to_owned(), vec![file])),
        }
    }
    groups
}

/// How many files there are of each ending: `3 .HEIC, 2 .csv and 1 folder`.
pub(super) fn counts(files: &[PathBuf]) -> String {
    let kinds = by_ending(files).into_iter().map(|(ending, files)| match ending.as_str() {
        "/" => count(files.len(), "folder"),
        "" => count(files.len(), "file") + " without an ending",
        ending => format!("{} .{ending}", files.len()),
    });
    let kinds: Vec<String> = kinds.collect();
    match kinds.as_slice() {
        [] => "nothing".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Of the files that ffmpeg may read, those of the ending that most have.
pub(super) fn of_most(files: Vec<PathBuf>) -> Vec<PathBuf> {
    let foreign: Vec<PathBuf> = files.into_iter().filter(|path| kind(path) == Kind::Converted).collect();
    let most = by_ending(&foreign).into_iter().rev().max_by_key(|(_, files)| files.len());
    most.map_or(Vec::new(), |(_, files)| files.into_iter().cloned().collect())
}

/// Pictures that are read, and those that cannot be; of each ending ffmpeg is asked about the first.
pub(super) fn readable(files: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let mut endings: HashMap<String, bool> = HashMap::new();
    files.into_iter().partition(|file| {
        let is_read = || match kind(file) {
            Kind::Own => true,
            Kind::Converted => read_size(file).is_ok(),
            Kind::Raw | Kind::Other => false,
        };
        *endings.entry(ending(file).unwrap_or_default().to_lowercase()).or_insert_with(is_read)
    })
}

pub(super) fn remedy(files: &[PathBuf]) -> String {
    let commands = by_ending(files).into_iter().map(|(ending, files)| {
        let of_each = |program: &str| format!("for f in *.{ending}; do {program} \"$f\" \"${{f%.*}}.jpg\"; done");
        let (command, package) = match ending.to_lowercase().as_str() {
            "heic" | "heif" => (of_each("heif-convert -q 95"), "libheif-examples"),
            _ if kind(files[0]) == Kind::Raw => (of_each("darktable-cli"), "darktable"),
            _ => (format!("mogrify -format jpg *.{ending}"), "imagemagick"),
        };
        format!("`{command}` (of the package {package})")
    });
    format!("convert them in their folder with {}", commands.collect::<Vec<_>>().join(" and "))
}

pub(super) fn converted(files: &[PathBuf]) -> Option<String> {
    let mut foreign = files.to_vec();
    foreign.retain(|path| kind(path) == Kind::Converted);
    let linear = by_ending(&foreign).iter().any(|(ending, _)| ending.eq_ignore_ascii_case("exr"));
    let how = if linear { "; those of .exr, which are linear, are encoded as sRGB" } else { "" };
    (!foreign.is_empty()).then(|| format!("{}: read by ffmpeg and kept with 8 bits a colour{how}", counts(&foreign)))
}

/// True if a picture has more than 8 bits a colour: COLMAP reads none of them.
pub(super) fn is_deep(path: &Path) -> bool {
    // The depth is the 25th byte of a PNG.
    let mut start = [0; 25];
    let read = std::fs::File::open(path).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut start));
    read.is_ok() && start.starts_with(b"\x89PNG") && start[24] > 8
}

pub(super) fn read_size(path: &Path) -> Result<(u32, u32)> {
    if kind(path) != Kind::Converted {
        return Ok(capture::read_size(path)?);
    }
    let shown = ["-v", "error", "-select_streams", "v:0", "-show_entries", "stream=width,height", "-of", "csv=p=0"];
    let arguments: Vec<OsString> = shown.iter().map(OsString::from).chain(picture(path)).collect();
    let (said, outcome) = FFPROBE.attempt(arguments, path, &mut |_| {})?;
    let said = String::from_utf8_lossy(&said);
    let mut sides = said.lines().next().unwrap_or_default().split(',').map(|side| side.parse().ok().filter(|n| *n > 0));
    outcome.ok().and_then(|()| Some((sides.next()??, sides.next()??))).ok_or_else(|| {
        Error::data(path, "", "is a picture that the installed ffmpeg cannot read", remedy(&[path.to_owned()]))
    })
}

/// As [`read_size`], of a picture that is turned as its EXIF says if it fits its camera only then.
pub(super) fn size_for(path: &Path, calibrated: (u32, u32)) -> Result<(u32, u32)> {
    if kind(path) == Kind::Converted { read_size(path) } else { Ok(capture::size_for(path, calibrated)?) }
}

pub(super) fn decode_image(path: &Path, width: u32, height: u32) -> Result<DynamicImage> {
    if kind(path) != Kind::Converted {
        return capture::decode_image(path, width, height);
    }
    // What OpenEXR holds is linear.
    let is_linear = ending(path).is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
    let encoded: &[&str] = if is_linear { &["-apply_trc", "iec61966_2_1"] } else { &[] };
    let before = ["-v", "error", "-nostdin"].iter().chain(encoded).map(OsString::from);
    let after = ["-frames:v", "1", "-c:v", "png", "-compression_level", "1", "-f", "image2pipe", "pipe:1"];
    let arguments: Vec<OsString> = before.chain(picture(path)).chain(after.map(OsString::from)).collect();
    let png = FFMPEG.run(arguments, path)?;
    let bad = |reason: String| Error::data(path, "", reason, "make or copy the picture again");
    let mut reader = ImageReader::with_format(Cursor::new(png), ImageFormat::Png);
    let mut limits = image::Limits::default();
    // 16 bits for each of four channels is the most that a PNG has.
    limits.max_alloc = Some(8 * u64::from(width) * u64::from(height) + SLACK);
    reader.limits(limits);
    let image = reader.decode().map_err(|fault| bad(format!("does not decode: {fault}")))?;
    if (image.width(), image.height()) != (width, height) {
        return Err(bad(format!("is {} x {}, its camera is {width} x {height}", image.width(), image.height())));
    }
    Ok(image)
}
