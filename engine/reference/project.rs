//! Projection of one Gaussian (SPEC 3), with the covariance as a factor of its inverse.

use super::input::{Camera, Gaussian, Rules};
use super::math::{add, apply, dot, max_abs, rotation, row_times, scaled, sub};
use super::real::Real;
use super::sh;

/// A Gaussian as the blending sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected<R> {
    /// Projected centre, pixels.
    pub xy: [R; 2],
    /// A square root of the inverse covariance, 1 / pixels: the exponent at offset d is `|m d|^2 / 2`.
    pub m: [[R; 2]; 2],
    /// opacity(t').
    pub opacity: R,
    /// Colour seen from this camera, at least 0.
    pub color: [R; 3],
    /// Camera depth of the centre, scene units.
    pub z: R,
    /// Projected velocity or displacement, pixels per `flow_dt`.
    pub flow: [R; 2],
    /// Half the size of the box that holds every pixel centre with alpha >= alpha_min, pixels.
    pub extent: [R; 2],
}

/// A projected covariance: a square root of its inverse and its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint<R> {
    /// Square root of the inverse covariance, 1 / pixels.
    pub m: [[R; 2]; 2],
    /// Standard deviations in x and y with the blur, pixels.
    pub deviation: [R; 2],
}

/// Projects Gaussian `g` at the shifted time t'. `None` when it is dropped: z <= near, opacity < alpha_min, no
/// rotation, or any number that is not finite. The guards are positive, so NaN drops.
pub fn project<R: Real>(g: &Gaussian<R>, camera: &Camera<R>, time: R, rules: &Rules<R>) -> Option<Projected<R>> {
    let mean = g.position_at(time);
    let center_cam = add(apply(camera.rotation, mean), camera.translation);
    let z = center_cam[2];
    let in_front = z > rules.near;
    if !in_front {
        return None;
    }
    let opacity = g.opacity_at(time);
    let bright = opacity >= rules.alpha_min;
    if !bright {
        return None;
    }
    let ratio = [center_cam[0] / z, center_cam[1] / z];
    let xy = add([camera.focal[0] * ratio[0], camera.focal[1] * ratio[1]], camera.principal);

    let jacobian = jacobian_rows(camera, ratio, z);
    let turn = rotation(g.rotation)?;
    let Footprint { m, deviation } =
        footprint(jacobian.map(|row| row_times(row, turn)), g.scale.map(R::exp), rules.blur);

    let to_mean = sub(mean, camera.centre);
    let dir = scaled(to_mean, R::one() / dot(to_mean, to_mean).sqrt());
    let color = sh::color(g.sh, dir);

    let later = camera.next.map(|(rotation, translation)| {
        add(apply(rotation, add(mean, scaled(g.velocity(), camera.flow_dt))), translation)
    });
    let flow = match later.filter(|p| p[2] > rules.near) {
        Some(p) => std::array::from_fn(|k| camera.focal[k] * (p[k] / p[2] - ratio[k])),
        // Unclamped Jacobian, here and only here.
        None => {
            let velocity_cam = apply(camera.rotation, g.velocity());
            std::array::from_fn(|k| {
                camera.flow_dt * (camera.focal[k] / z * (velocity_cam[k] - ratio[k] * velocity_cam[2]))
            })
        }
    };

    let reach = (R::from_f64(2.0) * (opacity / rules.alpha_min).ln().max(R::zero())).sqrt();
    let projected = Projected { xy, m, opacity, color, z, flow, extent: scaled(deviation, reach) };
    projected.is_finite().then_some(projected)
}

/// Rows of J times the world-to-camera rotation, pixels per scene unit, with the clamp of SPEC 3.
fn jacobian_rows<R: Real>(camera: &Camera<R>, ratio: [R; 2], z: R) -> [[R; 3]; 2] {
    std::array::from_fn(|k| {
        let clamped = camera.clamped(ratio[k], k);
        scaled(sub(camera.rotation[k], scaled(camera.rotation[2], clamped)), camera.focal[k] / z)
    })
}

/// The footprint of V V^T + blur I, V = g diag(s): g is J W Rot(q) in pixels per scene unit, s the standard deviations.
///
/// With rows r1, r2 of V: a = |r1|^2 + blur, c = |r2|^2 + blur, b = r1 . r2 and, by Cauchy-Binet,
/// det = |r1 x r2|^2 + blur (|r1|^2 + |r2|^2) + blur^2, a sum of squares (numerics rows 1, 2, 8). Everything is divided
/// by n = max(1, max |V|), so that f32 carries log-scales up to 40: e = V / n, A = a / n^2, C = c / n^2, and
/// q^2 = det / n^2 = |n e1 x e2|^2 + blur (|e1|^2 + |e2|^2) + blur^2 / n^2. The components of n e1 x e2 are
/// s_j s_k / n times the minors of g. The pivot is the larger diagonal, hence |b / a| <= 1 and nothing underflows in it:
/// `a >= c: m = [[1 / sqrt a, 0], [-(b / a) h, h]]`, h = sqrt(a / det) = sqrt(A) / q;
/// `a < c:  m = [[0, 1 / sqrt c], [h, -(b / c) h]]`, h = sqrt(c / det).
pub fn footprint<R: Real>(g: [[R; 3]; 2], s: [R; 3], blur: R) -> Footprint<R> {
    let v = g.map(|row| std::array::from_fn::<R, 3, _>(|k| row[k] * s[k]));
    let n = max_abs(v[0]).max(max_abs(v[1])).max(R::one());
    let e = v.map(|row| row.map(|x| x / n));
    let blur_n = blur / n / n;
    let (e11, e22, e12) = (dot(e[0], e[0]), dot(e[1], e[1]), dot(e[0], e[1]));
    let (a, c) = (e11 + blur_n, e22 + blur_n);

    let cross: [R; 3] = std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        (s[j] / n) * s[k] * (g[0][j] * g[1][k] - g[0][k] * g[1][j])
    });
    // A large part is divided out before squaring: both axes may be 1e19 px long.
    let big = max_abs(cross).max(R::one());
    let unit = cross.map(|x| x / big);
    let q = big * (dot(unit, unit) + (blur * (e11 + e22) + blur * blur_n) / big / big).sqrt();

    // Each row by its own largest entry: beside an axis of 1e19 px the square of the other row would underflow.
    let deviation = v.map(|row| {
        let n = max_abs(row).max(R::one());
        let e = row.map(|x| x / n);
        n * (dot(e, e) + blur / n / n).sqrt()
    });
    let zero = R::zero();
    let m = if a >= c {
        let h = a.sqrt() / q;
        [[R::one() / deviation[0], zero], [-(e12 / a) * h, h]]
    } else {
        let h = c.sqrt() / q;
        [[zero, R::one() / deviation[1]], [h, -(e12 / c) * h]]
    };
    Footprint { m, deviation }
}

/// The exponent `|m d|^2 / 2` at offset `d` pixels from the centre; never negative.
pub fn power<R: Real>(m: [[R; 2]; 2], d: [R; 2]) -> R {
    let w = apply(m, d);
    R::from_f64(0.5) * dot(w, w)
}

impl<R: Real> Projected<R> {
    /// True if every number is finite.
    fn is_finite(&self) -> bool {
        let flat = [self.xy, self.m[0], self.m[1], self.flow, self.extent];
        flat.iter().flatten().chain(&self.color).chain(&[self.opacity, self.z]).all(|x| x.is_finite())
    }

    /// Alpha at the point `pixel` (pixels), clamped to alpha_max but not compared with alpha_min.
    pub fn alpha_at(&self, pixel: [R; 2], rules: &Rules<R>) -> R {
        (self.opacity * (-power(self.m, sub(pixel, self.xy))).exp()).min(rules.alpha_max)
    }
}
