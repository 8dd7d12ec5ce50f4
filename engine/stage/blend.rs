//! Front-to-back blending of each tile's list.

use super::params::{Outputs, Purpose, TILE};
use super::project::Eye;
use super::tiles::{Lists, Tiles};
use crate::error::Result;
pub use crate::gpu::generated::constants::block::SEGMENT;
use crate::gpu::generated::{self, blend_fwd_p4, blend_fwd_train_p4};
use crate::gpu::{Buf, Gpu, Grid, KernelInfo, Recording};
use crate::vk::DeviceKind;

/// Images and shape of the blend kernel.
pub struct Blend {
    /// Colour and alpha, per pixel of the strip.
    pub image0: Buf<[f32; 4]>,
    /// Depth, inverse depth and flow; absent for [`Outputs::Color`].
    pub image1: Option<Buf<[f32; 4]>>,
    /// Final transmittance (its bits) and number of the last entry added, per pixel; unless for [`Purpose::Picture`].
    pub tail: Option<Buf<[u32; 2]>>,
    kernel: &'static KernelInfo,
    subgroup_size: u32,
    pixels_per_lane: u32,
    deals: bool,
}

impl Blend {
    /// Images of up to `pixels` pixels.
    pub fn new(gpu: &Gpu, pixels: usize, outputs: Outputs, purpose: Purpose) -> Result<Self> {
        let caps = gpu.caps();
        let is_cpu = caps.kind == DeviceKind::Cpu;
        // Eight pixels per lane pay where registers cost nothing; 64 lanes with eight would outgrow a tile.
        let pixels_per_lane = if is_cpu && caps.subgroup_size <= 32 { 8 } else { 4 };
        let kernel = generated::blend_fwd(purpose != Purpose::Picture, outputs == Outputs::Color, pixels_per_lane == 8);
        Ok(Blend {
            image0: gpu.alloc("image color", pixels)?,
            image1: match outputs {
                Outputs::Color => None,
                Outputs::All => Some(gpu.alloc("image depth flow", pixels)?),
            },
            tail: match purpose {
                Purpose::Picture => None,
                Purpose::Gradient | Purpose::Training => Some(gpu.alloc("image tail", pixels)?),
            },
            kernel,
            subgroup_size: caps.subgroup_size,
            pixels_per_lane,
            deals: is_cpu,
        })
    }

    /// The images, in the order of their numbers.
    pub fn images(&self) -> Vec<Buf<[f32; 4]>> {
        [&self.image0].into_iter().chain(&self.image1).cloned().collect()
    }

    /// Pixels that each lane blends.
    pub fn pixels_per_lane(&self) -> u32 {
        self.pixels_per_lane
    }

    /// Lanes of the device's subgroups.
    pub fn subgroup_size(&self) -> u32 {
        self.subgroup_size
    }

    /// Whether heavy tiles are dealt out, since the device gives each thread one run of workgroups.
    pub fn deals(&self) -> bool {
        self.deals
    }

    /// Appends blending of `lists` in `rounds` rounds, enough for lists of `rounds * SEGMENT` entries.
    pub fn record(&self, rec: &mut Recording, tiles: &Tiles, lists: &Lists, eye: Eye, n_tiles: u32, rounds: u32) {
        let Eye { view, projected, .. } = eye;
        rec.section("blend");
        let n_blocks = n_tiles * (TILE * TILE / (self.subgroup_size * self.pixels_per_lane));
        let subgroups_per_group = self.kernel.local / self.subgroup_size;
        for round in 0..rounds {
            let image1 = self.image1.as_ref().unwrap_or(&self.image0);
            let push = blend_fwd_p4::Push {
                n_blocks,
                stride: if self.deals { coprime_stride(n_blocks) } else { 1 },
                round,
                last_round: u32::from(round + 1 == rounds),
            };
            let grid = Grid::Groups(n_blocks.div_ceil(subgroups_per_group));
            let (tile_order, tile_first, tile_last) = (&tiles.tile_order, &tiles.tile_first, &tiles.tile_last);
            let (splat_ids, splats, image0) = (&lists.splat_ids, &projected.splats, &self.image0);
            if let Some(tail) = &self.tail {
                let args = blend_fwd_train_p4::Args {
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
                    blend_fwd_p4::Args { view, tile_order, tile_first, tile_last, splat_ids, splats, image0, image1 };
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
