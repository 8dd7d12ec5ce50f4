//! What the files of a sparse model hold, as it is written there.

use std::path::{Path, PathBuf};

/// What to do about a faulty file.
pub(super) const DAMAGED: &str = "the model is damaged: copy or export it again";

/// The files of a model, without their endings.
pub(super) const STEMS: [&str; 3] = ["cameras", "images", "points3D"];

/// The file of a model with this stem, and whether it is binary; binary goes first.
pub(super) fn is_there(folder: &Path, stem: &str) -> Option<(PathBuf, bool)> {
    let file = |ending: &str| folder.join(format!("{stem}.{ending}"));
    [(file("bin"), true), (file("txt"), false)].into_iter().find(|(file, _)| file.is_file())
}

/// A camera model as the files spell it: number, name, number of parameters.
pub(super) struct ModelKind {
    pub id: i32,
    pub name: &'static str,
    pub n_params: usize,
    /// Its parameters begin with one focal length, for both axes.
    pub has_one_focal: bool,
}

const fn one(id: i32, name: &'static str, n_params: usize) -> ModelKind {
    ModelKind { id, name, n_params, has_one_focal: true }
}

const fn two(id: i32, name: &'static str, n_params: usize) -> ModelKind {
    ModelKind { id, name, n_params, has_one_focal: false }
}

/// COLMAP's camera models (its `src/colmap/sensor/models.h`); those from 12 on are of version 4.
pub(super) const MODELS: [ModelKind; 18] = [
    one(0, "SIMPLE_PINHOLE", 3),
    two(1, "PINHOLE", 4),
    one(2, "SIMPLE_RADIAL", 4),
    one(3, "RADIAL", 5),
    two(4, "OPENCV", 8),
    two(5, "OPENCV_FISHEYE", 8),
    two(6, "FULL_OPENCV", 12),
    two(7, "FOV", 5),
    one(8, "SIMPLE_RADIAL_FISHEYE", 4),
    one(9, "RADIAL_FISHEYE", 5),
    two(10, "THIN_PRISM_FISHEYE", 12),
    two(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
    one(12, "SIMPLE_DIVISION", 4),
    two(13, "DIVISION", 5),
    one(14, "SIMPLE_FISHEYE", 3),
    two(15, "FISHEYE", 4),
    two(16, "EUCM", 6),
    // Width and height.
    one(17, "EQUIRECTANGULAR", 2),
];

/// A camera of `cameras.{bin,txt}`.
pub(super) struct RawCamera {
    pub place: String,
    pub id: u32,
    pub kind: &'static ModelKind,
    pub width: u64,
    pub height: u64,
    /// As many as the model has.
    pub params: Vec<f64>,
}

/// An image of `images.{bin,txt}`.
pub(super) struct RawImage {
    pub place: String,
    pub id: u32,
    /// w, x, y, z of the rotation from world to camera.
    pub quaternion: [f64; 4],
    pub translation: [f64; 3],
    pub camera_id: u32,
    /// As it is written, in whatever encoding.
    pub name: Vec<u8>,
}

/// A point of `points3D.{bin,txt}`.
pub(super) struct RawPoint {
    pub place: String,
    pub id: u64,
    pub position: [f64; 3],
    pub color: [u8; 3],
    /// Ids of the images that saw it; an id may come twice.
    pub seen_in: Vec<u32>,
}
