//! Gaussians that show one resting thing one after the other are merged.

use crate::internals::train::require::evidence::Evidence;
use crate::report::statistics::median_high;
use crate::scene::{SH_C0, Splats};
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;

/// Bhattacharyya distance below which two Gaussians have the same place and shape.
const SAME_PLACE: f64 = 0.1;
/// Way within tau of a Gaussian that rests, at most, in units of the largest standard deviation.
const RESTS: f64 = 0.5;
/// Saved by a merger: those of a dynamic Gaussian of degree 0.
const NUMBERS: f64 = 18.0;

struct One {
    mean: DVec3,
    covariance: DMat3,
    largest: f64,
    velocity: DVec3,
    t_center: f64,
    tau: f64,
}

impl One {
    fn new(splats: &Splats, i: usize) -> Option<Self> {
        let motion = splats.motion.get(i.checked_sub(splats.n_static)?)?;
        let [w, x, y, z] = splats.rotation[i].map(f64::from);
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let deviations = DVec3::from(splats.scale[i].map(|s| f64::from(s).exp()));
        let half = rotation * DMat3::from_diagonal(deviations);
        let one = One {
            mean: DVec3::from(splats.position[i].map(f64::from)),
            covariance: half * half.transpose(),
            largest: deviations.max_element(),
            velocity: DVec3::from(motion.velocity.map(f64::from)),
            t_center: motion.t_center.into(),
            tau: f64::from(motion.t_scale).exp(),
        };
        let rests = one.velocity.length() * one.tau.min(1.0) <= RESTS * one.largest;
        (rests && one.covariance.determinant() > 0.0 && one.mean.is_finite()).then_some(one)
    }

    fn at(&self, time: f64) -> DVec3 {
        self.mean + self.velocity * (time - self.t_center)
    }

    /// True if both have the same place and shape, and their times touch.
    fn continues(&self, other: &One) -> bool {
        let meet = 0.5 * (self.t_center + other.t_center);
        let apart = self.at(meet) - other.at(meet);
        let mean = 0.5 * (self.covariance + other.covariance);
        let shape = mean.determinant() / (self.covariance.determinant() * other.covariance.determinant()).sqrt();
        let distance = apart.dot(mean.inverse() * apart) / 8.0 + 0.5 * shape.ln();
        distance <= SAME_PLACE && (self.t_center - other.t_center).abs() <= self.tau + other.tau
    }
}

/// Merges those that may be one into the earlier of them and marks the later in `gone`; returns how often. It leaves those
/// alone that are marked already.
pub fn merge_resting(splats: &mut Splats, evidence: &mut Evidence, price: f64, gone: &mut [bool]) -> usize {
    let mut order: Vec<(usize, One)> =
        (splats.n_static..splats.len()).filter_map(|i| Some((i, One::new(splats, i)?))).collect();
    order.sort_by(|a, b| a.1.t_center.total_cmp(&b.1.t_center));
    // Centres of two that are one are less than one standard deviation apart.
    let side = 2.0 * median_high(order.iter().map(|(_, one)| one.largest)).unwrap_or(1.0);
    let cell = |p: DVec3| (p / side).floor().as_i64vec3().to_array();
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    order.iter().enumerate().for_each(|(at, (_, one))| cells.entry(cell(one.mean)).or_default().push(at));
    let mut n_merged = 0;
    for at in 0..order.len() {
        if gone[order[at].0] {
            continue;
        }
        let [x, y, z] = cell(order[at].1.mean);
        let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
        let mut near: Vec<usize> =
            around.filter_map(|key| cells.get(&key)).flatten().copied().filter(|b| *b > at).collect();
        near.sort_unstable();
        for other in near {
            let (a, b) = (order[at].0, order[other].0);
            if gone[b] || !order[at].1.continues(&order[other].1) || !agree(splats, evidence, price, a, b) {
                continue;
            }
            unite(splats, evidence, a, b);
            gone[b] = true;
            n_merged += 1;
            match One::new(splats, a) {
                Some(one) => order[at].1 = one,
                None => break,
            }
        }
    }
    n_merged
}

/// True if the pictures lose less by one colour and one opacity for both than a Gaussian costs.
fn agree(splats: &Splats, evidence: &Evidence, price: f64, a: usize, b: usize) -> bool {
    if [a, b].iter().any(|i| !evidence.seen[*i].tells_something()) {
        return false;
    }
    let k = splats.n_coefficients();
    let both = |of: fn(&crate::stage::Response) -> f64| {
        let [x, y] = [a, b].map(|i| evidence.seen[i].scale * evidence.seen[i].caution() * of(&evidence.information[i]));
        if x + y > 0.0 { x * y / (x + y) } else { 0.0 }
    };
    let colors = splats.sh[a * k].iter().zip(&splats.sh[b * k]);
    let color = colors.map(|(x, y)| (SH_C0 * f64::from(x - y)).powi(2)).sum::<f64>() / 3.0;
    let opacity = |i: usize| -(1.0 + (-f64::from(splats.opacity[i])).exp()).ln();
    let change = both(|r| r.color) * color + both(|r| r.whole) * (opacity(a) - opacity(b)).powi(2);
    let loss = 0.5 * change / evidence.variance.max(f64::MIN_POSITIVE);
    loss < 0.5 * price * NUMBERS * evidence.n_values.max(2.0).ln()
}

/// Puts the union in time of both into `a`; all else is the mean by their information.
fn unite(splats: &mut Splats, evidence: &mut Evidence, a: usize, b: usize) {
    let [wa, wb] = [a, b].map(|i| evidence.seen[i].scale * evidence.information[i].whole);
    let part = if wa + wb > 0.0 { (wb / (wa + wb)) as f32 } else { 0.5 };
    let mix = |x: f32, y: f32| x + part * (y - x);
    let (ma, mb) = (splats.motion[a - splats.n_static], splats.motion[b - splats.n_static]);
    let (ta, tb) = (ma.t_scale.exp(), mb.t_scale.exp());
    let (begin, end) = ((ma.t_center - ta).min(mb.t_center - tb), (ma.t_center + ta).max(mb.t_center + tb));
    let meet = mix(ma.t_center, mb.t_center);
    for c in 0..3 {
        let at = |p: f32, v: f32, t: f32| p + v * (meet - t);
        let (pa, pb) = (splats.position[a][c], splats.position[b][c]);
        splats.position[a][c] = mix(at(pa, ma.velocity[c], ma.t_center), at(pb, mb.velocity[c], mb.t_center));
        splats.scale[a][c] = mix(splats.scale[a][c], splats.scale[b][c]);
    }
    splats.opacity[a] = mix(splats.opacity[a], splats.opacity[b]);
    let k = splats.n_coefficients();
    for c in 0..k {
        let other = splats.sh[b * k + c];
        splats.sh[a * k + c].iter_mut().zip(other).for_each(|(x, y)| *x = mix(*x, y));
    }
    let motion = &mut splats.motion[a - splats.n_static];
    (motion.velocity, motion.t_center, motion.t_scale) = ([0.0; 3], 0.5 * (begin + end), (0.5 * (end - begin)).ln());
    let (other, part) = (evidence.information[b], evidence.seen[b].scale / evidence.seen[a].scale.max(1e-9));
    let own = &mut evidence.information[a];
    (own.whole, own.color) = (own.whole + part * other.whole, own.color + part * other.color);
}
