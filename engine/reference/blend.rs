//! Front-to-back blending (SPEC 3), by brute force over the depth-sorted Gaussians.

use super::input::{Camera, Params, Rules};
use super::math::{dot, max_abs, sub};
use super::project::{Projected, power, project};
use super::real::Real;
use crate::scene::{Splats, View};
use crate::settings::Constants;

/// Roundings, in units of f32's epsilon, that the bands allow a device for one position, depth or factor: a rotation
/// (three products, three sums), a translation, a division, a product and a sum, each half an epsilon, doubled.
const ROUNDINGS: f64 = 8.0 * f32::EPSILON as f64;

/// Relative width of the bands besides what positions contribute: exp and the product with the opacity (A.1, A.3).
const BAND: f64 = 1e-5;

/// A rendered view, row-major, top first. None of the sums is normalised by alpha.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs<R> {
    pub width: u32,
    pub height: u32,
    /// Blended colour with the background, `[H][W][3]`.
    pub color: Vec<[R; 3]>,
    /// 1 - final transmittance, `[H][W]`.
    pub alpha: Vec<R>,
    /// Sum of weight times camera depth, scene units, `[H][W]`.
    pub depth: Vec<R>,
    /// Sum of weight over camera depth, 1 / scene units, `[H][W]`.
    pub inverse_depth: Vec<R>,
    /// Sum of weight times projected velocity, pixels per `flow_dt`, `[H][W][2]`.
    pub flow: Vec<[R; 2]>,
    /// Gaussians that were added, `[H][W]`.
    pub n_contributing: Vec<u32>,
    /// True if f32 rounding may change which Gaussians are added, or their order, `[H][W]`. See [`render`].
    pub near_discontinuity: Vec<bool>,
}

#[derive(Default)]
pub(super) struct Pixel<R> {
    pub(super) color: [R; 3],
    pub(super) transmittance: R,
    depth: R,
    inverse_depth: R,
    flow: [R; 2],
    n_contributing: u32,
    near_discontinuity: bool,
}

/// The truth: `splats` seen by `view` in double precision, from the device's (f32) parameters and constants.
pub fn render_f64(splats: &Splats, view: &View, constants: &Constants) -> Outputs<f64> {
    render(&Params::new(splats, view), view, &Rules::new(constants))
}

/// Renders `params` seen by `view`; the time offset and the background of `view` are ignored for those of `params`.
///
/// `near_discontinuity` marks the pixels where a comparison that decides membership or order is closer than f32 can
/// tell: an alpha evaluated near alpha_min, a transmittance near t_min, a depth near `near`, or two Gaussians added one
/// after the other with almost the same depth. The width follows the roundings: a position is known to
/// `ROUNDINGS * (focal (1 + 2 |t| / z) + |xy| + |d| + size)` pixels, which changes the exponent by |m d| |m| times that, and the
/// errors of alpha add up in the transmittance. Exactly equal depths are not marked: their order is the index.
pub fn render<R: Real>(params: &Params<R>, view: &View, rules: &Rules<R>) -> Outputs<R> {
    let camera = Camera::new(view);
    let splats = visible_sorted(params, &camera, rules);
    let boxes: Vec<[f64; 4]> = splats.iter().map(bounds).collect();

    let (width, height) = (view.intrinsics.width, view.intrinsics.height);
    let mut outputs = Outputs { width, height, ..Outputs::default() };
    for row in 0..view.intrinsics.height {
        let y = f64::from(row) + 0.5;
        let in_row: Vec<usize> = (0..splats.len()).filter(|&k| boxes[k][2] <= y && y <= boxes[k][3]).collect();
        for column in 0..view.intrinsics.width {
            let x = f64::from(column) + 0.5;
            let candidates = in_row.iter().filter(|&&k| boxes[k][0] <= x && x <= boxes[k][1]).map(|&k| &splats[k]);
            outputs.push(blend([x, y], candidates, &camera, rules), params.background);
        }
    }
    outputs
}

/// Projects every Gaussian and sorts by depth, ties by index. The rules are relaxed by more than the bands, so that
/// Gaussians only just dropped still mark pixels; [`blend`] applies the exact rules.
fn visible_sorted<R: Real>(params: &Params<R>, camera: &Camera<R>, rules: &Rules<R>) -> Vec<Projected<R>> {
    let relaxed = Rules {
        alpha_min: rules.alpha_min * R::from_f64(1.0 - 1e-3),
        near: rules.near * R::from_f64(1.0 - 1e-3),
        ..*rules
    };
    let time = camera.shifted_time(params.time_offset);
    let mut splats: Vec<_> =
        (0..params.len()).filter_map(|i| project(&params.gaussian(i), camera, time, &relaxed)).collect();
    splats.sort_by(|a, b| a.z.to_f64().total_cmp(&b.z.to_f64()));
    splats
}

/// x and y range of the pixels that can see `splat`, with slack for the rounding of its own arithmetic.
pub(super) fn bounds<R: Real>(splat: &Projected<R>) -> [f64; 4] {
    let [x, y] = splat.xy.map(R::to_f64);
    let [rx, ry] = splat.extent.map(|r| r.to_f64() * 1.0001 + 0.01);
    [x - rx, x + rx, y - ry, y + ry]
}

/// Blends the depth-sorted `candidates` at one pixel centre.
pub(super) fn blend<'a, R: Real + 'a>(
    centre: [f64; 2],
    candidates: impl Iterator<Item = &'a Projected<R>>,
    camera: &Camera<R>,
    rules: &Rules<R>,
) -> Pixel<R> {
    let at = centre.map(R::from_f64);
    let mut pixel = Pixel { transmittance: R::one(), ..Pixel::default() };
    let mut z_before = f64::NEG_INFINITY;
    let mut t_error = BAND;
    for splat in candidates {
        let alpha = splat.alpha_at(at, rules);
        let alpha_error = alpha_error(splat, sub(at, splat.xy), camera);
        pixel.near_discontinuity |= close(alpha, rules.alpha_min, alpha_error);
        let bright = alpha >= rules.alpha_min;
        if !bright {
            continue;
        }
        let depth_error = ROUNDINGS * (splat.z.to_f64() + max_abs(camera.translation).to_f64());
        pixel.near_discontinuity |= (splat.z - rules.near).to_f64().abs() <= depth_error;
        let in_front = splat.z > rules.near;
        if !in_front {
            continue;
        }
        let gap = splat.z.to_f64() - z_before;
        pixel.near_discontinuity |= gap > 0.0 && gap <= depth_error;

        let left = pixel.transmittance * (R::one() - alpha);
        t_error += alpha_error * (alpha / (R::one() - alpha)).to_f64();
        pixel.near_discontinuity |= close(left, rules.t_min, t_error);
        let fits = left >= rules.t_min;
        if !fits {
            break;
        }
        let weight = alpha * pixel.transmittance;
        for (sum, value) in pixel.color.iter_mut().zip(splat.color) {
            *sum = *sum + weight * value;
        }
        pixel.depth = pixel.depth + weight * splat.z;
        pixel.inverse_depth = pixel.inverse_depth + weight / splat.z;
        for (sum, value) in pixel.flow.iter_mut().zip(splat.flow) {
            *sum = *sum + weight * value;
        }
        pixel.transmittance = left;
        pixel.n_contributing += 1;
        z_before = splat.z.to_f64();
    }
    pixel
}

/// Relative error that f32 may make in the alpha of `splat` at offset `d` pixels.
fn alpha_error<R: Real>(splat: &Projected<R>, d: [R; 2], camera: &Camera<R>) -> f64 {
    let focal = max_abs(camera.focal).to_f64();
    let lever = 1.0 + 2.0 * max_abs(camera.translation).to_f64() / splat.z.to_f64();
    let pixels = max_abs(splat.xy).to_f64() + max_abs(d).to_f64() + max_abs(camera.size).to_f64();
    let m_norm = (dot(splat.m[0], splat.m[0]) + dot(splat.m[1], splat.m[1])).to_f64().sqrt();
    let m_d = (2.0 * power(splat.m, d).to_f64()).sqrt();
    BAND + ROUNDINGS * (focal * lever + pixels) * m_norm * m_d
}

/// True if `value` is within the relative `width` of `threshold`.
fn close<R: Real>(value: R, threshold: R, width: f64) -> bool {
    (value - threshold).to_f64().abs() <= width * threshold.to_f64()
}

impl<R: Real> Outputs<R> {
    /// Appends a pixel over `background`.
    fn push(&mut self, pixel: Pixel<R>, background: [R; 3]) {
        self.color.push(std::array::from_fn(|k| pixel.color[k] + pixel.transmittance * background[k]));
        self.alpha.push(R::one() - pixel.transmittance);
        self.depth.push(pixel.depth);
        self.inverse_depth.push(pixel.inverse_depth);
        self.flow.push(pixel.flow);
        self.n_contributing.push(pixel.n_contributing);
        self.near_discontinuity.push(pixel.near_discontinuity);
    }

    /// The same view with `f` applied to every number.
    pub fn map<S>(&self, f: impl Fn(R) -> S + Copy) -> Outputs<S> {
        Outputs {
            width: self.width,
            height: self.height,
            color: self.color.iter().map(|c| c.map(f)).collect(),
            alpha: self.alpha.iter().copied().map(f).collect(),
            depth: self.depth.iter().copied().map(f).collect(),
            inverse_depth: self.inverse_depth.iter().copied().map(f).collect(),
            flow: self.flow.iter().map(|x| x.map(f)).collect(),
            n_contributing: self.n_contributing.clone(),
            near_discontinuity: self.near_discontinuity.clone(),
        }
    }
}
