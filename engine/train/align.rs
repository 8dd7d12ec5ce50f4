//! Alignment of colours: what remains of an error when a camera's colour response is forgiven.

use glam::{DMat4, DVec4};

/// Weight of the identity, per pixel: a picture of one colour does not fix the map.
const RIDGE: f64 = 1e-6;

/// Mean squared error over the channels of `pairs` (rendered, truth; colours in [0, 1]) after the affine map of colours
/// that fits the truth best in least squares; clamped to [0, 1]. NaN when there is no pair.
pub(super) fn aligned_mse(pairs: &[([f64; 3], [f64; 3])]) -> f64 {
    let n = pairs.len() as f64;
    let with_one = |[r, g, b]: [f64; 3]| DVec4::new(r, g, b, 1.0);
    let mut gram = DMat4::IDENTITY * (RIDGE * n);
    let mut moments: [DVec4; 3] = std::array::from_fn(|c| DMat4::IDENTITY.col(c) * (RIDGE * n));
    for (rendered, truth) in pairs {
        let x = with_one(*rendered);
        gram += DMat4::from_cols(x * x.x, x * x.y, x * x.z, x);
        moments.iter_mut().zip(truth).for_each(|(m, t)| *m += x * *t);
    }
    let inverse = gram.inverse();
    let maps = moments.map(|m| inverse * m);
    let errors = pairs.iter().flat_map(|(rendered, truth)| {
        let x = with_one(*rendered);
        maps.iter().zip(truth).map(move |(map, t)| (map.dot(x).clamp(0.0, 1.0) - t).powi(2))
    });
    errors.sum::<f64>() / (3.0 * n)
}

#[cfg(test)]
mod tests {
    use super::aligned_mse;

    #[test]
    fn an_affine_map_is_undone_and_nothing_else() {
        let rendered = |i: u32| {
            [0.3 + 0.004 * f64::from(i % 101), 0.2 + 0.005 * f64::from(i % 37), 0.5 + 0.01 * f64::from(i % 13)]
        };
        let mapped = |[r, g, b]: [f64; 3]| [0.8 * r + 0.05, 0.1 * r + 0.7 * g, 0.9 * b - 0.02];
        let pairs: Vec<_> = (0..500).map(|i| (rendered(i), mapped(rendered(i)))).collect();
        assert!(aligned_mse(&pairs) < 1e-9, "{}", aligned_mse(&pairs));
        let alternate = |i: u32| if i.is_multiple_of(2) { 0.1 } else { -0.1 };
        let noisy: Vec<_> = (0..500).map(|i| (rendered(i), mapped(rendered(i)).map(|t| t + alternate(i)))).collect();
        let left = aligned_mse(&noisy);
        assert!((0.009..=0.01).contains(&left), "{left} of 0.01");
        // One colour: the mean is matched, and the map stays finite.
        let flat: Vec<_> = (0..100).map(|i| ([0.5; 3], [0.6 + alternate(i); 3])).collect();
        assert!((aligned_mse(&flat) - 0.01).abs() < 1e-5, "{}", aligned_mse(&flat));
        assert!(aligned_mse(&[]).is_nan());
    }
}
