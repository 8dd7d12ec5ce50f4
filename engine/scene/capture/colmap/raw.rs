//! What the files of a sparse model hold, as it is written there.

/// What to do about a faulty file.
pub(super) const DAMAGED: &str = "the model is damaged: copy or export it again";

/// A camera model as the files spell it: number, name, number of parameters.
pub(super) struct ModelKind {
    pub id: i32,
    pub name: &'static str,
    pub n_params: usize,
}

const fn kind(id: i32, name: &'static str, n_params: usize) -> ModelKind {
    ModelKind { id, name, n_params }
}

/// COLMAP's camera models (its `src/colmap/sensor/models.h`).
pub(super) const MODELS: [ModelKind; 12] = [
    kind(0, "SIMPLE_PINHOLE", 3),
    kind(1, "PINHOLE", 4),
    kind(2, "SIMPLE_RADIAL", 4),
    kind(3, "RADIAL", 5),
    kind(4, "OPENCV", 8),
    kind(5, "OPENCV_FISHEYE", 8),
    kind(6, "FULL_OPENCV", 12),
    kind(7, "FOV", 5),
    kind(8, "SIMPLE_RADIAL_FISHEYE", 4),
    kind(9, "RADIAL_FISHEYE", 5),
    kind(10, "THIN_PRISM_FISHEYE", 12),
    kind(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
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
    pub name: String,
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
