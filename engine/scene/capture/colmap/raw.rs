//! The contents of a sparse model's files, as written there.

use std::path::{Path, PathBuf};

use crate::scene::Intrinsics;
use crate::scene::capture::MAX_SIDE;
use crate::scene::undistort::{Distortion, Lens};

pub(super) const DAMAGED: &str = "the model is damaged: copy or export it again";

pub(super) const STEMS: [&str; 3] = ["cameras", "images", "points3D"];

pub(super) fn is_there(folder: &Path, stem: &str) -> Option<(PathBuf, bool)> {
    let file = |ending: &str| folder.join(format!("{stem}.{ending}"));
    [(file("bin"), true), (file("txt"), false)].into_iter().find(|(file, _)| file.is_file())
}

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
pub(super) const MODELS: &[ModelKind] = &[
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

pub(super) struct RawCamera {
    pub place: String,
    pub id: u32,
    pub kind: &'static ModelKind,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
}

impl RawCamera {
    pub fn lens(&self) -> Result<Lens, (String, &'static str)> {
        let side = |side: u64| u32::try_from(side).ok().filter(|side| (1..=MAX_SIDE).contains(side));
        let (Some(width), Some(height)) = (side(self.width), side(self.height)) else {
            let reason = format!("has {} x {} pixels, 1 to {MAX_SIDE} each is allowed", self.width, self.height);
            return Err((reason, "give the size of the images"));
        };
        let name = self.kind.name;
        if name == "EQUIRECTANGULAR" {
            let reason = "is a panorama (EQUIRECTANGULAR), which is not read".to_owned();
            return Err((reason, "cut it into views of a pinhole, as COLMAP's panorama_sfm.py does"));
        }
        let (pinhole, more) = self.params.split_at(if self.kind.has_one_focal { 3 } else { 4 });
        let (fx, fy, cx, cy) = match *pinhole {
            [f, cx, cy] => (f, f, cx, cy),
            [fx, fy, cx, cy] => (fx, fy, cx, cy),
            _ => (0.0, 0.0, 0.0, 0.0),
        };
        let distortion = match (name, more) {
            ("SIMPLE_PINHOLE" | "PINHOLE", []) => Distortion::None,
            ("SIMPLE_RADIAL" | "RADIAL", k) => Distortion::brown(padded(k), [0.0; 2]),
            ("OPENCV", &[k1, k2, p1, p2]) => Distortion::brown(padded(&[k1, k2]), [p1, p2]),
            ("FULL_OPENCV", &[k1, k2, p1, p2, k3, k4, k5, k6]) => Distortion::brown([k1, k2, k3, k4, k5, k6], [p1, p2]),
            ("OPENCV_FISHEYE" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" | "SIMPLE_FISHEYE" | "FISHEYE", k) => {
                Distortion::Fisheye(padded(k))
            }
            ("SIMPLE_DIVISION" | "DIVISION", &[k]) => Distortion::Division(k),
            ("EUCM", &[alpha, beta]) => Distortion::Unified { alpha, beta },
            ("FOV", &[omega]) => Distortion::FieldOfView(omega),
            _ => {
                let remedy = "undistort the images with `colmap image_undistorter`";
                return Err((format!("has the model {name}, which is not undistorted here"), remedy));
            }
        };
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let lens = Lens { intrinsics, distortion: distortion.simplified() };
        lens.fault().map_or(Ok(lens), |reason| Err((reason, DAMAGED)))
    }
}

fn padded<const N: usize>(k: &[f64]) -> [f64; N] {
    std::array::from_fn(|index| k.get(index).copied().unwrap_or(0.0))
}

pub(super) struct RawImage {
    pub place: String,
    pub id: u32,
    /// w, x, y, z of the rotation from world to camera.
    pub quaternion: [f64; 4],
    pub translation: [f64; 3],
    pub camera_id: u32,
    pub name: Vec<u8>,
}

pub(super) struct RawPoint {
    pub place: String,
    pub id: u64,
    pub position: [f64; 3],
    pub color: [u8; 3],
    /// Ids of the images that saw it; an id may come twice.
    pub seen_in: Vec<u32>,
}
