//! Active Gaussians on the picture: splats, depth keys, tile counts.

use super::cull::{ARGS_FIRST_GROUP, Cull, indirect};
use super::scene::SceneBuffers;
use crate::error::Result;
use crate::gpu::generated::{self, Status, ViewParams, constants, project_static_sh0};
use crate::gpu::{Buf, Gpu, Recording};

/// vec4 per splat; the layout is defined in `include/splat.glsl`.
pub const SPLAT_PLANES: usize = constants::splat::SPLAT_PLANES as usize;

/// The projected Gaussians, by active index.
pub struct Projected {
    /// `SPLAT_PLANES` vec4 each.
    pub splats: Buf<[f32; 4]>,
    /// Bits of the camera depth.
    pub depth_keys: Buf<u32>,
    /// Room for active indices in the order of their depths.
    pub order: Buf<u32>,
    /// Tiles touched.
    pub tile_counts: Buf<u32>,
}

/// A view, and the buffers that its projection is written to.
#[derive(Clone, Copy)]
pub struct Eye<'a> {
    /// Where it looks from.
    pub view: &'a Buf<ViewParams>,
    /// The counts of the frame.
    pub status: &'a Buf<Status>,
    /// The Gaussians on the picture.
    pub projected: &'a Projected,
}

impl Projected {
    /// Room for `capacity` active Gaussians.
    pub fn new(gpu: &Gpu, capacity: u32) -> Result<Self> {
        let n = capacity as usize;
        Ok(Projected {
            splats: gpu.alloc("splats", SPLAT_PLANES * n)?,
            depth_keys: gpu.alloc("depth keys", n)?,
            order: gpu.alloc("depth order", n)?,
            tile_counts: gpu.alloc("tile counts", n)?,
        })
    }

    /// Appends the projection of every group's active Gaussians.
    pub fn record(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: &Cull,
        view: &Buf<ViewParams>,
        status: &Buf<Status>,
    ) {
        rec.section("project");
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let args = project_static_sh0::Args {
                view,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                params: group.params.slices(),
                splats: &self.splats,
                depth_keys: &self.depth_keys,
                tile_counts: &self.tile_counts,
                frame_status: status,
            };
            let kernel = generated::project(group.params.motion.is_some(), group.degree());
            let push = project_static_sh0::Push { group: index as u32, first: group.first };
            rec.pass_variant(kernel, args, push, indirect(&cull.args, ARGS_FIRST_GROUP + index));
        }
        rec.group(None);
    }
}
