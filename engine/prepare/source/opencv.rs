//! Calibrations in OpenCV's terms, where pixel (0, 0) has its centre at (0, 0).

use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, rotation_of_rows};
use glam::{DMat3, DQuat, DVec3};

/// The lens of OpenCV's matrix and 4, 5 or 8 coefficients (k1 k2 p1 p2 k3 k4 k5 k6), or 4 of its fisheye; or why no lens has them.
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
    let intrinsics = Intrinsics {
        width: size[0],
        height: size[1],
        fx: matrix[0][0],
        fy: matrix[1][1],
        cx: matrix[0][2] + 0.5,
        cy: matrix[1][2] + 0.5,
    };
    let lens = Lens { intrinsics, distortion };
    lens.fault().map_or(Ok(lens), Err)
}

/// A rotation from world to camera, as OpenCV writes one.
#[derive(serde::Deserialize)]
#[serde(untagged)]
pub(super) enum Rotation {
    Matrix([[f64; 3]; 3]),
    /// Its axis, as long as its angle in radians.
    Vector([f64; 3]),
}

impl Rotation {
    pub fn matrix(&self) -> DMat3 {
        match self {
            Rotation::Matrix(rows) => rotation_of_rows(rows.map(DVec3::from)),
            Rotation::Vector(vector) => DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from(*vector))),
        }
    }
}
