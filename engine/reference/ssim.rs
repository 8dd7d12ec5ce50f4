//! The photometric loss of SPEC 4 (0.8 L1 + 0.2 (1 - SSIM)), by the definition, a window at a time.

use super::real::Real;

/// Taps of SSIM's window along one axis.
const TAPS: usize = 11;
/// Its standard deviation, pixels.
const SIGMA: f64 = 1.5;
/// Keeps the means' quotient finite, for colours in [0, 1].
const C1: f64 = 0.01 * 0.01;
/// Keeps the variances' quotient finite, for colours in [0, 1].
const C2: f64 = 0.03 * 0.03;
/// Weight of 1 - SSIM; L1 has the rest.
const SSIM_WEIGHT: f64 = 0.2;

/// The photometric loss of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photometry<R> {
    /// Mean SSIM over the visible pixels and the channels, 1 for equal pictures.
    pub ssim: R,
    /// Mean absolute error over the visible pixels and the channels.
    pub l1: R,
}

impl<R: Real> Photometry<R> {
    /// 0.8 L1 + 0.2 (1 - SSIM).
    pub fn loss(&self) -> R {
        R::from_f64(1.0 - SSIM_WEIGHT) * self.l1 + R::from_f64(SSIM_WEIGHT) * (R::one() - self.ssim)
    }
}

/// Compares `image` with `truth`, both `[height][width]`. A word of the truth holds RGB and the mask, 8 bits each from
/// the least significant byte on. Where the mask hides a pixel the picture takes the truth's colour, which has no error;
/// the means are over the `n_visible` others (at least one), and a hidden pixel's SSIM counts by how much it is below 1.
/// SSIM is taken at every `stride`-th pixel of every `stride`-th row, each of which stands for its share of all.
pub fn photometric<R: Real>(
    image: &[[R; 3]],
    truth: &[u32],
    size: [usize; 2],
    n_visible: usize,
    stride: usize,
) -> Photometry<R> {
    let values: Vec<[f64; 4]> = truth.iter().map(|word| word.to_le_bytes().map(|b| f64::from(b) / 255.0)).collect();
    let n = R::from_f64(3.0 * n_visible as f64);
    let is_taken = |pixel: usize| [pixel % size[0], pixel / size[0]].into_iter().all(|at| at.is_multiple_of(stride));
    let share = R::from_f64(values.len() as f64 / (0..values.len()).filter(|pixel| is_taken(*pixel)).count() as f64);
    let (mut lost, mut l1) = (R::zero(), R::zero());
    for channel in 0..3 {
        let y: Vec<R> = values.iter().map(|v| R::from_f64(v[channel])).collect();
        let mix = |(color, v): (&[R; 3], &[f64; 4])| {
            color[channel] * R::from_f64(v[3]) + R::from_f64(v[channel] * (1.0 - v[3]))
        };
        let x: Vec<R> = image.iter().zip(&values).map(mix).collect();
        let places = ssim_map(&x, &y, size).into_iter().enumerate().filter(|(pixel, _)| is_taken(*pixel));
        lost = places.fold(lost, |sum, (_, s)| sum + (R::one() - s));
        l1 = x.iter().zip(&y).fold(l1, |sum, (x, y)| sum + error(*x, *y));
    }
    Photometry { ssim: R::one() - share * lost / n, l1: l1 / n }
}

/// SSIM of every pixel of one channel, `[height][width]`: 11 x 11 Gaussian window of standard deviation 1.5 pixels,
/// zeros outside the picture, population moments, variances at least 0 with no derivative where that holds.
pub fn ssim_map<R: Real>(x: &[R], y: &[R], size: [usize; 2]) -> Vec<R> {
    let product = |a: &[R], b: &[R]| -> Vec<R> { a.iter().zip(b).map(|(a, b)| *a * *b).collect() };
    let [mx, my] = [x, y].map(|values| filtered(values, size));
    let [exx, eyy, exy] = [(x, x), (y, y), (x, y)].map(|(a, b)| filtered(&product(a, b), size));
    let (c1, c2, two) = (R::from_f64(C1), R::from_f64(C2), R::from_f64(2.0));
    (0..x.len())
        .map(|i| {
            let (mx, my) = (mx[i], my[i]);
            let (sxx, syy, sxy) = (positive(exx[i] - mx * mx), positive(eyy[i] - my * my), exy[i] - mx * my);
            let means = (two * mx * my + c1) / (mx * mx + my * my + c1);
            means * (two * sxy + c2) / (sxx + syy + c2)
        })
        .collect()
}

/// `values` under the window: along the rows, then along the columns.
fn filtered<R: Real>(values: &[R], [width, height]: [usize; 2]) -> Vec<R> {
    let window = window();
    // One axis: `n` places, of which this one is number `at`, `step` apart.
    let along = |values: &[R], i: usize, at: usize, n: usize, step: usize| {
        let mut sum = R::zero();
        for (k, w) in window.iter().enumerate() {
            if let Some(other) = (at + k).checked_sub(TAPS / 2).filter(|other| *other < n) {
                sum = sum + R::from_f64(*w) * values[i + other * step - at * step];
            }
        }
        sum
    };
    let rows: Vec<R> = (0..values.len()).map(|i| along(values, i, i % width, width, 1)).collect();
    (0..values.len()).map(|i| along(&rows, i, i / width, height, width)).collect()
}

/// The taps, normalised in double precision.
fn window() -> [f64; TAPS] {
    let taps: [f64; TAPS] = std::array::from_fn(|k| {
        let d = k as f64 - (TAPS / 2) as f64;
        (-d * d / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = taps.iter().sum();
    taps.map(|tap| tap / sum)
}

/// `x` where it is above 0; otherwise 0 without a derivative.
fn positive<R: Real>(x: R) -> R {
    if x > R::zero() { x } else { R::zero() }
}

/// |x - y| with derivative 0 where they are equal.
fn error<R: Real>(x: R, y: R) -> R {
    if x == y { R::zero() } else { (x - y).abs() }
}
