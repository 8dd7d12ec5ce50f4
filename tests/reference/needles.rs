//! The factored covariance in f32: needles and extreme scales, rows n03 and n02 of `ivv-conformance`.

use crate::common::prelude::*;
use ivv::internals::reference::{Footprint, footprint, power};

const BLUR: f32 = 0.3;
/// Exponent at which opacity 1 falls to 1/255: beyond it nothing is drawn.
const POWER_MAX: f64 = 5.55;
const EPSILON: f64 = f32::EPSILON as f64;

/// Two rows of a random rotation times `pixels_per_unit`, as f32.
fn random_rows(random: &mut Random, pixels_per_unit: f64) -> [[f32; 3]; 2] {
    let q = random.vector::<4>(-1.0, 1.0).map(f64::from);
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|v| v / length);
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
    ];
    rows.map(|row| row.map(|v| (v * pixels_per_unit) as f32))
}

/// Rows along the axes: what underflows in one diagonal is not hidden by the other.
fn aligned_rows(pixels_per_unit: f32) -> [[f32; 3]; 2] {
    [[pixels_per_unit, 0.0, 0.0], [0.0, pixels_per_unit, 0.0]]
}

fn exact(g: [[f32; 3]; 2], s: [f32; 3]) -> Footprint<f64> {
    footprint(g.map(|row| row.map(f64::from)), s.map(f64::from), f64::from(BLUR))
}

/// The exponent as every peer writes it: det = ac - b^2, quadratic form of the inverse.
fn naive_power(g: [[f32; 3]; 2], s: [f32; 3], d: [f32; 2]) -> f32 {
    let v = g.map(|row| [row[0] * s[0], row[1] * s[1], row[2] * s[2]]);
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (a, b, c) = (dot(v[0], v[0]) + BLUR, dot(v[0], v[1]), dot(v[1], v[1]) + BLUR);
    let det = a * c - b * b;
    0.5 * (c / det * d[0] * d[0] + a / det * d[1] * d[1]) - b / det * d[0] * d[1]
}

fn point_in_ellipse(random: &mut Random, m: [[f64; 2]; 2]) -> [f32; 2] {
    let (angle, radius) = (random.uniform(0.0, 6.3), random.uniform(0.0, (2.0 * POWER_MAX).sqrt()));
    let w = [radius * angle.cos(), radius * angle.sin()];
    let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    [(m[1][1] * w[0] - m[0][1] * w[1]) / det, (m[0][0] * w[1] - m[1][0] * w[0]) / det].map(|x| x as f32)
}

/// How far an exponent is off, in units of what is allowed.
///
/// `near`: within 8 px of the centre, |d power| <= 1e-6 (1 + power). `ellipse`: anywhere in the ellipse, the same plus
/// what a relative rounding of m must cost, eps |m d| |m| |d|. Measured factored: 0.7 and 0.7 at every size.
#[derive(Default)]
struct Worst {
    near: f64,
    ellipse: f64,
    negative: bool,
}

impl Worst {
    fn record(&mut self, g: [[f32; 3]; 2], s: [f32; 3], d: [f32; 2], found: f64) {
        let m = exact(g, s).m;
        let d = d.map(f64::from);
        let truth = power(m, d);
        if truth > POWER_MAX {
            return;
        }
        let base = 1e-6 * (1.0 + truth);
        let m_norm = m.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
        let rounding = EPSILON * (2.0 * truth).sqrt() * m_norm * d[0].hypot(d[1]);
        // NaN must count as worst: f64::max would ignore it.
        let error = if found.is_nan() { f64::INFINITY } else { (found - truth).abs() };
        if d[0].hypot(d[1]) <= 8.0 {
            self.near = self.near.max(error / base);
        }
        self.ellipse = self.ellipse.max(error / (base + rounding));
        self.negative |= found < 0.0;
    }
}

/// Factored and naive form over needles with the given major axis in pixels, minor axes below 0.01.
fn worst_of_needles(major: f64) -> [Worst; 2] {
    let mut random = Random::new(7);
    let (mut factored, mut naive) = (Worst::default(), Worst::default());
    for _ in 0..1500 {
        let g = random_rows(&mut random, 1.0);
        let s = [major, random.uniform(1e-4, 0.01), random.uniform(1e-4, 0.01)].map(|x| x as f32);
        let m = footprint(g, s, BLUR).m;
        for d in [random.vector(-8.0, 8.0), random.vector(-2.0, 2.0), point_in_ellipse(&mut random, exact(g, s).m)] {
            factored.record(g, s, d, f64::from(power(m, d)));
            naive.record(g, s, d, f64::from(naive_power(g, s, d)));
        }
    }
    [factored, naive]
}

#[test]
fn the_factored_exponent_of_needles_is_right_in_f32_at_every_size() {
    for major in [0.01, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5] {
        let [factored, _] = worst_of_needles(major);
        assert!(factored.near > 0.0 && factored.ellipse > 0.0, "{major} px: nothing was compared");
        assert!(factored.near <= 1.0, "{major} px: {} of what is allowed near the centre", factored.near);
        assert!(factored.ellipse <= 1.0, "{major} px: {} of what is allowed in the ellipse", factored.ellipse);
        assert!(!factored.negative, "{major} px: a negative exponent");
    }
}

#[test]
fn the_naive_exponent_fails_the_needle_table() {
    for major in [1e2, 1e3, 1e4, 1e5] {
        let [factored, naive] = worst_of_needles(major);
        assert!(naive.near > 100.0, "{major} px: the naive form reaches only {}", naive.near);
        assert!(naive.ellipse > 10.0 * factored.ellipse, "{major} px: {}", naive.ellipse);
    }
    assert!(worst_of_needles(1e4)[1].negative, "the naive form has lost its negative exponents");
}

#[test]
fn extreme_scales_give_finite_positive_footprints_in_f32() {
    let scales = [-30.0f32, -15.0, -5.0, 0.0, 5.0, 10.0, 20.0, 40.0];
    let mut random = Random::new(3);
    for scale in scales {
        for n_axes in 1..=3 {
            for _ in 0..200 {
                let pixels_per_unit = random.pick(&[0.1, 10.0, 1e3]);
                let g = if random.bits().is_multiple_of(4) {
                    aligned_rows(pixels_per_unit as f32)
                } else {
                    random_rows(&mut random, pixels_per_unit)
                };
                let mut s = [random.pick(&[-12.0, -3.0]) as f32; 3];
                s[..n_axes].fill(scale);
                s.rotate_right((random.bits() % 3) as usize);
                let s = s.map(f32::exp);
                let (found, truth) = (footprint(g, s, BLUR), exact(g, s));
                let what = format!("scale {scale} on {n_axes} axes: {found:?} but {truth:?}");

                assert!(found.deviation.iter().chain(found.m.as_flattened()).all(|x| x.is_finite()), "{what}");
                for k in 0..2 {
                    let error = f64::from(found.deviation[k]) / truth.deviation[k] - 1.0;
                    assert!(error.abs() < 1e-6, "{what}");
                }
                // One entry of m is 0, so its determinant is one product: 1 / sqrt(det C).
                let root = |m: [[f64; 2]; 2]| (m[0][0] * m[1][1] - m[0][1] * m[1][0]).abs();
                let (root_found, root_truth) = (root(found.m.map(|row| row.map(f64::from))), root(truth.m));
                assert!(root_found > 0.0, "{what}");
                // A pancake seen edge-on is as thin as its normal is known: eps of the larger axis per minor.
                let sorted = {
                    let mut v = s.map(f64::from);
                    v.sort_by(f64::total_cmp);
                    v
                };
                let minor_error = 4.0 * EPSILON * pixels_per_unit.powi(2) * sorted[2] * sorted[1] * root_truth;
                let error = (root_found / root_truth - 1.0).abs();
                assert!(error < 1e-6 + minor_error, "{what}: {error:e} {minor_error:e}");
                let d = random.vector(-100.0, 100.0);
                assert!(power(found.m, d) >= 0.0, "{what}");
            }
        }
    }
}
