//! Sound and keypoints that lie beside a source's pictures, as far as they are taken over.

use super::camera::Camera;
use crate::error::Result;
use crate::prepare::journal::cannot_list;
use std::fs;
use std::path::{Path, PathBuf};

/// The sound of a source of which the frames from `start` on are taken.
pub fn sounds(source: &Path, cameras: &[Camera], start: u32) -> Result<Vec<PathBuf>> {
    let audio = source.join("audio");
    if start != 0 || !audio.is_dir() {
        return Ok(Vec::new());
    }
    let is_taken = |path: &PathBuf| {
        let is_of = |camera: &Camera| path.file_stem().is_some_and(|stem| stem == camera.name.as_str());
        let is_shifted = cameras.iter().any(|camera| camera.start != 0 && is_of(camera));
        path.extension().is_some_and(|ending| ending == "wav") && !is_shifted
    };
    let entries = fs::read_dir(&audio).map_err(|fault| cannot_list(&audio, &fault))?.flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_taken).collect();
    files.sort();
    Ok(files)
}

/// The keypoints of a camera, where they are taken over.
pub fn keypoints(source: &Path, camera: &Camera) -> Option<PathBuf> {
    let path = source.join(format!("keypoints/{}.json", camera.name));
    (camera.start == 0 && path.is_file()).then_some(path)
}
