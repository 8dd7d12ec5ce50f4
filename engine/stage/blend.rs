//! Front-to-back blending of each tile's list.

use super::chunks::{self, Chunks};
use super::params::TILE;
use super::{Lists, Outputs, Purpose, Tiles, ViewBuffers, Zeros};
use crate::error::Result;
pub use crate::gpu::generated::constants::block::SEGMENT;
use crate::gpu::generated::{self, blend_fwd_p4, blend_fwd_p8, blend_fwd_train_p8};
use crate::gpu::{Buf, Gpu, Grid, KernelInfo, Recording};
use crate::vk::DeviceKind;

pub struct Blend {
    pub image0: Buf<[f32; 4]>,
    /// Depth, inverse depth and flow, with [`Outputs::All`].
    pub image1: Option<Buf<[f32; 4]>>,
    /// Final transmittance (its bits) and number of the last entry added, per pixel; unless for [`Purpose::Picture`].
    pub tail: Option<Buf<[u32; 2]>>,
    kernel: &'static KernelInfo,
    pub(super) subgroup_size: u32,
    pub(super) pixels_per_lane: u32,
    // Of long lists, where they have any.
    pub(super) chunks: Option<Chunks>,
}

impl Blend {
    /// True if `gpu` cuts long lists into chunks, as a GPU does: where lists follow each other on a few threads, rounds do.
    pub(super) fn has_chunks(gpu: &Gpu) -> bool {
        gpu.caps().kind != DeviceKind::Cpu
    }

    pub fn n_zeros(gpu: &Gpu) -> usize {
        if Blend::has_chunks(gpu) { chunks::N_ZEROS } else { 0 }
    }

    /// Images of up to `pixels` pixels, of lists of up to `intersections` entries in all.
    pub fn new(
        gpu: &Gpu,
        pixels: usize,
        intersections: u32,
        outputs: Outputs,
        purpose: Purpose,
        zeros: &mut Zeros,
    ) -> Result<Self> {
        let caps = gpu.caps();
        let has_chunks = Blend::has_chunks(gpu);
        // Eight pixels per lane pay where registers cost nothing.
        let pixels_per_lane = if has_chunks { 4 } else { 8 };
        let (is_kept, has_image1) = (purpose != Purpose::Picture, outputs == Outputs::All);
        let chunks = || Chunks::new(gpu, intersections, outputs, purpose, zeros);
        Ok(Blend {
            image0: gpu.alloc("image color", pixels)?,
            image1: has_image1.then(|| gpu.alloc("image depth flow", pixels)).transpose()?,
            tail: is_kept.then(|| gpu.alloc("image tail", pixels)).transpose()?,
            kernel: generated::blend_fwd(is_kept, !has_image1, pixels_per_lane == 8),
            subgroup_size: caps.subgroup_size,
            pixels_per_lane,
            chunks: has_chunks.then(chunks).transpose()?,
        })
    }

    pub fn images(&self) -> Vec<Buf<[f32; 4]>> {
        [&self.image0].into_iter().chain(&self.image1).cloned().collect()
    }

    pub(super) fn blocks_per_tile(&self) -> u32 {
        TILE * TILE / (self.subgroup_size * self.pixels_per_lane)
    }

    pub fn longest(&self, rounds: u32) -> u32 {
        if self.chunks.is_some() { u32::MAX } else { rounds * SEGMENT }
    }

    /// Appends blending of `lists` in `rounds` rounds, enough for lists of [`Blend::longest`] entries.
    pub fn record(
        &self,
        rec: &mut Recording,
        tiles: &Tiles,
        lists: &Lists,
        eye: ViewBuffers,
        n_tiles: u32,
        rounds: u32,
    ) {
        rec.section("blend");
        match &self.chunks {
            Some(chunks) => self.record_chunks(rec, chunks, tiles, lists, eye, n_tiles),
            None => self.record_rounds(rec, tiles, lists, eye, n_tiles, rounds),
        }
    }

    fn record_chunks(
        &self,
        rec: &mut Recording,
        chunks: &Chunks,
        tiles: &Tiles,
        lists: &Lists,
        eye: ViewBuffers,
        n_tiles: u32,
    ) {
        chunks.record_list(rec, tiles, lists, eye, n_tiles);
        let image0 = &self.image0;
        let no_tail = image0.cast();
        let args = blend_fwd_p4::Args {
            view: eye.view,
            tile_order: &tiles.tile_order,
            tile_first: &tiles.tile_first,
            tile_last: &tiles.tile_last,
            splat_ids: &lists.splat_ids,
            splats: &eye.projected.splats,
            image0,
            image1: self.image1.as_ref().unwrap_or(image0),
            tail: self.tail.as_ref().unwrap_or(&no_tail),
            chunk_args: &chunks.args,
            chunk_items: &chunks.items,
            chunk_light: &chunks.light,
            chunk0: &chunks.image0,
            chunk1: &chunks.image1,
            chunk_last: &chunks.last,
        };
        rec.pass_variant(self.kernel, args, blend_fwd_p4::Push { n_tiles }, chunks.grid());
        chunks.record_merge(rec, tiles, eye, self);
    }

    fn record_rounds(
        &self,
        rec: &mut Recording,
        tiles: &Tiles,
        lists: &Lists,
        eye: ViewBuffers,
        n_tiles: u32,
        rounds: u32,
    ) {
        let n_blocks = n_tiles * self.blocks_per_tile();
        let subgroups_per_group = self.kernel.local / self.subgroup_size;
        let Tiles { tile_order, tile_first, tile_last, .. } = tiles;
        let (view, splat_ids, splats) = (eye.view, &lists.splat_ids, &eye.projected.splats);
        let image0 = &self.image0;
        let image1 = self.image1.as_ref().unwrap_or(image0);
        for round in 0..rounds {
            let (stride, last_round) = (coprime_stride(n_blocks), u32::from(round + 1 == rounds));
            let push = blend_fwd_p8::Push { n_blocks, stride, round, last_round };
            let grid = Grid::Groups(n_blocks.div_ceil(subgroups_per_group));
            if let Some(tail) = &self.tail {
                let args = blend_fwd_train_p8::Args {
                    view,
                    tile_order,
                    tile_first,
                    tile_last,
                    splat_ids,
                    splats,
                    image0,
                    image1,
                    tail,
                };
                rec.pass_variant(self.kernel, args, push, grid);
            } else {
                let args =
                    blend_fwd_p8::Args { view, tile_order, tile_first, tile_last, splat_ids, splats, image0, image1 };
                rec.pass_variant(self.kernel, args, push, grid);
            }
            rec.scale(1.0 / f64::from(rounds));
        }
    }
}

/// A stride that visits all of `n` places and leaves no long run of neighbours.
pub(super) fn coprime_stride(n: u32) -> u32 {
    [97, 89, 83, 79, 73].into_iter().find(|p| !n.is_multiple_of(*p) && n > 2 * p).unwrap_or(1)
}
