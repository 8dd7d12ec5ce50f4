//! From cotangents of a picture to gradients of the parameters or to a step: the blend's adjoint, then the projection's.

use super::accumulation::SLOT_PAIRS;
use super::blend::{SEGMENT, coprime_stride};
use super::chunks::Chunks;
use super::cull::{ARGS_FIRST_GROUP, indirect};
use super::{
    Batch, Blend, Capacity, Cull, Group, Lists, Optimiser, Outputs, Planes, Projected, Purpose, SceneBuffers, Size,
    Sums, Tiles, ViewBuffers, Zeros,
};
use crate::error::Result;
use crate::gpu::generated::constants::types::{CAMERA_ALONE, CAMERA_WITH_NEXT};
use crate::gpu::generated::{
    self, background_sum, blend_bwd_p4, blend_bwd_p8, camera_sum, camera_total, constants, fixed_sums,
    project_bwd_adam_static_sh0, project_bwd_static_sh0,
};
use crate::gpu::{Buf, Gpu, Grid, Recording};

const FIXED_WORDS: usize = constants::fixed::FIXED_WORDS as usize;
const CAMERA_GROUPS: u32 = 64;

pub struct Backward {
    /// Cotangents of colour and alpha, per pixel.
    pub d_image0: Buf<[f32; 4]>,
    /// Cotangents of depth, inverse depth and flow; absent for [`Outputs::Color`].
    pub d_image1: Option<Buf<[f32; 4]>>,
    /// Gradients, by group; for [`Purpose::Gradient`], and where a step sees several images.
    pub gradients: Vec<Planes>,
    /// Gaussians whose gradient was not finite; of a step the optimiser counts them.
    pub n_bad: Buf<u32>,
    /// Gradient of the camera, three vec4: rotation about its own axes, time; translation along them; background. See
    /// [`super::Gradients`] for the units.
    pub d_camera: Buf<[f32; 4]>,
    carry: Buf<[f32; 2]>,
    // Slots, or one slot per active Gaussian; words of fixed point beside them.
    d_slots: Buf<[f32; 2]>,
    words: Option<Buf<u32>>,
    d_camera_each: Buf<[f32; 4]>,
    camera_partials: Buf<[f32; 4]>,
    sums: Sums,
    wants_camera: bool,
    // See `Backward::scale`.
    is_of_a_loss: bool,
    outputs: Outputs,
}

#[derive(Clone, Copy)]
pub struct Drawn<'a> {
    pub cull: &'a Cull,
    pub eye: ViewBuffers<'a>,
    pub tiles: &'a Tiles,
    pub lists: &'a Lists,
    pub blend: &'a Blend,
    /// Numbers of each pixel that the blend kept.
    pub tail: &'a Buf<[u32; 2]>,
    pub size: Size,
}

pub enum Target<'a> {
    /// Gradients of the parameters and the camera, in the backward pass's own buffers.
    Gradients,
    Step(&'a Optimiser),
    /// Sums over several pictures, along which the optimiser takes a step later. It counts gradients that are not finite.
    Sums(&'a Batch, &'a Optimiser),
}

impl Backward {
    /// Words of slots, and of fixed point: of either, those that are summed up are zero before each picture.
    fn words(capacity: &Capacity) -> [usize; 2] {
        let n_slots = if capacity.sums.is_fixed() { capacity.active } else { capacity.intersections };
        let n_fixed = if capacity.sums.is_fixed() { FIXED_WORDS * capacity.active.max(1) as usize } else { 0 };
        [2 * SLOT_PAIRS * n_slots.max(1) as usize, n_fixed]
    }

    pub fn n_zeros(capacity: &Capacity) -> usize {
        let [slots, fixed] = Self::words(capacity);
        if capacity.sums.is_fixed() { fixed } else { slots }
    }

    /// Buffers for pictures within `capacity`, blended as `blend` does. Each needs its part of `zeros` to be zero.
    pub fn new(gpu: &Gpu, scene: &SceneBuffers, blend: &Blend, capacity: &Capacity, zeros: &mut Zeros) -> Result<Self> {
        let Capacity { active, pixels, outputs, purpose, sums, camera, is_batched, .. } = *capacity;
        let wants_camera = camera || purpose == Purpose::Gradient;
        let [n_slots, n_fixed] = Self::words(capacity);
        let groups = if purpose == Purpose::Gradient || is_batched { &scene.groups[..] } else { &[] };
        let gradients = groups.iter().map(|group| Planes::like(gpu, &group.params, "gradients"));
        let n_camera = if wants_camera { 2 * active as usize } else { 1 };
        let has_image1 = outputs == Outputs::All;
        Ok(Backward {
            d_image0: gpu.alloc("d image color", pixels)?,
            d_image1: has_image1.then(|| gpu.alloc("d image depth flow", pixels)).transpose()?,
            gradients: gradients.collect::<Result<_>>()?,
            n_bad: gpu.alloc("bad gradients", 1)?,
            d_camera: gpu.alloc("d camera", 3)?,
            carry: gpu.alloc("blend carry", if blend.chunks.is_some() { 1 } else { pixels })?,
            d_slots: if sums.is_fixed() { gpu.alloc("d slots", n_slots / 2)? } else { zeros.take(n_slots).cast() },
            words: sums.is_fixed().then(|| zeros.take(n_fixed)),
            d_camera_each: gpu.alloc("d camera of each", n_camera)?,
            camera_partials: gpu.alloc("d camera partials", 3 * CAMERA_GROUPS as usize)?,
            sums,
            wants_camera,
            is_of_a_loss: purpose == Purpose::Training,
            outputs,
        })
    }

    /// The gradients of the camera that are wanted: where poses are learnt, a correction moves the camera of the next frame too.
    fn camera(&self) -> u32 {
        match (self.wants_camera, self.is_of_a_loss) {
            (false, _) => 0,
            (true, false) => CAMERA_ALONE,
            (true, true) => CAMERA_WITH_NEXT,
        }
    }

    /// The scale of the fixed point, a power of two. Terms stay below 2^62, and the sizes of a Gaussian's large ones below 3/4 of 2^63 in
    /// all: 2^30 and 3/4 of 2^31 in units of a cotangent. Those of a loss are of a mean over three channels of the picture at hand:
    /// the sums have the same bits whichever other pictures there has been room for.
    fn scale(&self, size: Size) -> f32 {
        let n = if self.is_of_a_loss { 3.0 * f64::from(size.n_pixels.max(1)) } else { 1.0 };
        (32.0 + n.log2().floor()).exp2() as f32
    }

    /// Appends the backward pass of `drawn`, a strip of `scene` whose forward pass was recorded for one.
    pub fn record(&self, rec: &mut Recording, scene: &SceneBuffers, drawn: Drawn, target: &Target) {
        self.record_blend(rec, drawn);
        rec.section(if matches!(target, Target::Step(_)) { "project bwd adam" } else { "project bwd" });
        if matches!(target, Target::Gradients) {
            rec.fill(self.n_bad.slice(), 0);
        }
        if self.wants_camera && scene.groups.iter().any(|group| scene.holds(group)) {
            // Held Gaussians have no gradient of the camera.
            rec.fill(self.d_camera_each.slice(), 0);
        }
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            if matches!(target, Target::Gradients) {
                self.gradients[index].buffers().for_each(|buffer| rec.fill(buffer.slice(), 0));
            } else if scene.holds(group) {
                continue;
            }
            self.record_project(rec, index, group, drawn, target);
        }
        rec.group(None);
        if let Target::Sums(batch, _) = target {
            batch.record_add(rec, scene, drawn.cull, drawn.eye.status, &self.gradients);
        }
        if self.wants_camera {
            self.record_camera(rec, scene.n_flat, drawn, target);
        }
    }

    /// The projection's adjoint for one group, which writes gradients or moves the parameters at once.
    fn record_project(&self, rec: &mut Recording, index: usize, group: &Group, drawn: Drawn, target: &Target) {
        let Drawn { cull, eye: ViewBuffers { view, status, projected }, tiles, .. } = drawn;
        let (Cull { ranges, active_id, .. }, Projected { splats, tile_counts, .. }) = (cull, projected);
        let (slot_first, d_slots, d_camera) = (&tiles.slot_first, &self.d_slots, &self.d_camera_each);
        let is_summed = u32::from(self.sums.is_fixed());
        let (first, wants_camera) = (group.first, self.camera());
        let grid = indirect(&cull.args, ARGS_FIRST_GROUP + index);
        let kernel = |steps: bool, is_16_bits: bool| {
            generated::project_bwd(steps, group.is_dynamic(), group.degree(), is_16_bits)
        };
        let n_bad = match target {
            Target::Gradients => &self.n_bad,
            Target::Step(optimiser) | Target::Sums(_, optimiser) => &optimiser.n_bad,
        };
        if let Target::Step(optimiser) = target {
            let (moments, state) = optimiser.of_group(index);
            let args = project_bwd_adam_static_sh0::Args {
                view,
                ranges,
                active_id,
                params: group.params.slices(),
                splats,
                tile_counts,
                slot_first,
                d_slots,
                n_bad,
                frame_status: status,
                d_camera,
                moments,
                state,
                adam: &optimiser.params,
            };
            let push = project_bwd_adam_static_sh0::Push { group: index as u32, first, is_summed, wants_camera };
            rec.pass_variant(kernel(true, optimiser.moments.bits == 16), args, push, grid);
        } else {
            let args = project_bwd_static_sh0::Args {
                view,
                ranges,
                active_id,
                params: group.params.slices(),
                splats,
                tile_counts,
                slot_first,
                d_slots,
                n_bad,
                frame_status: status,
                d_camera,
                d: self.gradients[index].slices(),
            };
            let push = project_bwd_static_sh0::Push { group: index as u32, first, is_summed, wants_camera };
            rec.pass_variant(kernel(false, false), args, push, grid);
        }
    }

    /// The sum of what all Gaussians, of which the flat index has `n_flat`, and the background say of the camera.
    fn record_camera(&self, rec: &mut Recording, n_flat: u32, drawn: Drawn, target: &Target) {
        rec.section("camera bwd");
        let Drawn { cull, tail, size: Size { n_pixels, .. }, .. } = drawn;
        let (d_camera, partials) = (&self.d_camera_each, &self.camera_partials);
        rec.pass(
            camera_sum::Args { count: &cull.n_active, bits: &cull.bits, offsets: &cull.offsets, d_camera, partials },
            camera_sum::Push { n: n_flat / 32 },
            Grid::Groups(CAMERA_GROUPS),
        );
        if let Target::Gradients = target {
            rec.pass(
                background_sum::Args { tail, d_image0: &self.d_image0, partials },
                background_sum::Push { n: n_pixels },
                Grid::Groups(CAMERA_GROUPS),
            );
        }
        rec.pass(camera_total::Args { partials, total: &self.d_camera }, (), Grid::Groups(1));
    }

    fn record_blend(&self, rec: &mut Recording, drawn: Drawn) {
        rec.section("blend bwd");
        let words = self.words.as_ref().map(Buf::cast);
        let d_slots = words.as_ref().unwrap_or(&self.d_slots);
        match &drawn.blend.chunks {
            Some(chunks) => self.record_chunks(rec, drawn, chunks, d_slots),
            None => self.record_rounds(rec, drawn, d_slots),
        }
        if let Some(words) = &self.words {
            rec.pass(
                fixed_sums::Args { count: &drawn.cull.n_active, words, d_slots: &self.d_slots },
                fixed_sums::Push { inverse_scale: 1.0 / self.scale(drawn.size) },
                drawn.tiles.active_grid(),
            );
        }
    }

    /// Blocks of a tile that go back one dispatch after another: all of them where each slot has one writer at a time.
    fn dispatches(&self, blend: &Blend) -> u32 {
        if self.sums.is_fixed() { 1 } else { blend.blocks_per_tile() }
    }

    fn record_chunks(&self, rec: &mut Recording, drawn: Drawn, chunks: &Chunks, d_slots: &Buf<[f32; 2]>) {
        let Drawn { eye: ViewBuffers { view, projected, .. }, tiles, lists, blend, tail, size, .. } = drawn;
        for block in 0..self.dispatches(blend) {
            let args = blend_bwd_p4::Args {
                view,
                tile_order: &tiles.tile_order,
                tile_first: &tiles.tile_first,
                splat_ids: &lists.splat_ids,
                slots: lists.slots.as_ref().unwrap_or(&lists.splat_ids),
                splats: &projected.splats,
                tail,
                d_image0: &self.d_image0,
                tile_last: &tiles.tile_last,
                d_slots,
                d_image1: self.d_image1.as_ref().unwrap_or(&self.d_image0),
                chunk_args: &chunks.args,
                chunk_items: &chunks.items,
                chunk0: &chunks.image0,
                chunk1: &chunks.image1,
            };
            let (scale, large) = (self.scale(size), large(blend, size));
            let push = blend_bwd_p4::Push { n_tiles: size.n_tiles, block, scale, large };
            let kernel = self.sums.kernel(self.outputs, blend.pixels_per_lane);
            rec.pass_variant(kernel, args, push, chunks.grid());
            rec.scale(1.0 / f64::from(self.dispatches(blend)));
        }
    }

    fn record_rounds(&self, rec: &mut Recording, drawn: Drawn, d_slots: &Buf<[f32; 2]>) {
        let Drawn { eye: ViewBuffers { view, projected, .. }, tiles, lists, blend, tail, size, .. } = drawn;
        let Size { n_tiles, rounds, .. } = size;
        let kernel = self.sums.kernel(self.outputs, blend.pixels_per_lane);
        let subgroups_per_group = kernel.local / blend.subgroup_size;
        let n_dispatches = self.dispatches(blend);
        let n_work = n_tiles * blend.blocks_per_tile() / n_dispatches;
        let rounds = rounds * (SEGMENT / self.sums.segment());
        for round in 0..rounds {
            for block in 0..n_dispatches {
                let args = blend_bwd_p8::Args {
                    view,
                    tile_order: &tiles.tile_order,
                    tile_first: &tiles.tile_first,
                    splat_ids: &lists.splat_ids,
                    slots: lists.slots.as_ref().unwrap_or(&lists.splat_ids),
                    splats: &projected.splats,
                    tail,
                    d_image0: &self.d_image0,
                    carry: &self.carry,
                    d_slots,
                    d_image1: self.d_image1.as_ref().unwrap_or(&self.d_image0),
                };
                let push = blend_bwd_p8::Push {
                    n_work,
                    stride: coprime_stride(n_work),
                    block,
                    segment: rounds - 1 - round,
                    first_round: u32::from(round == 0),
                    scale: self.scale(size),
                    large: large(blend, size),
                };
                rec.pass_variant(kernel, args, push, Grid::Groups(n_work.div_ceil(subgroups_per_group)));
                rec.scale(1.0 / f64::from(rounds * n_dispatches));
            }
        }
    }
}

/// The size from which on terms of fixed point are large, see `fixed.glsl`: a sum has at most one from each block of pixels.
fn large(blend: &Blend, size: Size) -> f32 {
    constants::fixed::FIXED_SMALL / (size.n_tiles.max(1) * blend.blocks_per_tile()) as f32
}
