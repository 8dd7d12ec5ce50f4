//! Poses that other programs wrote and ivv does not read: they are named, so that nobody believes them used.

use std::fs;
use std::io::Read;
use std::path::Path;

use super::is_hidden;
use crate::files::open_file;

const START: u64 = 4096;
/// Programs whose poses are not read: by the ending of a file, and by what its first bytes hold, one of these.
const PROGRAMS: [(&str, &str, &[&str]); 16] = [
    ("RealityScan", "csv", &["#name,", "#cameras", "Name,X,Y,", "#Image"]),
    ("RealityScan", "rcproj", &[]),
    ("RealityScan", "xmp", &["xcr:"]),
    ("Metashape", "xml", &["<chunk", "agisoft", "Agisoft"]),
    ("Metashape", "psx", &[]),
    ("Metashape", "psz", &[]),
    ("ContextCapture", "xml", &["BlocksExchange"]),
    ("Meshroom", "sfm", &[]),
    ("Meshroom", "mg", &[]),
    ("OpenMVG", "json", &["sfm_data_version"]),
    ("OpenSfM", "json", &["\"shots\""]),
    ("3D Gaussian Splatting", "json", &["\"img_name\""]),
    ("VisualSFM", "nvm", &["NVM_"]),
    ("Bundler", "out", &["# Bundle file"]),
    ("Blender", "blend", &[]),
    ("Postshot", "psht", &[]),
];

/// The files of a folder, or beside a file, that hold such poses, each with what to do.
pub(crate) fn unread_poses(folder: &Path) -> Vec<String> {
    let folder = if folder.is_dir() { folder } else { folder.parent().unwrap_or(folder) };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<_> = entries.filter(|file| !is_hidden(file)).collect();
    files.sort();
    let named = |file: &std::path::PathBuf| {
        let (program, name) = (program(file)?, file.file_name()?.display());
        let remedy = "to use them, export them as a COLMAP model or transforms.json";
        Some(format!("the poses of {program} in {name} are not read; {remedy}"))
    };
    files.iter().filter_map(named).collect()
}

fn program(file: &Path) -> Option<&'static str> {
    let ending = file.extension()?.to_str()?.to_lowercase();
    let of_ending = || PROGRAMS.iter().filter(|(_, own, _)| *own == ending);
    of_ending().next()?;
    let mut start = Vec::new();
    open_file(file).ok()?.take(START).read_to_end(&mut start).ok()?;
    let start = String::from_utf8_lossy(&start);
    let is_of = |signs: &[&str]| signs.is_empty() || signs.iter().any(|sign| start.contains(sign));
    of_ending().find(|(.., signs)| is_of(signs)).map(|(program, ..)| *program)
}
