//! Density control (SPEC 6): which Gaussians go, which grow and where each is stored, decided and carried out on the device.

use super::capacity::too_large;
use super::scan::SCAN_BLOCK;
use super::scene::BUCKETS;
use super::sort::SORT_BLOCK;
use super::{Among, Carried, Group, Moments, Scan, SceneBuffers, Sort, Unsorted};
use crate::error::{Error, Result};
use crate::gpu::generated::constants::density as shared;
use crate::gpu::generated::{
    self, PruneLimits, Status, density_children, density_choose, density_classify_static, density_gather, density_list,
    density_relocate, density_sample, mcmc_noise,
};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::scene::Cone;
use crate::settings::Constants;
use std::path::Path;

/// Flat indices leave two bits of a source word for its kind.
const MAX_FLAT: u32 = 1 << shared::SOURCE_BITS;
/// Weight of opacity 1 among those that are drawn, while the sum of all fits 32 bits.
const WEIGHT: u32 = 1023;
/// So that places keep 16 bits.
const MOST_LEVELS: u32 = 12;
/// Log of the largest standard deviation whose square f32 holds.
const LARGEST: f32 = 44.0;

const N_BUCKET: usize = shared::N_BUCKET as usize;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// 3DGS: those whose projected centre is pulled grow, the hardest pulled first; those that rules prune go.
    Pulled {
        /// Mean norm of the gradient, in half pictures, above which a Gaussian grows.
        gradient: f32,
        /// Standard deviation, scene units, above which it splits and below which it is cloned.
        split_above: f32,
    },
    /// 3DGS-MCMC (Kheradmand et al. 2024): the dead, and new ones, become copies of living ones drawn by opacity.
    Drawn,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityRound {
    pub choice: Choice,
    /// Frames of the clip, at times f / F.
    pub n_frames: u32,
    /// Middle of the captured space, relative to the scene's origin, and its size, scene units.
    pub center: [f32; 3],
    pub extent: f32,
    /// Limits beyond which a Gaussian is removed or counts as dead.
    pub limits: PruneLimits,
    /// Opacity logit that none exceeds afterwards; `f32::MAX` leaves all.
    pub opacity_ceiling: f32,
    pub max_gaussians: u32,
    pub growth: f32,
    pub key: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Gaussians cloned; of drawn ones, those added.
    pub cloned: u32,
    pub split: u32,
    pub pruned: u32,
    /// Dead Gaussians that became copies of living ones.
    pub relocated: u32,
}

pub struct Grown {
    pub scene: SceneBuffers,
    pub moments: Moments,
    pub state: Vec<Buf<[f32; 4]>>,
    pub counts: Counts,
}

#[derive(Clone, Copy)]
struct OldScene<'a> {
    scene: &'a SceneBuffers,
    moments: &'a Moments,
    state: &'a [Buf<[f32; 4]>],
}

/// Scratch of a round, by flat index unless said otherwise.
struct Scratch {
    lenses: Buf<[f32; 4]>,
    n_lenses: u32,
    flags: Buf<u32>,
    scores: Buf<u32>,
    identity: Buf<u32>,
    entries: Buf<u32>,
    codes: Buf<u32>,
    copies: Buf<u32>,
    counters: Buf<u32>,
    n_flat: Buf<u32>,
    scan: Scan,
    sources: Buf<u32>,
    source_codes: Buf<u32>,
}

impl DensityRound {
    /// One round on `scene` before `lenses`, relative to the scene's origin. The Gaussians come out by population, time and place
    /// (Morton's order); whatever is not as it was has moments zero, and so has every opacity after a reset; all statistics begin anew.
    pub fn run(
        &self,
        gpu: &Gpu,
        scene: &SceneBuffers,
        moments: &Moments,
        state: &[Buf<[f32; 4]>],
        lenses: &[Cone],
        constants: &Constants,
    ) -> Result<Grown> {
        let old = OldScene { scene, moments, state };
        if scene.n_flat >= MAX_FLAT {
            let (needed, limit) = (scene.n.into(), MAX_FLAT.into());
            return Err(too_large("density control (Gaussians)", needed, limit, "lower --max-gaussians"));
        }
        if scene.n == 0 {
            return Err(nothing_left());
        }
        let most_new = self.most_new(scene.n);
        let scratch = Scratch::new(gpu, scene, most_new, lenses)?;
        let mut rec = Recording::new();
        rec.section("density");
        rec.fill(scratch.counters.slice(), 0);
        rec.fill(scratch.copies.slice(), 0);
        self.record_classify(&mut rec, &scratch, old);
        match self.choice {
            Choice::Pulled { .. } => self.record_pulled(gpu, &mut rec, &scratch)?,
            Choice::Drawn => self.record_drawn(gpu, &mut rec, &scratch, scene.n, most_new)?,
        }
        gpu.run(&rec)?;
        let counters = gpu.read(&scratch.counters)?;
        let places = [shared::N_LISTED, shared::N_KEPT, shared::N_CLONED, shared::N_SPLIT];
        let [n_listed, n_kept, n_cloned, n_split] = places.map(|at| counters[at as usize]);
        if n_kept == 0 {
            return Err(nothing_left());
        }
        let n_gone = scene.n - n_kept;
        let (n_new, counts) = match self.choice {
            Choice::Pulled { .. } => (0, Counts { cloned: n_cloned, split: n_split, pruned: n_gone, relocated: 0 }),
            Choice::Drawn => (most_new, Counts { cloned: most_new, split: 0, pruned: 0, relocated: n_gone }),
        };
        let n = (n_listed + n_new) as usize;
        let mut rec = Recording::new();
        rec.section("density");
        let (count, Scratch { source_codes, sources, .. }) = (gpu.upload("density listed", &[n as u32])?, &scratch);
        let (_, sources) = record_sort(gpu, &mut rec, &count, n, source_codes, sources)?;
        gpu.run(&rec)?;
        let counts_by_bucket = std::array::from_fn(|bucket| counters[N_BUCKET + bucket] as usize);
        let scene = SceneBuffers::reshaped(gpu, scene, &counts_by_bucket)?;
        let (moments, state) = self.carry(gpu, old, &scene, &sources, &scratch.copies, constants)?;
        Ok(Grown { scene, moments, state, counts })
    }

    /// The Gaussians that a round adds to `n` at most; exactly, where they are drawn.
    fn most_new(&self, n: u32) -> u32 {
        let growth = (self.growth * n as f32).ceil() as u32;
        match self.choice {
            Choice::Pulled { .. } => growth.min(self.max_gaussians),
            Choice::Drawn => growth.min(self.max_gaussians.saturating_sub(n)),
        }
    }

    fn record_classify(&self, rec: &mut Recording, scratch: &Scratch, old: OldScene) {
        let n_flat = old.scene.n_flat;
        let [x, y, z] = self.center;
        let (weight, split_above, gradient) = match self.choice {
            Choice::Pulled { gradient, split_above } => (0, split_above.ln(), gradient),
            Choice::Drawn => (WEIGHT.min(u32::MAX / n_flat.max(1) - 1), f32::MAX, f32::MAX),
        };
        // Times that slots of time are halved, until they are two frames long.
        let levels = self.n_frames.div_ceil(2).next_power_of_two().ilog2().min(MOST_LEVELS);
        let limits = PruneLimits { log_scale: self.limits.log_scale.min(LARGEST), ..self.limits };
        let Scratch { lenses, flags, scores, identity, entries, codes, counters, .. } = scratch;
        for (index, (group, state)) in old.scene.groups.iter().zip(old.state).enumerate() {
            rec.group(Some(index));
            let (is_held, params) = (old.scene.holds(group), &group.params);
            let push = density_classify_static::Push {
                center: [x, y, z, 1.0 / self.extent],
                n: group.n,
                first: group.first,
                n_frames: self.n_frames,
                weight,
                split_above,
                // Held Gaussians do not grow either.
                gradient: if is_held { f32::MAX } else { gradient },
                bucket: group.bucket() as u32,
                n_lenses: scratch.n_lenses,
                levels,
                is_held: u32::from(is_held),
                limits,
            };
            let args = density_classify_static::Args {
                geometry: &params.geometry,
                state,
                flags,
                scores,
                identity,
                entries,
                codes,
                counters,
                lenses,
                motion: params.motion.as_ref().unwrap_or(&params.geometry),
            };
            rec.pass_variant(generated::density_classify(group.is_dynamic()), args, push, Grid::Threads(group.n));
        }
        rec.group(None);
    }

    /// The hardest pulled grow: sorted by pull, as many as the budget allows.
    fn record_pulled(&self, gpu: &Gpu, rec: &mut Recording, scratch: &Scratch) -> Result<()> {
        let Scratch { flags, scores, identity, entries, codes, counters, sources, source_codes, .. } = scratch;
        let n = flags.len();
        let (keys, order) = record_sort(gpu, rec, &scratch.n_flat, n, scores, identity)?;
        let args = density_choose::Args { keys: &keys, order: &order, counters, flags, entries };
        let push = density_choose::Push { n: n as u32, max_gaussians: self.max_gaussians, growth: self.growth };
        rec.pass(args, push, Grid::Threads(n as u32));
        scratch.record_scan(rec, entries, counters);
        let args = density_list::Args { flags, offsets: entries, codes, sources, source_codes, counters };
        rec.pass(args, density_list::Push { n: n as u32 }, Grid::Threads(n as u32));
        Ok(())
    }

    /// The dead and `n_new` more become copies of living ones.
    fn record_drawn(&self, gpu: &Gpu, rec: &mut Recording, scratch: &Scratch, n_old: u32, n_new: u32) -> Result<()> {
        let Scratch { flags, scores, entries, codes, copies, counters, sources, source_codes, .. } = scratch;
        let n = flags.len() as u32;
        let total = &gpu.alloc("density weight", 1)?;
        let targets = &gpu.alloc("density targets", (n + n_new) as usize)?;
        let grid = Grid::Threads(n + n_new);
        scratch.record_scan(rec, scores, total);
        let args = density_sample::Args { flags, before: scores, total, targets, copies };
        rec.pass(args, density_sample::Push { n, n_new, key: self.key }, grid.clone());
        scratch.record_scan(rec, entries, counters);
        let args =
            density_relocate::Args { flags, offsets: entries, codes, targets, copies, sources, source_codes, counters };
        rec.pass(args, density_relocate::Push { n, n_new, n_old }, grid);
        Ok(())
    }

    /// Fills `scene`, and new moments and state, from `old`: in the order of `sources`, with the numbers of copies.
    fn carry(
        &self,
        gpu: &Gpu,
        old: OldScene,
        scene: &SceneBuffers,
        sources: &Buf<u32>,
        copies: &Buf<u32>,
        constants: &Constants,
    ) -> Result<(Moments, Vec<Buf<[f32; 4]>>)> {
        let moments = old.moments.undefined(gpu, scene)?;
        let state = scene.groups.iter().map(|g| gpu.alloc("state", g.n as usize)).collect::<Result<Vec<_>>>()?;
        let mut rec = Recording::new();
        rec.section("density");
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let of_bucket = |(_, source): &(usize, &Group)| source.bucket() == group.bucket();
            for (from, source) in old.scene.groups.iter().enumerate().filter(of_bucket) {
                let (old_params, geometry) = (&source.params.geometry, &group.params.geometry);
                let args = density_children::Args { sources, copies, old: old_params, geometry };
                let push = density_children::Push {
                    n: group.n,
                    start: group.start as u32,
                    old_first: source.first,
                    old_n: source.n,
                    key: self.key,
                    ceiling: if scene.holds(group) { f32::MAX } else { self.opacity_ceiling },
                };
                rec.pass(args, push, Grid::Threads(group.n.next_multiple_of(32)));
                let transport = Transport { sources, old: source, new: group };
                let params = source.params.buffers().zip(group.params.buffers()).zip(group.params.plane_counts());
                for ((old, new), planes) in params.skip(1) {
                    transport.record(&mut rec, old, new, planes, 0, [[1.0; 4], [1.0; 4]]);
                }
                // What is known of opacities says nothing of those that they are reset to. They are in the first plane of the geometry.
                let resets = self.opacity_ceiling < f32::MAX && !scene.holds(group);
                let pairs = old.moments.groups[from].buffers().zip(moments.groups[index].buffers());
                for (at, ((old, new), planes)) in pairs.zip(group.params.plane_counts()).enumerate() {
                    let faded = if resets && at == 0 { moments.planes(1) } else { 0 };
                    transport.record(&mut rec, old, new, moments.planes(planes), faded, [[1.0; 4], [0.0; 4]]);
                }
                // The statistics begin anew; a child has no residual.
                let stays = [[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]];
                transport.record(&mut rec, &old.state[from], &state[index], 1, 0, stays);
            }
        }
        // Whatever could not be drawn was pruned or relocated.
        scene.record_bounds(&mut rec, constants, &gpu.upload("undrawable Gaussians", &[0])?, Among::All);
        gpu.run(&rec)?;
        Ok((moments, state))
    }
}

fn nothing_left() -> Error {
    let remedy = "begin with more Gaussians, or set density.stop=0 to prune none";
    Error::data(Path::new("settings"), "density", "density control pruned every Gaussian", remedy)
}

struct Transport<'a> {
    sources: &'a Buf<u32>,
    old: &'a Group,
    new: &'a Group,
}

impl Transport<'_> {
    /// Appends the transport of one buffer; the masks say which components stay of a Gaussian that is as it was, and of
    /// any other. Of the first `faded` planes the last component does not stay.
    fn record(
        &self,
        rec: &mut Recording,
        old: &Buf<[f32; 4]>,
        gathered: &Buf<[f32; 4]>,
        planes: usize,
        faded: usize,
        [as_it_was, child]: [[f32; 4]; 2],
    ) {
        let push = density_gather::Push {
            as_it_was,
            child,
            size: gathered.len() as u32,
            planes: planes as u32,
            n: self.new.n,
            start: self.new.start as u32,
            old_first: self.old.first,
            old_n: self.old.n,
            faded: faded as u32,
        };
        let args = density_gather::Args { sources: self.sources, old: &old.cast(), gathered: &gathered.cast() };
        rec.pass(args, push, Grid::Threads(push.size));
    }
}

impl Scratch {
    fn new(gpu: &Gpu, scene: &SceneBuffers, most_new: u32, lenses: &[Cone]) -> Result<Self> {
        let n = scene.n_flat as usize;
        let listed = scene.n as usize + most_new as usize;
        Ok(Scratch {
            lenses: gpu.upload("lenses", bytemuck::cast_slice(lenses))?,
            n_lenses: lenses.len() as u32,
            flags: gpu.alloc("density flags", n)?,
            scores: gpu.alloc("density scores", n)?,
            identity: gpu.alloc("density identity", n)?,
            entries: gpu.alloc("density entries", n)?,
            codes: gpu.alloc("density codes", n)?,
            copies: gpu.alloc("density copies", n)?,
            counters: gpu.alloc("density counters", N_BUCKET + BUCKETS)?,
            n_flat: gpu.upload("density length", &[scene.n_flat])?,
            scan: Scan::new(gpu, n)?,
            sources: gpu.alloc("density sources", listed)?,
            source_codes: gpu.alloc("density source codes", listed)?,
        })
    }

    /// Appends the scan of `values`; the sum goes to `total[0]`.
    fn record_scan(&self, rec: &mut Recording, values: &Buf<u32>, total: &Buf<u32>) {
        let blocks = Grid::Groups(values.len().div_ceil(SCAN_BLOCK) as u32);
        self.scan.record(rec, &self.n_flat, values, total, blocks);
    }
}

/// Appends the sort of `n` pairs, as many as `count` says, by all bits of their keys.
fn record_sort(
    gpu: &Gpu,
    rec: &mut Recording,
    count: &Buf<u32>,
    n: usize,
    keys: &Buf<u32>,
    values: &Buf<u32>,
) -> Result<(Buf<u32>, Buf<u32>)> {
    let sort = Sort::new(gpu, n, u32::BITS)?;
    let blocks = &Grid::Groups(n.div_ceil(SORT_BLOCK) as u32);
    sort.record_clear(rec);
    Ok(sort.record(rec, Unsorted { count, keys, carried: Carried::Values(values), n_bits: u32::BITS, blocks }))
}

/// Appends the noise of 3DGS-MCMC after a step: faint Gaussians move by `rate` (the learning rate of positions, scene units, times the
/// noise's) times their covariance; none when the step failed. The bounds are due afterwards.
pub fn record_mcmc_noise(rec: &mut Recording, scene: &SceneBuffers, status: &Buf<Status>, rate: f32, key: u32) {
    rec.section("noise");
    for (index, group) in scene.groups.iter().enumerate() {
        rec.group(Some(index));
        let args = mcmc_noise::Args { frame_status: status, geometry: &group.params.geometry };
        let push = mcmc_noise::Push { n: group.n, first: group.first, key, rate };
        rec.pass(args, push, Grid::Threads(group.n));
    }
    rec.group(None);
}
