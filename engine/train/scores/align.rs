//! Alignment of colours: errors without a camera's colour response.

use crate::parallel::{in_parallel, threads};
use crate::scene::Frame;
use crate::scene::capture::Picture;
use glam::{DMat4, DVec4};
use std::ops::Range;

/// Weight of the identity, per pixel: a picture of one colour does not fix the map.
const RIDGE: f64 = 1e-6;

/// Pixels that a thread adds up at a time, on every machine: so the sums have the same bits.
const PART: usize = 1 << 16;

/// Rendered and true colours in [0, 1].
type Pair = ([f64; 3], [f64; 3]);

/// The affine map of colours that brings a rendered view closest to its image (SPEC 10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorMap {
    // Rows; the last number is the constant.
    rows: [DVec4; 3],
}

/// Sums over the pixels of a view, and of their squared errors before the fit.
#[derive(Clone, Copy)]
struct Sums {
    n: usize,
    squares: f64,
    gram: DMat4,
    moments: [DVec4; 3],
}

impl Sums {
    fn of(pairs: impl Iterator<Item = Pair>) -> Self {
        let mut sums = Sums { n: 0, squares: 0.0, gram: DMat4::ZERO, moments: [DVec4::ZERO; 3] };
        for (rendered, truth) in pairs {
            let x = with_one(rendered);
            sums.n += 1;
            sums.squares += square_of(rendered, truth);
            sums.gram += DMat4::from_cols(x * x.x, x * x.y, x * x.z, x);
            sums.moments.iter_mut().zip(truth).for_each(|(m, t)| *m += x * t);
        }
        sums
    }

    fn and(self, other: Self) -> Self {
        Sums {
            n: self.n + other.n,
            squares: self.squares + other.squares,
            gram: self.gram + other.gram,
            moments: std::array::from_fn(|c| self.moments[c] + other.moments[c]),
        }
    }
}

impl ColorMap {
    /// Least squares with a slight pull towards the identity, which decides what the pixels leave open.
    fn fit(sums: &Sums) -> Self {
        let identity = std::array::from_fn(|c| DMat4::IDENTITY.col(c));
        if sums.n == 0 {
            return ColorMap { rows: identity };
        }
        let ridge = RIDGE * sums.n as f64;
        let inverse = (DMat4::IDENTITY * ridge + sums.gram).inverse();
        ColorMap { rows: std::array::from_fn(|c| inverse * (identity[c] * ridge + sums.moments[c])) }
    }

    /// Brings `frame`, clamped to [0, 1], to `picture` over the pixels that are not hidden.
    pub fn of_view(frame: &Frame, picture: &Picture) -> Self {
        Self::fit(&sums_of(frame, picture))
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

/// Mean squared errors of a view over the channels of the pixels that the mask does not hide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Errors {
    pub n: usize,
    /// Error of the colour, clamped to [0, 1].
    pub plain: f64,
    pub aligned: f64,
}

impl Errors {
    /// Of `frame` against `picture`; 0 if all is hidden.
    pub fn of_view(frame: &Frame, picture: &Picture) -> Self {
        let sums = sums_of(frame, picture);
        let map = ColorMap::fit(&sums);
        let of_part =
            |part| visible(frame, picture, part).map(|(rendered, truth)| square_of(map.apply(rendered), truth));
        let aligned: f64 = by_parts(frame, |part| of_part(part).sum::<f64>()).into_iter().sum();
        let n_values = 3.0 * sums.n.max(1) as f64;
        Errors { n: sums.n, plain: sums.squares / n_values, aligned: aligned / n_values }
    }
}

fn with_one([r, g, b]: [f64; 3]) -> DVec4 {
    DVec4::new(r, g, b, 1.0)
}

fn clamped(color: [f32; 3]) -> [f64; 3] {
    color.map(|x| f64::from(x.clamp(0.0, 1.0)))
}

fn square_of(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// The pixels of a part of a view that the mask does not hide: clamped, and true.
fn visible(frame: &Frame, picture: &Picture, part: Range<usize>) -> impl Iterator<Item = Pair> {
    let both = frame.color[part.clone()].iter().zip(&picture.pixels[part]);
    both.filter_map(|(color, word)| {
        let [r, g, b, mask] = word.to_le_bytes();
        (mask > 0).then(|| (clamped(*color), [r, g, b].map(|c| f64::from(c) / 255.0)))
    })
}

fn sums_of(frame: &Frame, picture: &Picture) -> Sums {
    let parts = by_parts(frame, |part| Sums::of(visible(frame, picture, part)));
    parts.into_iter().reduce(Sums::and).unwrap_or_else(|| Sums::of(std::iter::empty()))
}

fn by_parts<T: Send>(frame: &Frame, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let n = frame.color.len();
    let part = |k: usize| k * PART..((k + 1) * PART).min(n);
    let done = in_parallel(n.div_ceil(PART), threads(), |k| Ok(work(part(k))), |_| ());
    done.unwrap_or_else(|never| unreachable!("no part fails: {never}"))
}

#[cfg(test)]
mod tests {
    use super::{ColorMap, Errors, Pair, Sums, square_of};
    use crate::scene::Frame;
    use crate::scene::capture::Picture;

    fn fit(pairs: &[Pair]) -> ColorMap {
        ColorMap::fit(&Sums::of(pairs.iter().copied()))
    }

    fn aligned_mse(pairs: &[Pair]) -> f64 {
        let map = fit(pairs);
        let squares = pairs.iter().map(|(rendered, truth)| square_of(map.apply(*rendered), *truth));
        squares.sum::<f64>() / (3 * pairs.len()) as f64
    }

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
    }

    #[test]
    fn what_few_pixels_leave_open_is_decided_by_the_identity() {
        let identity = fit(&[]);
        assert_eq!(identity.apply([0.25, 0.5, 0.75]), [0.25, 0.5, 0.75]);
        assert_eq!(identity.apply([-1.0, 0.0, 2.0]), [0.0, 0.0, 1.0]);
        // One pixel: it is met, and what lies far from it moves along.
        let one = fit(&[([0.4, 0.2, 0.1], [0.5, 0.2, 0.1])]);
        let [r, g, b] = one.apply([0.4, 0.2, 0.1]);
        assert!((r - 0.5).abs() < 1e-5 && (g - 0.2).abs() < 1e-5 && (b - 0.1).abs() < 1e-5, "{r} {g} {b}");
        let black = one.apply([0.0; 3]);
        assert!(black[0] > 0.05 && black[0] < 0.15 && black[1] < 1e-5, "{black:?}");
        // Grey pixels alone: nothing is said of colours, so a colour keeps what sets it apart from grey.
        let greys: Vec<_> = (0..9).map(|i| ([f64::from(i) / 10.0; 3], [f64::from(i) / 20.0 + 0.1; 3])).collect();
        let map = fit(&greys);
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
        let frame = Frame { width, height, color: (0..n as u32).map(color).collect(), ..Frame::default() };
        let picture = Picture::new(width, height, (0..n as u32).map(truth).collect());
        let map = ColorMap::of_view(&frame, &picture);
        let aligned = map.aligned(&frame);
        assert_eq!(aligned.len(), n);
        for (found, i) in aligned.iter().zip(0..) {
            let expected = color(i).map(|x| 0.5 * x + 0.25);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 4e-3), "{found:?} for {expected:?}");
        }
    }

    #[test]
    fn errors_of_a_view_in_parts_are_those_of_the_whole() {
        // More than two parts, the last one short.
        let (width, height) = (401, 331);
        let n = width * height;
        let color = |i: u32| [0.0, 0.4, 0.9].map(|c| c + 0.3 * (i as f32 * 0.7 + c).sin());
        let word = |i: u32| u32::from_le_bytes([(i % 251) as u8, (i % 241) as u8, (i % 239) as u8, (i % 5) as u8]);
        let frame = Frame { width, height, color: (0..n).map(color).collect(), ..Frame::default() };
        let picture = Picture::new(width, height, (0..n).map(word).collect());
        let clamp = |i: u32| color(i).map(|x| f64::from(x.clamp(0.0, 1.0)));
        let truth = |i: u32| std::array::from_fn(|c| f64::from(word(i).to_le_bytes()[c]) / 255.0);
        let pairs: Vec<Pair> = (0..n).filter(|i| i % 5 != 0).map(|i| (clamp(i), truth(i))).collect();
        let found = Errors::of_view(&frame, &picture);
        let plain = pairs.iter().map(|(a, b)| square_of(*a, *b)).sum::<f64>() / (3 * pairs.len()) as f64;
        assert_eq!(found.n, pairs.len());
        assert!((found.plain / plain - 1.0).abs() < 1e-12, "{} and {plain}", found.plain);
        assert!((found.aligned / aligned_mse(&pairs) - 1.0).abs() < 1e-9 && found.aligned < 0.9 * plain);
        let hidden = Picture::new(width, height, vec![0x00ff_ffff; n as usize]);
        assert_eq!(Errors::of_view(&frame, &hidden), Errors { n: 0, plain: 0.0, aligned: 0.0 });
    }
}
