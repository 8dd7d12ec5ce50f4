//! Calibrations of others that are not read: they are named, so that nobody wonders where the cameras are.

use std::fs;
use std::io::Read;
use std::path::Path;

use super::names::is_hidden;
use crate::files::open_file;

/// Bytes of a file in which it is recognised.
const START_BYTES: u64 = 4096;
/// Most files that are looked into.
const MAX_FILES: usize = 200;

/// What is said of calibrations in a folder that are not read: the program that wrote it, and the way on.
pub(crate) fn unread(path: &Path) -> Vec<String> {
    let entries = fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<_> = entries.filter(|file| !is_hidden(file)).take(MAX_FILES).collect();
    files.sort();
    files.iter().filter_map(|file| program(file).map(|(what, remedy)| told(file, what, remedy))).collect()
}

fn told(file: &Path, what: &str, remedy: &str) -> String {
    let name = file.file_name().unwrap_or_default().display();
    format!("{name} is {what}, which is not read: {remedy}")
}

/// Who wrote a file, and how to get the same cameras in a format that is read.
fn program(file: &Path) -> Option<(&'static str, &'static str)> {
    let extension = file.extension()?.to_str()?.to_ascii_lowercase();
    if !["csv", "xml", "out", "nvm", "sfm"].contains(&extension.as_str()) {
        return None;
    }
    let mut start = Vec::new();
    open_file(file).ok()?.take(START_BYTES).read_to_end(&mut start).ok()?;
    let start = String::from_utf8_lossy(&start).to_lowercase();
    let holds = |words: &[&str]| words.iter().all(|word| start.contains(word));
    match extension.as_str() {
        "csv" if holds(&["name", "heading", "pitch", "roll"]) => {
            Some(("RealityScan's registration", "export the alignment as COLMAP's text format"))
        }
        "xml" if holds(&["<document", "<chunk"]) || holds(&["<sensors", "<cameras"]) => {
            Some(("Metashape's cameras", "export them as COLMAP's text format"))
        }
        "out" if start.contains("bundle file") => {
            Some(("Bundler's cameras", "place the images with COLMAP, as `ivv prepare` does"))
        }
        "nvm" if start.starts_with("nvm_v") => {
            Some(("VisualSFM's cameras", "place the images with COLMAP, as `ivv prepare` does"))
        }
        "sfm" if holds(&["\"views\"", "\"poses\""]) || holds(&["\"version\"", "\"intrinsics\""]) => {
            Some(("Meshroom's cameras", "export them as a COLMAP project"))
        }
        _ => None,
    }
}
