//! Gradients of several images, added up in fixed point.

/// A gradient of 1 in a sum.
const SCALE: f64 = (1u64 << 50) as f64;
/// A pull of 1 in a sum.
const PULL_SCALE: f64 = (1u64 << 40) as f64;

/// The sum of gradients, each rounded to a multiple of 2^-50 (halves away from zero) and held within 16 but for a float's last
/// bit, in units of 2^-50.
pub fn batch_sum(gradients: &[f32]) -> i64 {
    let most = 16.0 * (1.0 - 2f64.powi(-24));
    gradients.iter().map(|g| (f64::from(*g).clamp(-most, most) * SCALE).round() as i64).sum()
}

/// The sum of pulls on a centre, held within 0 and 32, in units of 2^-40, and how many there are, in units of 2^52. Those below 0 do
/// not count.
pub fn batch_pulls(pulls: &[f32]) -> i64 {
    let counted = pulls.iter().filter(|pull| **pull >= 0.0);
    counted.map(|pull| (1i64 << 52) + (f64::from(*pull).min(32.0) * PULL_SCALE).round() as i64).sum()
}

pub fn batch_gradient(sum: i64) -> f64 {
    sum as f64 / SCALE
}

/// Element `element` of row `row` among `n` rows, where machines exchange them: all rows' first elements, then all their second ones.
pub fn batch_place(element: usize, row: usize, n: usize) -> usize {
    element * n + row
}
