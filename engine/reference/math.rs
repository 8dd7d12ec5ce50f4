//! The few vector operations that the projection needs.

use super::real::Real;

pub fn dot<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> R {
    let mut sum = a[0] * b[0];
    for k in 1..N {
        sum = sum + a[k] * b[k];
    }
    sum
}

pub fn add<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> [R; N] {
    std::array::from_fn(|k| a[k] + b[k])
}

pub(crate) fn sub<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> [R; N] {
    std::array::from_fn(|k| a[k] - b[k])
}

pub fn scaled<R: Real, const N: usize>(a: [R; N], s: R) -> [R; N] {
    a.map(|x| x * s)
}

pub fn max_abs<R: Real, const N: usize>(a: [R; N]) -> R {
    a.into_iter().fold(R::zero(), |m, x| x.abs().max(m))
}

pub fn apply<R: Real, const N: usize, const M: usize>(rows: [[R; N]; M], v: [R; N]) -> [R; M] {
    rows.map(|row| dot(row, v))
}

/// `row` times the 3 x 3 matrix.
pub(crate) fn row_times<R: Real>(row: [R; 3], matrix: [[R; 3]; 3]) -> [R; 3] {
    std::array::from_fn(|k| dot(row, [matrix[0][k], matrix[1][k], matrix[2][k]]))
}

/// Rotation matrix (rows) of a quaternion (w, x, y, z) of any length above 1e-37; `None` below, where no direction
/// can be told. The largest component is divided out first, so that no length overflows in f32.
pub fn rotation<R: Real>(q: [R; 4]) -> Option<[[R; 3]; 3]> {
    let largest = max_abs(q);
    let has_direction = largest.to_f64() > 1e-37;
    if !has_direction {
        return None;
    }
    let q = q.map(|x| x / largest);
    let length = dot(q, q).sqrt();
    let [w, x, y, z] = q.map(|x| x / length);
    let (one, two) = (R::one(), R::from_f64(2.0));
    Some([
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ])
}
