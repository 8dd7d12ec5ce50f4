//! The conservative bound by which a device skips Gaussians before it projects them.

use super::input::{Camera, Gaussian, Rules};
use super::math::{add, apply};
use super::real::Real;

/// True if `g` can contribute to a pixel centre in the rows `rows = [first, last + 1]` of the image at the shifted time
/// t'. May say yes to one that does not, never no to one that does.
///
/// With `L0 = ln(sigmoid(o) / alpha_min)` and r the largest standard deviation: the opacity reaches alpha_min only for
/// `|t' - t_center| <= tau sqrt(L0)`; no row of V is longer than r times J's row, so with the clamped u
/// `C_xx <= r^2 (fx / z)^2 (1 + u^2) + blur`, and alpha >= alpha_min needs `|dx| <= sqrt(2 L0 C_xx)`; likewise in y.
/// L0 gets 1e-4 on top (ln is only good to 2^-21 near 1), the window 1e-5 and the box 1e-5 and 0.01 px.
pub fn visible<R: Real>(g: &Gaussian<R>, camera: &Camera<R>, time: R, rows: [R; 2], rules: &Rules<R>) -> bool {
    let c = R::from_f64;
    let one = R::one();
    let base = one / (one + (-g.opacity).exp());
    let level = (base / rules.alpha_min).ln() + c(1e-4);
    let bright = level >= R::zero();
    if !bright {
        return false;
    }
    if let Some(motion) = g.motion {
        let window = motion.t_scale.exp() * level.sqrt() * c(1.0 + 1e-5);
        let in_window = (time - motion.t_center).abs() <= window;
        if !in_window {
            return false;
        }
    }
    let center_cam = add(apply(camera.rotation, g.position_at(time)), camera.translation);
    let z = center_cam[2];
    let in_front = z > rules.near;
    if !in_front {
        return false;
    }
    let radius = g.scale[0].max(g.scale[1]).max(g.scale[2]).exp();
    let window = [[R::zero(), camera.size[0]], rows];
    (0..2).all(|k| {
        let ratio = center_cam[k] / z;
        let u = camera.clamped(ratio, k);
        let longest = radius * camera.focal[k] / z;
        let half = (c(2.0) * level * (longest * longest * (one + u * u) + rules.blur)).sqrt();
        let half = half * c(1.0 + 1e-5) + c(0.01);
        let at = camera.focal[k] * ratio + camera.principal[k];
        at + half >= window[k][0] && at - half <= window[k][1]
    })
}
