//! Active Gaussians on the picture: splats, depth keys, tile counts.

use super::cull::{ARGS_FIRST_GROUP, Cull, indirect};
use super::scene::{Group, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::{self, Status, ViewParams, constants, project_static_sh0, project_stereo_static_sh0};
use crate::gpu::{Buf, Gpu, Grid, KernelInfo, Recording};

/// vec4 per splat; the layout is defined in `include/splat.glsl`.
pub const SPLAT_PLANES: usize = constants::splat::SPLAT_PLANES as usize;

/// What projection gives, by active index.
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

/// One of two eyes: its view, and the buffers that its projection is written to.
#[derive(Clone, Copy)]
pub struct Eye<'a> {
    /// Where it looks from.
    pub view: &'a Buf<ViewParams>,
    /// What it counts.
    pub status: &'a Buf<Status>,
    /// What is projected.
    pub projected: &'a Projected,
}

/// Bands 1 to 3 of a group, as halves where it has those; what it lacks is the constant one, which nobody reads there.
fn bands_of(group: &Group) -> [Buf<[f32; 4]>; 3] {
    let whole = group.params.three_bands();
    [0, 1, 2].map(|b| group.halves.get(b).map_or_else(|| whole[b].clone(), Buf::cast))
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

    /// Room for as many of a second eye: with splats and tile counts of its own, and the order of the first.
    pub fn beside(&self, gpu: &Gpu) -> Result<Self> {
        Ok(Projected {
            splats: gpu.alloc("second splats", self.splats.len())?,
            depth_keys: self.depth_keys.clone(),
            order: self.order.clone(),
            tile_counts: gpu.alloc("second tile counts", self.tile_counts.len())?,
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
        each_group(rec, scene, cull, |rec, group, [sh1, sh2, sh3], [kernel, _], index, grid| {
            let args = project_static_sh0::Args {
                view,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                geometry: &group.params.geometry,
                sh0: &group.params.sh0,
                splats: &self.splats,
                depth_keys: &self.depth_keys,
                tile_counts: &self.tile_counts,
                frame_status: status,
                motion: group.params.motion_or_any(),
                sh1,
                sh2,
                sh3,
            };
            rec.pass_variant(kernel, args, project_static_sh0::Push { group: index, first: group.first }, grid);
        });
    }

    /// Appends the projection of every group's active Gaussians for two eyes of one time, which reads each Gaussian once. Depth keys
    /// are those of the first eye.
    pub fn record_both(rec: &mut Recording, scene: &SceneBuffers, cull: &Cull, [first, second]: [Eye; 2]) {
        each_group(rec, scene, cull, |rec, group, [sh1, sh2, sh3], [_, kernel], index, grid| {
            let args = project_stereo_static_sh0::Args {
                view: first.view,
                ranges: &cull.ranges,
                active_id: &cull.active_id,
                geometry: &group.params.geometry,
                sh0: &group.params.sh0,
                splats: &first.projected.splats,
                depth_keys: &first.projected.depth_keys,
                tile_counts: &first.projected.tile_counts,
                frame_status: first.status,
                motion: group.params.motion_or_any(),
                sh1,
                sh2,
                sh3,
                second_view: second.view,
                second_splats: &second.projected.splats,
                second_tile_counts: &second.projected.tile_counts,
                second_status: second.status,
            };
            rec.pass_variant(kernel, args, project_stereo_static_sh0::Push { group: index, first: group.first }, grid);
        });
    }
}

/// Appends a pass for each group: `pass` has its bands, its kernels, its index and its grid.
fn each_group(
    rec: &mut Recording,
    scene: &SceneBuffers,
    cull: &Cull,
    pass: impl Fn(&mut Recording, &Group, [&Buf<[f32; 4]>; 3], [&'static KernelInfo; 2], u32, Grid),
) {
    rec.section("project");
    for (index, group) in scene.groups.iter().enumerate() {
        rec.group(Some(index));
        let bands = bands_of(group);
        let (dynamic, degree, halves) = (group.params.motion.is_some(), group.degree(), !group.halves.is_empty());
        let kernels = [false, true].map(|stereo| generated::project(stereo, dynamic, degree, halves));
        let grid = indirect(&cull.args, ARGS_FIRST_GROUP + index);
        pass(rec, group, bands.each_ref(), kernels, index as u32, grid);
    }
    rec.group(None);
}
