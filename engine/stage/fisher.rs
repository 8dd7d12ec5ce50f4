//! Fisher information and slopes of pictures along each part of each Gaussian, added up behind the backward pass.

use super::params::moment;
use super::planes::{FISHER_PLANES, PLANE_BLOCK, plane_of};
use super::{Group, Planes, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::{self, fisher_static_sh0};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::scene::View;

/// Sums over pictures of one Gaussian, of each part: the response to the step that leaves it out, or that adds what a static Gaussian
/// lacks; squared, with cotangents of random signs, it is the information along that step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Response {
    /// Of a dynamic Gaussian: standing still, where it is in the middle of the clip and as opaque as it is in the mean.
    pub rest: f64,
    /// Without bands 1 to 3, their mean over the cameras in the constant band.
    pub bands: [f64; 3],
    /// Colours of bands 1 to 3 in the mean over the cameras; no sum.
    pub band_means: [[f64; 3]; 3],
    pub whole: f64,
    /// Per unit of colour, the three channels together.
    pub color: f64,
    /// Pictures that see it, once for each strip that they are rendered in.
    pub seen: f64,
    /// Of a static Gaussian, per unit of velocity (scene units per clip), of a relative opacity that grows evenly with time,
    /// and of one that is larger at both ends than in the middle.
    pub lacks: [f64; 5],
}

pub(super) struct Fisher {
    sums: Vec<Buf<[f32; 4]>>,
    cameras: Buf<[f32; 4]>,
    squares: bool,
}

/// The information of pictures on a scene so far; made by [`super::Renderer::census`].
pub struct Census {
    pub(super) information: Fisher,
    pub(super) slope: Fisher,
}

impl Census {
    pub(super) fn new(gpu: &Gpu, scene: &SceneBuffers, cameras: &[[f64; 3]]) -> Result<Self> {
        let [information, slope] = [Fisher::new(gpu, scene, cameras, true)?, Fisher::new(gpu, scene, cameras, false)?];
        Ok(Census { information, slope })
    }
}

impl Fisher {
    pub fn new(gpu: &Gpu, scene: &SceneBuffers, cameras: &[[f64; 3]], squares: bool) -> Result<Self> {
        let zeros = |group: &Group| {
            let n = (group.n as usize).next_multiple_of(PLANE_BLOCK) * FISHER_PLANES;
            gpu.upload("fisher sums", &vec![[0.0f32; 4]; n])
        };
        let weight = 1.0 / cameras.len().max(1) as f32;
        let place = |camera: &[f64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|c| (camera[c] - scene.origin[c]) as f32);
            [x, y, z, weight]
        };
        let cameras = gpu.upload("fisher cameras", &cameras.iter().map(place).collect::<Vec<_>>())?;
        Ok(Fisher { cameras, sums: scene.groups.iter().map(zeros).collect::<Result<_>>()?, squares })
    }

    /// Appends the addition of the gradients that a backward pass left of `view`.
    pub fn record(&self, rec: &mut Recording, scene: &SceneBuffers, gradients: &[Planes], view: &View) {
        rec.section("fisher");
        for (index, ((group, d), sums)) in scene.groups.iter().zip(gradients).zip(&self.sums).enumerate() {
            rec.group(Some(index));
            let params = group.params.slices();
            let args = fisher_static_sh0::Args { params, d: d.slices(), sums, cameras: &self.cameras };
            let push = fisher_static_sh0::Push {
                n: group.n,
                time: moment(view) as f32,
                middle: 0.5,
                squares: if self.squares { 1.0 } else { 0.0 },
                n_cameras: self.cameras.len() as u32,
                is_of_clip: if view.is_photo() { 0.0 } else { 1.0 },
            };
            let kernel = generated::fisher(group.is_dynamic(), group.degree());
            rec.pass_variant(kernel, args, push, Grid::Threads(group.n));
        }
        rec.group(None);
    }

    /// The result of `of` on the planes of each Gaussian, in the scene's order.
    fn each<T>(&self, gpu: &Gpu, scene: &SceneBuffers, of: impl Fn(&dyn Fn(usize) -> [f32; 4]) -> T) -> Result<Vec<T>> {
        let mut all = Vec::with_capacity(scene.n as usize);
        for (group, sums) in scene.groups.iter().zip(&self.sums) {
            let sums = gpu.read(sums)?;
            all.extend((0..group.n as usize).map(|i| of(&|plane| sums[plane_of(i, FISHER_PLANES, plane)])));
        }
        Ok(all)
    }

    /// Pictures, strip by strip, that see each Gaussian.
    pub fn seen(&self, gpu: &Gpu, scene: &SceneBuffers) -> Result<Vec<f32>> {
        self.each(gpu, scene, |plane| plane(1)[3])
    }

    pub fn read(&self, gpu: &Gpu, scene: &SceneBuffers) -> Result<Vec<Response>> {
        self.each(gpu, scene, |plane| {
            let [part, own, lacks] = [0, 1, 2].map(|at| plane(at).map(f64::from));
            Response {
                rest: part[0],
                bands: [part[1], part[2], part[3]],
                band_means: [3, 4, 5].map(|at| plane(at).map(f64::from)).map(|[r, g, b, _]| [r, g, b]),
                whole: own[0],
                color: own[1],
                seen: own[3],
                lacks: [lacks[0], lacks[1], lacks[2], lacks[3], own[2]],
            }
        })
    }
}
