//! Space before lenses, kept clear of Gaussians.

use super::real::Real;
use crate::scene::Clearing;

/// Where a Gaussian at `p` goes that may not be in any of `clearings`, up to `margin` behind their surfaces: `little` further, one after
/// the other.
pub fn cleared<R: Real>(clearings: &[Clearing], p: [R; 3], [margin, little]: [R; 2]) -> [R; 3] {
    let c = |x: f32| R::from_f64(x.into());
    let dot = |a: [R; 3], b: [R; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    clearings.iter().fold(p, |p, clearing| {
        let [place, axis, slope] = [clearing.place, clearing.axis, clearing.slope].map(|v| v.map(c));
        let offset: [R; 3] = std::array::from_fn(|k| p[k] - place[k]);
        let z = dot(offset, axis);
        let square = dot(offset, offset) - z * z;
        let height = z - dot(offset, slope) - R::from_f64(0.5) * c(clearing.curvature) * square;
        let is_within =
            height > -margin && height < c(clearing.depth) && square < c(clearing.radius) * c(clearing.radius);
        let by = if is_within { height + margin + little } else { R::zero() };
        std::array::from_fn(|k| p[k] - by * axis[k])
    })
}
