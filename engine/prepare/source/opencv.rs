//! Calibrations in OpenCV's terms, where pixel (0, 0) has its centre at (0, 0).

use crate::scene::capture::Pose;
use crate::scene::undistort::{Distortion, Lens};

/// The lens of OpenCV's matrix and 4, 5 or 8 coefficients (k1 k2 p1 p2 k3 k4 k5 k6), or 4 of its fisheye; or why it is none.
pub(super) fn lens(
    size: [u32; 2],
    matrix: &[[f64; 3]; 3],
    coefficients: &[f64],
    fisheye: bool,
) -> Result<Lens, String> {
    if matrix[0][1] != 0.0 || matrix[1][0] != 0.0 || matrix[2] != [0.0, 0.0, 1.0] {
        return Err(format!("has the matrix {matrix:?}, which has skew or is none of a camera"));
    }
    let k = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
    let distortion = match (fisheye, coefficients.len()) {
        (true, 4) => Distortion::Fisheye([k(0), k(1), k(2), k(3)]),
        (false, 0 | 4 | 5 | 8) => Distortion::brown([k(0), k(1), k(4), k(5), k(6), k(7)], [k(2), k(3)]),
        (_, n) => return Err(format!("has {n} coefficients of distortion; 4, 5 or 8 are read, 4 of a fisheye")),
    };
    let lens = Lens {
        width: size[0],
        height: size[1],
        fx: matrix[0][0],
        fy: matrix[1][1],
        cx: matrix[0][2] + 0.5,
        cy: matrix[1][2] + 0.5,
        distortion,
    };
    lens.fault().map_or(Ok(lens), Err)
}

/// The rows of world to camera.
pub(super) fn pose(rotation: &[[f64; 3]; 3], translation: [f64; 3]) -> Pose {
    let row = |k: usize| [rotation[k][0], rotation[k][1], rotation[k][2], translation[k]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// World to camera from the camera's axes in the world (x right, y down, z forward) and its centre.
pub(super) fn pose_of_axes(axes: [[f64; 3]; 3], center: [f64; 3]) -> Pose {
    let translation = axes.map(|axis| -(0..3).map(|k| axis[k] * center[k]).sum::<f64>());
    pose(&axes, translation)
}
