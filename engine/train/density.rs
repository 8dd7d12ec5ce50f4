//! Adaptive density control (3DGS; SPEC 6): Gaussians whose projected centre is pulled hard are cloned or split, faint and
//! huge ones are removed. Children inherit the temporal parameters.

use super::config::{Config, Density};
use super::random::Random;
use crate::scene::Splats;

/// A split shrinks the standard deviations by this.
const SPLIT_SHRINK: f32 = 1.6;

/// Which Gaussian each new one comes from, and whether it keeps its moments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// Index of the parent, or of the Gaussian itself.
    pub from: usize,
    /// An old Gaussian keeps its moments, a child begins with none.
    pub is_old: bool,
}

/// What a round did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Gaussians cloned.
    pub cloned: usize,
    /// Gaussians split in two.
    pub split: usize,
    /// Gaussians removed.
    pub pruned: usize,
}

/// One round for `splats` after `step` steps. `stats` holds (sum of gradient norms, frames) per Gaussian. Returns the
/// Gaussians, where each comes from, and the counts. The order is kept within each population, children last.
pub fn round(
    splats: &Splats,
    stats: &[[f32; 2]],
    config: &Config,
    step: u64,
    extent: f64,
) -> (Splats, Vec<Origin>, Counts) {
    let Density { gradient, split_above, prune_opacity, prune_scale, .. } = config.density;
    let extent = extent as f32;
    let n = splats.len();
    let largest = |i: usize| splats.scale[i].iter().copied().fold(f32::NEG_INFINITY, f32::max).exp();
    let base = |i: usize| 1.0 / (1.0 + (-splats.opacity[i]).exp());
    let pull = |i: usize| if stats[i][1] > 0.0 { stats[i][0] / stats[i][1] } else { 0.0 };
    let keeps = |i: usize| base(i) >= prune_opacity && largest(i) <= prune_scale * extent && is_finite(splats, i);
    let mut growing: Vec<usize> = (0..n).filter(|&i| keeps(i) && pull(i) > gradient).collect();
    // The budget goes to those that are pulled hardest.
    growing.sort_by(|&a, &b| pull(b).total_cmp(&pull(a)).then(a.cmp(&b)));
    let n_kept = (0..n).filter(|&i| keeps(i)).count();
    let most = (n_kept as f64 * config.density.growth).ceil() as usize;
    growing.truncate(config.max_gaussians.saturating_sub(n_kept).min(most));
    let mut grows = vec![false; n];
    growing.iter().for_each(|&i| grows[i] = true);

    let mut out = Out { from: splats, to: Splats::new(splats.sh_degree), origins: Vec::new() };
    let mut counts = Counts::default();
    for (range, is_static) in [(0..splats.n_static, true), (splats.n_static..n, false)] {
        for i in range.clone() {
            let splits = grows[i] && largest(i) > split_above * extent;
            if !keeps(i) {
                counts.pruned += 1;
            } else if !splits {
                out.push(i, true);
            }
        }
        for i in range.filter(|&i| grows[i]) {
            if largest(i) > split_above * extent {
                let random = Random::new(&[config.seed, step, i as u64]);
                for child in 0..2 {
                    let deviation = std::array::from_fn(|k| random.normal(3 * child + k as u64) as f32);
                    out.push_split(i, deviation);
                }
                counts.split += 1;
            } else {
                out.push(i, false);
                counts.cloned += 1;
            }
        }
        if is_static {
            out.to.n_static = out.to.len();
        }
    }
    let Out { mut to, origins, .. } = out;
    to.source_row = (0..to.len() as u32).collect();
    (to, origins, counts)
}

fn is_finite(splats: &Splats, i: usize) -> bool {
    let motion = i.checked_sub(splats.n_static).and_then(|at| splats.motion.get(at));
    splats.position[i].iter().chain(&splats.rotation[i]).chain(&splats.scale[i]).all(|x| x.is_finite())
        && motion.is_none_or(|m| m.velocity.iter().all(|x| x.is_finite()) && m.t_center.is_finite())
}

struct Out<'a> {
    from: &'a Splats,
    to: Splats,
    origins: Vec<Origin>,
}

impl Out<'_> {
    fn push(&mut self, i: usize, is_old: bool) {
        let (from, to) = (self.from, &mut self.to);
        let k = from.n_coefficients();
        to.position.push(from.position[i]);
        to.rotation.push(from.rotation[i]);
        to.scale.push(from.scale[i]);
        to.opacity.push(from.opacity[i]);
        to.sh.extend_from_slice(&from.sh[i * k..(i + 1) * k]);
        if i >= from.n_static {
            to.motion.push(from.motion[i - from.n_static]);
        }
        self.origins.push(Origin { from: i, is_old });
    }

    /// A child of `i`, moved by `deviation` standard deviations along its axes.
    fn push_split(&mut self, i: usize, deviation: [f32; 3]) {
        self.push(i, false);
        let at = self.to.len() - 1;
        let [w, x, y, z] = self.from.rotation[i];
        let turn = glam::Quat::from_xyzw(x, y, z, w);
        let local = glam::Vec3::from_array(std::array::from_fn(|k| deviation[k] * self.from.scale[i][k].exp()));
        let moved = glam::Vec3::from_array(self.from.position[i]) + turn.normalize() * local;
        self.to.position[at] = moved.to_array();
        self.to.scale[at] = self.from.scale[i].map(|s| s - SPLIT_SHRINK.ln());
    }
}

/// Moments of the Gaussians that `origins` tells, from those before the round; children begin at zero.
pub fn inherit(moments: &Splats, origins: &[Origin], n_static: usize) -> Splats {
    let k = moments.n_coefficients();
    let mut out = Splats { n_static, ..Splats::new(moments.sh_degree) };
    let pick = |is_old: bool, x: f32| if is_old { x } else { 0.0 };
    for &Origin { from, is_old } in origins {
        out.position.push(moments.position[from].map(|x| pick(is_old, x)));
        out.rotation.push(moments.rotation[from].map(|x| pick(is_old, x)));
        out.scale.push(moments.scale[from].map(|x| pick(is_old, x)));
        out.opacity.push(pick(is_old, moments.opacity[from]));
        out.sh.extend(moments.sh[from * k..(from + 1) * k].iter().map(|c| c.map(|x| pick(is_old, x))));
        if let Some(at) = from.checked_sub(moments.n_static) {
            let mut m = moments.motion[at];
            if !is_old {
                m = bytemuck::Zeroable::zeroed();
            }
            out.motion.push(m);
        }
    }
    out.source_row = (0..out.len() as u32).collect();
    out
}
