//! A scene on the device: groups of Gaussians of one population and one SH degree, each short enough for the device's
//! bindings.

use super::params::Purpose;
use crate::error::{Error, Result};
use crate::gpu::generated::{bound_dynamic, bound_static, constants, cull_static, sh_half};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::scene::{Motion, Splats};
use crate::settings::{Constants, Knobs};

/// Items in one block of planes.
pub(super) const PLANE_BLOCK: usize = constants::grid::PLANE_BLOCK as usize;
/// Gaussians per workgroup of the cull; groups begin at multiples of it in the flat index.
pub const CULL_BLOCK: u32 = cull_static::INFO.local;
/// vec4 planes of bands 1 to 3.
pub(super) const BAND_PLANES: [usize; 3] = [3, 4, 6];

/// Numbers per Gaussian in the layout of the parameters: the parameters themselves, their gradients, their moments.
pub struct Planes {
    /// Position and opacity; rotation; scale and t_scale.
    pub geometry: Buf<[f32; 4]>,
    /// The constant band.
    pub sh0: Buf<[f32; 4]>,
    /// Bands 1 to 3; as many as the degree.
    pub bands: Vec<Buf<[f32; 4]>>,
    /// Velocity and t_center; dynamic groups only.
    pub motion: Option<Buf<[f32; 4]>>,
}

/// Gaussians that share their kernels: static or dynamic, one SH degree, one set of buffers.
pub struct Group {
    /// Flat index of the first, a multiple of 128, the workgroup of the cull.
    pub first: u32,
    /// Number of Gaussians.
    pub n: u32,
    /// Index of the first in the scene's order.
    pub start: usize,
    /// The parameters; positions relative to the scene's origin.
    pub params: Planes,
    /// Position and reach, derived.
    pub bound: Buf<[f32; 4]>,
    /// Bands 1 to 3 as halves, derived, where projection reads those; a pair of words for each vec4 of the parameters.
    pub halves: Vec<Buf<[u32; 2]>>,
    /// Half-width of the time window, derived; dynamic groups only.
    pub window: Option<Buf<f32>>,
}

/// A scene on the device.
pub struct SceneBuffers {
    /// The groups, static ones first.
    pub groups: Vec<Group>,
    /// Length of the flat index, a multiple of `CULL_BLOCK`.
    pub n_flat: u32,
    /// Gaussians.
    pub n: u32,
    /// First cull workgroup of each group.
    pub group_first: Buf<u32>,
    /// Most Gaussians of a group, a multiple of `CULL_BLOCK`.
    pub group_limit: usize,
    /// SH degree that a Gaussian has at most.
    pub sh_degree: usize,
    /// Subtracted from every position, and from the cameras; zero unless the scene is far from its origin.
    pub origin: [f64; 3],
    /// Gaussians with a non-finite parameter or no rotation: never drawn.
    pub n_bad: u32,
}

impl SceneBuffers {
    /// Uploads `splats` and derives what culling reads for `constants`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer.
    pub fn upload(gpu: &Gpu, splats: &Splats, constants: &Constants, purpose: Purpose) -> Result<Self> {
        Self::upload_in_groups(gpu, splats, constants, group_limit(gpu, splats.sh_degree as usize, purpose))
    }

    /// As [`SceneBuffers::upload`] in groups of at most `limit` Gaussians, a multiple of 128.
    ///
    /// # Errors
    /// As [`SceneBuffers::upload`].
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
        let has_halves = constants.knobs.sh_bits == 16;
        let (groups, n_flat) = cut(&counts(splats), limit, |slot| {
            Group::new(gpu, slot, Planes::upload(gpu, splats, slot.start, slot.n, origin)?, has_halves)
        })?;
        let n_bad = gpu.upload("bad Gaussians", &[0u32])?;
        let mut scene = Self::from_groups(gpu, groups, n_flat, limit, degree, origin)?;
        let mut rec = Recording::new();
        scene.record_bounds(&mut rec, constants, &n_bad);
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
        let group_first: Vec<u32> = self.groups.iter().map(|group| group.first / CULL_BLOCK).collect();
        self.group_first = gpu.upload("group starts", &group_first)?;
        Ok(())
    }

    /// Groups with undefined contents for so many Gaussians of each bucket, for a scene like `other`.
    pub(super) fn reshaped(gpu: &Gpu, other: &SceneBuffers, counts: &[usize; BUCKETS]) -> Result<Self> {
        let has_halves = other.groups.iter().any(|group| !group.halves.is_empty());
        let (groups, n_flat) = cut(counts, other.group_limit, |slot| {
            let params = Planes::alloc(gpu, "parameters", slot.n, slot.degree, slot.dynamic, 1)?;
            Group::new(gpu, slot, params, has_halves)
        })?;
        Self::from_groups(gpu, groups, n_flat, other.group_limit, other.sh_degree, other.origin)
    }

    fn from_groups(
        gpu: &Gpu,
        groups: Vec<Group>,
        n_flat: u32,
        group_limit: usize,
        sh_degree: usize,
        origin: [f64; 3],
    ) -> Result<Self> {
        let group_first: Vec<u32> = groups.iter().map(|g| g.first / CULL_BLOCK).collect();
        let n = groups.iter().map(|g| g.n).sum();
        let group_first = gpu.upload("group starts", &group_first)?;
        Ok(SceneBuffers { groups, n_flat, n, group_first, group_limit, sh_degree, origin, n_bad: 0 })
    }

    /// Appends the derivation of what culling and projection read; due whenever the parameters have changed. `n_bad` grows by the
    /// number of Gaussians that can never be drawn.
    pub fn record_bounds(&self, rec: &mut Recording, constants: &Constants, n_bad: &Buf<u32>) {
        rec.stage("bound");
        for (index, group) in self.groups.iter().enumerate() {
            rec.group(Some(index));
            group.record_bound(rec, constants, n_bad);
        }
        rec.group(None);
        self.record_halves(rec);
    }

    /// Appends the rounding of what projection reads as halves; due whenever the coefficients have changed.
    pub fn record_halves(&self, rec: &mut Recording) {
        for group in &self.groups {
            for (band, halves) in group.params.bands.iter().zip(&group.halves) {
                let n = band.len() as u32;
                rec.pass(sh_half::Args { band, halves }, sh_half::Push { n }, Grid::Threads(n));
            }
        }
    }

    /// Reads numbers in the parameters' layout back into the scene's order; one [`Planes`] per group.
    pub fn download<'a>(&self, gpu: &Gpu, planes: impl Iterator<Item = &'a Planes>) -> Result<Splats> {
        let arrays = planes.map(|planes| Arrays::read(gpu, planes)).collect::<Result<Vec<_>>>()?;
        Ok(self.assemble(&arrays))
    }

    /// The numbers of all groups in the scene's order.
    pub(super) fn assemble(&self, arrays: &[Arrays]) -> Splats {
        let (n, k) = (self.n as usize, self.n_coefficients());
        let n_static = self.groups.iter().filter(|g| g.params.motion.is_none()).map(|g| g.n as usize).sum();
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

/// The most Gaussians of a degree whose longest binding the device can see: that of the widest set of planes, and of its
/// moments for [`Purpose::Training`]. A multiple of the workgroup of the cull.
pub fn group_limit(gpu: &Gpu, degree: usize, purpose: Purpose) -> usize {
    let widest = BAND_PLANES.iter().take(degree).copied().chain([3]).max().unwrap_or(3);
    let planes = if purpose == Purpose::Training { 2 * widest } else { widest };
    (gpu.caps().max_binding_bytes / (16 * planes as u64)) as usize / CULL_BLOCK as usize * CULL_BLOCK as usize
}

/// [`Planes`] on the host.
pub(super) struct Arrays {
    pub(super) geometry: Vec<[f32; 4]>,
    pub(super) sh0: Vec<[f32; 4]>,
    pub(super) bands: Vec<Vec<[f32; 4]>>,
    pub(super) motion: Option<Vec<[f32; 4]>>,
}

impl Planes {
    /// The values of Gaussians `start..start + n` of `splats`, positions relative to `origin`.
    pub fn upload(gpu: &Gpu, splats: &Splats, start: usize, n: usize, origin: [f64; 3]) -> Result<Self> {
        Arrays::of(splats, origin, start, n).upload(gpu, "parameters")
    }

    /// Buffers of the same shape with undefined contents.
    pub fn like(gpu: &Gpu, other: &Planes, name: &str) -> Result<Self> {
        let like = |buffer: &Buf<[f32; 4]>| gpu.alloc(name, buffer.len());
        Ok(Planes {
            geometry: like(&other.geometry)?,
            sh0: like(&other.sh0)?,
            bands: other.bands.iter().map(like).collect::<Result<_>>()?,
            motion: other.motion.as_ref().map(like).transpose()?,
        })
    }

    /// Undefined numbers for `n` Gaussians, with `times` the planes of the parameters.
    pub(super) fn alloc(gpu: &Gpu, name: &str, n: usize, degree: usize, dynamic: bool, times: usize) -> Result<Self> {
        // A single plane is flat; its last block is as long as there are items.
        let buffer = |planes: usize| match planes * times {
            1 => gpu.alloc(name, n),
            planes => gpu.alloc(name, n.next_multiple_of(PLANE_BLOCK) * planes),
        };
        Ok(Planes {
            geometry: buffer(3)?,
            sh0: buffer(1)?,
            bands: BAND_PLANES.iter().take(degree).map(|planes| buffer(*planes)).collect::<Result<_>>()?,
            motion: if dynamic { Some(buffer(1)?) } else { None },
        })
    }

    /// vec4 planes of each of [`Planes::buffers`] of parameters.
    pub(super) fn plane_counts(&self) -> impl Iterator<Item = usize> {
        [3, 1].into_iter().chain(BAND_PLANES.into_iter().take(self.bands.len())).chain(self.motion.as_ref().map(|_| 1))
    }

    /// All buffers, in the same order for planes of one shape.
    pub fn buffers(&self) -> impl Iterator<Item = &Buf<[f32; 4]>> {
        [&self.geometry, &self.sh0].into_iter().chain(&self.bands).chain(&self.motion)
    }
}

impl Arrays {
    pub(super) fn read(gpu: &Gpu, planes: &Planes) -> Result<Self> {
        Ok(Arrays {
            geometry: gpu.read(&planes.geometry)?,
            sh0: gpu.read(&planes.sh0)?,
            bands: planes.bands.iter().map(|band| gpu.read(band)).collect::<Result<_>>()?,
            motion: planes.motion.as_ref().map(|motion| gpu.read(motion)).transpose()?,
        })
    }

    pub(super) fn upload(&self, gpu: &Gpu, name: &str) -> Result<Planes> {
        Ok(Planes {
            geometry: gpu.upload(name, &self.geometry)?,
            sh0: gpu.upload(name, &self.sh0)?,
            bands: self.bands.iter().map(|band| gpu.upload(name, band)).collect::<Result<_>>()?,
            motion: self.motion.as_ref().map(|motion| gpu.upload(name, motion)).transpose()?,
        })
    }

    /// Each array through `f`, which is told its planes in the layout of the parameters.
    pub(super) fn map(&self, f: impl Fn(usize, &[[f32; 4]]) -> Vec<[f32; 4]>) -> Arrays {
        Arrays {
            geometry: f(3, &self.geometry),
            sh0: f(1, &self.sh0),
            bands: self.bands.iter().enumerate().map(|(b, data)| f(BAND_PLANES[b], data)).collect(),
            motion: self.motion.as_ref().map(|data| f(1, data)),
        }
    }

    fn write_into(&self, out: &mut Splats, start: usize, n: usize) {
        let k = out.n_coefficients();
        for i in 0..n {
            let at = start + i;
            let [a, q, s] = [0, 1, 2].map(|plane| self.geometry[plane_of(i, 3, plane)]);
            out.position[at] = [a[0], a[1], a[2]];
            out.opacity[at] = a[3];
            out.rotation[at] = q;
            out.scale[at] = [s[0], s[1], s[2]];
            out.sh[at * k] = [self.sh0[i][0], self.sh0[i][1], self.sh0[i][2]];
            for (band, data) in self.bands.iter().enumerate().map(|(b, data)| (b + 1, data)) {
                let float = |f: usize| data[plane_of(i, BAND_PLANES[band - 1], f / 4)][f % 4];
                for c in 0..2 * band + 1 {
                    out.sh[at * k + band * band + c] = [float(3 * c), float(3 * c + 1), float(3 * c + 2)];
                }
            }
            if let Some(motion) = &self.motion {
                let m = motion[i];
                out.motion[at - out.n_static] = Motion { velocity: [m[0], m[1], m[2]], t_center: m[3], t_scale: s[3] };
            }
        }
    }
}

impl SceneBuffers {
    /// SH coefficients per Gaussian.
    pub fn n_coefficients(&self) -> usize {
        let side = self.sh_degree + 1;
        side * side
    }
}

impl Group {
    fn new(gpu: &Gpu, slot: &Slot, params: Planes, has_halves: bool) -> Result<Self> {
        let halves = params.bands.iter().filter(|_| has_halves).map(|band| gpu.alloc("sh halves", band.len()));
        Ok(Group {
            halves: halves.collect::<Result<_>>()?,
            first: slot.first,
            n: slot.n as u32,
            start: slot.start,
            params,
            bound: gpu.alloc("bound", slot.n)?,
            window: if slot.dynamic { Some(gpu.alloc("window", slot.n)?) } else { None },
        })
    }

    /// SH degree.
    pub fn degree(&self) -> usize {
        self.params.bands.len()
    }

    /// Its bucket.
    pub(super) fn bucket(&self) -> usize {
        bucket(self.params.motion.is_some(), self.degree())
    }

    fn record_bound(&self, rec: &mut Recording, constants: &Constants, n_bad: &Buf<u32>) {
        let (geometry, bound, n) = (&self.params.geometry, &self.bound, self.n);
        let grid = Grid::Threads(n);
        let Constants { alpha_min, knobs: Knobs { time_cull, temporal_cut, .. }, .. } = *constants;
        let temporal_cut = if time_cull { temporal_cut } else { -1.0 };
        if let (Some(motion), Some(window)) = (&self.params.motion, &self.window) {
            rec.pass(
                bound_dynamic::Args { geometry, bound, n_bad, motion, window },
                bound_dynamic::Push { n, alpha_min, temporal_cut },
                grid,
            );
        } else {
            let push = bound_static::Push { n, alpha_min, temporal_cut };
            rec.pass(bound_static::Args { geometry, bound, n_bad }, push, grid);
        }
    }
}

/// Place of plane `p` of item `i` among `planes` planes; as `plane_index` of include/grid.glsl has it.
pub(super) fn plane_of(i: usize, planes: usize, p: usize) -> usize {
    (i / PLANE_BLOCK * planes + p) * PLANE_BLOCK + i % PLANE_BLOCK
}

/// `n` items of `planes` vec4 each, from `value(item)[plane]`, in blocks of [`PLANE_BLOCK`].
fn planes<const P: usize>(n: usize, value: impl Fn(usize) -> [[f32; 4]; P]) -> Vec<[f32; 4]> {
    let mut out = vec![[0.0; 4]; n.next_multiple_of(PLANE_BLOCK) * P];
    for i in 0..n {
        for (p, v) in value(i).into_iter().enumerate() {
            out[plane_of(i, P, p)] = v;
        }
    }
    out
}

/// Kinds of Gaussians that are stored apart: static ones of degree 3 to 0, then dynamic ones.
pub(super) const BUCKETS: usize = 8;

/// The bucket of a population and a degree, `bucket` of `include/density.glsl`.
pub(super) fn bucket(dynamic: bool, degree: usize) -> usize {
    usize::from(dynamic) * 4 + 3 - degree
}

/// Gaussians of each bucket.
fn counts(splats: &Splats) -> [usize; BUCKETS] {
    let mut counts = [0; BUCKETS];
    (0..splats.len()).for_each(|i| counts[bucket(i >= splats.n_static, splats.degree_of(i))] += 1);
    counts
}

/// Where a group lies.
struct Slot {
    /// Index of its first Gaussian in the scene's order.
    start: usize,
    n: usize,
    /// Flat index of the first.
    first: u32,
    dynamic: bool,
    degree: usize,
}

/// Cuts so many Gaussians of each bucket into groups of at most `limit`. Returns what `group` makes of each, and the length
/// of the flat index.
fn cut(counts: &[usize; BUCKETS], limit: usize, group: impl Fn(&Slot) -> Result<Group>) -> Result<(Vec<Group>, u32)> {
    let (mut groups, mut first, mut begin) = (Vec::new(), 0u32, 0);
    for (bucket, count) in counts.iter().enumerate() {
        let end = begin + count;
        for start in (begin..end).step_by(limit) {
            let slot = Slot { start, n: limit.min(end - start), first, dynamic: bucket >= 4, degree: 3 - bucket % 4 };
            let flat = (slot.n as u64).next_multiple_of(u64::from(CULL_BLOCK));
            groups.push(group(&slot)?);
            first = u32::try_from(u64::from(first) + flat).map_err(|_| Error::OutOfMemory {
                what: "the scene (Gaussians)".to_owned(),
                needed: counts.iter().sum::<usize>() as u64,
                limit: u64::from(u32::MAX),
                remedy: "split the scene".to_owned(),
            })?;
        }
        begin = end;
    }
    Ok((groups, first))
}

impl Arrays {
    /// The values of Gaussians `start..start + n` of `splats`, all of one bucket, positions relative to `origin`.
    pub(super) fn of(splats: &Splats, origin: [f64; 3], start: usize, n: usize) -> Self {
        let dynamic = start >= splats.n_static;
        let motion_of = |i: usize| splats.motion[start + i - splats.n_static];
        let geometry = planes(n, |i| {
            let g = start + i;
            let p: [f32; 3] = std::array::from_fn(|k| (f64::from(splats.position[g][k]) - origin[k]) as f32);
            let s = splats.scale[g];
            let t_scale = if dynamic { motion_of(i).t_scale } else { 0.0 };
            [[p[0], p[1], p[2], splats.opacity[g]], splats.rotation[g], [s[0], s[1], s[2], t_scale]]
        });
        let k = splats.n_coefficients();
        let coefficient = |i: usize, c: usize| splats.sh[(start + i) * k + c];
        let sh0: Vec<[f32; 4]> = (0..n).map(|i| coefficient(i, 0)).map(|[r, g, b]| [r, g, b, 0.0]).collect();
        // Band l holds coefficients l^2 .. (l+1)^2, their colours one after the other.
        let float = |i: usize, band: usize, f: usize| {
            let c = f / 3;
            if c < 2 * band + 1 { coefficient(i, band * band + c)[f % 3] } else { 0.0 }
        };
        let vec4 = |i: usize, band: usize, p: usize| std::array::from_fn(|j| float(i, band, 4 * p + j));
        let mut bands = Vec::new();
        for band in 1..=splats.degree_of(start) {
            let data = match band {
                1 => planes::<3>(n, |i| std::array::from_fn(|p| vec4(i, 1, p))),
                2 => planes::<4>(n, |i| std::array::from_fn(|p| vec4(i, 2, p))),
                _ => planes::<6>(n, |i| std::array::from_fn(|p| vec4(i, 3, p))),
            };
            bands.push(data);
        }
        let motion: Option<Vec<[f32; 4]>> = dynamic.then(|| {
            (0..n)
                .map(|i| {
                    let m = motion_of(i);
                    [m.velocity[0], m.velocity[1], m.velocity[2], m.t_center]
                })
                .collect()
        });
        Arrays { geometry, sh0, bands, motion }
    }
}

/// Where to put the origin: zero, unless the scene lies so far away that f32 would lose its detail there.
///
/// The median and the quartiles of the finite positions decide, so that a few wild Gaussians move nothing; the result
/// is a multiple of a power of two above the scene's size, so that a few more or less do not either.
pub(super) fn far_origin(splats: &Splats) -> [f64; 3] {
    let mut axes: [Vec<f32>; 3] = Default::default();
    for p in splats.position.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
        for (axis, x) in axes.iter_mut().zip(p) {
            axis.push(*x);
        }
    }
    if axes[0].is_empty() {
        return [0.0; 3];
    }
    let mut medians = [0.0; 3];
    let mut spread = 0.0f64;
    for (axis, median) in axes.iter_mut().zip(&mut medians) {
        axis.sort_unstable_by(f32::total_cmp);
        let quantile = |q: usize| f64::from(axis[(axis.len() - 1) * q / 4]);
        *median = quantile(2);
        spread = spread.max(quantile(3) - quantile(1));
    }
    let distance = medians.iter().map(|m| m * m).sum::<f64>().sqrt();
    if distance < 64.0 * spread || distance < 64.0 {
        return [0.0; 3];
    }
    let step = (4.0 * spread.max(distance * 1e-6)).log2().ceil().exp2();
    medians.map(|m| (m / step).round() * step)
}
