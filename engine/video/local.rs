//! Input of files for ffmpeg: by a name that is no protocol, and with leave to open nothing else.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Containers that are read; playlists and lists of files, which name other files, are not among them.
const FORMATS: &str = "mov,matroska,avi,mpegts,mpeg,mxf,flv,asf,ogg,dv,h264,hevc,m4v,ivf,gif,yuv4mpegpipe,wav,w64,flac,mp3,\
                       aac,aiff,caf";

const PICTURES: &str = "tiff_pipe,webp_pipe,dpx_pipe,exr_pipe,bmp_pipe,j2k_pipe,jpegxl_pipe,mov";

/// The name of a file for ffmpeg: a colon in a path would make what stands before it a protocol.
pub(crate) fn file_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

pub(super) fn words(words: &[&str]) -> Vec<OsString> {
    words.iter().map(OsString::from).collect()
}

/// An input with its options: local files only, no playlist; a take that a GoPro continued in further files is one input.
pub(crate) fn input(path: &Path) -> Vec<OsString> {
    let chapters = chapters(path);
    if chapters.len() == 1 {
        return one_file(path, FORMATS);
    }
    words(&["-protocol_whitelist", "file,data", "-f", "concat", "-safe", "0", "-i", &list(&chapters)])
}

pub(crate) fn picture(path: &Path) -> Vec<OsString> {
    one_file(path, PICTURES)
}

fn one_file(path: &Path, formats: &str) -> Vec<OsString> {
    let options = words(&["-protocol_whitelist", "file", "-format_whitelist", formats, "-i"]);
    [options, vec![file_url(path)]].concat()
}

/// A list of files for ffmpeg, in the argument itself; each must be in one of the [`FORMATS`].
fn list(files: &[PathBuf]) -> String {
    let mut list = "data:text/plain,ffconcat version 1.0\n".to_owned();
    for file in files {
        let path = std::path::absolute(file).unwrap_or(file.clone());
        let quoted = path.to_string_lossy().replace('\'', "'\\''");
        list += &format!("file 'file:{quoted}'\noption format_whitelist {FORMATS}\n");
    }
    list
}

/// The files of the take that `path` begins: itself and, where a GoPro wrote it, those that continue it.
pub(crate) fn chapters(path: &Path) -> Vec<PathBuf> {
    let next = |path: &PathBuf| beside(path, 1);
    std::iter::successors(Some(path.to_owned()), next).collect()
}

pub(crate) fn is_later_chapter(path: &Path) -> bool {
    beside(path, -1).is_some()
}

/// The file so many chapters on, where it is there: GX010123, GX020123 or, of older GoPros, GOPR0123, GP010123.
fn beside(path: &Path, by: i32) -> Option<PathBuf> {
    let (stem, ending) = (path.file_stem()?.to_str()?, path.extension()?.to_str()?);
    // A list of files has a line for each.
    if stem.len() != 8 || !stem.is_ascii() || path.to_str()?.contains('\n') {
        return None;
    }
    let (kind, take) = stem.split_at(4);
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (letters, chapter) = kind.split_at(2);
    let chapter = match (letters, chapter) {
        ("GO", "PR") => 0,
        (_, chapter) if letters.starts_with('G') && is_number(chapter) => chapter.parse::<i32>().ok()?,
        _ => return None,
    };
    let kind = match (letters, chapter + by) {
        ("GO" | "GP", 0) => "GOPR".to_owned(),
        ("GO" | "GP", chapter @ 1..=99) => format!("GP{chapter:02}"),
        (_, chapter @ 1..=99) => format!("{letters}{chapter:02}"),
        _ => return None,
    };
    let file = path.with_file_name(format!("{kind}{take}.{ending}"));
    (is_number(take) && file.is_file()).then_some(file)
}
