//! From cotangents of a picture to gradients of the parameters: the blend's adjoint into slots, then the projection's.

use super::blend::{Blend, Outputs, SEGMENT, coprime_stride};
use super::cull::{ARGS_FIRST_GROUP, Cull, indirect};
use super::params::TILE;
use super::project::Projected;
use super::scene::{Planes, SceneBuffers};
use super::tiles::{Lists, Tiles};
use crate::error::Result;
use crate::gpu::generated::{
    self as g, Status, ViewParams, blend_bwd_color_p4, blend_bwd_color_p8, blend_bwd_p4, blend_bwd_p8,
    project_bwd_static_sh0,
};
use crate::gpu::{Buf, Gpu, Grid, Kernel, KernelInfo, Recording};

/// vec2 per slot: the twelve sums that one intersection gives its splat.
pub const SLOT_PAIRS: usize = 6;

/// Buffers of the backward pass.
pub struct Backward {
    /// Cotangents of colour and alpha, per pixel.
    pub d_image0: Buf<[f32; 4]>,
    /// Cotangents of depth, inverse depth and flow; absent for [`Outputs::Color`].
    pub d_image1: Option<Buf<[f32; 4]>>,
    /// Gradients, by group.
    pub gradients: Vec<Planes>,
    /// Per Gaussian: sum of the norms of the projected centre's gradient, in half pictures, and the frames it was seen in.
    /// Grows from frame to frame; density control reads and clears it.
    pub stats: Vec<Buf<[f32; 2]>>,
    /// Gaussians whose gradient was not finite.
    pub n_bad: Buf<u32>,
    carry: Buf<[f32; 2]>,
    d_slots: Buf<[f32; 2]>,
    kernel: &'static KernelInfo,
    blocks_per_tile: u32,
}

/// The kernel of a population and a degree.
fn kernel_of(dynamic: bool, degree: usize) -> &'static KernelInfo {
    match (dynamic, degree) {
        (false, 0) => g::project_bwd_static_sh0::Args::INFO,
        (false, 1) => g::project_bwd_static_sh1::Args::INFO,
        (false, 2) => g::project_bwd_static_sh2::Args::INFO,
        (false, _) => g::project_bwd_static_sh3::Args::INFO,
        (true, 0) => g::project_bwd_dynamic_sh0::Args::INFO,
        (true, 1) => g::project_bwd_dynamic_sh1::Args::INFO,
        (true, 2) => g::project_bwd_dynamic_sh2::Args::INFO,
        (true, _) => g::project_bwd_dynamic_sh3::Args::INFO,
    }
}

impl Backward {
    /// Buffers for pictures of up to `pixels` pixels and `intersections` slots, blended as `blend` does.
    pub fn new(
        gpu: &Gpu,
        scene: &SceneBuffers,
        blend: &Blend,
        pixels: usize,
        intersections: u32,
        outputs: Outputs,
    ) -> Result<Self> {
        let kernel = match (outputs, blend.pixels_per_lane()) {
            (Outputs::All, 4) => blend_bwd_p4::Args::INFO,
            (Outputs::All, _) => blend_bwd_p8::Args::INFO,
            (Outputs::Color, 4) => blend_bwd_color_p4::Args::INFO,
            (Outputs::Color, _) => blend_bwd_color_p8::Args::INFO,
        };
        Ok(Backward {
            d_image0: gpu.alloc("d image color", pixels)?,
            d_image1: match outputs {
                Outputs::Color => None,
                Outputs::All => Some(gpu.alloc("d image depth flow", pixels)?),
            },
            gradients: scene
                .groups
                .iter()
                .map(|group| Planes::like(gpu, &group.params, "gradients"))
                .collect::<Result<_>>()?,
            stats: scene
                .groups
                .iter()
                .map(|group| gpu.upload("density statistics", &vec![[0.0; 2]; group.n as usize]))
                .collect::<Result<_>>()?,
            n_bad: gpu.alloc("bad gradients", 1)?,
            carry: gpu.alloc("blend carry", pixels)?,
            d_slots: gpu.alloc("d slots", SLOT_PAIRS * intersections as usize)?,
            kernel,
            blocks_per_tile: TILE * TILE / (gpu.caps().subgroup_size * blend.pixels_per_lane()),
        })
    }

    /// Appends the backward pass of a frame whose forward pass was recorded for training with the same arguments.
    #[expect(clippy::too_many_arguments, reason = "each names a stage of the frame")]
    pub fn record(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: &Cull,
        projected: &Projected,
        tiles: &Tiles,
        lists: &Lists,
        blend: &Blend,
        view: &Buf<ViewParams>,
        status: &Buf<Status>,
        n_tiles: u32,
        rounds: u32,
    ) {
        let (Some(slots), Some(tail)) = (&lists.slots, &blend.tail) else {
            unreachable!("the forward pass was recorded for training");
        };
        rec.stage("blend bwd");
        rec.fill(self.d_slots.slice(), 0);
        let subgroups_per_group = self.kernel.local / blend.subgroup_size();
        for round in 0..rounds {
            for block in 0..self.blocks_per_tile {
                let args = blend_bwd_p4::Args {
                    view,
                    tile_order: &tiles.tile_order,
                    tile_first: &tiles.tile_first,
                    splat_ids: &lists.splat_ids,
                    slots,
                    splats: &projected.splats,
                    tail,
                    d_image0: &self.d_image0,
                    carry: &self.carry,
                    d_slots: &self.d_slots,
                    d_image1: self.d_image1.as_ref().unwrap_or(&self.d_image0),
                };
                let push = blend_bwd_p4::Push {
                    n_tiles,
                    stride: if blend.deals() { coprime_stride(n_tiles) } else { 1 },
                    block,
                    segment: rounds - 1 - round,
                    first_round: u32::from(round == 0),
                };
                rec.pass_variant(self.kernel, args, push, Grid::Groups(n_tiles.div_ceil(subgroups_per_group)));
            }
        }
        rec.stage("project bwd");
        rec.fill(self.n_bad.slice(), 0);
        for (index, ((group, d), stats)) in scene.groups.iter().zip(&self.gradients).zip(&self.stats).enumerate() {
            for buffer in d.buffers() {
                rec.fill(buffer.slice(), 0);
            }
            rec.group(Some(index));
            let band = |b: usize| group.params.bands.get(b).unwrap_or(&group.params.sh0);
            let d_band = |b: usize| d.bands.get(b).unwrap_or(&d.sh0);
            let args = project_bwd_static_sh0::Args {
                view,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                geometry: &group.params.geometry,
                splats: &projected.splats,
                tile_counts: &projected.tile_counts,
                slot_first: &tiles.slot_first,
                d_slots: &self.d_slots,
                d_geometry: &d.geometry,
                d_sh0: &d.sh0,
                n_bad: &self.n_bad,
                motion: group.params.motion.as_ref().unwrap_or(&group.params.sh0),
                sh1: band(0),
                sh2: band(1),
                sh3: band(2),
                d_motion: d.motion.as_ref().unwrap_or(&d.sh0),
                d_sh1: d_band(0),
                d_sh2: d_band(1),
                d_sh3: d_band(2),
                stats,
                frame_status: status,
            };
            rec.pass_variant(
                kernel_of(group.params.motion.is_some(), group.degree()),
                args,
                project_bwd_static_sh0::Push { group: index as u32, first: group.first },
                indirect(&cull.args, ARGS_FIRST_GROUP + index),
            );
        }
        rec.group(None);
    }
}

/// `SEGMENT` of the backward kernel is that of the forward one: both walk the same rounds.
const _: () = assert!(SEGMENT == 32_768);
