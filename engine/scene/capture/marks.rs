//! By which files a folder is known for a capture, without reading any of them.

use std::fs;
use std::path::{Path, PathBuf};

use super::names::by_number;

/// Files of which each makes its folder a capture.
const FILES: [&str; 7] = [
    "capture.toml",
    "prepare.json",
    "train_meta.json",
    "transforms.json",
    "transforms_train.json",
    "reconstruction.json",
    "opensfm/reconstruction.json",
];
/// Folders of images beside the poses of LLFF.
const IMAGES: [&str; 4] = ["images", "images_2", "images_4", "images_8"];

/// Whether the files of a COLMAP model lie in a folder.
pub(super) fn is_model(folder: &Path) -> bool {
    ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file())
}

/// The models in a folder `sparse`, by their numbers.
pub(super) fn models(sparse: &Path) -> Vec<PathBuf> {
    let folders = fs::read_dir(sparse).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut models: Vec<PathBuf> = folders.filter(|folder| is_model(folder)).collect();
    models.sort_by(|a, b| by_number(a, b));
    models
}

/// Whether a folder itself looks like a capture, of whatever format.
pub(super) fn is_capture(folder: &Path) -> bool {
    let sparse = folder.join("sparse");
    let is_llff = || folder.join("poses_bounds.npy").is_file() && IMAGES.iter().any(|name| folder.join(name).is_dir());
    FILES.iter().any(|name| folder.join(name).is_file())
        || is_model(folder)
        || is_model(&sparse)
        || !models(&sparse).is_empty()
        || is_llff()
}
