//! Colours on the format's grids: base colours from 0 to 1, harmonics in steps of 8/255 and coarser.
//!
//! If each of 16 coefficients were rounded by itself, a colour would be off by the errors of all of them, and a base colour beyond
//! [0, 1] by all that is cut from it. But what shows is the colour towards the cameras, and those are in fewer directions than
//! there are functions. So the coefficients of a Gaussian are rounded one after the other, the last harmonics first, and those
//! that are still to come make good what the error does to the colour towards the cameras: Babai's nearest plane, in the norm of
//! the squared error over them. A base colour that is cut comes before all others.

use super::Grades;
use crate::scene::{SH_C0, View};
use fourdgs::quantization::{SH_QUANT_HI, SH_QUANT_LO, quantize_sh, sh_coefficient};
use std::f64::consts::PI;

const K: usize = 16;
/// Weight of the mean over all directions against that over the cameras: what nobody looks at stays about as it is.
const ANYWHERE: f64 = 0.02;
/// A base colour this far beyond [0, 1] shows in no picture of 8 bits.
pub(super) const HALF_STEP: f64 = 0.5 / 255.0;

/// [coefficient][channel].
type Coefficients = [[f64; 3]; K];
/// Lower triangle.
type Factor = [[f64; K]; K];

pub(super) struct Rounded {
    /// From 0 to 1.
    pub(super) base: [f64; 3],
    /// [coefficient][channel]; entry 0 means nothing.
    pub(super) bytes: [[u8; 3]; K],
    /// Root mean square error of the worst channel over the views that see it, or over all directions where none does.
    pub(super) off: f64,
    /// True if a view sees it, or there are no views.
    pub(super) is_seen: bool,
}

pub(super) struct Viewpoints<'a> {
    views: &'a [View],
    centers: Vec<[f64; 3]>,
}

impl<'a> Viewpoints<'a> {
    pub(super) fn new(views: &'a [View]) -> Self {
        Viewpoints { views, centers: views.iter().map(|view| view.pose.center().to_array()).collect() }
    }

    /// The colours on the format's grids that look like the `coefficients` of a Gaussian at `place`.
    pub(super) fn round(&self, place: [f64; 3], coefficients: &[[f32; 3]], grades: &Grades) -> Rounded {
        let k = coefficients.len();
        let mut exact = Coefficients::default();
        exact.iter_mut().zip(coefficients).for_each(|(to, of)| *to = of.map(f64::from));
        if coefficients[1..].iter().all(|harmonic| *harmonic == [0.0; 3]) {
            // A colour that is below 0 from everywhere is drawn as 0.
            exact[0] = exact[0].map(|dc| dc.max(-0.5 / SH_C0));
        }
        let (norm, n_views) = self.norm(place, k);
        let (mut base, mut bytes, mut off) = ([0.0; 3], [[0; 3]; K], 0.0);
        // Coefficients in the order of the factor; the last one is rounded first.
        let (inwards, outwards): ([usize; K], [usize; K]) =
            (std::array::from_fn(|i| i), std::array::from_fn(|i| if i + 1 < k { i + 1 } else { 0 }));
        let factors = [&inwards, &outwards].map(|order| factor(&norm, order, k));
        for channel in 0..3 {
            let color = 0.5 + SH_C0 * exact[0][channel];
            let is_cut = !(-HALF_STEP..=1.0 + HALF_STEP).contains(&color);
            let (order, factor) = if is_cut { (&outwards, &factors[1]) } else { (&inwards, &factors[0]) };
            let mut error = [0.0; K];
            for i in (0..k).rev() {
                let owed: f64 = (i + 1..k).map(|j| factor[j][i] * error[j]).sum();
                let wanted = exact[order[i]][channel] - owed / factor[i][i];
                let found = match order[i] {
                    0 => {
                        base[channel] = (0.5 + SH_C0 * wanted).clamp(0.0, 1.0);
                        (base[channel] - 0.5) / SH_C0
                    }
                    harmonic => {
                        let (byte, value) = grade(harmonic, grades, wanted);
                        bytes[harmonic][channel] = byte;
                        value
                    }
                };
                error[i] = found - exact[order[i]][channel];
            }
            let of = |a: usize, b: usize| norm[order[a].max(order[b])][order[a].min(order[b])];
            let all: f64 =
                (0..k).flat_map(|a| (0..k).map(move |b| (a, b))).map(|(a, b)| error[a] * of(a, b) * error[b]).sum();
            let anywhere: f64 = error.iter().map(|e| e * e).sum();
            let of_views = all - anywhere * anywhere_of(n_views);
            let of_one = if n_views > 0 { of_views / n_views as f64 } else { anywhere / (4.0 * PI) };
            off = f64::max(off, of_one.max(0.0).sqrt());
        }
        Rounded { base, bytes, off, is_seen: n_views > 0 || self.views.is_empty() }
    }

    /// The squared error of a colour, summed over the views that see `place`, as a quadratic form of the coefficients' errors;
    /// and the number of those views.
    fn norm(&self, place: [f64; 3], k: usize) -> (Factor, usize) {
        let (mut norm, mut n) = (Factor::default(), 0);
        for (view, center) in self.views.iter().zip(&self.centers) {
            let to: [f64; 3] = std::array::from_fn(|axis| place[axis] - center[axis]);
            let length = to.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length == 0.0 || !sees(view, place) {
                continue;
            }
            let basis = basis(to.map(|x| x / length));
            for (i, row) in norm.iter_mut().enumerate().take(k) {
                row.iter_mut().zip(basis).take(i + 1).for_each(|(sum, b)| *sum += basis[i] * b);
            }
            n += 1;
        }
        (0..K).for_each(|i| norm[i][i] += anywhere_of(n));
        (norm, n)
    }
}

/// Weight of a coefficient's squared error beside `n` views. A basis function's mean square over the sphere is 1 / 4 pi.
fn anywhere_of(n: usize) -> f64 {
    ANYWHERE * n.max(1) as f64 / (4.0 * PI)
}

/// The byte of a harmonic nearest to `wanted`, and its value; 0 in a band that is left out.
fn grade(harmonic: usize, grades: &Grades, wanted: f64) -> (u8, f64) {
    let band = (harmonic as f64).sqrt() as usize;
    let grade = grades.bands[..band].iter().copied().max().unwrap_or(0);
    if grade >= Grades::LEFT_OUT {
        return (0, 0.0);
    }
    let part = (wanted - SH_QUANT_LO) / (SH_QUANT_HI - SH_QUANT_LO);
    let byte = quantize_sh((255.0 * part).round() as u8, 8 - grades.bands[band - 1]);
    (byte, sh_coefficient(byte))
}

/// The lower triangular L of `norm` = L Lᵀ, coefficients in `order`. `norm` is positive definite.
fn factor(norm: &Factor, order: &[usize; K], k: usize) -> Factor {
    let mut l = Factor::default();
    for i in 0..k {
        for j in 0..=i {
            let (a, b) = (order[i].max(order[j]), order[i].min(order[j]));
            let rest = norm[a][b] - (0..j).map(|m| l[i][m] * l[j][m]).sum::<f64>();
            l[i][j] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / l[j][j] };
        }
    }
    l
}

fn sees(view: &View, place: [f64; 3]) -> bool {
    let (at, intrinsics) = (view.pose.to_camera(place.into()), view.intrinsics);
    at.z > 0.0 && intrinsics.holds(intrinsics.project(at))
}

/// Real spherical harmonics at a unit vector, in 3DGS's order and signs (SPEC 2).
fn basis([x, y, z]: [f64; 3]) -> [f64; K] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let c1 = (3.0 / (4.0 * PI)).sqrt();
    let c2 = (15.0 / (4.0 * PI)).sqrt();
    let c3 = [(35.0 / (32.0 * PI)).sqrt(), (105.0 / (4.0 * PI)).sqrt(), (21.0 / (32.0 * PI)).sqrt()];
    [
        SH_C0,
        -c1 * y,
        c1 * z,
        -c1 * x,
        c2 * x * y,
        -c2 * y * z,
        (5.0 / (16.0 * PI)).sqrt() * (2.0 * zz - xx - yy),
        -c2 * x * z,
        0.5 * c2 * (xx - yy),
        -c3[0] * y * (3.0 * xx - yy),
        c3[1] * x * y * z,
        -c3[2] * y * (4.0 * zz - xx - yy),
        (7.0 / (16.0 * PI)).sqrt() * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -c3[2] * x * (4.0 * zz - xx - yy),
        0.5 * c3[1] * z * (xx - yy),
        -c3[0] * x * (xx - 3.0 * yy),
    ]
}
