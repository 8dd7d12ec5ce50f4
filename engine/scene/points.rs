//! Triangulated points of one frame, as `points/<frame:05>.ply` holds them (SPEC 8).

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::write_atomic;

#[derive(Clone, Debug, PartialEq)]
pub struct SeenPoint {
    /// World, scene units.
    pub position: [f64; 3],
    pub rgb: [u8; 3],
    /// Ids of COLMAP's cameras (`sparse/0`) that saw it.
    pub camera_ids: Vec<u32>,
}

/// Writes points as binary PLY: `x y z red green blue` and the list `camera_ids` of those that saw each.
///
/// # Errors
/// [`Error::Data`] when the file cannot be written or a point was seen by more than 65,535 cameras.
pub fn write_points(path: &Path, points: &[SeenPoint]) -> Result<()> {
    let most = points.iter().map(|point| point.camera_ids.len()).max().unwrap_or(0);
    let Ok(most) = u16::try_from(most) else {
        let reason = format!("a point was seen by {most} cameras");
        return Err(Error::data(path, "", reason, "the list holds at most 65,535: take fewer cameras"));
    };
    let short = most <= u16::from(u8::MAX);
    let mut ply = format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment camera_ids: CAMERA_ID in sparse/0 of every camera that saw the point\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property list {} int camera_ids\nend_header\n",
        points.len(),
        if short { "uchar" } else { "ushort" },
    )
    .into_bytes();
    for point in points {
        ply.extend(point.position.iter().flat_map(|v| (*v as f32).to_le_bytes()));
        ply.extend(point.rgb);
        let n = (point.camera_ids.len() as u16).to_le_bytes();
        ply.extend(if short { &n[..1] } else { &n[..] });
        ply.extend(point.camera_ids.iter().flat_map(|id| id.to_le_bytes()));
    }
    write_atomic(path, |to| to.write_all(&ply))
}
