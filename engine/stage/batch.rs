//! Steps on several images: gradients of each image are added up in fixed point, so that their sum has the same bits in
//! whatever order, and on however many machines, they are added.

use super::adam::Optimiser;
use super::cull::{ARGS_FIRST_GROUP, Cull, indirect};
use super::planes::Planes;
use super::scene::{Group, SceneBuffers};
use super::zeros::APART;
use crate::error::Result;
use crate::gpu::generated::{self, Status, batch_add, batch_pack, batch_step, batch_unpack};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Most images of a step: so many gradients fit their sum.
pub const MOST_IMAGES: u64 = 64;

/// Sums of gradients of a scene's Gaussians, zero between steps.
pub struct Batch {
    /// By group that is trained, in twice the planes of the parameters: 2p the low, 2p + 1 the high words of plane p.
    sums: Vec<(usize, Planes)>,
    /// Which Gaussians an image of the step had in view, a bit each, by group that is trained: each part begins where a binding can.
    touched: Buf<u32>,
}

/// Most bytes of a part of rows: what every device can bind. The same on all machines, since rows lie by part.
const PART_BYTES: usize = 1 << 27;

/// Sums of chosen Gaussians, as machines exchange them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// By group that is trained, the chosen Gaussians, counted from the group's first, ascending.
    pub ids: Vec<Vec<u32>>,
    /// One group after the other, each in parts of as many rows as fit 128 MiB: element e of row r of a part of n at e * n + r.
    pub sums: Vec<i64>,
}

impl Batch {
    /// Sums of nothing.
    ///
    /// # Errors
    /// `OutOfMemory` naming the buffer that does not fit.
    pub fn new(gpu: &Gpu, scene: &SceneBuffers) -> Result<Self> {
        let planes = |(index, group): (usize, &Group)| {
            let dynamic = group.params.motion.is_some();
            let planes = Planes::alloc(gpu, "gradient sums", group.n as usize, group.degree(), dynamic, 2)?;
            Ok((index, planes))
        };
        let sums = scene.trained().map(planes).collect::<Result<Vec<_>>>()?;
        let words = scene.trained().map(|(_, group)| words_of(group.n)).sum::<usize>();
        let batch = Batch { sums, touched: gpu.alloc("touched", words.max(1))? };
        batch.clear(gpu)?;
        Ok(batch)
    }

    /// Forgets what has been added, after a frame that failed.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn clear(&self, gpu: &Gpu) -> Result<()> {
        let mut rec = Recording::new();
        rec.section("batch");
        let buffers = self.sums.iter().flat_map(|(_, planes)| planes.buffers());
        buffers.for_each(|buffer| rec.fill(buffer.slice(), 0));
        rec.fill(self.touched.slice(), 0);
        gpu.run(&rec)
    }

    /// By group that is trained: its index, its sums, and its part of [`Batch::touched`].
    fn parts<'a>(&'a self, scene: &'a SceneBuffers) -> impl Iterator<Item = (usize, &'a Planes, Buf<u32>)> {
        let mut first = 0;
        self.sums.iter().map(move |(index, sums)| {
            let n = words_of(scene.groups[*index].n);
            first += n;
            (*index, sums, self.touched.range(first - n, n))
        })
    }

    /// Appends the addition of `gradients`, by group, of the image that was culled by `cull`; of none where the frame failed.
    pub fn record_add(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: &Cull,
        status: &Buf<Status>,
        gradients: &[Planes],
    ) {
        rec.section("batch");
        for (index, sums, touched) in self.parts(scene) {
            rec.group(Some(index));
            let group = &scene.groups[index];
            let args = batch_add::Args {
                frame_status: status,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                d: gradients[index].slices(),
                sums: sums.slices(),
                touched: &touched,
            };
            let push = batch_add::Push {
                group: index as u32,
                first: group.first,
                is_dynamic: u32::from(group.params.motion.is_some()),
                degree: group.degree() as u32,
            };
            rec.pass(args, push, indirect(&cull.args, ARGS_FIRST_GROUP + index));
            rec.scale(group.params.plane_counts().sum::<usize>() as f64);
        }
        rec.group(None);
    }

    /// Appends the step of `optimiser` along the sums, of all Gaussians. The sums are zero afterwards. Nothing moves where a frame
    /// failed.
    pub fn record_step(&self, rec: &mut Recording, scene: &SceneBuffers, optimiser: &Optimiser, status: &Buf<Status>) {
        rec.section("batch");
        let kernel = generated::batch_step(optimiser.moments.bits == 16);
        for (index, sums, touched) in self.parts(scene) {
            rec.group(Some(index));
            let group = &scene.groups[index];
            let params = &group.params;
            let args = batch_step::Args {
                frame_status: status,
                adam: &optimiser.params,
                touched: &touched,
                params: params.slices(),
                moments: optimiser.moments.groups[index].slices(),
                state: &optimiser.state[index],
                sums: sums.slices(),
            };
            let push = batch_step::Push {
                n: group.n,
                first: group.first,
                is_dynamic: u32::from(params.motion.is_some()),
                degree: group.degree() as u32,
            };
            rec.pass_variant(kernel, args, push, Grid::Threads(group.n));
            rec.scale(params.plane_counts().sum::<usize>() as f64);
        }
        rec.group(None);
        rec.fill(self.touched.slice(), 0);
    }

    /// Which Gaussians the images so far had in view, a bit each, as [`Batch::rows`] takes it. Waits for the device.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn touched(&self, gpu: &Gpu) -> Result<Vec<u32>> {
        gpu.read(&self.touched)
    }

    /// The sums of the Gaussians whose bit in `touched` is set. Waits for the device.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`], [`crate::Error::DeviceLost`].
    pub fn rows(&self, gpu: &Gpu, scene: &SceneBuffers, touched: &[u32]) -> Result<Rows> {
        let ids = self.ids(scene, touched);
        let mut rec = Recording::new();
        rec.section("exchange");
        let mut rows = Vec::new();
        for ((index, planes, _), ids) in self.parts(scene).zip(&ids) {
            rec.group(Some(index));
            for ids in ids.chunks(rows_of_part(planes)) {
                let part = gpu.alloc::<i64>("rows of sums", ids.len() * elements(planes))?;
                record_rows(gpu, &mut rec, &scene.groups[index], planes, ids, &part, Direction::Out)?;
                rows.push(part);
            }
        }
        gpu.run(&rec)?;
        let mut sums = Vec::new();
        for part in rows {
            sums.extend(gpu.read(&part)?);
        }
        Ok(Rows { ids, sums })
    }

    /// Puts back `rows`, the sums of those Gaussians over all machines, which all have been in view somewhere.
    ///
    /// # Errors
    /// As [`Batch::rows`].
    pub fn put(&self, gpu: &Gpu, scene: &SceneBuffers, rows: &Rows, touched: &[u32]) -> Result<()> {
        gpu.write(&self.touched, touched)?;
        let mut rec = Recording::new();
        rec.section("exchange");
        let mut from = 0;
        for ((index, planes, _), ids) in self.parts(scene).zip(&rows.ids) {
            rec.group(Some(index));
            for ids in ids.chunks(rows_of_part(planes)) {
                let n = ids.len() * elements(planes);
                let part = gpu.upload("rows of sums", &rows.sums[from..from + n])?;
                from += n;
                record_rows(gpu, &mut rec, &scene.groups[index], planes, ids, &part, Direction::Back)?;
            }
        }
        gpu.run(&rec)
    }

    /// By group that is trained, whose bits are set.
    fn ids(&self, scene: &SceneBuffers, touched: &[u32]) -> Vec<Vec<u32>> {
        let mut first = 0;
        let of_group = |(index, _): &(usize, Planes)| {
            let n = words_of(scene.groups[*index].n);
            first += n;
            bits(&touched[first - n..first])
        };
        self.sums.iter().map(of_group).collect()
    }
}

/// Which way sums are copied.
#[derive(Clone, Copy)]
enum Direction {
    /// To rows.
    Out,
    /// From rows.
    Back,
}

/// Appends the copy of the `sums` of Gaussians `ids` of `group` to `rows`, or back.
fn record_rows(
    gpu: &Gpu,
    rec: &mut Recording,
    group: &Group,
    sums: &Planes,
    ids: &[u32],
    rows: &Buf<i64>,
    direction: Direction,
) -> Result<()> {
    let (n, is_dynamic) = (ids.len() as u32, u32::from(group.params.motion.is_some()));
    let degree = group.degree() as u32;
    let (ids, rows, planes) = (&gpu.upload("rows", ids)?, &rows.cast(), sums.slices());
    match direction {
        Direction::Out => {
            let args = batch_pack::Args { ids, rows, sums: planes };
            rec.pass(args, batch_pack::Push { n, is_dynamic, degree }, Grid::Threads(n));
        }
        Direction::Back => {
            let args = batch_unpack::Args { ids, rows, sums: planes };
            rec.pass(args, batch_unpack::Push { n, is_dynamic, degree }, Grid::Threads(n));
        }
    }
    rec.scale(f64::from(n) * (elements(sums) / 4) as f64);
    Ok(())
}

/// Words of a bit for each of `n` Gaussians, so many that the next group's are bound where a binding can begin.
fn words_of(n: u32) -> usize {
    n.div_ceil(32).max(1).next_multiple_of(APART as u32) as usize
}

/// Numbers of a row: four for each plane of the parameters.
fn elements(sums: &Planes) -> usize {
    4 * sums.plane_counts().sum::<usize>()
}

/// Most rows of a part.
fn rows_of_part(sums: &Planes) -> usize {
    PART_BYTES / (size_of::<i64>() * elements(sums))
}

/// The places of the bits that are set.
fn bits(words: &[u32]) -> Vec<u32> {
    let of_word = |(at, word): (usize, &u32)| {
        let (at, word) = (32 * at as u32, *word);
        (0..32).filter(move |bit| word >> bit & 1 == 1).map(move |bit| at + bit)
    };
    words.iter().enumerate().flat_map(of_word).collect()
}
