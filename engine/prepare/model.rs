//! `sparse/0`: the calibration as COLMAP's text files.

use std::path::Path;

use crate::error::Result;
use crate::files::{make_folder, write_atomic};
use crate::scene::capture::{Faults, Posed, read_images};
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose, SeenPoint, quaternion};
use glam::{DVec2, DVec3};

pub(super) struct ModelCamera {
    pub id: u32,
    pub lens: Lens,
    /// Name and pose of its images: one, or one for each frame of a moving camera.
    pub images: Vec<(String, Pose)>,
}

/// The images of a model; its first fault is an error.
pub(super) fn read(folder: &Path) -> Result<Vec<Posed>> {
    let mut faults = Faults::default();
    let model = read_images(folder, &mut faults);
    faults.first().map_or(Ok(model.images), Err)
}

/// Writes cameras, images and points3D. Points were seen by the first images of cameras, whose ids count from 1; as
/// observations COLMAP is given their projections.
pub(super) fn write(folder: &Path, cameras: &[ModelCamera], points: &[SeenPoint]) -> Result<()> {
    make_folder(folder)?;
    let mut observed: Vec<Vec<String>> = vec![Vec::new(); cameras.len()];
    let reaches: Vec<f64> = cameras.iter().map(|camera| camera.lens.reach()).collect();
    let mut firsts = vec![1];
    firsts.extend(cameras.iter().scan(1, |next, camera| {
        *next += camera.images.len();
        Some(*next)
    }));
    let mut points_txt = String::from("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n");
    for (point, id) in points.iter().zip(1_u64..) {
        let ([x, y, z], [r, g, b]) = (point.position, point.rgb);
        points_txt += &format!("{id} {x} {y} {z} {r} {g} {b} 0");
        for index in point.camera_ids.iter().map(|id| *id as usize - 1) {
            let pixel = project(&cameras[index], reaches[index], point.position.into());
            let Some(DVec2 { x: u, y: v }) = pixel else { continue };
            points_txt += &format!(" {} {}", firsts[index], observed[index].len());
            observed[index].push(format!("{u} {v} {id}"));
        }
        points_txt.push('\n');
    }
    let mut cameras_txt = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
    let mut images_txt = String::from(
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# X, Y, POINT3D_ID, ... (projections)\n",
    );
    for ((camera, observed), first) in cameras.iter().zip(&observed).zip(&firsts) {
        let Intrinsics { width, height, .. } = camera.lens.intrinsics;
        let (kind, numbers) = parameters(&camera.lens);
        cameras_txt += &format!("{} {kind} {width} {height} {}\n", camera.id, joined(&numbers, " "));
        for ((name, pose), id) in camera.images.iter().zip(*first..) {
            let ([w, x, y, z], [tx, ty, tz]) = (quaternion(&pose.rotation), pose.translation.to_array());
            images_txt += &format!("{id} {w} {x} {y} {z} {tx} {ty} {tz} {} {name}\n", camera.id);
            images_txt += &if id == *first { observed.join(" ") } else { String::new() };
            images_txt.push('\n');
        }
    }
    for (name, text) in [("cameras.txt", cameras_txt), ("images.txt", images_txt), ("points3D.txt", points_txt)] {
        write_atomic(&folder.join(name), |to| to.write_all(text.as_bytes()))?;
    }
    Ok(())
}

/// Where the first image of a camera shows a point in front of it.
fn project(camera: &ModelCamera, reach: f64, at: DVec3) -> Option<DVec2> {
    let (_, pose) = camera.images.first()?;
    let local = pose.to_camera(at);
    let lens = &camera.lens;
    if local.z <= 0.0 {
        return None;
    }
    if lens.distortion == Distortion::None {
        return Some(lens.intrinsics.project(local));
    }
    lens.pixel([local.x / local.z, local.y / local.z], reach).map(DVec2::from)
}

/// A lens as COLMAP spells it: the name of its model, and its numbers in their order.
pub(super) fn parameters(lens: &Lens) -> (&'static str, Vec<f64>) {
    let Intrinsics { fx, fy, cx, cy, .. } = lens.intrinsics;
    let (kind, more) = match lens.distortion {
        Distortion::None => ("PINHOLE", vec![]),
        // The model that COLMAP fits by itself.
        Distortion::Brown { radial: [k, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0, 0.0] } if fx == fy => {
            return ("SIMPLE_RADIAL", vec![fx, cx, cy, k]);
        }
        Distortion::Brown { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] } => {
            ("FULL_OPENCV", vec![k1, k2, p1, p2, k3, k4, k5, k6])
        }
        Distortion::Fisheye(k) => ("OPENCV_FISHEYE", k.to_vec()),
        Distortion::Division(k) => ("DIVISION", vec![k]),
        Distortion::Unified { alpha, beta } => ("EUCM", vec![alpha, beta]),
        Distortion::FieldOfView(omega) => ("FOV", vec![omega]),
    };
    (kind, [vec![fx, fy, cx, cy], more].concat())
}

pub(super) fn joined(numbers: &[f64], between: &str) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(between)
}
