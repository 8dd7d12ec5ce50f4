//! A scene on the device: groups of Gaussians of one population and one SH degree, each short enough for the device's
//! bindings.

use super::capacity::too_large;
use super::live::CULL_BLOCK;
use super::planes::{Arrays, BAND_PLANES, FISHER_PLANES};
use super::{Among, Live, Planes, Purpose};
use crate::error::Result;
use crate::gpu::generated::{bound_dynamic, bound_static};
use crate::gpu::{Buf, Gpu, Recording};
use crate::scene::{Motion, Splats};
use crate::settings::{Constants, Knobs};

/// Gaussians that share their kernels: static or dynamic, one SH degree, one set of buffers.
pub struct Group {
    /// Flat index of the first, a multiple of 128, the workgroup of the cull.
    pub first: u32,
    pub n: u32,
    pub start: usize,
    /// The parameters; positions relative to the scene's origin.
    pub params: Planes,
    /// Position and reach, derived.
    pub bound: Buf<[f32; 4]>,
    /// Half-width of the time window, derived; dynamic groups only.
    pub window: Option<Buf<f32>>,
    pub live: Live,
}

pub struct SceneBuffers {
    pub groups: Vec<Group>,
    /// Length of the flat index, a multiple of `CULL_BLOCK`.
    pub n_flat: u32,
    pub n: u32,
    pub group_first: Buf<u32>,
    pub group_limit: usize,
    pub sh_degree: usize,
    /// Subtracted from every position, and from the cameras; zero unless the scene is far from its origin.
    pub origin: [f64; 3],
    /// Gaussians with a non-finite parameter or no rotation: never drawn.
    pub n_bad: u32,
    /// True if training leaves the static Gaussians as they are.
    pub holds_static: bool,
}

impl SceneBuffers {
    /// Uploads `splats` and derives what culling reads for `constants`.
    pub fn upload(gpu: &Gpu, splats: &Splats, constants: &Constants, purpose: Purpose) -> Result<Self> {
        Self::upload_in_groups(gpu, splats, constants, group_limit(gpu, splats.sh_degree as usize, purpose))
    }

    /// As [`SceneBuffers::upload`] in groups of at most `limit` Gaussians, a multiple of 128.
    pub fn upload_in_groups(gpu: &Gpu, splats: &Splats, constants: &Constants, limit: usize) -> Result<Self> {
        Self::upload_around(gpu, splats, constants, limit, far_origin(splats))
    }

    /// As [`SceneBuffers::upload_in_groups`], around an origin that is given.
    pub(super) fn upload_around(
        gpu: &Gpu,
        splats: &Splats,
        constants: &Constants,
        limit: usize,
        origin: [f64; 3],
    ) -> Result<Self> {
        let degree = splats.sh_degree as usize;
        let (groups, n_flat) = cut(&counts(splats), limit, |slot| {
            Group::new(gpu, slot, Planes::upload(gpu, splats, slot.start, slot.n, origin)?)
        })?;
        let n_bad = gpu.upload("bad Gaussians", &[0u32])?;
        let mut scene = Self::from_groups(gpu, groups, n_flat, limit, degree, origin)?;
        let mut rec = Recording::new();
        scene.record_bounds(&mut rec, constants, &n_bad, Among::All);
        gpu.run(&rec)?;
        scene.n_bad = gpu.read(&n_bad)?.first().copied().unwrap_or(0);
        Ok(scene)
    }

    /// Takes all dynamic Gaussians out; of those that stay, `n_bad` are never drawn.
    pub(super) fn clear_dynamic(&mut self, n_bad: u32) {
        self.groups.retain(|group| group.params.motion.is_none());
        self.n = self.groups.iter().map(|group| group.n).sum();
        let end = |group: &Group| group.first + group.n.next_multiple_of(CULL_BLOCK);
        self.n_flat = self.groups.last().map_or(0, end);
        self.n_bad = n_bad;
    }

    /// Puts `dynamic`, which has no static Gaussians, behind the static ones of this scene.
    pub(super) fn append_dynamic(&mut self, gpu: &Gpu, dynamic: SceneBuffers) -> Result<()> {
        let (first, start) = (self.n_flat, self.n as usize);
        let moved = |group: Group| Group { first: group.first + first, start: group.start + start, ..group };
        self.groups.extend(dynamic.groups.into_iter().map(moved));
        (self.n, self.n_bad) = (self.n + dynamic.n, self.n_bad + dynamic.n_bad);
        self.n_flat += dynamic.n_flat;
        self.group_first = upload_starts(gpu, &self.groups)?;
        Ok(())
    }

    /// Groups with undefined contents for so many Gaussians of each bucket, for a scene like `other`.
    pub(super) fn reshaped(gpu: &Gpu, other: &SceneBuffers, counts: &[usize; BUCKETS]) -> Result<Self> {
        let (groups, n_flat) = cut(counts, other.group_limit, |slot| {
            let params = Planes::alloc(gpu, "parameters", slot.n, slot.degree, slot.dynamic, 1)?;
            Group::new(gpu, slot, params)
        })?;
        let scene = Self::from_groups(gpu, groups, n_flat, other.group_limit, other.sh_degree, other.origin)?;
        Ok(SceneBuffers { holds_static: other.holds_static, ..scene })
    }

    fn from_groups(
        gpu: &Gpu,
        groups: Vec<Group>,
        n_flat: u32,
        group_limit: usize,
        sh_degree: usize,
        origin: [f64; 3],
    ) -> Result<Self> {
        Ok(SceneBuffers {
            n: groups.iter().map(|g| g.n).sum(),
            group_first: upload_starts(gpu, &groups)?,
            groups,
            n_flat,
            group_limit,
            sh_degree,
            origin,
            n_bad: 0,
            holds_static: false,
        })
    }

    /// Appends the derivation of what culling reads; due whenever parameters `among` these have changed. `n_bad` grows by the Gaussians
    /// that can never be drawn.
    pub fn record_bounds(&self, rec: &mut Recording, constants: &Constants, n_bad: &Buf<u32>, among: Among) {
        rec.section("bound");
        for (index, group) in self.groups.iter().enumerate() {
            rec.group(Some(index));
            group.record_bound(rec, constants, n_bad, among);
        }
        rec.group(None);
    }

    pub fn download<'a>(&self, gpu: &Gpu, planes: impl Iterator<Item = &'a Planes>) -> Result<Splats> {
        let arrays = planes.map(|planes| Arrays::read(gpu, planes)).collect::<Result<Vec<_>>>()?;
        Ok(self.assemble(&arrays))
    }

    pub(super) fn assemble(&self, arrays: &[Arrays]) -> Splats {
        let (n, k) = (self.n as usize, self.n_coefficients());
        let n_static = self.groups.iter().filter(|g| !g.is_dynamic()).map(|g| g.n as usize).sum();
        let mut out = Splats {
            n_static,
            position: vec![[0.0; 3]; n],
            rotation: vec![[0.0; 4]; n],
            scale: vec![[0.0; 3]; n],
            opacity: vec![0.0; n],
            sh: vec![[0.0; 3]; n * k],
            motion: vec![Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: 0.0 }; n - n_static],
            source_row: (0..n as u32).collect(),
            ..Splats::new(self.sh_degree as u32)
        };
        if self.groups.iter().any(|group| group.degree() != self.sh_degree) {
            out.degree = self.groups.iter().flat_map(|g| std::iter::repeat_n(g.degree() as u8, g.n as usize)).collect();
        }
        for (group, arrays) in self.groups.iter().zip(arrays) {
            arrays.write_into(&mut out, group.start, group.n as usize);
        }
        out
    }
}

fn upload_starts(gpu: &Gpu, groups: &[Group]) -> Result<Buf<u32>> {
    gpu.upload("group starts", &groups.iter().map(|group| group.first / CULL_BLOCK).collect::<Vec<_>>())
}

/// The most Gaussians of a degree whose longest binding the device can see: the widest planes, with their moments for
/// [`Purpose::Training`]. A multiple of the workgroup of the cull.
pub fn group_limit(gpu: &Gpu, degree: usize, purpose: Purpose) -> usize {
    let widest = BAND_PLANES.iter().take(degree).copied().chain([3]).max().unwrap_or(3);
    // What pictures say of a rendered scene is summed beside it.
    let planes = if purpose == Purpose::Training { 2 * widest } else { widest.max(FISHER_PLANES) };
    (gpu.caps().max_binding_bytes / (16 * planes as u64)) as usize / CULL_BLOCK as usize * CULL_BLOCK as usize
}

impl SceneBuffers {
    /// The groups that training changes, with their indices.
    pub fn trained(&self) -> impl Iterator<Item = (usize, &Group)> {
        self.groups.iter().enumerate().filter(|(_, group)| !self.holds(group))
    }

    pub(super) fn holds(&self, group: &Group) -> bool {
        self.holds_static && !group.is_dynamic()
    }

    pub fn n_trained(&self) -> u32 {
        self.trained().map(|(_, group)| group.n).sum()
    }

    pub fn n_coefficients(&self) -> usize {
        let side = self.sh_degree + 1;
        side * side
    }
}

impl Group {
    fn new(gpu: &Gpu, slot: &Slot, params: Planes) -> Result<Self> {
        Ok(Group {
            first: slot.first,
            n: slot.n as u32,
            start: slot.start,
            params,
            bound: gpu.alloc("bound", slot.n)?,
            window: slot.dynamic.then(|| gpu.alloc("window", slot.n)).transpose()?,
            live: Live::new(gpu, slot.n, slot.dynamic)?,
        })
    }

    pub fn degree(&self) -> usize {
        self.params.bands.len()
    }

    pub(super) fn is_dynamic(&self) -> bool {
        self.params.motion.is_some()
    }

    /// `is_dynamic` and `degree` of push constants.
    pub(super) fn kind(&self) -> (u32, u32) {
        (u32::from(self.is_dynamic()), self.degree() as u32)
    }

    /// vec4 planes of its parameters, the scale of passes that go over all of them.
    pub(super) fn n_planes(&self) -> f64 {
        self.params.plane_counts().sum::<usize>() as f64
    }

    pub(super) fn bucket(&self) -> usize {
        bucket(self.is_dynamic(), self.degree())
    }

    fn record_bound(&self, rec: &mut Recording, constants: &Constants, n_bad: &Buf<u32>, among: Among) {
        let (geometry, bound, n) = (&self.params.geometry, &self.bound, self.n);
        let (grid, is_listed) = self.live.grid(among);
        let Constants { alpha_min, knobs: Knobs { culls, temporal_cut, .. }, .. } = *constants;
        let temporal_cut = if culls.time_cull { temporal_cut } else { -1.0 };
        if let (Some(motion), Some(window), Some(life)) = (&self.params.motion, &self.window, &self.live.life) {
            let (live, live_args) = (&self.live.blocks, &self.live.args.cast());
            let args = bound_dynamic::Args { geometry, bound, n_bad, motion, window, life, live, live_args };
            rec.pass(args, bound_dynamic::Push { n, alpha_min, temporal_cut, is_listed }, grid);
            rec.count(among.counted());
        } else {
            rec.pass(bound_static::Args { geometry, bound, n_bad }, bound_static::Push { n, alpha_min }, grid);
        }
    }
}

/// Kinds of Gaussians that are stored apart: static ones of degree 3 to 0, then dynamic ones.
pub(super) const BUCKETS: usize = 8;

/// The bucket of a population and a degree, `bucket` of `include/density.glsl`.
pub(super) fn bucket(dynamic: bool, degree: usize) -> usize {
    usize::from(dynamic) * 4 + 3 - degree
}

fn counts(splats: &Splats) -> [usize; BUCKETS] {
    let mut counts = [0; BUCKETS];
    (0..splats.len()).for_each(|i| counts[bucket(i >= splats.n_static, splats.degree_of(i))] += 1);
    counts
}

struct Slot {
    start: usize,
    n: usize,
    first: u32,
    dynamic: bool,
    degree: usize,
}

/// Cuts so many Gaussians of each bucket into groups of at most `limit`, which `group` makes; gives the length of the flat index too.
fn cut(counts: &[usize; BUCKETS], limit: usize, group: impl Fn(&Slot) -> Result<Group>) -> Result<(Vec<Group>, u32)> {
    let (mut groups, mut first, mut begin) = (Vec::new(), 0u32, 0);
    for (bucket, count) in counts.iter().enumerate() {
        let end = begin + count;
        for start in (begin..end).step_by(limit) {
            let slot = Slot { start, n: limit.min(end - start), first, dynamic: bucket >= 4, degree: 3 - bucket % 4 };
            let flat = (slot.n as u64).next_multiple_of(u64::from(CULL_BLOCK));
            groups.push(group(&slot)?);
            let needed = counts.iter().sum::<usize>() as u64;
            let too_large = |_| too_large("the scene (Gaussians)", needed, u32::MAX.into(), "split the scene");
            first = u32::try_from(u64::from(first) + flat).map_err(too_large)?;
        }
        begin = end;
    }
    Ok((groups, first))
}

/// Where to put the origin: zero, unless the scene lies so far away that f32 would lose its detail there.
///
/// The median and the quartiles of the finite positions decide, so that a few wild Gaussians change nothing; the result
/// is a multiple of a power of two above the scene's size, so that a few more or less do not either.
pub(super) fn far_origin(splats: &Splats) -> [f64; 3] {
    let finite = || splats.position.iter().filter(|p| p.iter().all(|x| x.is_finite()));
    if finite().next().is_none() {
        return [0.0; 3];
    }
    let mut spread = 0.0f64;
    let medians = [0, 1, 2].map(|axis| {
        let mut along: Vec<f32> = finite().map(|p| p[axis]).collect();
        along.sort_unstable_by(f32::total_cmp);
        let quantile = |q: usize| f64::from(along[(along.len() - 1) * q / 4]);
        spread = spread.max(quantile(3) - quantile(1));
        quantile(2)
    });
    let distance = medians.iter().map(|m| m * m).sum::<f64>().sqrt();
    if distance < 64.0 * spread || distance < 64.0 {
        return [0.0; 3];
    }
    let step = (4.0 * spread.max(distance * 1e-6)).log2().ceil().exp2();
    medians.map(|m| (m / step).round() * step)
}
