//! Density control (SPEC 6): the exact reference of the device's lists, and the children's parameters in double precision.

use super::math::{apply, rotation};
use super::scan::exclusive_scan;
use crate::scene::{Cone, Splats};
use glam::Vec3;

/// The fate of a Gaussian of the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// It stays, with its moments.
    AsItWas,
    /// A clone of a Gaussian that was pulled, or one of the copies of a drawn one.
    Copy,
    /// The first half of a split.
    HalfA,
    /// The second half.
    HalfB,
}

/// A Gaussian after the round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Descendant {
    /// Whom it comes from: index in the scene before the round.
    pub from: usize,
    pub kind: Kind,
}

/// A scene after the round, as descendants of that before.
#[derive(Clone, Debug, PartialEq)]
pub struct Descent {
    pub descendants: Vec<Descendant>,
    /// How many copies were drawn of each Gaussian before the round.
    pub copies: Vec<u32>,
    /// Gaussians cloned or added, split, and pruned or relocated.
    pub counts: [usize; 3],
}

/// A round on `splats`. The numbers are those of `stage::DensityRound`.
#[derive(Clone, Debug)]
pub struct Density<'a> {
    /// The Gaussians before the round; positions relative to the origin that `center` is relative to.
    pub splats: &'a Splats,
    /// The index of each on the device, and the length of that index.
    pub flat: &'a [u32],
    pub n_flat: u32,
    pub n_frames: u32,
    pub center: [f32; 3],
    pub extent: f32,
    /// Opacity below which a Gaussian is removed or counts as dead.
    pub prune_opacity: f32,
    /// Standard deviation above which it is.
    pub prune_scale: f32,
    pub lenses: &'a [Cone],
    /// Standard deviation towards a lens that sees it, as a part of its depth before that, above which a Gaussian is removed.
    pub prune_veil: f32,
    pub max_gaussians: usize,
    /// Fraction of the Gaussians that a round adds at most.
    pub growth: f32,
    pub key: u32,
}

impl Density<'_> {
    /// 3DGS: clones and splits the hardest pulled, removes the faint and the huge. `stats` are (sum of gradient norms,
    /// frames seen), `split_above` is a standard deviation.
    pub fn pulled(&self, stats: &[[f32; 2]], gradient: f32, split_above: f32) -> Descent {
        let n = self.splats.len();
        let kept: Vec<bool> = (0..n).map(|i| self.is_kept(i)).collect();
        let pull = |i: usize| if stats[i][1] > 0.0 { stats[i][0] / stats[i][1] } else { 0.0 };
        let mut growing: Vec<usize> = (0..n).filter(|&i| kept[i] && pull(i) > gradient).collect();
        growing.sort_by(|&a, &b| pull(b).total_cmp(&pull(a)));
        let n_kept = kept.iter().filter(|kept| **kept).count();
        growing.truncate(self.max_gaussians.saturating_sub(n_kept).min(self.most_new(n_kept)));
        let mut descendants = Vec::new();
        let mut counts = [0, 0, n - n_kept];
        for from in (0..n).filter(|&i| kept[i]) {
            let grows = growing.contains(&from);
            let splits = grows && self.largest(from) > split_above;
            descendants.push(Descendant { from, kind: if splits { Kind::HalfA } else { Kind::AsItWas } });
            if grows {
                descendants.push(Descendant { from, kind: if splits { Kind::HalfB } else { Kind::Copy } });
                counts[usize::from(splits)] += 1;
            }
        }
        self.stored(descendants, vec![0; n], counts)
    }

    /// 3DGS-MCMC: the dead and the new become copies of living ones, drawn with weights 1 + floor(1023 opacity).
    pub fn drawn(&self) -> Descent {
        let n = self.splats.len();
        let lives: Vec<bool> = (0..n).map(|i| self.is_kept(i)).collect();
        let weight = |i: usize| if lives[i] { 1 + (1023.0 * self.opacity(i)) as u32 } else { 0 };
        let before = exclusive_scan(&(0..n).map(weight).collect::<Vec<_>>());
        let mut copies = vec![0; n];
        let mut draw = |index: u32| {
            let u = (u64::from(random_bits(self.key, index, 0)) * u64::from(before.total)) >> 32;
            let drawn = before.offsets.partition_point(|sum| u64::from(*sum) <= u) - 1;
            copies[drawn] += 1;
            drawn
        };
        let mut targets: Vec<usize> = (0..n).map(|i| if lives[i] { i } else { draw(self.flat[i]) }).collect();
        let n_new = self.most_new(n).min(self.max_gaussians.saturating_sub(n));
        targets.extend((0..n_new as u32).map(|k| draw(self.n_flat + k)));
        let descendant = |(i, &from): (usize, &usize)| {
            let is_untouched = i == from && copies[from] == 0;
            Descendant { from, kind: if is_untouched { Kind::AsItWas } else { Kind::Copy } }
        };
        let descendants = targets.iter().enumerate().map(descendant).collect();
        let n_dead = lives.iter().filter(|lives| !**lives).count();
        self.stored(descendants, copies, [n_new, 0, n_dead])
    }

    /// Position, log-scales and opacity logit of `of`, one of the Gaussians after a round.
    pub fn child(&self, of: Descendant, copies: &[u32], ceiling: f64) -> ([f64; 3], [f64; 3], f64) {
        let Descendant { from, kind } = of;
        let wide = |v: [f32; 3]| v.map(f64::from);
        let (mut position, mut scale) = (wide(self.splats.position[from]), wide(self.splats.scale[from]));
        let mut opacity = f64::from(self.splats.opacity[from]);
        if let Kind::HalfA | Kind::HalfB = kind {
            let normals = normals(self.key, self.flat[from], if kind == Kind::HalfA { 0 } else { 4 });
            let local = std::array::from_fn(|k| scale[k].exp() * normals[k]);
            let turn = rotation(self.splats.rotation[from].map(f64::from)).unwrap_or_default();
            let moved = apply(turn, local);
            position = std::array::from_fn(|k| position[k] + moved[k]);
            scale = scale.map(|s| s - 1.6f64.ln());
        }
        if copies[from] > 0 {
            let (logit, factor) = shared_opacity(opacity, copies[from] + 1);
            opacity = logit;
            scale = scale.map(|s| s + factor.ln());
        }
        (position, scale, opacity.min(ceiling))
    }

    /// `descendants` in the order in which they are stored: by population, time and place.
    fn stored(&self, mut descendants: Vec<Descendant>, copies: Vec<u32>, counts: [usize; 3]) -> Descent {
        descendants.sort_by_key(|d| self.code(d.from));
        Descent { descendants, copies, counts }
    }

    fn most_new(&self, n: usize) -> usize {
        (self.growth * n as f32).ceil() as usize
    }

    fn largest(&self, i: usize) -> f32 {
        self.splats.scale[i].into_iter().fold(f32::NEG_INFINITY, f32::max).exp()
    }

    /// Opacity at the training time that is nearest to the peak.
    fn opacity(&self, i: usize) -> f32 {
        let base = 1.0 / (1.0 + (-self.splats.opacity[i]).exp());
        let Some(at) = i.checked_sub(self.splats.n_static) else { return base };
        let motion = self.splats.motion[at];
        let n_frames = self.n_frames as f32;
        let frame = (motion.t_center * n_frames + 0.5).floor().clamp(0.0, n_frames - 1.0);
        let u = (frame / n_frames - motion.t_center) * (-motion.t_scale).exp();
        base * (-u * u).exp()
    }

    fn is_kept(&self, i: usize) -> bool {
        let splats = self.splats;
        let numbers = splats.position[i].iter().chain(&splats.rotation[i]).chain(&splats.scale[i]);
        let motion = i.checked_sub(splats.n_static).map(|at| splats.motion[at]);
        numbers.chain([&splats.opacity[i]]).all(|x| x.is_finite())
            && motion.is_none_or(|m| m.velocity.iter().all(|x| x.is_finite()) && m.t_center.is_finite())
            && motion.is_none_or(|m| !m.t_scale.is_nan() && m.t_scale != f32::NEG_INFINITY)
            && splats.rotation[i].iter().any(|x| x.abs() > 1e-37)
            && self.opacity(i) >= self.prune_opacity
            && self.largest(i) <= self.prune_scale
            && self.largest(i) <= 44f32.exp()
            && !self.lenses.iter().any(|lens| self.floats_before(i, lens))
    }

    /// True if it is a floater before a camera with this lens.
    fn floats_before(&self, i: usize, lens: &Cone) -> bool {
        let axis = Vec3::from(lens.axis);
        let offset = Vec3::from(self.splats.position[i]) - Vec3::from(lens.tip);
        let depth = offset.dot(axis);
        let aside = (offset - depth * axis).length() - depth * lens.reach;
        depth > 0.0 && self.reach(i, offset.normalize()) > self.prune_veil * (depth + 2.0 * aside.max(0.0))
    }

    /// Standard deviation along a direction.
    fn reach(&self, i: usize, direction: Vec3) -> f32 {
        let turn = rotation(self.splats.rotation[i].map(f64::from)).unwrap_or_default();
        // Its columns are the Gaussian's axes.
        let along = |k: usize| (0..3).map(|row| turn[row][k] as f32 * direction[row]).sum::<f32>();
        let sizes = self.splats.scale[i].map(|scale| scale.min(80.0).exp());
        (0..3).map(|k| (sizes[k] * along(k)).powi(2)).sum::<f32>().sqrt()
    }

    /// Where a Gaussian is stored: population and falling SH degree, slot of time, Morton's code. Slots are 1 / 2^k of the clip
    /// long, down to two frames; a Gaussian has the shortest that 4 tau fits into. Longer ones come first.
    pub fn code(&self, i: usize) -> u32 {
        let cell = |k: usize| {
            let x = (self.splats.position[i][k] - self.center[k]) / self.extent;
            (256.0 * (0.5 + 0.5 * (x / (1.0 + x.abs())))).clamp(0.0, 255.0) as u32
        };
        let morton =
            (0..8).flat_map(|bit| (0..3).map(move |k| (bit, k))).map(|(bit, k)| (cell(k) >> bit & 1) << (3 * bit + k));
        let morton = morton.sum::<u32>();
        let place = i.checked_sub(self.splats.n_static).map_or(morton, |at| {
            let motion = self.splats.motion[at];
            let most = self.n_frames.div_ceil(2).next_power_of_two().ilog2().min(12);
            let level = (-std::f32::consts::LOG2_E * motion.t_scale - 2.0).floor().clamp(0.0, most as f32);
            let n_slots = 1u32 << level as u32;
            let slot = ((motion.t_center.clamp(0.0, 1.0) * n_slots as f32) as u32).min(n_slots - 1);
            1 << 31 | (n_slots - 1 + slot) << (28 - most) | morton >> (most.max(4) - 4)
        });
        place | (3 - self.splats.degree_of(i) as u32) << 29
    }
}

/// Logit of the opacity of each of `n` copies at one place that together have the opacity of `logit`, and the factor of
/// their standard deviations (3DGS-MCMC's equation 9, as it is written there).
pub fn shared_opacity(logit: f64, n: u32) -> (f64, f64) {
    let opacity = 1.0 / (1.0 + (-logit).exp());
    // -ln(1 - opacity), and that of one copy.
    let all = logit.exp().ln_1p();
    let own = -(-all / f64::from(n)).exp_m1();
    let mut sum = 0.0;
    for i in 0..n {
        let mut binomial = 1.0;
        for k in 0..=i {
            sum += binomial * own.powi(k as i32 + 1) / f64::from(k + 1).sqrt();
            binomial *= -f64::from(i - k) / f64::from(k + 1);
        }
    }
    ((own / (1.0 - own)).ln(), opacity / sum)
}

/// PCG's output permutation of a linear congruential step (O'Neill 2014; Jarzynski and Olano 2020).
fn permute(x: u32) -> u32 {
    let s = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let w = ((s >> ((s >> 28) + 4)) ^ s).wrapping_mul(277_803_737);
    w >> 22 ^ w
}

/// The device's random number `draw` of item `index` under `key`.
pub fn random_bits(key: u32, index: u32, draw: u32) -> u32 {
    permute(draw.wrapping_add(permute(index.wrapping_add(permute(key)))))
}

/// The device's three normal numbers from `draw` on (Box and Muller).
pub fn normals(key: u32, index: u32, draw: u32) -> [f64; 3] {
    let bits = |k: u32| random_bits(key, index, draw + k);
    let radius = |k: u32| (-2.0 * ((f64::from(bits(k) >> 8) + 1.0) / 2f64.powi(24)).ln()).sqrt();
    // The lowest six bits are not used.
    let angle = |k: u32| f64::from(bits(k) >> 6) / 2f64.powi(26) * std::f64::consts::TAU;
    [radius(0) * angle(1).cos(), radius(0) * angle(1).sin(), radius(2) * angle(3).cos()]
}
