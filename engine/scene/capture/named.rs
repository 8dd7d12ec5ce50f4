//! Paths that name a capture (its folder, a file in it, the folder of its model), and the files by which a capture is recognised.

use std::fs;
use std::path::{Path, PathBuf};

use super::{by_number, is_hidden};

const FILES: [&str; 7] = [
    "capture.toml",
    "prepare.json",
    "train_meta.json",
    "transforms.json",
    "transforms_train.json",
    "reconstruction.json",
    "opensfm/reconstruction.json",
];
const IMAGES: [&str; 4] = ["images", "images_2", "images_4", "images_8"];
const VIDEOS: [&str; 5] = ["mp4", "mov", "mkv", "avi", "webm"];
const MAX_DEPTH: usize = 2;
const MAX_FOLDERS: usize = 2000;

#[derive(Clone, Debug, Default)]
pub(super) struct Named {
    pub folder: PathBuf,
    /// The file of cameras, if one was named.
    pub file: Option<PathBuf>,
    /// COLMAP's model, if one was named.
    pub model: Option<PathBuf>,
}

impl Named {
    pub fn of(path: &Path) -> Named {
        let folder = |path: &Path| Named { folder: path.to_owned(), ..Named::default() };
        if path.is_file() {
            let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
            return match (path.file_name().and_then(|name| name.to_str()), extension(path).as_deref()) {
                (Some("capture.toml" | "train_meta.json" | "poses_bounds.npy" | "reconstruction.json"), _) => {
                    folder(parent)
                }
                (_, Some("json")) => Named { file: Some(path.to_owned()), ..folder(parent) },
                (Some(name), Some("bin" | "txt")) if is_of_model(name) => Named::of(parent),
                _ => folder(path),
            };
        }
        let is_sparse = |path: &Path| path.file_name().is_some_and(|name| name == "sparse");
        // A model lies in `sparse` of its project.
        match path.parent() {
            Some(parent) if is_sparse(path) && (is_model(path) || !models(path).is_empty()) => folder(&or_here(parent)),
            Some(parent) if is_sparse(parent) && is_model(path) => {
                let project = parent.parent().map(or_here).unwrap_or_default();
                Named { model: Some(path.to_owned()), ..folder(&project) }
            }
            _ => folder(path),
        }
    }
}

fn is_of_model(name: &str) -> bool {
    ["cameras.", "images.", "points3D."].iter().any(|stem| name.starts_with(stem))
}

fn or_here(path: &Path) -> PathBuf {
    if path.as_os_str().is_empty() { PathBuf::from(".") } else { path.to_owned() }
}

fn extension(path: &Path) -> Option<String> {
    path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase)
}

/// True if a folder, or one of its folders, holds videos: it may be a recording, which no capture inside it replaces.
pub(super) fn has_videos(path: &Path) -> bool {
    let is_video = |path: &Path| extension(path).is_some_and(|e| VIDEOS.contains(&e.as_str())) && !is_hidden(path);
    let entries = |path: &Path| fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let holds = |path: &Path| entries(path).any(|entry| is_video(&entry));
    holds(path) || entries(path).take(MAX_FOLDERS).any(|entry| entry.is_dir() && holds(&entry))
}

/// The outermost captures one or two folders below.
pub(super) fn captures_below(path: &Path) -> Vec<PathBuf> {
    let (mut found, mut level) = (Vec::new(), vec![path.to_owned()]);
    let mut n_seen = 0;
    for _ in 0..MAX_DEPTH {
        let mut next = Vec::new();
        for folder in level {
            let entries = fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path());
            let mut folders: Vec<PathBuf> = entries.take(MAX_FOLDERS).filter(|path| path.is_dir()).collect();
            folders.sort();
            n_seen += folders.len();
            if n_seen > MAX_FOLDERS {
                return found;
            }
            for folder in folders.into_iter().filter(|folder| !is_hidden(folder)) {
                // A model in `sparse` is that of the folder above.
                let is_model = folder.file_name().is_some_and(|name| name == "sparse");
                if is_capture(&folder) {
                    found.push(folder);
                } else if !is_model {
                    next.push(folder);
                }
            }
        }
        level = next;
    }
    found
}

pub(super) fn is_model(folder: &Path) -> bool {
    ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file())
}

pub(super) fn models(sparse: &Path) -> Vec<PathBuf> {
    let folders = fs::read_dir(sparse).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut models: Vec<PathBuf> = folders.filter(|folder| is_model(folder)).collect();
    models.sort_by_cached_key(|model| by_number(&model.to_string_lossy()));
    models
}

pub(super) fn is_capture(folder: &Path) -> bool {
    let sparse = folder.join("sparse");
    let is_llff = || folder.join("poses_bounds.npy").is_file() && IMAGES.iter().any(|name| folder.join(name).is_dir());
    FILES.iter().any(|name| folder.join(name).is_file())
        || is_model(folder)
        || is_model(&sparse)
        || !models(&sparse).is_empty()
        || is_llff()
}
