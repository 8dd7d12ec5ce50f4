//! Alignment of colours: what remains of an error when a camera's colour response is forgiven.

use crate::scene::Frame;
use crate::scene::capture::Picture;
use glam::{DMat4, DVec4};

/// Weight of the identity, per pixel: a picture of one colour does not fix the map.
const RIDGE: f64 = 1e-6;

/// Colours in [0, 1]: rendered, truth.
pub(super) type Pair = ([f64; 3], [f64; 3]);

/// The affine map of colours that brings a rendered view closest to its image (SPEC 10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorMap {
    // Rows; the last number is the constant.
    rows: [DVec4; 3],
}

impl ColorMap {
    /// Least squares over `pairs` with a slight pull towards the identity, which decides where they leave it open; the
    /// identity when there is no pair.
    pub(super) fn fit(pairs: &[Pair]) -> Self {
        let identity = std::array::from_fn(|c| DMat4::IDENTITY.col(c));
        if pairs.is_empty() {
            return ColorMap { rows: identity };
        }
        let ridge = RIDGE * pairs.len() as f64;
        let mut gram = DMat4::IDENTITY * ridge;
        let mut moments = identity.map(|row| row * ridge);
        for (rendered, truth) in pairs {
            let x = with_one(*rendered);
            gram += DMat4::from_cols(x * x.x, x * x.y, x * x.z, x);
            moments.iter_mut().zip(truth).for_each(|(m, t)| *m += x * *t);
        }
        let inverse = gram.inverse();
        ColorMap { rows: moments.map(|m| inverse * m) }
    }

    /// The map of `frame`, clamped to [0, 1], to `picture`, of the same size, over the pixels that are not hidden.
    pub fn of_view(frame: &Frame, picture: &Picture) -> Self {
        Self::fit(&visible_pairs(frame, picture))
    }

    /// A colour under the map, clamped to [0, 1].
    pub fn apply(&self, color: [f64; 3]) -> [f64; 3] {
        self.rows.map(|row| row.dot(with_one(color)).clamp(0.0, 1.0))
    }

    /// The colours of `frame` under the map, `[height][width]`.
    pub fn aligned(&self, frame: &Frame) -> Vec<[f32; 3]> {
        frame.color.iter().map(|color| self.apply(clamped(*color)).map(|x| x as f32)).collect()
    }
}

fn with_one([r, g, b]: [f64; 3]) -> DVec4 {
    DVec4::new(r, g, b, 1.0)
}

fn clamped(color: [f32; 3]) -> [f64; 3] {
    color.map(|x| f64::from(x.clamp(0.0, 1.0)))
}

/// The pixels of a view that the mask does not hide: colour clamped to [0, 1], and truth.
pub(super) fn visible_pairs(frame: &Frame, picture: &Picture) -> Vec<Pair> {
    let both = frame.color.iter().zip(&picture.pixels);
    both.filter_map(|(color, word)| {
        let [r, g, b, mask] = word.to_le_bytes();
        (mask > 0).then(|| (clamped(*color), [r, g, b].map(|c| f64::from(c) / 255.0)))
    })
    .collect()
}

/// Mean squared error over the channels of `pairs` after the map that fits them best. NaN when there is no pair.
pub(super) fn aligned_mse(pairs: &[Pair]) -> f64 {
    let map = ColorMap::fit(pairs);
    let errors = pairs.iter().flat_map(|(rendered, truth)| {
        let mapped = map.apply(*rendered);
        (0..3).map(move |c| (mapped[c] - truth[c]).powi(2))
    });
    errors.sum::<f64>() / (3.0 * pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::{ColorMap, aligned_mse};
    use crate::scene::Frame;
    use crate::scene::capture::Picture;

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

    #[test]
    fn what_few_pixels_leave_open_is_decided_by_the_identity() {
        let identity = ColorMap::fit(&[]);
        assert_eq!(identity.apply([0.25, 0.5, 0.75]), [0.25, 0.5, 0.75]);
        assert_eq!(identity.apply([-1.0, 0.0, 2.0]), [0.0, 0.0, 1.0]);
        // One pixel: it is met, and what lies far from it moves along.
        let one = ColorMap::fit(&[([0.4, 0.2, 0.1], [0.5, 0.2, 0.1])]);
        let [r, g, b] = one.apply([0.4, 0.2, 0.1]);
        assert!((r - 0.5).abs() < 1e-5 && (g - 0.2).abs() < 1e-5 && (b - 0.1).abs() < 1e-5, "{r} {g} {b}");
        let black = one.apply([0.0; 3]);
        assert!(black[0] > 0.05 && black[0] < 0.15 && black[1] < 1e-5, "{black:?}");
        // Grey pixels alone: nothing is said of colours, so a colour keeps what sets it apart from grey.
        let greys: Vec<_> = (0..9).map(|i| ([f64::from(i) / 10.0; 3], [f64::from(i) / 20.0 + 0.1; 3])).collect();
        let map = ColorMap::fit(&greys);
        let red = map.apply([0.6, 0.4, 0.4]);
        assert!(red.iter().all(|x| x.is_finite()) && red[0] > red[1] && red[0] > red[2], "{red:?}");
    }

    #[test]
    fn a_view_is_aligned_over_the_pixels_that_are_not_hidden() {
        let color = |i: u32| [(i % 5) as f32 / 6.0 + 0.1, (i % 7) as f32 / 8.0, (i % 11) as f32 / 12.0];
        let truth = |i: u32| {
            let [r, g, b] = color(i).map(|x| ((0.5 * x + 0.25) * 255.0).round() as u8);
            // Every third pixel is hidden and wrong.
            if i.is_multiple_of(3) { 0x0000_00ff } else { u32::from_le_bytes([r, g, b, 255]) }
        };
        let (width, height) = (16, 12);
        let n = (width * height) as usize;
        let frame = Frame {
            width,
            height,
            color: (0..n as u32).map(color).collect(),
            alpha: vec![1.0; n],
            depth: vec![1.0; n],
            inverse_depth: vec![1.0; n],
            flow: vec![[0.0; 2]; n],
        };
        let picture = Picture::new(width, height, (0..n as u32).map(truth).collect());
        let map = ColorMap::of_view(&frame, &picture);
        let aligned = map.aligned(&frame);
        assert_eq!(aligned.len(), n);
        for (found, i) in aligned.iter().zip(0..) {
            let expected = color(i).map(|x| 0.5 * x + 0.25);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 4e-3), "{found:?} for {expected:?}");
        }
    }
}
