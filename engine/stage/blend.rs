//! Front-to-back blending of each tile's list.

use super::params::TILE;
use super::project::Projected;
use super::tiles::Tiles;
use crate::error::Result;
use crate::gpu::generated::{ViewParams, blend_fwd_color_p4, blend_fwd_color_p8, blend_fwd_p4, blend_fwd_p8};
use crate::gpu::{Buf, Gpu, Grid, Kernel, KernelInfo, Recording};
use crate::vk::DeviceKind;

/// Entries of a list that one round walks, `SEGMENT` of the shader.
pub const SEGMENT: u32 = 32_768;

/// What a picture needs; the rest is neither computed nor read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// Colour and alpha.
    Color,
    /// Colour, alpha, depth, inverse depth and flow.
    All,
}

/// Images and shape of the blend kernel.
pub struct Blend {
    /// Colour and alpha, per pixel of the strip.
    pub image0: Buf<[f32; 4]>,
    /// Depth, inverse depth and flow; absent for [`Outputs::Color`].
    pub image1: Option<Buf<[f32; 4]>>,
    kernel: &'static KernelInfo,
    blocks_per_tile: u32,
    subgroups_per_group: u32,
    deal: bool,
}

impl Blend {
    /// Images of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize, outputs: Outputs) -> Result<Self> {
        let caps = gpu.caps();
        let is_cpu = caps.kind == DeviceKind::Cpu;
        // Eight pixels per lane pay where registers cost nothing; 64 lanes with eight would outgrow a tile.
        let pixels_per_lane = if is_cpu && caps.subgroup_size <= 32 { 8 } else { 4 };
        let kernel = match (outputs, pixels_per_lane) {
            (Outputs::All, 4) => blend_fwd_p4::Args::INFO,
            (Outputs::All, _) => blend_fwd_p8::Args::INFO,
            (Outputs::Color, 4) => blend_fwd_color_p4::Args::INFO,
            (Outputs::Color, _) => blend_fwd_color_p8::Args::INFO,
        };
        Ok(Blend {
            image0: gpu.alloc("image color", pixels)?,
            image1: match outputs {
                Outputs::Color => None,
                Outputs::All => Some(gpu.alloc("image depth flow", pixels)?),
            },
            kernel,
            blocks_per_tile: TILE * TILE / (caps.subgroup_size * pixels_per_lane),
            subgroups_per_group: kernel.local / caps.subgroup_size,
            deal: is_cpu,
        })
    }

    /// Appends blending of `lists` in `rounds` rounds, enough for lists of `rounds * SEGMENT` entries.
    pub fn record(
        &self,
        rec: &mut Recording,
        tiles: &Tiles,
        lists: &Buf<u32>,
        projected: &Projected,
        view: &Buf<ViewParams>,
        n_tiles: u32,
        rounds: u32,
    ) {
        rec.stage("blend");
        let n_blocks = n_tiles * self.blocks_per_tile;
        for round in 0..rounds {
            let args = blend_fwd_p4::Args {
                view,
                tile_order: &tiles.tile_order,
                tile_first: &tiles.tile_first,
                tile_last: &tiles.tile_last,
                splat_ids: lists,
                splats: &projected.splats,
                image0: &self.image0,
                image1: self.image1.as_ref().unwrap_or(&self.image0),
            };
            let push = blend_fwd_p4::Push {
                n_blocks,
                stride: if self.deal { coprime_stride(n_blocks) } else { 1 },
                round,
                last_round: u32::from(round + 1 == rounds),
            };
            rec.pass_variant(self.kernel, args, push, Grid::Groups(n_blocks.div_ceil(self.subgroups_per_group)));
        }
    }
}

/// A stride that visits all of `n` places and leaves no long run of neighbours.
fn coprime_stride(n: u32) -> u32 {
    [97, 89, 83, 79, 73].into_iter().find(|p| n % p != 0 && n > 2 * p).unwrap_or(1)
}
