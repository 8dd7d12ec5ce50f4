//! Where a camera is and how it is turned.

use glam::{DMat3, DQuat, DVec3, DVec4};

const LAST_ROW: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// World to camera: `x_camera = rotation x_world + translation`; the camera's axes are x right, y down, z forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its rows are the camera's axes in the world.
    pub rotation: DMat3,
    /// The world's origin in the camera's axes, scene units.
    pub translation: DVec3,
}

impl Default for Pose {
    /// A camera at the world's origin, along its axes.
    fn default() -> Self {
        Pose { rotation: DMat3::IDENTITY, translation: DVec3::ZERO }
    }
}

impl Pose {
    /// A camera at `center`, world, whose axes are the rows of `rotation`.
    pub fn at(center: DVec3, rotation: DMat3) -> Self {
        Pose { rotation, translation: -(rotation * center) }
    }

    /// A camera at `eye` that looks at `target`, world, with the direction `up` upwards in the picture. Where `eye` is at `target` it looks
    /// along z; where it looks along `up`, some direction is upwards.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(DVec3::Z);
        let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        Pose::at(eye, rotation_of_rows([right, forward.cross(right), forward]))
    }

    /// From the first three of four rows of four; the last one must be (0, 0, 0, 1).
    pub fn of_rows([x, y, z, _]: &[[f64; 4]; 4]) -> Self {
        let rotation = rotation_of_rows([x, y, z].map(|row| DVec3::from_slice(row)));
        Pose { rotation, translation: DVec3::new(x[3], y[3], z[3]) }
    }

    /// From a quaternion (w, x, y, z), which need not have quite the length 1, and a translation, as COLMAP writes them.
    pub fn of_quaternion(quaternion: [f64; 4], translation: DVec3) -> Self {
        let [w, x, y, z] = (DVec4::from(quaternion) / DVec4::from(quaternion).length()).to_array();
        Pose { rotation: DMat3::from_quat(DQuat::from_xyzw(x, y, z, w)), translation }
    }

    /// The pose turned about the world's axes by `turn`, radians, and shifted along them by `shift`:
    /// `x_camera = R exp([turn]x) (x_world - center - shift)`.
    #[doc(hidden)]
    pub fn corrected(&self, turn: DVec3, shift: DVec3) -> Self {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(turn));
        Pose::at(self.center() + shift, self.rotation * turn)
    }

    /// The rows of the 4 x 4 matrix from world to camera.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let row = |k: usize| self.rotation.row(k).extend(self.translation[k]).to_array();
        [row(0), row(1), row(2), LAST_ROW]
    }

    /// A point of the world in the camera's axes.
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.rotation * world + self.translation
    }

    /// Where the camera is, world: `-R^-1 t`. The transpose would do for an exact rotation; of one with six decimals it would move the
    /// centre by a millionth of the way to the world's origin.
    pub fn center(&self) -> DVec3 {
        -(self.rotation.inverse() * self.translation)
    }

    /// The world's direction to the right of the picture.
    pub fn right(&self) -> DVec3 {
        self.rotation.row(0)
    }

    /// The world's direction downwards in the picture.
    pub fn down(&self) -> DVec3 {
        self.rotation.row(1)
    }

    /// The world's direction along the optical axis.
    pub fn forward(&self) -> DVec3 {
        self.rotation.row(2)
    }
}

impl serde::Serialize for Pose {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.rows().serialize(to)
    }
}

impl<'de> serde::Deserialize<'de> for Pose {
    /// The rotation is not checked.
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let rows = <[[f64; 4]; 4]>::deserialize(from)?;
        if rows[3] != LAST_ROW {
            let reason = format!("a pose has {:?} as its last row, not [0, 0, 0, 1]", rows[3]);
            return Err(serde::de::Error::custom(reason));
        }
        Ok(Pose::of_rows(&rows))
    }
}

pub(crate) fn rotation_of_rows([x, y, z]: [DVec3; 3]) -> DMat3 {
    DMat3::from_cols(x, y, z).transpose()
}

/// The unit quaternion (w, x, y, z), w >= 0, of a rotation (Shepperd's method). glam's own has other last bits, and the bytes of a
/// synthetic capture hold these.
pub(crate) fn quaternion(rotation: &DMat3) -> [f64; 4] {
    let m = |row: usize, column: usize| rotation.col(column)[row];
    let trace = m(0, 0) + m(1, 1) + m(2, 2);
    let mut q = [0.0; 4];
    if trace > 0.0 {
        let s = (trace + 1.0).sqrt() * 2.0;
        q = [s / 4.0, (m(2, 1) - m(1, 2)) / s, (m(0, 2) - m(2, 0)) / s, (m(1, 0) - m(0, 1)) / s];
    } else {
        let largest = |a: usize, b: usize| if m(b, b) > m(a, a) { b } else { a };
        let i = largest(largest(0, 1), 2);
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let s = (1.0 + m(i, i) - m(j, j) - m(k, k)).sqrt() * 2.0;
        q[0] = (m(k, j) - m(j, k)) / s;
        q[1 + i] = s / 4.0;
        q[1 + j] = (m(j, i) + m(i, j)) / s;
        q[1 + k] = (m(k, i) + m(i, k)) / s;
    }
    if q[0] < 0.0 { q.map(|v| -v) } else { q }
}
