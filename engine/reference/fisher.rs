//! The information of a picture on a Gaussian's parts, in double precision: the truth of `fisher.comp`.

use super::sh::basis;
use crate::scene::{Splats, View};
use glam::DVec3;

/// Middle of the clip, normalised time.
const MIDDLE: f64 = 0.5;
const SH_0: f64 = 0.282_094_791_773_878_14;

/// Responses of Gaussian `i` of `splats` in a picture from `view`, whose gradients of the parameters are `d`: coming to rest,
/// without bands 1 to 3, without it; its colour's gradient by channel; what it lacks where it is static: velocity, an opacity that
/// grows with time, one that is larger at both ends, of which a photograph says nothing. What a band is in the mean over `cameras`,
/// their centres, stays.
pub fn responses(
    splats: &Splats,
    d: &Splats,
    i: usize,
    view: &View,
    cameras: &[[f64; 3]],
) -> ([f64; 5], [f64; 3], [f64; 5]) {
    let time = view.time + view.time_offset * view.flow_dt;
    let wide = |v: [f32; 3]| v.map(f64::from);
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let d_mean = wide(d.position[i]);
    // o dL/do.
    let d_own = f64::from(d.opacity[i]) * (1.0 + f64::from(splats.opacity[i]).exp());
    let k = splats.n_coefficients();
    let d_color = wide(d.sh[i * k]).map(|g| g / SH_0);
    let mean_basis = |c: usize| {
        let of = |camera: &[f64; 3]| {
            let way = DVec3::from(wide(splats.position[i])) - DVec3::from(*camera);
            basis(way.normalize().to_array())[c]
        };
        cameras.iter().map(of).sum::<f64>() / cameras.len().max(1) as f64
    };
    let band = |band: usize| {
        let coefficients = (band * band..(band + 1) * (band + 1)).filter(|c| *c < k);
        let own = |c: usize| {
            let sh = wide(splats.sh[i * k + c]);
            mean_basis(c) * dot(sh, d_color) - dot(sh, wide(d.sh[i * k + c]))
        };
        coefficients.map(own).sum::<f64>()
    };
    let motion = i.checked_sub(splats.n_static).map(|at| splats.motion[at]);
    let rest = motion.map_or(0.0, |m| {
        let weight = splats.mean_weight(i) / splats.weight_at(i, time).max(1e-6);
        dot(d_mean, wide(m.velocity)) * (MIDDLE - time) + (weight - 1.0) * d_own
    });
    let x = time - MIDDLE;
    let lacks = match motion {
        Some(_) => [0.0; 5],
        None if view.is_photo() => [0.0; 5],
        None => [x * d_mean[0], x * d_mean[1], x * d_mean[2], x * d_own, (x * x - 1.0 / 12.0) * d_own],
    };
    ([rest, band(1), band(2), band(3), -d_own], d_color, lacks)
}
