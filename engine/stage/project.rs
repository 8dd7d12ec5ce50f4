//! Active Gaussians on the picture: splats, depth keys, tile counts.

use super::cull::{ARGS_FIRST_GROUP, indirect};
use super::{Cull, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::{self, Status, ViewParams, constants, project_static_sh0};
use crate::gpu::{Buf, Gpu, Recording};

pub const SPLAT_PLANES: usize = constants::splat::SPLAT_PLANES as usize;

/// The projected Gaussians, by active index; see `include/splat.glsl`.
pub struct Projected {
    /// `SPLAT_PLANES` vec4 each.
    pub splats: Buf<[f32; 4]>,
    pub depth_keys: Buf<u32>,
    /// Room for active indices in the order of their depths.
    pub order: Buf<u32>,
    pub tile_counts: Buf<u32>,
}

/// A view, the frame's counts, and the buffers that its projection is written to.
#[derive(Clone, Copy)]
pub struct ViewBuffers<'a> {
    pub view: &'a Buf<ViewParams>,
    pub status: &'a Buf<Status>,
    pub projected: &'a Projected,
}

impl Projected {
    pub fn new(gpu: &Gpu, capacity: u32) -> Result<Self> {
        let n = capacity as usize;
        Ok(Projected {
            splats: gpu.alloc("splats", SPLAT_PLANES * n)?,
            depth_keys: gpu.alloc("depth keys", n)?,
            order: gpu.alloc("depth order", n)?,
            tile_counts: gpu.alloc("tile counts", n)?,
        })
    }

    pub fn record(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: &Cull,
        view: &Buf<ViewParams>,
        frame_status: &Buf<Status>,
    ) {
        let (Cull { ranges, active_id, .. }, Projected { splats, depth_keys, tile_counts, .. }) = (cull, self);
        rec.section("project");
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let args = project_static_sh0::Args {
                view,
                ranges,
                active_id,
                params: group.params.slices(),
                splats,
                depth_keys,
                tile_counts,
                frame_status,
            };
            let kernel = generated::project(group.is_dynamic(), group.degree());
            let push = project_static_sh0::Push { group: index as u32, first: group.first };
            rec.pass_variant(kernel, args, push, indirect(&cull.args, ARGS_FIRST_GROUP + index));
        }
        rec.group(None);
    }
}
