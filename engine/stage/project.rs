//! Active Gaussians on the picture: splats, depth keys, tile counts.

use super::cull::{ARGS_FIRST_GROUP, Cull, indirect};
use super::scene::SceneBuffers;
use crate::error::Result;
use crate::gpu::generated::{self, Status, ViewParams, constants, project_static_sh0};
use crate::gpu::{Buf, Gpu, Recording};

/// vec4 per splat; the layout is told in `include/splat.glsl`.
pub const SPLAT_PLANES: usize = constants::splat::SPLAT_PLANES as usize;

/// What projection gives, by active index.
pub struct Projected {
    /// `SPLAT_PLANES` vec4 each.
    pub splats: Buf<[f32; 4]>,
    /// Bits of the camera depth.
    pub depth_keys: Buf<u32>,
    /// The active index itself, the value that the depth sort carries.
    pub identity: Buf<u32>,
    /// Tiles touched.
    pub tile_counts: Buf<u32>,
}

impl Projected {
    /// Room for `capacity` active Gaussians.
    pub fn new(gpu: &Gpu, capacity: u32) -> Result<Self> {
        let n = capacity as usize;
        Ok(Projected {
            splats: gpu.alloc("splats", SPLAT_PLANES * n)?,
            depth_keys: gpu.alloc("depth keys", n)?,
            identity: gpu.alloc("depth order", n)?,
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
        rec.stage("project");
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let halves: Vec<Buf<[f32; 4]>> = group.halves.iter().map(Buf::cast).collect();
            let bands = if halves.is_empty() { &group.params.bands } else { &halves };
            let band = |b: usize| bands.get(b).unwrap_or(&group.params.sh0);
            let args = project_static_sh0::Args {
                view,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                geometry: &group.params.geometry,
                sh0: &group.params.sh0,
                splats: &self.splats,
                depth_keys: &self.depth_keys,
                identity: &self.identity,
                tile_counts: &self.tile_counts,
                frame_status: status,
                motion: group.params.motion.as_ref().unwrap_or(&group.params.sh0),
                sh1: band(0),
                sh2: band(1),
                sh3: band(2),
            };
            rec.pass_variant(
                generated::project(group.params.motion.is_some(), group.degree(), !halves.is_empty()),
                args,
                project_static_sh0::Push { group: index as u32, first: group.first },
                indirect(&cull.args, ARGS_FIRST_GROUP + index),
            );
        }
        rec.group(None);
    }
}
