//! Two eyes that look the same way: they share the culling of the scene, its projection and the sort by depth.

use super::cull::ARGS_FIRST_GROUP;
use super::job::{Destination, Extent, Job, Launched, Measure, Recorded};
use super::params::{Outputs, Strip, moment, view_params};
use super::project::Projected;
use super::render::{FrameReport, Picture};
use super::renderer::Renderer;
use super::scene::SceneBuffers;
use super::second_eye::SecondEye;
use super::tiles::Lists;
use super::workspace::Workspace;
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::{Buf, Recording, Slice};
use crate::scene::{Frame, View};
use crate::settings::Constants;
use glam::DVec3;

/// Rows of two rotations are alike within this.
const ALIKE: f64 = 1e-9;
/// Part by which the near plane of both eyes is nearer than it is.
const NEARER: f64 = 1e-5;

impl Renderer {
    /// Hands the pictures of two eyes to the device and does not wait for them. Eyes of one size, at one time, that look the same
    /// way from places beside each other share culling, projection and the sort by depth: the first one's picture is that of
    /// [`Renderer::begin`], the second one's too but for Gaussians whose depths differ by less than single precision tells. Others
    /// share nothing.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn begin_stereo(
        &mut self,
        eyes: [&View; 2],
        outputs: Outputs,
        destination: Destination,
    ) -> Result<[Picture; 2]> {
        let fits = self.longest_strip(eyes[0])? >= eyes[0].intrinsics.height;
        let Some((union, back)) = union(eyes).filter(|_| fits) else {
            let [first, second] = eyes.map(|eye| self.begin(eye, outputs, destination));
            return Ok([first?, second?]);
        };
        let [job, other] =
            eyes.map(|view| Job { view, outputs, destination, cotangents: None, measure: Measure::Nothing });
        // A little nearer, for the rounding of the kernel: projection drops what is too near for good.
        let near = (f64::from(self.constants.near) + back) * (1.0 - NEARER);
        let launched = self.launch_stereo(&job, &other, &union, near)?;
        let [first, second] = launched.map(Some);
        let picture = |view: &View, launched| Picture { view: view.clone(), outputs, destination, launched };
        Ok([picture(eyes[0], first), picture(eyes[1], second)])
    }

    /// Renders two eyes, see [`Renderer::begin_stereo`].
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn stereo(
        &mut self,
        eyes: [&View; 2],
        outputs: Outputs,
        destination: Destination,
    ) -> Result<[(Frame, FrameReport); 2]> {
        let [first, second] = self.begin_stereo(eyes, outputs, destination)?;
        Ok([self.end(first)?, self.end(second)?])
    }

    fn launch_stereo(&mut self, job: &Job, other: &Job, union: &View, near: f64) -> Result<[Launched; 2]> {
        self.load_window(job.view)?;
        let extent = Extent::new(job.view, Strip::whole(job.view));
        self.make_room(job, &extent);
        let params = self.stereo_params([job.view, other.view], union, near);
        let [view, second_view, union] = params.map(|params| self.gpu.staged("view", &[params]));
        let views = [view?, second_view?, union?];
        let [status, second_status] = [self.slice(size_of::<Status>())?, self.slice(size_of::<Status>())?];
        let work = Workspace::fit(&mut self.work, &self.gpu, &self.scene, self.room)?;
        let second = SecondEye::fit(&mut self.second, &self.gpu, work)?;
        let n_tiles = extent.n_tiles;

        let mut recording = Recording::new();
        let (lists, order) = record_first(&mut recording, &self.scene, (work, second), views, n_tiles);
        recording.section("status");
        recording.copy(work.status.slice(), status.clone());
        let images = job.read_back(&work.blend);
        let first = Recorded { recording, lists, extent, status, rounds: 1, images, measure: Measure::Nothing };

        let mut recording = Recording::new();
        let lists = record_second(&mut recording, (work, second), &order, n_tiles);
        recording.section("status");
        recording.copy(second.status.slice(), second_status.clone());
        let images = job.read_back(&second.blend);
        let status = second_status;
        let second = Recorded { recording, lists, extent, status, rounds: 1, images, measure: Measure::Nothing };

        // The first eye's images are copied before the second begins: a replay of the first would draw over what they share.
        Ok([self.hand_over(first)?, self.hand_over(second)?])
    }

    /// What kernels read of both eyes, and of the `union` with its near plane at `near`.
    fn stereo_params(&self, eyes: [&View; 2], union: &View, near: f64) -> [ViewParams; 3] {
        let origin = self.scene.origin;
        let eyes = eyes.map(|view| view_params(view, &self.constants, origin, Strip::whole(view)));
        let constants = Constants { near: near as f32, ..self.constants };
        let mut of_union = view_params(union, &constants, origin, Strip::whole(union));
        // The wider the angle, the wider the reach: that of the widest one that an eye has.
        let widest = eyes.map(|params| params.clamp_uv.map(f32::abs));
        let [x, y] = [0, 2].map(|at| widest.iter().map(|uv| uv[at].max(uv[at + 1])).fold(0.0, f32::max));
        of_union.clamp_uv = [x, x, y, y];
        let [first, second] = eyes;
        [first, second, of_union]
    }
}

/// Appends what both eyes share and the picture of the first. Returns its lists, and the order by depth.
fn record_first(
    rec: &mut Recording,
    scene: &SceneBuffers,
    (work, second): (&Workspace, &SecondEye),
    [view, second_view, union]: [Slice; 3],
    n_tiles: u32,
) -> (Lists, Buf<u32>) {
    let Workspace { cull, projected, tiles, blend, status, zeros, .. } = work;
    rec.section("view");
    rec.copy(view, work.view.slice());
    rec.copy(second_view, second.view.slice());
    rec.copy(union, second.union.slice());
    rec.section("cull");
    zeros.record(rec, 0);
    cull.record(rec, scene, &second.union, status);
    rec.copy(shared_grids(work), second.grids.slice());
    // What failed for both, and how many are active; the rest is 0, and each eye counts its own from here on.
    rec.copy(status.slice(), second.status.slice());
    Projected::record_both(rec, scene, cull, [work.eye(), second.eye()]);
    let order = tiles.record_order(rec, cull, projected);
    let lists = tiles.record(rec, cull, work.eye(), &order, n_tiles, blend.longest(1));
    blend.record(rec, tiles, &lists, work.eye(), n_tiles, 1);
    (lists, order)
}

/// Appends the picture of the second eye, behind that of the first, whose `order` it shares. Returns its lists.
fn record_second(
    rec: &mut Recording,
    (work, second): (&Workspace, &SecondEye),
    order: &Buf<u32>,
    n_tiles: u32,
) -> Lists {
    rec.section("tiles");
    rec.copy(second.grids.slice(), shared_grids(work));
    work.tiles.record_clear(rec);
    second.blend.record_clear(rec);
    let lists = work.tiles.record(rec, &work.cull, second.eye(), order, n_tiles, second.blend.longest(1));
    second.blend.record(rec, &work.tiles, &lists, second.eye(), n_tiles, 1);
    lists
}

/// The grids over active Gaussians, which the lists of either eye turn into grids over its intersections.
fn shared_grids(work: &Workspace) -> Slice {
    work.cull.args.range(0, ARGS_FIRST_GROUP).slice()
}

/// A view that sees all that either eye sees, from behind them, and how far behind; none where they do not look the same way
/// from places beside each other.
fn union(eyes: [&View; 2]) -> Option<(View, f64)> {
    let [a, b] = eyes;
    let alike = |x: f64, y: f64| (x - y).abs() <= ALIKE * x.abs().max(1.0);
    let (m, other) = (a.pose.rows(), b.pose.rows());
    let same_way = (0..3).all(|row| (0..3).all(|k| alike(m[row][k], other[row][k]))) && alike(m[2][3], other[2][3]);
    if !same_way
        || moment(a) != moment(b)
        || (a.intrinsics.width, a.intrinsics.height) != (b.intrinsics.width, b.intrinsics.height)
    {
        return None;
    }
    // In the camera's axes, from the middle between the eyes: where each is, and the tangents of its borders.
    let axis = |row: usize, f: fn(&View) -> f64, c: fn(&View) -> f64, size: u32| {
        let middle = (m[row][3] + other[row][3]) / 2.0;
        let place = [m[row][3], other[row][3]].map(|t| middle - t);
        let low = eyes.map(|eye| -c(eye) / f(eye));
        let high = eyes.map(|eye| (f64::from(size) - c(eye)) / f(eye));
        let (lowest, highest) = (low[0].min(low[1]), high[0].max(high[1]));
        let back = place.iter().map(|x| (x / highest).max(x / lowest)).fold(0.0, f64::max);
        (lowest < 0.0 && highest > 0.0).then_some((middle, lowest, highest, back))
    };
    let (x, left, right, back_x) = axis(0, |v| v.intrinsics.fx, |v| v.intrinsics.cx, a.intrinsics.width)?;
    let (y, top, bottom, back_y) = axis(1, |v| v.intrinsics.fy, |v| v.intrinsics.cy, a.intrinsics.height)?;
    let back = back_x.max(back_y) * (1.0 + ALIKE);
    let mut view = a.clone();
    view.pose.translation = DVec3::new(x, y, m[2][3] + back);
    // Where the eyes' pixels differ, those of the larger ones, which blur farther.
    (view.intrinsics.fx, view.intrinsics.fy) =
        (a.intrinsics.fx.min(b.intrinsics.fx), a.intrinsics.fy.min(b.intrinsics.fy));
    (view.intrinsics.cx, view.intrinsics.cy) = (-left * view.intrinsics.fx, -top * view.intrinsics.fy);
    (view.intrinsics.width, view.intrinsics.height) =
        (((right - left) * view.intrinsics.fx).ceil() as u32, ((bottom - top) * view.intrinsics.fy).ceil() as u32);
    Some((view, back))
}
