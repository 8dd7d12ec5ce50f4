//! Steps on several images: their gradients are added up in fixed point, so that the sum has the same bits in whatever order, and on
//! however many machines, they are added.

use super::cull::{ARGS_FIRST_GROUP, indirect};
use super::workspace::APART;
use super::{Cull, Group, Optimiser, Planes, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::{self, Status, batch_add, batch_pack, batch_step, batch_unpack};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use std::ops::Range;

/// Most images of a step: so many gradients fit their sum.
pub const MOST_IMAGES: u64 = 64;

/// Sums of gradients of a scene's Gaussians, zero between steps.
pub struct Batch {
    /// By group that is trained, in twice the planes of the parameters: 2p the low, 2p + 1 the high words of plane p.
    sums: Vec<(usize, Planes)>,
    /// A bit for each Gaussian that an image of the step had in view, by group that is trained: each part begins where a binding can.
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
    pub fn new(gpu: &Gpu, scene: &SceneBuffers) -> Result<Self> {
        let planes = |(index, group): (usize, &Group)| {
            let n = group.n as usize;
            Ok((index, Planes::alloc(gpu, "gradient sums", n, group.degree(), group.is_dynamic(), 2)?))
        };
        let sums = scene.trained().map(planes).collect::<Result<Vec<_>>>()?;
        let words = scene.trained().map(|(_, group)| words_of(group.n)).sum::<usize>();
        let batch = Batch { sums, touched: gpu.alloc("touched", words.max(1))? };
        batch.clear(gpu)?;
        Ok(batch)
    }

    pub fn clear(&self, gpu: &Gpu) -> Result<()> {
        let mut rec = Recording::new();
        rec.section("batch");
        let buffers = self.sums.iter().flat_map(|(_, planes)| planes.buffers());
        buffers.for_each(|buffer| rec.fill(buffer.slice(), 0));
        rec.fill(self.touched.slice(), 0);
        gpu.run(&rec)
    }

    /// By group that is trained: its index, its sums, and its words of [`Batch::touched`].
    fn parts<'a>(&'a self, scene: &'a SceneBuffers) -> impl Iterator<Item = (usize, &'a Planes, Range<usize>)> {
        let mut first = 0;
        self.sums.iter().map(move |(index, sums)| {
            let words = first..first + words_of(scene.groups[*index].n);
            first = words.end;
            (*index, sums, words)
        })
    }

    /// Appends the addition of `gradients`, by group, of the image that was culled by `cull`; of none where the frame failed.
    pub fn record_add(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: &Cull,
        frame_status: &Buf<Status>,
        gradients: &[Planes],
    ) {
        rec.section("batch");
        for (index, sums, words) in self.parts(scene) {
            rec.group(Some(index));
            let (group, Cull { ranges, active_id, .. }) = (&scene.groups[index], cull);
            let (d, sums) = (gradients[index].slices(), sums.slices());
            let touched = &self.touched.range(words.start, words.len());
            let args = batch_add::Args { frame_status, ranges, active_id, d, sums, touched };
            let (is_dynamic, degree) = group.kind();
            let push = batch_add::Push { group: index as u32, first: group.first, is_dynamic, degree };
            rec.pass(args, push, indirect(&cull.args, ARGS_FIRST_GROUP + index));
            rec.scale(group.n_planes());
        }
        rec.group(None);
    }

    /// Appends the step of `optimiser` along the sums, of all Gaussians; no step where a frame failed. The sums are zero afterwards.
    pub fn record_step(&self, rec: &mut Recording, scene: &SceneBuffers, optimiser: &Optimiser, status: &Buf<Status>) {
        rec.section("batch");
        let kernel = generated::batch_step(optimiser.moments.bits == 16);
        for (index, sums, words) in self.parts(scene) {
            rec.group(Some(index));
            let group = &scene.groups[index];
            let (moments, state) = optimiser.of_group(index);
            let args = batch_step::Args {
                frame_status: status,
                adam: &optimiser.params,
                touched: &self.touched.range(words.start, words.len()),
                params: group.params.slices(),
                moments,
                state,
                sums: sums.slices(),
            };
            let (is_dynamic, degree) = group.kind();
            let push = batch_step::Push { n: group.n, first: group.first, is_dynamic, degree };
            rec.pass_variant(kernel, args, push, Grid::Threads(group.n));
            rec.scale(group.n_planes());
        }
        rec.group(None);
        rec.fill(self.touched.slice(), 0);
    }

    /// Which Gaussians the images so far had in view, a bit each. Waits for the device.
    pub fn touched(&self, gpu: &Gpu) -> Result<Vec<u32>> {
        gpu.read(&self.touched)
    }

    /// The sums of the Gaussians whose bit in `touched` is set. Waits for the device.
    pub fn rows(&self, gpu: &Gpu, scene: &SceneBuffers, touched: &[u32]) -> Result<Rows> {
        let ids: Vec<Vec<u32>> = self.parts(scene).map(|(_, _, words)| bits(&touched[words])).collect();
        let mut rec = Recording::new();
        rec.section("exchange");
        let mut rows = Vec::new();
        for ((index, planes, _), ids) in self.parts(scene).zip(&ids) {
            rec.group(Some(index));
            for ids in ids.chunks(rows_of_part(planes)) {
                let part = gpu.alloc::<i64>("rows of sums", ids.len() * elements(planes))?;
                record_rows(gpu, &mut rec, &scene.groups[index], planes, ids, &part, true)?;
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
                record_rows(gpu, &mut rec, &scene.groups[index], planes, ids, &part, false)?;
            }
        }
        gpu.run(&rec)
    }
}

/// Appends the copy of the `sums` of Gaussians `ids` of `group` to `rows`, or back.
fn record_rows(
    gpu: &Gpu,
    rec: &mut Recording,
    group: &Group,
    sums: &Planes,
    ids: &[u32],
    rows: &Buf<i64>,
    to_rows: bool,
) -> Result<()> {
    let (n, (is_dynamic, degree)) = (ids.len() as u32, group.kind());
    let (ids, rows, planes) = (&gpu.upload("rows", ids)?, &rows.cast(), sums.slices());
    if to_rows {
        let push = batch_pack::Push { n, is_dynamic, degree };
        rec.pass(batch_pack::Args { ids, rows, sums: planes }, push, Grid::Threads(n));
    } else {
        let push = batch_unpack::Push { n, is_dynamic, degree };
        rec.pass(batch_unpack::Args { ids, rows, sums: planes }, push, Grid::Threads(n));
    }
    rec.scale(f64::from(n) * (elements(sums) / 4) as f64);
    Ok(())
}

/// Words of a bit for each of `n` Gaussians, so many that the next group's are bound where a binding can begin.
fn words_of(n: u32) -> usize {
    n.div_ceil(32).max(1).next_multiple_of(APART as u32) as usize
}

fn elements(sums: &Planes) -> usize {
    4 * sums.plane_counts().sum::<usize>()
}

fn rows_of_part(sums: &Planes) -> usize {
    PART_BYTES / (size_of::<i64>() * elements(sums))
}

fn bits(words: &[u32]) -> Vec<u32> {
    let of_word = |(at, word): (usize, &u32)| {
        let (at, word) = (32 * at as u32, *word);
        (0..32).filter(move |bit| word >> bit & 1 == 1).map(move |bit| at + bit)
    };
    words.iter().enumerate().flat_map(of_word).collect()
}
