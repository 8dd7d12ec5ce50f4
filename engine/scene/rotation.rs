//! Rotations in the ways that files write them.

/// The unit quaternion (w, x, y, z), w >= 0, of a rotation given by its rows (Shepperd's method). Other columns of the rows
/// are ignored.
pub(crate) fn quaternion<const N: usize>(rows: &[[f64; N]]) -> [f64; 4] {
    let m = |row: usize, column: usize| rows[row][column];
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

/// The rows of the rotation about a vector by its length in radians (Rodrigues).
pub(crate) fn rotation_of_vector(vector: [f64; 3]) -> [[f64; 3]; 3] {
    let angle = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z] = if angle > 0.0 { vector.map(|v| v / angle) } else { [0.0; 3] };
    let (sin, cos) = angle.sin_cos();
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let axis = [x, y, z];
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let unit = if row == column { cos } else { 0.0 };
            unit + sin * cross[row][column] + (1.0 - cos) * axis[row] * axis[column]
        })
    })
}
