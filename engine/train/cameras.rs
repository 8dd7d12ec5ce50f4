//! Learnt parameters of the cameras: clocks, poses and bilateral grids.

use super::density::recovered_from;
use super::terms::{self, Pair};
use super::{CameraState, Config, GridKind, PoseKind, Rate, Setup};
use crate::error::{Error, Result};
use crate::gpu::{Buf, Gpu, Recording, Slice};
use crate::scene::{Pose, Similarity, View};
use crate::stage::{
    GRID_BYTES, GRID_NUMBERS, GradedBack, GridStep, Grids, PoseRows, PoseStep, Poses, TimeOffsetStep, TimeOffsets,
    Workspace,
};
use glam::{DVec3, Vec3};
use std::ops::Range;
use std::path::Path;

/// The share of the run at which poses begin to be learnt: before, the scene is too coarse.
const POSES_FROM: f64 = 0.1;
/// The share of the run at which the learnt poses of a clip are compared with the capture's.
const POSES_JUDGED: f64 = 0.3;
/// Learning rate of the colour maps, that of the authors of bilateral grids (SPEC 6), in runs of any length.
const GRID_RATE: f64 = 2e-3;
/// Learning rate of the time offsets, frames.
const OFFSET_RATE: f64 = 1e-3;
/// Longest shift of a camera, scene extents.
const MOST_SHIFT: f64 = 0.1;

/// The step of a run of `total` after which the learnt poses are compared with the capture's.
pub(super) fn poses_judged_at(config: &Config, total: u64) -> u64 {
    recovered_from(config, (POSES_JUDGED * total as f64).round() as u64, total)
}

/// True if a run of `before` steps that goes on as one of `total` has passed the comparison of that one but not its own,
/// and has learnt poses for as long as that one would have.
pub(super) fn poses_are_missed(config: &Config, step: u64, before: u64, total: u64) -> bool {
    let learnt = step as f64 - POSES_FROM * before as f64;
    let is_past = poses_judged_at(config, total) <= step && step < poses_judged_at(config, before);
    is_past && learnt >= (POSES_JUDGED - POSES_FROM) * total as f64
}

/// The step of a run of `total` after which offsets that the images do not determine are fixed.
pub(super) fn offsets_judged_at(config: &Config, total: u64) -> u64 {
    recovered_from(config, total / 2, total)
}

/// The difference of a camera's pose from the capture's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Turn about the world's axes, radians.
    pub turn: DVec3,
    /// Shift along the world's axes, scene units.
    pub shift: DVec3,
}

impl Correction {
    pub fn of([turn, shift, ..]: &PoseRows) -> Self {
        let [turn, shift] = [turn, shift].map(|row| Vec3::from_slice(row).as_dvec3());
        Correction { turn, shift }
    }

    pub fn view(&self, view: &View) -> View {
        let corrected = |pose: &Pose| pose.corrected(self.turn, self.shift);
        View { pose: corrected(&view.pose), next_pose: view.next_pose.as_ref().map(corrected), ..view.clone() }
    }

    /// The same in the capture's own world; `world` leads from there to this one.
    pub fn in_capture(&self, world: &Similarity) -> Self {
        Correction { shift: self.shift / world.scale, ..*self }
    }
}

pub(super) struct Cameras {
    config: Config,
    clocks: Option<TimeOffsets>,
    learns_offset: Vec<bool>,
    poses: Option<Poses>,
    /// Poses have been learnt already, perhaps in a shorter run.
    has_learnt_poses: bool,
    learns_pose: Vec<Option<DVec3>>,
    pose_rate: Rate,
    /// Radius of the scene, scene units.
    extent: f64,
    graded: Option<Graded>,
    /// Gradients of the cameras' parameters by image, if a step has several.
    kept: Option<Kept>,
    dt: f64,
    total: u64,
}

struct Kept {
    d_cameras: Buf<[f32; 4]>,
    /// Space for one grid if no camera has one.
    d_grids: Buf<[f32; 4]>,
}

/// vec4 of a camera's gradient, and of a grid.
const CAMERA_ROWS: usize = 3;
const GRID_ROWS: usize = GRID_NUMBERS / 4;

/// Bilateral grids, with buffers for pictures after them.
struct Graded {
    grids: Grids,
    /// Grids of cameras that film; they come first.
    n_filming: usize,
    /// By camera, its place among the grids.
    of_camera: Vec<Option<usize>>,
    /// See [`is_free`].
    is_free: bool,
    /// By place, steps of this grid so far, with those under way.
    steps: Vec<u64>,
    /// By place, steps that have ended well.
    ended: Vec<u64>,
    image: Buf<[f32; 4]>,
    d_image: Buf<[f32; 4]>,
}

#[derive(Clone, Copy)]
pub(super) struct OwnGrid {
    place: usize,
    step: u64,
}

#[derive(Clone, Copy)]
pub(super) struct Taken {
    pub camera: usize,
    pub grid: Option<OwnGrid>,
}

fn n_filming_grids(setup: &Setup) -> usize {
    setup.has_grid.iter().take(setup.first_photo).filter(|has| **has).count()
}

/// True if nothing fixes the tint that all cameras have in common: each camera that films has a grid, and all colours are
/// trained. Photographs do not fix it, since they show the light of another day.
fn is_free(config: &Config, setup: &Setup) -> bool {
    !config.holds_static && n_filming_grids(setup) == setup.n_filming
}

impl Graded {
    /// All the identity; none if no camera has one.
    fn new(gpu: &Gpu, config: &Config, setup: &Setup) -> Result<Option<Self>> {
        let is_free = is_free(config, setup);
        // The gauge binds all grids at once, and may turn out to be free only during the run.
        let may_be_free = is_free || (!config.holds_static && setup.has_grid.is_empty());
        let needed = setup.most_grids as u64 * (GRID_BYTES / 3);
        let limit = gpu.caps().max_binding_bytes;
        if may_be_free && needed > limit {
            return Err(Error::OutOfMemory {
                what: format!("the buffer of the colour maps of {} cameras", setup.most_grids),
                needed,
                limit,
                remedy: "train without them (--set grids=none), or with fewer cameras and photographs".to_owned(),
            });
        }
        let n_grids = setup.has_grid.iter().filter(|has| **has).count();
        if n_grids == 0 {
            return Ok(None);
        }
        let n_filming = n_filming_grids(setup);
        let mut place = 0..n_grids;
        Ok(Some(Graded {
            grids: Grids::new(gpu, n_grids)?.with_photos(n_grids - n_filming),
            n_filming,
            of_camera: setup.has_grid.iter().map(|has| if *has { place.next() } else { None }).collect(),
            is_free,
            steps: vec![0; n_grids],
            ended: vec![0; n_grids],
            image: gpu.alloc("image graded", 1)?,
            d_image: gpu.alloc("d image graded", 1)?,
        }))
    }
}

impl Cameras {
    pub fn new(gpu: &Gpu, config: &Config, setup: &Setup, total: u64) -> Result<Self> {
        let mut cameras = Cameras {
            config: config.clone(),
            clocks: None,
            learns_offset: setup.learns_offset.clone(),
            poses: None,
            has_learnt_poses: false,
            learns_pose: setup.learns_pose.clone(),
            pose_rate: setup.pose_rate,
            extent: setup.extent.radius,
            graded: Graded::new(gpu, config, setup)?,
            kept: None,
            dt: setup.dt,
            total,
        };
        if !cameras.learns_pose.is_empty() {
            let none = vec![PoseRows::default(); cameras.learns_pose.len() + 1];
            cameras.poses = Some(Poses::new(gpu, &none, &cameras.learns_pose)?);
        }
        if config.batch > 1 {
            let n = config.batch as usize;
            cameras.kept = Some(Kept {
                d_cameras: gpu.alloc("d cameras of a step", CAMERA_ROWS * n)?,
                d_grids: gpu.alloc("d grids of a step", if cameras.graded.is_some() { GRID_ROWS * n } else { 1 })?,
            });
        }
        if !setup.learns_offset.is_empty() {
            let zeros = vec![[0.0; 4]; setup.learns_offset.len()];
            cameras.clocks = Some(TimeOffsets::new(gpu, &zeros, &setup.learns_offset)?);
        }
        Ok(cameras)
    }

    pub fn wants_gradient(&self) -> bool {
        self.clocks.is_some() || self.poses.is_some()
    }

    pub fn grids(&self) -> Option<&Grids> {
        self.graded.as_ref().map(|graded| &graded.grids)
    }

    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        if let Some(graded) = &mut self.graded {
            graded.image = gpu.alloc("image graded", pixels)?;
            graded.d_image = gpu.alloc("d image graded", pixels)?;
        }
        Ok(())
    }

    /// The grid of `camera` in its next step, which is counted.
    pub fn next(&mut self, camera: usize) -> Option<OwnGrid> {
        let graded = self.graded.as_mut()?;
        let place = graded.of_camera.get(camera).copied().flatten()?;
        graded.steps[place] += 1;
        Some(OwnGrid { place, step: graded.steps[place] })
    }

    pub fn end(&mut self, grid: Option<OwnGrid>) {
        if let (Some(graded), Some(grid)) = (&mut self.graded, grid) {
            graded.ended[grid.place] = grid.step;
        }
    }

    /// Share of the run before step `step`.
    fn done(&self, step: u64) -> f64 {
        (step - 1) as f64 / self.total.max(1) as f64
    }

    /// The poses, if their learning has begun at step `step`.
    fn poses_at(&self, step: u64) -> Option<&Poses> {
        let has_begun = self.has_learnt_poses || self.done(step) >= POSES_FROM;
        self.poses.as_ref().filter(|_| has_begun)
    }

    /// True if step `step` reads the view that its image was seen from.
    pub fn reads_view(&self, step: u64) -> bool {
        self.poses_at(step).is_some()
    }

    pub fn record_view(&self, rec: &mut Recording, work: &Workspace, camera: usize, step: u64) {
        if let Some(poses) = self.poses_at(step) {
            poses.record_apply(rec, &work.view, camera as u32);
        }
        if let Some(clocks) = &self.clocks {
            clocks.record_apply(rec, &work.view, camera as u32);
        }
    }

    /// Appends the colour map of `grid` for a picture of `size`; gives the mapped picture.
    pub fn record_shown<'a>(
        &'a mut self,
        gpu: &Gpu,
        rec: &mut Recording,
        rendered: Pair<'a>,
        size: [u32; 2],
        grid: Option<OwnGrid>,
    ) -> Result<Pair<'a>> {
        let (Some(graded), Some(grid)) = (&mut self.graded, grid) else { return Ok(rendered) };
        graded.grids.fit(gpu, size[1])?;
        graded.grids.record_slice(rec, grid.place, rendered.image, &graded.image, size);
        Ok(Pair { image: &graded.image, cotangent: &graded.d_image })
    }

    pub fn record_back(&self, rec: &mut Recording, rendered: Pair, size: [u32; 2], grid: Option<OwnGrid>) {
        if let (Some(graded), Some(grid)) = (&self.graded, grid) {
            let back = GradedBack {
                image: rendered.image,
                d_graded: &graded.d_image,
                d_image: rendered.cotangent,
                size,
                tv_weight: terms::GRID_VARIATION_WEIGHT,
            };
            graded.grids.record_backward(rec, grid.place, &back);
        }
    }

    pub fn record_keep(&self, rec: &mut Recording, work: &Workspace, grid: Option<OwnGrid>, at: usize) {
        self.copies(work, grid, at).for_each(|[here, kept]| rec.copy(here, kept));
    }

    pub fn record_take(&self, rec: &mut Recording, work: &Workspace, grid: Option<OwnGrid>, at: usize) {
        self.copies(work, grid, at).for_each(|[here, kept]| rec.copy(kept, here));
    }

    /// Pairs of a present gradient and the place of that of image `at`.
    fn copies(&self, work: &Workspace, grid: Option<OwnGrid>, at: usize) -> impl Iterator<Item = [Slice; 2]> {
        let [of_camera, of_grid] = self.kept_parts(at);
        let d_camera = work.backward.as_ref().map(|backward| backward.d_camera.slice());
        let d_grid = self.graded.as_ref().filter(|_| grid.is_some()).map(|graded| graded.grids.d_grid.slice());
        let pairs = [d_camera.zip(of_camera), d_grid.zip(of_grid)].into_iter().flatten();
        pairs.map(|(here, kept)| [here, kept.slice()])
    }

    /// The kept gradients of the images `range` of a step, as bytes: equally many of each, in every process.
    pub fn kept(&self, gpu: &Gpu, range: Range<usize>) -> Result<Vec<Vec<u8>>> {
        let parts = |at: usize| self.kept_parts(at).into_iter().flatten().map(|part| gpu.read(&part));
        let of_image = |at| Ok(bytemuck::cast_slice(&parts(at).collect::<Result<Vec<_>>>()?.concat()).to_vec());
        range.map(of_image).collect()
    }

    /// Puts back what [`Cameras::kept`] of another process gave of image `at`.
    pub fn put_kept(&self, gpu: &Gpu, at: usize, bytes: &[u8]) -> Result<()> {
        let rows: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(bytes);
        let mut from = 0;
        for part in self.kept_parts(at).into_iter().flatten() {
            gpu.write(&part, &rows[from..from + part.len()])?;
            from += part.len();
        }
        Ok(())
    }

    /// The part of the cameras and that of the grids. Without a grid its part holds old values.
    fn kept_parts(&self, at: usize) -> [Option<Buf<[f32; 4]>>; 2] {
        let Some(kept) = &self.kept else { return [None, None] };
        let of_camera = self.wants_gradient().then(|| kept.d_cameras.range(CAMERA_ROWS * at, CAMERA_ROWS));
        let of_grid = self.graded.is_some().then(|| kept.d_grids.range(GRID_ROWS * at, GRID_ROWS));
        [of_camera, of_grid]
    }

    /// Appends step `step`, after the backward pass of its image `index`.
    pub fn record_step(&self, rec: &mut Recording, work: &Workspace, by: Taken, step: u64, index: usize) {
        let Taken { camera, grid } = by;
        let done = self.done(step);
        let Config { lr, loss, batch, .. } = &self.config;
        // The moments of the cameras decay with each image, as in steps of one image.
        let image = (step - 1).saturating_mul(u64::from(*batch)).saturating_add(index as u64 + 1);
        if let (Some(graded), Some(grid)) = (&self.graded, grid) {
            let at = GridStep {
                step: image,
                is_free: graded.is_free,
                is_affine: self.config.grids == GridKind::Affine,
                camera_step: grid.step,
                rate: GRID_RATE,
            };
            graded.grids.record_step(rec, grid.place, &at, &work.status);
        }
        let Some(backward) = &work.backward else { return };
        // A camera takes a step for each of its images.
        let pace = lr.pace.at(done, self.total.saturating_mul(u64::from(*batch)));
        if let Some(poses) = self.poses_at(step) {
            let at = PoseStep {
                camera: camera as u32,
                turn_rate: self.pose_rate.at(done) * pace,
                shift_rate: self.pose_rate.at(done) * pace * self.extent,
                most_shift: MOST_SHIFT * self.extent,
            };
            poses.record_step(rec, &backward.d_camera, &work.view, &work.status, &at);
        }
        let Some(clocks) = &self.clocks else { return };
        let at = TimeOffsetStep {
            camera: camera as u32,
            dt: self.dt,
            rate: OFFSET_RATE * pace,
            regulariser: loss.offset,
            step: image,
        };
        clocks.record_step(rec, &backward.d_camera, &work.status, &at);
    }

    /// Fixes the offsets of the cameras that `freeze` names at 0, and shifts the others to a mean of 0.
    pub fn freeze(&mut self, gpu: &Gpu, freeze: &[bool]) -> Result<()> {
        let Some(clocks) = &self.clocks else { return Ok(()) };
        let mut state = gpu.read(&clocks.state)?;
        let mut learns_offset = self.learns_offset.clone();
        for ((clock, learns), freeze) in state.iter_mut().zip(&mut learns_offset).zip(freeze) {
            if *learns && *freeze {
                (*clock, *learns) = ([0.0; 4], false);
            }
        }
        let free = || learns_offset.iter().enumerate().filter(|(_, learns)| **learns).map(|(camera, _)| camera);
        let mean = free().map(|k| f64::from(state[k][0])).sum::<f64>() / free().count().max(1) as f64;
        free().for_each(|k| state[k][0] = (f64::from(state[k][0]) - mean) as f32);
        self.clocks = Some(TimeOffsets::new(gpu, &state, &learns_offset)?);
        self.learns_offset = learns_offset;
        Ok(())
    }

    pub fn state(&self, gpu: &Gpu) -> Result<CameraState> {
        let clocks = self.clocks.as_ref().map_or(Ok(Vec::new()), |clocks| gpu.read(&clocks.state))?;
        let poses = self.poses.as_ref().map_or(Ok(Vec::new()), |poses| gpu.read(&poses.state))?;
        let poses = poses.as_chunks().0.to_vec();
        let own = CameraState { clocks, learns_offset: self.learns_offset.clone(), poses, ..CameraState::default() };
        let Some(graded) = &self.graded else { return Ok(own) };
        let has_grid = graded.of_camera.iter().map(Option::is_some).collect();
        Ok(CameraState { grids: graded.grids.download(gpu)?, grid_steps: graded.ended.clone(), has_grid, ..own })
    }

    pub fn restore(&mut self, gpu: &Gpu, state: &CameraState) -> Result<()> {
        self.learns_offset = state.learns_offset.clone();
        self.clocks = None;
        if !state.clocks.is_empty() {
            self.clocks = Some(TimeOffsets::new(gpu, &state.clocks, &state.learns_offset)?);
        }
        if self.config.poses == PoseKind::Auto && state.poses.is_empty() {
            (self.poses, self.learns_pose) = (None, Vec::new());
        }
        let check = |what: &str, found: usize, expected: usize| {
            let reason = || format!("has {what} of {found} cameras, the run of {expected}");
            let remedy = "go on with the capture and the test cameras that the run began with";
            let fault = || Error::data(Path::new("checkpoint"), "cameras", reason(), remedy);
            if found == expected { Ok(()) } else { Err(fault()) }
        };
        check("poses", state.poses.len().saturating_sub(1), self.learns_pose.len())?;
        if let Some([[_, _, decay, _], ..]) = state.poses.last() {
            // 1 - beta_2^steps of the row of all.
            self.has_learnt_poses = *decay > 0.0;
            self.poses = Some(Poses::new(gpu, &state.poses, &self.learns_pose)?);
        }
        let n_grids = self.graded.as_ref().map_or(0, |graded| graded.steps.len());
        check("bilateral grids", state.grids.len(), n_grids)?;
        if let Some(graded) = &mut self.graded {
            graded.grids = Grids::upload(gpu, &state.grids)?.with_photos(n_grids - graded.n_filming);
            graded.steps.clone_from(&state.grid_steps);
            graded.ended.clone_from(&state.grid_steps);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Config, Setup, is_free};
    use crate::scene::capture::Extent;

    #[test]
    fn the_tint_is_free_where_each_camera_that_films_has_a_grid_and_colours_are_trained() {
        // Three cameras, one of them for tests, and two photographs.
        let is_free = |has_grid: [bool; 5], holds_static: bool| {
            let plain = Setup::plain(Extent { center: [0.0; 3], radius: 1.0 }, 0.1);
            let setup = Setup { has_grid: has_grid.to_vec(), n_filming: 2, first_photo: 3, ..plain };
            is_free(&Config { holds_static, ..Config::default() }, &setup)
        };
        assert!(is_free([true, false, true, true, true], false));
        assert!(is_free([true, false, true, true, false], false), "a photograph holds no tint");
        assert!(!is_free([false, false, true, true, true], false), "a camera without a grid does");
        assert!(!is_free([true, false, true, true, true], true), "and so do colours that stay");
    }
}
