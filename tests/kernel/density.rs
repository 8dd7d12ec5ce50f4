//! Density control on the device against its reference: the same lists, the same parameters, on scenes of both populations in
//! groups of any length.

use crate::adversary::needs_roundings;
use crate::common::one::logit;
use crate::common::prelude::*;
use ivv::internals::gpu::Buf;
use ivv::internals::reference::{Density, Descent, Kind};
use ivv::internals::scene::Cone;
use ivv::internals::stage::{Choice, Counts, DensityRound, Grown, Moments, PruneLimits};

tested! {
    "density/density_classify.comp" by Density in the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred;
    "density/density_choose.comp" by Density in the_hardest_pulled_grow_and_the_faint_go_as_in_the_reference;
    "density/density_list.comp" by Density in the_hardest_pulled_grow_and_the_faint_go_as_in_the_reference;
    "density/density_sample.comp" by Density in the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred;
    "density/density_relocate.comp" by Density in the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred;
    "density/density_gather.comp" by Density in the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred;
    "density/density_children.comp" by Density in the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred;
}

const PULLED: Choice = Choice::Pulled { gradient: 2e-4, split_above: 0.03 };
const LIMITS: PruneLimits = PruneLimits { opacity: 0.005, log_scale: 0.405_465_1, veil: 0.33 }; // ln 1.5

const ROUND: DensityRound = DensityRound {
    choice: PULLED,
    n_frames: 5,
    center: [0.5, -0.25, 1.0],
    extent: 3.0,
    limits: LIMITS,
    opacity_ceiling: f32::MAX,
    max_gaussians: 100_000,
    growth: 0.15,
    key: 0x1234_5678,
};

/// Two in the midst of the scenes, with floaters before them.
const LENSES: [Cone; 2] = [
    Cone { tip: [0.4, 0.1, 1.2], reach: 0.8, axis: [0.0, 0.0, 1.0], unused: 0.0 },
    Cone { tip: [-0.6, -0.5, 2.0], reach: 0.6, axis: [0.6, 0.0, 0.8], unused: 0.0 },
];

pub(super) const DRAWN: DensityRound = DensityRound {
    choice: Choice::Drawn,
    limits: PruneLimits { log_scale: f32::INFINITY, ..LIMITS },
    growth: 0.05,
    ..ROUND
};

/// A scene with statistics, the moments that training would have, and its place on the device.
pub(super) struct Case {
    pub(super) splats: Splats,
    /// (sum of gradient norms, frames seen, residual of t_center, step of the last update) of each Gaussian.
    state: Vec<[f32; 4]>,
    scene: SceneBuffers,
    state_buffers: Vec<Buf<[f32; 4]>>,
    moments: Moments,
    /// What is in `moments`, by group and buffer.
    filled: Vec<Vec<Vec<[u32; 4]>>>,
    gpu: Watched,
}

pub(super) struct After {
    pub(super) splats: Splats,
    pub(super) grown: Grown,
}

/// Place of plane `p` of item `i` among `planes`, as `plane_index` of the shaders has it.
fn plane_index(i: usize, planes: usize, p: usize) -> usize {
    (i / 32 * planes + p) * 32 + i % 32
}

impl Case {
    pub(super) fn new(splats: Splats, state: Vec<[f32; 4]>, group_limit: usize) -> Case {
        Self::with_moments(splats, state, group_limit, 32)
    }

    fn with_moments(splats: Splats, state: Vec<[f32; 4]>, group_limit: usize, moment_bits: u32) -> Case {
        let gpu = gpu();
        let mut random = Random::new(9);
        let scene = SceneBuffers::upload_in_groups(&gpu, &splats, &Constants::default(), group_limit).unwrap();
        let of_groups =
            |g: &ivv::internals::stage::Group| gpu.upload("state", &state[g.start..g.start + g.n as usize]).unwrap();
        let state_buffers = scene.groups.iter().map(of_groups).collect();
        // Of any contents; then bits that no other place has.
        let moments = Moments::upload(&gpu, &scene, &splats, &splats, moment_bits).unwrap();
        let mut fill = |buffer: &Buf<[f32; 4]>| {
            let data: Vec<[u32; 4]> = (0..buffer.len()).map(|_| [(); 4].map(|()| random.bits() as u32)).collect();
            gpu.write(&buffer.cast(), &data).unwrap();
            data
        };
        let filled = moments.groups.iter().map(|planes| planes.buffers().map(&mut fill).collect()).collect();
        Case { splats, state, scene, state_buffers, moments, filled, gpu }
    }

    pub(super) fn run(&self, round: &DensityRound) -> ivv::Result<After> {
        let constants = Constants::default();
        let grown = round.run(&self.gpu, &self.scene, &self.moments, &self.state_buffers, &LENSES, &constants)?;
        let splats = grown.scene.download(&self.gpu, grown.scene.groups.iter().map(|g| &g.params)).unwrap();
        Ok(After { splats, grown })
    }

    fn flat(&self) -> Vec<u32> {
        self.scene.groups.iter().flat_map(|g| g.first..g.first + g.n).collect()
    }

    fn reference(&self, round: &DensityRound) -> Descent {
        let flat = self.flat();
        let reference = self.reference_of(round, &flat);
        match round.choice {
            Choice::Pulled { gradient, split_above } => {
                let stats: Vec<[f32; 2]> = self.state.iter().map(|s| [s[0], s[1]]).collect();
                reference.pulled(&stats, gradient, split_above)
            }
            Choice::Drawn => reference.drawn(),
        }
    }

    fn reference_of<'a>(&'a self, round: &DensityRound, flat: &'a [u32]) -> Density<'a> {
        Density {
            splats: &self.splats,
            flat,
            n_flat: self.scene.n_flat,
            n_frames: round.n_frames,
            center: round.center,
            extent: round.extent,
            prune_opacity: round.limits.opacity,
            prune_scale: round.limits.log_scale.exp(),
            lenses: &LENSES,
            prune_veil: round.limits.veil,
            max_gaussians: round.max_gaussians as usize,
            growth: round.growth,
            key: round.key,
        }
    }

    /// One round, every number of which must be the reference's.
    fn check(&self, round: &DensityRound) -> (After, Descent) {
        let (after, reference) = (self.run(round).unwrap(), self.reference(round));
        let flat = self.flat();
        let density = self.reference_of(round, &flat);
        let n_static = reference.descendants.iter().filter(|d| d.from < self.splats.n_static).count();
        assert_eq!((after.splats.len(), after.splats.n_static), (reference.descendants.len(), n_static));
        let codes: Vec<u32> = reference.descendants.iter().map(|d| density.code(d.from)).collect();
        assert!(codes.is_sorted());
        let k = self.splats.n_coefficients();
        for (i, d) in reference.descendants.iter().enumerate() {
            let (new, old) = (&after.splats, &self.splats);
            // The first coefficient is a Gaussian's name.
            assert_eq!(new.sh[i * k..(i + 1) * k], old.sh[d.from * k..(d.from + 1) * k], "{i}: {d:?}");
            assert_eq!(new.rotation[i], old.rotation[d.from]);
            if let Some(at) = i.checked_sub(new.n_static) {
                assert_eq!(new.motion[at], old.motion[d.from - old.n_static], "children inherit v, t_center, t_scale");
            }
            let found = (new.position[i], new.scale[i], new.opacity[i]);
            if d.kind == Kind::AsItWas {
                let opacity = old.opacity[d.from].min(round.opacity_ceiling);
                assert_eq!(found, (old.position[d.from], old.scale[d.from], opacity));
            }
            let (position, scale, opacity) = density.child(*d, &reference.copies, f64::from(round.opacity_ceiling));
            let size = f64::from(old.scale[d.from].iter().copied().fold(f32::MIN, f32::max)).exp();
            for k in 0..3 {
                let error = (f64::from(found.0[k]) - position[k]).abs();
                assert!(error <= 2e-5 * size + 1e-6 * position[k].abs(), "{i}: {d:?}, {found:?}, {position:?}");
                assert!((f64::from(found.1[k]) - scale[k]).abs() < 4e-6 * (1.0 + scale[k].abs()), "{i}: {d:?}");
            }
            assert!((f64::from(found.2) - opacity).abs() < 4e-6 * (1.0 + opacity.abs()), "{i}: {d:?} {opacity}");
        }
        self.check_moments(&after, &reference, round.opacity_ceiling < f32::MAX);
        (after, reference)
    }

    /// Moments and state of what is as it was are kept, but for those of opacities that are reset; all others are zero.
    fn check_moments(&self, after: &After, reference: &Descent, resets: bool) {
        let old = &self.scene.groups;
        for (at, group) in after.grown.scene.groups.iter().enumerate() {
            assert!(group.n as usize <= self.scene.group_limit);
            let buffers: Vec<Vec<[u32; 4]>> =
                after.grown.moments.groups[at].buffers().map(|b| self.gpu.read(&b.cast()).unwrap()).collect();
            let state = self.gpu.read(&after.grown.state[at]).unwrap();
            for i in 0..group.n as usize {
                let d = reference.descendants[group.start + i];
                let from = old.iter().rposition(|g| g.start <= d.from).unwrap();
                let local = d.from - old[from].start;
                let planes = planes_of(&self.splats, d.from, self.moments.bits);
                for (b, ((new, old), planes)) in buffers.iter().zip(&self.filled[from]).zip(planes).enumerate() {
                    for p in 0..planes {
                        let kept = d.kind == Kind::AsItWas;
                        let mut expected = if kept { old[plane_index(local, planes, p)] } else { [0; 4] };
                        // The first plane of the geometry: position and opacity.
                        if resets && b == 0 && p < self.moments.bits as usize / 16 {
                            expected[3] = 0;
                        }
                        assert_eq!(new[plane_index(i, planes, p)], expected, "{d:?}");
                    }
                }
                let [_, _, residual, last] = self.state[d.from];
                let residual = if d.kind == Kind::AsItWas { residual } else { 0.0 };
                assert_eq!(state[i], [0.0, 0.0, residual, last], "{d:?}");
            }
            // The padding of the last block is defined.
            let planes = planes_of(&self.splats, 0, self.moments.bits)[0];
            let padded = buffers[0].len() / planes;
            let padding = (group.n as usize..padded).flat_map(|i| (0..planes).map(move |p| plane_index(i, planes, p)));
            assert!(padding.into_iter().all(|at| buffers[0][at] == [0; 4]));
        }
    }
}

/// Planes of each buffer of moments.
fn planes_of(splats: &Splats, i: usize, moment_bits: u32) -> Vec<usize> {
    let bands = [3, 4, 6].into_iter().take(splats.degree_of(i));
    let motion = (i >= splats.n_static).then_some(1);
    [3, 1].into_iter().chain(bands).chain(motion).map(|planes| planes * moment_bits as usize / 16).collect()
}

fn half(random: &mut Random, n: u64) -> f64 {
    (random.bits() % n) as f64 + 0.5
}

/// A scene of all that matters to density control: every place, time, size, brightness and pull, none within rounding of
/// a threshold; a few Gaussians are broken.
pub(super) fn scene(seed: u64, n_static: usize, n_dynamic: usize, sh_degree: u32) -> (Splats, Vec<[f32; 4]>) {
    let mut random = Random::new(seed);
    let mut splats = Splats { n_static, ..Splats::new(sh_degree) };
    let mut state = Vec::new();
    for i in 0..n_static + n_dynamic {
        let mut weight = 1.0;
        if i >= n_static {
            let t_center = half(&mut random, 30) / 30.0;
            let t_scale = random.pick(&[-3.0, -1.5, -1.2, 0.0, f64::INFINITY]);
            let frame = (t_center * 5.0).round().min(4.0);
            weight = (-((frame / 5.0 - t_center) / t_scale.exp()).powi(2)).exp();
            let velocity = random.vector(-1.0, 1.0);
            splats.motion.push(Motion { velocity, t_center: t_center as f32, t_scale: t_scale as f32 });
        }
        splats.position.push(std::array::from_fn(|k| {
            let s = half(&mut random, 256) / 128.0 - 1.0;
            (f64::from(ROUND.center[k]) + f64::from(ROUND.extent) * s / (1.0 - s.abs())) as f32
        }));
        splats.rotation.push(random.vector(-1.0, 1.0));
        let size = random.pick(&[0.001, 0.02, 0.04, 0.3, 1.0, 2.0]);
        splats.scale.push([0.9 * size, size, 0.2 * size].map(|s| s.ln() as f32));
        // Some are dead; the brightest that the window allows.
        let steps = random.pick(&[8.0, 100.0, 900.0]) as u64;
        let opacity = (half(&mut random, steps) / 1023.0).min(0.98 * weight);
        splats.opacity.push(logit(opacity / weight));
        splats.sh.push([i as f32, 0.25, 0.5]);
        // Degrees fall within each population.
        let (at, n) = if i < n_static { (i, n_static) } else { (i - n_static, n_dynamic) };
        let degree = sh_degree as usize * (n - at) / n;
        splats.degree.push(degree as u8);
        let modelled = |c: usize| if c.isqrt() <= degree { 1.0 } else { 0.0 };
        let coefficients = (1..splats.n_coefficients()).map(|c| random.vector::<3>(-0.5, 0.5).map(|x| modelled(c) * x));
        splats.sh.extend(coefficients.collect::<Vec<_>>());
        splats.source_row.push(i as u32);
        let pull = random.pick(&[0.0, 1e-4, 3e-4, 6e-4, 1e-2]) as f32;
        let frames = random.pick(&[0.0, 1.0, 4.0]) as f32;
        state.push([pull * frames, frames, random.uniform(-1e-8, 1e-8) as f32, (random.bits() % 1000) as f32]);
        match random.bits() % 40 {
            0 => splats.position[i][1] = f32::NAN,
            1 => splats.opacity[i] = f32::NAN,
            2 => splats.rotation[i] = [0.0; 4],
            3 => splats.scale[i][2] = f32::INFINITY,
            4 if i >= n_static => splats.motion[i - n_static].velocity[0] = f32::INFINITY,
            5 if i >= n_static => splats.motion[i - n_static].t_center = f32::NAN,
            _ => {}
        }
    }
    (splats, state)
}

/// Static and dynamic Gaussians, and the most of a group.
const SIZES: [(usize, usize, usize); 9] = [
    (1, 1, 128),
    (0, 127, 128),
    (128, 0, 128),
    (129, 1, 128),
    (1, 129, 256),
    (1000, 0, 384),
    (0, 1000, 2048),
    (700, 900, 256),
    (3000, 2500, 1 << 20),
];

#[test]
fn the_hardest_pulled_grow_and_the_faint_go_as_in_the_reference() {
    needs_roundings!("places on the edge of a cell, whose side the last bit of a quotient decides");
    let mut totals = [0; 3];
    for (seed, (n_static, n_dynamic, limit)) in SIZES.into_iter().enumerate() {
        // Without broken or faint ones in the smallest, so that someone is left.
        let (mut splats, state) = scene(seed as u64, n_static, n_dynamic, seed as u32 % 4);
        if n_static + n_dynamic < 3 {
            splats.opacity.fill(1.0);
            splats.scale.fill([-4.0; 3]);
        }
        let case = Case::with_moments(splats, state, limit, [32, 16][seed % 2]);
        let (after, reference) = case.check(&ROUND);
        let [cloned, split, pruned] = reference.counts.map(|n| n as u32);
        assert_eq!(after.grown.counts, Counts { cloned, split, pruned, relocated: 0 });
        totals = std::array::from_fn(|k| totals[k] + reference.counts[k]);
    }
    assert!(totals.iter().all(|n| *n > 100), "{totals:?}");
}

#[test]
fn a_long_clip_is_stored_by_slots_as_long_as_lives() {
    needs_roundings!("places on the edge of a cell, whose side the last bit of a quotient decides");
    let (mut splats, state) = scene(20, 100, 900, 1);
    let t_scales = [-3.0, -4.2, -4.9, -5.5, -9.0, f32::NEG_INFINITY];
    splats.motion.iter_mut().zip(t_scales.into_iter().cycle()).for_each(|(motion, t_scale)| motion.t_scale = t_scale);
    let case = Case::new(splats, state, 1 << 20);
    let (after, _) =
        case.check(&DensityRound { n_frames: 300, limits: PruneLimits { opacity: 0.0, ..LIMITS }, ..ROUND });
    let motion = &after.splats.motion;
    let shortest: Vec<f32> = motion.iter().filter(|m| m.t_scale < -8.0).map(|m| m.t_center).collect();
    assert!(shortest.len() > 60, "{}", shortest.len());
    let slot = |t: &f32| (256.0 * t) as u32;
    let in_order = shortest.windows(2).filter(|pair| slot(&pair[0]) <= slot(&pair[1])).count();
    // Two degrees are stored apart.
    assert!(in_order + 2 >= shortest.len(), "{in_order} of {} follow the one before in time", shortest.len());
}

#[test]
fn what_is_wide_before_a_lens_goes_whoever_looks_through_it() {
    // A third of the depth, from above and from below, before the lens and behind it; far from any; at the cone's side, within and
    // without; where the lens is, a little beside it.
    let [x, y, z] = LENSES[0].tip;
    let wide = |dz: f32, part: f64| ball([x, y, z + dz], part * f64::from(dz.abs()), 0.9, [1.0; 3]);
    let beside = |dx: f32| ball([x + dx, y, z + 0.5], 0.19, 0.9, [1.0; 3]);
    let at = ball([x + 0.08, y, z + 0.02], 0.1, 0.9, [1.0; 3]);
    let far = ball([5.0, 5.0, 9.0], 0.5, 0.9, [0.5; 3]);
    let all = [wide(0.5, 0.30), wide(0.5, 0.36), wide(-0.5, 0.36), far, beside(0.38), beside(0.46), at];
    let state = vec![[0.0; 4]; all.len()];
    for choice in [PULLED, Choice::Drawn] {
        let case = Case::new(scene_of(&all), state.clone(), 128);
        let counts = |veil: f32| {
            let round = DensityRound { choice, limits: PruneLimits { veil, ..LIMITS }, growth: 0.0, ..ROUND };
            let Counts { pruned, relocated, .. } = case.run(&round).unwrap().grown.counts;
            pruned + relocated
        };
        assert_eq!([counts(0.33), counts(f32::MAX), counts(0.28)], [3, 0, 5]);
    }
}

#[test]
fn a_disc_before_a_lens_goes_if_it_lies_along_the_line_of_sight_and_stays_if_it_faces_the_lens() {
    // As wide as half its depth, thin as paper: a wall that is seen face on, one that is seen at a grazing angle, a ball.
    let [x, y, z] = LENSES[0].tip;
    let disc = |turn: [f32; 4], thin: f32| {
        let (before, far) = (ball([x, y, z + 1.0], 0.5, 0.9, [1.0; 3]), ball([5.0, 5.0, 9.0], 0.1, 0.9, [0.5; 3]));
        let mut splats = scene_of(&[before, far]);
        (splats.rotation[0], splats.scale[0][2]) = (turn, thin.ln());
        splats
    };
    let quarter = std::f32::consts::FRAC_1_SQRT_2;
    for choice in [PULLED, Choice::Drawn] {
        let n_gone = |splats: Splats| {
            let case = Case::new(splats, vec![[0.0; 4]; 2], 128);
            let (after, _) = case.check(&DensityRound { choice, growth: 0.0, ..ROUND });
            let Counts { pruned, relocated, .. } = after.grown.counts;
            pruned + relocated
        };
        let flat = 1e-3;
        let faces = [n_gone(disc([1.0, 0.0, 0.0, 0.0], flat)), n_gone(disc([0.0, 0.0, 3.0, 0.0], flat))];
        let lies = [n_gone(disc([quarter, quarter, 0.0, 0.0], flat)), n_gone(disc([1.0, 0.0, 0.0, 0.0], 0.5))];
        assert_eq!((faces, lies), ([0, 0], [1, 1]));
    }
}

#[test]
fn the_dead_are_relocated_as_in_the_reference_and_a_round_adds_five_in_a_hundred() {
    let mut copied = 0;
    for (seed, (n_static, n_dynamic, limit)) in SIZES.into_iter().enumerate() {
        let (mut splats, state) = scene(seed as u64, n_static, n_dynamic, seed as u32 % 4);
        if n_static + n_dynamic < 3 {
            splats.opacity.fill(1.0);
        }
        let case = Case::with_moments(splats, state, limit, [16, 32][seed % 2]);
        let (after, reference) = case.check(&DRAWN);
        let n = n_static + n_dynamic;
        assert_eq!(after.splats.len(), n + n.div_ceil(20));
        let [cloned, _, relocated] = reference.counts.map(|n| n as u32);
        assert_eq!(after.grown.counts, Counts { cloned, split: 0, pruned: 0, relocated });
        copied += relocated;
        assert_eq!(reference.copies.iter().sum::<u32>(), relocated + cloned);
        // At the budget, relocation keeps the number.
        let full = DensityRound { max_gaussians: n as u32, ..DRAWN };
        assert_eq!(case.check(&full).0.splats.len(), n);
    }
    assert!(copied > 500, "{copied}");
}

#[test]
fn two_rounds_on_the_same_scene_give_the_same_bits_and_another_key_does_not() {
    let (splats, state) = scene(3, 700, 900, 1);
    let case = Case::new(splats, state, 256);
    for round in [ROUND, DRAWN] {
        let bits = |key: u32| {
            let splats = case.run(&DensityRound { key, ..round }).unwrap().splats;
            let numbers = splats.position.as_flattened().iter().chain(&splats.opacity);
            numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        let first = bits(1);
        assert_same("the same key", &bits(1), &first);
        assert!(first != bits(2));
    }
}

#[test]
fn the_budget_is_never_exceeded_and_growth_0_adds_none() {
    needs_roundings!("places on the edge of a cell, whose side the last bit of a quotient decides");
    let (splats, state) = scene(4, 300, 300, 0);
    let n = splats.len() as u32;
    let case = Case::new(splats, state, 128);
    let kept = n - case.check(&ROUND).0.grown.counts.pruned;
    for growth in [0.0, 0.1, 1.0, 100.0] {
        for max_gaussians in [0, 1, kept - 1, kept, kept + 1, kept + 5, n, 100_000] {
            let round = DensityRound { growth, max_gaussians, ..ROUND };
            let (after, _) = case.check(&round);
            let Counts { cloned, split, .. } = after.grown.counts;
            assert_eq!(after.splats.len() as u32, kept + cloned + split);
            assert!(after.splats.len() as u32 <= max_gaussians.max(kept) && (growth > 0.0 || cloned + split == 0));
        }
    }
    // Unlimited, all that are pulled grow.
    let all = case.check(&DensityRound { growth: 1.0, ..ROUND }).0;
    assert!(all.grown.counts.cloned > 20 && all.grown.counts.split > 20, "{:?}", all.grown.counts);
    for max_gaussians in [0, n - 1, n, n + 1, n + 1000] {
        let after = case.check(&DensityRound { max_gaussians, ..DRAWN }).0;
        assert_eq!(after.splats.len() as u32, n.max(max_gaussians).min(n + n.div_ceil(20)));
    }
}

#[test]
fn a_population_may_die_out_and_a_scene_may_not() {
    needs_roundings!("places on the edge of a cell, whose side the last bit of a quotient decides");
    for static_goes in [false, true] {
        let (mut splats, state) = scene(5, 200, 200, 1);
        let gone = if static_goes { 0..200 } else { 200..400 };
        splats.opacity[gone].fill(-20.0);
        let case = Case::new(splats, state.clone(), 128);
        let (after, _) = case.check(&ROUND);
        let n = after.splats.len();
        assert!(n > 50 && after.splats.n_static == if static_goes { 0 } else { n });
        case.check(&DRAWN);
    }
    let (mut splats, state) = scene(5, 200, 200, 1);
    splats.opacity.fill(-20.0);
    let case = Case::new(splats, state, 128);
    for round in [ROUND, DRAWN] {
        let fault = case.run(&round).err().expect("nothing is left");
        assert!(fault.to_string().contains("density control pruned every Gaussian"), "{fault}");
    }
    let empty = Case::new(Splats::new(0), Vec::new(), 128);
    assert!(empty.run(&ROUND).is_err());
}

#[test]
fn a_gaussian_that_shows_only_between_two_frames_goes() {
    // Bright at 0.3, between the frames at 0.2 and 0.4.
    let with = |t_center: f32, t_scale: f32| One {
        motion: Some(Motion { velocity: [0.0; 3], t_center, t_scale }),
        ..ball([0.0, 0.0, 4.0], 0.1, 0.9, [0.5; 3])
    };
    // 0.9 exp(-(0.1 / tau)^2) is 0.005 at tau = 0.0439. The clip has no frame at 1, nor before 0.
    let all = [(0.3, 0.043), (0.3, 0.045), (0.2, 0.01), (0.96, 0.05), (0.88, 0.05), (-0.2, 0.05), (-0.1, 0.05)];
    let splats = scene_of(&all.map(|(t_center, tau): (f32, f32)| with(t_center, tau.ln())));
    let case = Case::new(splats, vec![[0.0; 4]; all.len()], 128);
    let after = case.check(&ROUND).0;
    let mut left: Vec<f32> = after.splats.motion.iter().map(|m| m.t_center).collect();
    left.sort_by(f32::total_cmp);
    assert_eq!(left, [-0.1, 0.2, 0.3, 0.88]);
    assert!(after.splats.motion.iter().all(|m| m.t_scale != 0.043f32.ln()));
}

#[test]
fn the_opacity_ceiling_holds_for_all() {
    needs_roundings!("places on the edge of a cell, whose side the last bit of a quotient decides");
    let (splats, state) = scene(6, 200, 200, 0);
    let case = Case::new(splats, state, 128);
    for round in [ROUND, DRAWN] {
        let after = case.check(&DensityRound { opacity_ceiling: -2.0, ..round }).0;
        assert_eq!(after.splats.opacity.iter().copied().fold(f32::MIN, f32::max), -2.0);
    }
}
