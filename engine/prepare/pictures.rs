//! Pictures without cameras: what a source holds of them.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};

use super::journal::cannot_list;
use super::source::footage::{has_video, is_video};
use crate::error::Result;
use crate::scene::capture::is_image;

/// Pictures without cameras.
pub(super) enum Pictures {
    /// A folder of photos of something that stands still.
    Photos(PathBuf),
    /// A video of something that stands still, by a camera that moves.
    Video(PathBuf),
    /// A folder of videos of the same moment, by cameras that stand still.
    Videos(PathBuf),
}

impl Pictures {
    /// What a path without any calibration holds; nothing where it is neither photos nor videos.
    pub fn at(path: &Path) -> Option<Pictures> {
        if is_video(path) {
            return Some(Pictures::Video(path.to_owned()));
        }
        if has_video(path) {
            return Some(Pictures::Videos(path.to_owned()));
        }
        let holds_photos = |folder: &Path| {
            let files = fs::read_dir(folder).into_iter().flatten().flatten();
            files.map(|file| file.path()).filter(|file| is_image(file) && file.is_file()).nth(1).is_some()
        };
        [path.to_owned(), path.join("images")].into_iter().find(|folder| holds_photos(folder)).map(Pictures::Photos)
    }

    /// For messages.
    pub fn name(&self) -> &'static str {
        match self {
            Pictures::Photos(_) => "photos",
            Pictures::Video(_) => "a video",
            Pictures::Videos(_) => "a folder of videos",
        }
    }
}

/// Names of the pictures of a folder, sorted.
pub(super) fn photos(folder: &Path) -> Result<Vec<OsString>> {
    let files = fs::read_dir(folder).map_err(|fault| cannot_list(folder, &fault))?.flatten();
    let photos = files.map(|file| file.path()).filter(|file| is_image(file) && file.is_file());
    let mut names: Vec<OsString> = photos.filter_map(|file| file.file_name().map(OsStr::to_owned)).collect();
    names.sort();
    Ok(names)
}
