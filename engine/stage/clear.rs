//! Space before lenses, kept clear of Gaussians.

use super::scene::SceneBuffers;
use crate::error::Result;
use crate::gpu::generated::{Status, clear};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::scene::Clearing;

/// Height over the surface of the lenses below which a Gaussian is clear of them, scene units; negative is behind it.
const MARGIN: f32 = 0.06;
/// How far beyond that a Gaussian is moved, scene units: more than f32 loses of a height.
const LITTLE: f32 = 1e-4;

pub struct Clearings(Buf<[f32; 4]>);

impl Clearings {
    /// `clearings`, relative to the scene's origin.
    pub fn upload(gpu: &Gpu, clearings: &[Clearing]) -> Result<Option<Self>> {
        let buffer = || gpu.upload("clearings", bytemuck::cast_slice(clearings)).map(Clearings);
        (!clearings.is_empty()).then(buffer).transpose()
    }

    /// Appends that Gaussians in these spaces go behind the lenses, of the groups that are trained; none when the step failed. The bounds
    /// are due afterwards.
    pub fn record(&self, rec: &mut Recording, scene: &SceneBuffers, status: &Buf<Status>) {
        rec.section("clear");
        let n_clearings = (self.0.len() / 3) as u32;
        for (index, group) in scene.trained() {
            rec.group(Some(index));
            let args = clear::Args { frame_status: status, clearings: &self.0, geometry: &group.params.geometry };
            let push = clear::Push { n: group.n, n_clearings, margin: MARGIN, little: LITTLE };
            rec.pass(args, push, Grid::Threads(group.n));
        }
        rec.group(None);
    }
}
