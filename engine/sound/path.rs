//! Paths of a head, from the files that cameras' paths come in.
//!
//! | file | a pose | its axes, unless told |
//! | --- | --- | --- |
//! | `.json`, nerfstudio's and nerfview's camera path | `camera_to_world` (4 x 4 by rows), one for each frame | OpenGL's |
//! | `.csv` with a header | columns `t,x,y,z,qx,qy,qz,qw` in any order | the head's |
//! | any other: TUM | `t x y z qx qy qz qw`, `#` begins a comment | OpenCV's |
//!
//! Times are seconds of the clip, places are in the world of the capture.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use super::pose::{HeadPose, PoseTrack};
use crate::error::{Error, Result};
use crate::files::{cannot_read, read_text};
use crate::scene;

/// Largest deviation of R R^T from the identity, entry by entry.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Which way the axes of a pose point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// x right, y down, z forward: COLMAP's too.
    OpenCv,
    /// x right, y up, z backward: nerfstudio's and Blender's too.
    OpenGl,
    /// As OpenGL.
    OpenXr,
    /// x forward, y left, z up: SOFA's too.
    Head,
}

impl Convention {
    /// Turns the head's frame into the one of the convention.
    pub(super) fn of_head(self) -> DQuat {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let axes = match self {
            Convention::OpenCv => DMat3::from_cols(z, -x, -y),
            Convention::OpenGl | Convention::OpenXr => DMat3::from_cols(-z, -x, y),
            Convention::Head => return DQuat::IDENTITY,
        };
        DQuat::from_mat3(&axes)
    }
}

impl HeadPose {
    /// That of a camera in the place of the head.
    pub fn world_to_camera(&self) -> scene::Pose {
        let to_world = self.q * Convention::OpenCv.of_head().inverse();
        scene::Pose::at(self.p, DMat3::from_quat(to_world).transpose())
    }
}

/// A path, as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadPath {
    /// Where the head is.
    pub track: PoseTrack,
    /// Pictures per second, width and height in pixels, and the vertical field of view in degrees, where the file says.
    pub camera: Option<PathCamera>,
}

/// The camera of a nerfstudio path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathCamera {
    /// Pictures per second.
    pub fps: f64,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Vertical field of view of the first picture, degrees.
    pub fov: f64,
}

/// Reads a path; see the module for the kinds of files. `convention` replaces the kind's own.
///
/// # Errors
/// [`Error::Data`] naming the file and the line that cannot be read.
pub fn read_path(path: impl AsRef<Path>, convention: Option<Convention>) -> Result<HeadPath> {
    let path = path.as_ref();
    let text = read_text(path).map_err(|fault| cannot_read(path, &fault))?;
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let (poses, camera, own) = match ending.as_deref() {
        Some("json") => nerfstudio(path, &text)?,
        Some("csv") => (csv(path, &text)?, None, Convention::Head),
        _ => (tum(path, &text)?, None, Convention::OpenCv),
    };
    let turn = convention.unwrap_or(own).of_head();
    let poses = poses.into_iter().map(|pose| HeadPose { q: pose.q * turn, ..pose }).collect();
    let track = PoseTrack::new(poses).map_err(|error| match error {
        Error::Data { place, reason, remedy, .. } => Error::data(path, place, reason, remedy),
        other => other,
    })?;
    Ok(HeadPath { track, camera })
}

/// The pose of t, x, y, z, qx, qy, qz, qw; the quaternion need not have quite the length 1.
fn pose([t, x, y, z, qx, qy, qz, qw]: [f64; 8]) -> HeadPose {
    HeadPose { t, p: DVec3::new(x, y, z), q: DQuat::from_xyzw(qx, qy, qz, qw).normalize() }
}

fn tum(path: &Path, text: &str) -> Result<Vec<HeadPose>> {
    let lines = text.lines().enumerate().filter(|(_, line)| !(line.trim().is_empty() || line.trim().starts_with('#')));
    let parsed = lines.map(|(number, line)| {
        let cells = line.split([' ', '\t', ',']).filter(|cell| !cell.is_empty());
        let numbers: std::result::Result<Vec<f64>, _> = cells.map(str::parse).collect();
        let numbers = numbers.ok().and_then(|numbers| <[f64; 8]>::try_from(numbers).ok());
        let reason = "has not the eight numbers t x y z qx qy qz qw";
        numbers.map(pose).ok_or_else(|| Error::data(path, format!("line {}", number + 1), reason, "correct the line"))
    });
    parsed.collect()
}

fn csv(path: &Path, text: &str) -> Result<Vec<HeadPose>> {
    const COLUMNS: [&str; 8] = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"];
    let mut lines = text.lines().enumerate();
    let header: Vec<&str> = lines.next().map_or("", |(_, line)| line).split(',').map(str::trim).collect();
    let mut at = [0; 8];
    for (column, at) in COLUMNS.iter().zip(&mut at) {
        *at = header.iter().position(|name| name == column).ok_or_else(|| {
            let remedy = format!("write a header with {}", COLUMNS.join(","));
            Error::data(path, "line 1", format!("has no column `{column}`"), remedy)
        })?;
    }
    let parsed = lines.filter(|(_, line)| !line.trim().is_empty()).map(|(number, line)| {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let mut numbers = [0.0; 8];
        for ((at, number_of), column) in at.iter().zip(&mut numbers).zip(COLUMNS) {
            *number_of = cells.get(*at).and_then(|cell| cell.parse().ok()).ok_or_else(|| {
                let reason = format!("has no number in the column `{column}`");
                Error::data(path, format!("line {}", number + 1), reason, "correct the line")
            })?;
        }
        Ok(pose(numbers))
    });
    parsed.collect()
}

#[derive(serde::Deserialize)]
struct Document {
    camera_path: Vec<Camera>,
    fps: f64,
    render_width: u32,
    render_height: u32,
    camera_type: Option<String>,
}

#[derive(serde::Deserialize)]
struct Camera {
    camera_to_world: Matrix,
    fov: f64,
}

#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Matrix {
    Flat([f64; 16]),
    Rows([[f64; 4]; 4]),
}

fn nerfstudio(path: &Path, text: &str) -> Result<(Vec<HeadPose>, Option<PathCamera>, Convention)> {
    let remedy = "give a camera path that nerfstudio or nerfview exported";
    let fault = |place: String, reason: String| Error::data(path, place, reason, remedy);
    let document: Document = serde_json::from_str(text).map_err(|e| fault(String::new(), e.to_string()))?;
    let Document { camera_path, fps, render_width: width, render_height: height, camera_type } = document;
    if let Some(kind) = camera_type.filter(|kind| kind != "perspective") {
        return Err(fault("field `camera_type`".to_owned(), format!("is `{}`, not perspective", kind.escape_debug())));
    }
    let fov = camera_path.first().map_or(0.0, |camera| camera.fov);
    if !(fps > 0.0 && fps.is_finite() && fov > 0.0 && fov < 180.0) {
        return Err(fault(String::new(), format!("has {fps} frames per second and a field of view of {fov} degrees")));
    }
    let mut poses = Vec::new();
    for (index, camera) in camera_path.iter().enumerate() {
        let m = match &camera.camera_to_world {
            Matrix::Rows(rows) => *rows,
            Matrix::Flat(flat) => [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| flat[4 * row + column])),
        };
        let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
        let rotation = DMat3::from_cols(column(0), column(1), column(2));
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        let is_rotation =
            off.to_cols_array().iter().all(|v| v.abs() <= ROTATION_TOLERANCE) && rotation.determinant() > 0.0;
        if !is_rotation {
            return Err(fault(format!("pose {index}"), "has a `camera_to_world` that does not rotate".to_owned()));
        }
        poses.push(HeadPose { t: index as f64 / fps, p: column(3), q: DQuat::from_mat3(&rotation).normalize() });
    }
    Ok((poses, Some(PathCamera { fps, width, height, fov }), Convention::OpenGl))
}
