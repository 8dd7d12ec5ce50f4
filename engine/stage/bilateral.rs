//! Bilateral grids (Wang et al. 2024; SPEC 7): affine maps of colours for each camera, so that exposure, white balance and vignetting
//! need not be built out of Gaussians.

use super::adam::{EPS, correction};
use super::{BETA1, BETA2};
use crate::error::Result;
use crate::gpu::generated::constants::bilateral::{self as shared, PANELS, TEAM};
use crate::gpu::generated::{
    self, Status, bilateral_adam, bilateral_bwd, bilateral_gauge, bilateral_grade, bilateral_grade_bwd,
    bilateral_slice, bilateral_slice_bwd, bilateral_sum,
};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::vk::DeviceKind;

pub const GRID_SIZE: [usize; 3] = [shared::CELLS as usize, shared::CELLS as usize, shared::LEVELS as usize];
/// Numbers of a camera's grid: 3 x 4 for each cell, row by row, x fastest, then y, then luma.
pub const GRID_NUMBERS: usize = 12 * GRID_SIZE[0] * GRID_SIZE[1] * GRID_SIZE[2];
/// Bytes on the device for each camera: its grid and Adam's moments.
pub const GRID_BYTES: u64 = 3 * 4 * GRID_NUMBERS as u64;

const ROWS: usize = shared::GRID_ROWS as usize;
const PART_SUMS: usize = shared::PART_SUMS as usize;
/// Threads of a workgroup, which leaves one sum.
const LOCAL: usize = bilateral_slice::INFO.local as usize;

/// The grid of one camera with Adam's moments, on the host; each of [`GRID_NUMBERS`].
#[derive(Clone, Debug, PartialEq)]
pub struct GridState {
    pub grid: Vec<f32>,
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl GridState {
    pub fn identity() -> Self {
        const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let zeros = vec![0.0; GRID_NUMBERS];
        GridState { grid: IDENTITY.repeat(GRID_NUMBERS / 12), first: zeros.clone(), second: zeros }
    }

    /// True if every part has its length and no number that a step cannot go on from.
    pub fn is_sound(&self) -> bool {
        [&self.grid, &self.first, &self.second].iter().all(|part| part.len() == GRID_NUMBERS)
            && self.grid.iter().chain(&self.first).all(|x| x.is_finite())
            // The square of a large gradient may be infinite; Adam takes no step then.
            && self.second.iter().all(|x| *x >= 0.0)
    }

    pub fn identity_deviation(&self) -> f64 {
        let identity = Self::identity().grid;
        let squares: f64 = self.grid.iter().zip(identity).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (squares / GRID_NUMBERS as f64).sqrt()
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridStep {
    /// Number of the image in the run, from 1: the gauge is restored once in as many images as there are cameras,
    pub step: u64,
    /// if it is free: a camera without a grid fixes it.
    pub is_free: bool,
    /// True if all cells step alike, along the gradient that they have together. They must be alike before.
    pub is_affine: bool,
    /// Number of the step among this camera's, from 1: for the bias corrections.
    pub camera_step: u64,
    pub rate: f64,
}

pub struct Grids {
    n_cameras: usize,
    /// Those of them that film; they come first.
    n_filming: usize,
    grids: Buf<[f32; 4]>,
    first: Buf<[f32; 4]>,
    second: Buf<[f32; 4]>,
    /// Gradient of the grid of the camera at hand, [`GRID_NUMBERS`].
    pub d_grid: Buf<[f32; 4]>,
    /// Total variation of that grid before the step, unweighted: sums by workgroup, in the first number.
    pub tv_sums: Buf<[f32; 4]>,
    partials: Buf<[f32; 4]>,
    is_for_gpus: bool,
}

/// Cotangents of a picture as a camera shows it, and where those of the picture itself go; 16 bytes a pixel each.
#[derive(Clone, Copy)]
pub struct GradedBack<'a> {
    /// The picture: colour in the first three channels.
    pub image: &'a Buf<[f32; 4]>,
    pub d_graded: &'a Buf<[f32; 4]>,
    /// The cotangent of `image`, with 0 in its fourth channel.
    pub d_image: &'a Buf<[f32; 4]>,
    pub size: [u32; 2],
    /// Weight of the camera's total variation in the loss (SPEC 6: 10).
    pub tv_weight: f64,
}

/// How the pixels of a picture are dealt out: pixel rows of a part, and parts down a panel.
#[derive(Clone, Copy)]
struct Parts {
    rows: u32,
    down: u32,
}

impl Parts {
    fn new(height: u32) -> Self {
        // The four columns of cells at a part's corners are read, and summed, once.
        const MOST_ROWS: u32 = 8;
        let panel_rows = height.div_ceil(PANELS);
        let down = panel_rows.div_ceil(MOST_ROWS).max(1);
        Parts { rows: panel_rows.div_ceil(down).max(1), down }
    }

    fn count(self) -> u32 {
        PANELS * PANELS * self.down
    }

    fn n_sums(self) -> usize {
        self.count() as usize * PART_SUMS
    }

    fn teams(self) -> Grid {
        Grid::Threads(TEAM * self.count())
    }

    fn groups(self) -> Grid {
        Grid::Groups(self.count())
    }
}

impl Grids {
    /// A grid for each of `n_cameras` cameras, all the identity. Every camera must be trained: the gauge spreads the mean over all. With
    /// one camera it keeps the grid at the identity, since nothing tells its tint from the scene's.
    pub fn new(gpu: &Gpu, n_cameras: usize) -> Result<Self> {
        Self::upload(gpu, &vec![GridState::identity(); n_cameras])
    }

    /// Grids that go on from `states`, one for each camera; all of them [`GridState::is_sound`].
    pub fn upload(gpu: &Gpu, states: &[GridState]) -> Result<Self> {
        let all = |name: &str, of: fn(&GridState) -> &Vec<f32>| {
            let numbers: Vec<f32> = states.iter().flat_map(of).copied().collect();
            gpu.upload::<[f32; 4]>(name, bytemuck::cast_slice(&numbers))
        };
        Ok(Grids {
            n_cameras: states.len(),
            n_filming: states.len(),
            grids: all("bilateral grids", |s| &s.grid)?,
            first: all("bilateral first moments", |s| &s.first)?,
            second: all("bilateral second moments", |s| &s.second)?,
            d_grid: gpu.alloc("d bilateral grid", ROWS)?,
            tv_sums: gpu.alloc("bilateral variation sums", ROWS.div_ceil(LOCAL))?,
            partials: gpu.alloc("bilateral partials", 0)?,
            // As wide as no CPU driver's subgroups are: a GPU's, which a test emulates.
            is_for_gpus: gpu.caps().kind != DeviceKind::Cpu || gpu.caps().subgroup_size >= 32,
        })
    }

    /// These with the kernels of GPUs or of CPU drivers, whatever the device is; for tests.
    pub fn by_kernels_for_gpus(self, is_for_gpus: bool) -> Self {
        Grids { is_for_gpus, ..self }
    }

    /// These grids, the last `n` of which are those of photographs. Their common tint is the light of another day, so the mean that the
    /// gauge subtracts leaves them out.
    pub fn with_photos(self, n: usize) -> Self {
        Grids { n_filming: self.n_cameras - n, ..self }
    }

    pub fn download(&self, gpu: &Gpu) -> Result<Vec<GridState>> {
        let [grids, first, second] = [&self.grids, &self.first, &self.second].map(|buffer| gpu.read(buffer));
        let (grids, first, second) = (grids?, first?, second?);
        let of = |all: &[[f32; 4]], camera: usize| all[camera * ROWS..(camera + 1) * ROWS].as_flattened().to_vec();
        let state =
            |camera| GridState { grid: of(&grids, camera), first: of(&first, camera), second: of(&second, camera) };
        Ok((0..self.n_cameras).map(state).collect())
    }

    pub fn n_cameras(&self) -> usize {
        self.n_cameras
    }

    /// Bytes of scratch of a backward pass on pictures of `height` rows.
    pub fn scratch_bytes(height: u32) -> u64 {
        16 * Parts::new(height).n_sums() as u64
    }

    /// Makes room for the backward pass of pictures of `height` rows.
    pub fn fit(&mut self, gpu: &Gpu, height: u32) -> Result<()> {
        let needed = Parts::new(height).n_sums();
        if needed > self.partials.len() {
            self.partials = gpu.alloc("bilateral partials", needed)?;
        }
        Ok(())
    }

    fn of_camera(&self, buffer: &Buf<[f32; 4]>, camera: usize) -> Buf<[f32; 4]> {
        buffer.range(camera * ROWS, ROWS)
    }

    /// Appends the slicing: `graded` becomes `image` (colour in the first three channels, `[height][width]`) as `camera`
    /// shows it; the fourth channel is copied. The identity grid gives every finite colour its bits.
    pub fn record_slice(
        &self,
        rec: &mut Recording,
        camera: usize,
        image: &Buf<[f32; 4]>,
        graded: &Buf<[f32; 4]>,
        [width, height]: [u32; 2],
    ) {
        rec.section("bilateral");
        let parts = Parts::new(height);
        let camera_grid = &self.of_camera(&self.grids, camera);
        let (rows, down) = (parts.rows, parts.down);
        if self.is_for_gpus {
            let push = bilateral_grade::Push { width, height, rows, parts: down };
            rec.pass(bilateral_grade::Args { camera_grid, image, graded }, push, parts.groups());
        } else {
            let push = bilateral_slice::Push { width, height, rows, parts: down };
            rec.pass(bilateral_slice::Args { camera_grid, image, graded }, push, parts.teams());
        }
    }

    /// Appends the adjoint of `record_slice`, which sets [`Grids::d_grid`], the total variation's share included, and
    /// [`Grids::tv_sums`]. Needs [`Grids::fit`].
    pub fn record_backward(&self, rec: &mut Recording, camera: usize, back: &GradedBack) {
        rec.section("bilateral");
        let GradedBack { image, d_graded, d_image, size: [width, height], tv_weight } = *back;
        let parts = Parts::new(height);
        let camera_grid = &self.of_camera(&self.grids, camera);
        let Grids { d_grid, tv_sums, .. } = self;
        let partials = &self.partials.range(0, parts.n_sums());
        let (rows, down) = (parts.rows, parts.down);
        if self.is_for_gpus {
            let args = bilateral_grade_bwd::Args { camera_grid, image, d_graded, d_image, partials };
            let push = bilateral_grade_bwd::Push { width, height, rows, parts: down };
            rec.pass(args, push, parts.groups());
        } else {
            let push = bilateral_slice_bwd::Push { width, height, rows, parts: down };
            rec.pass(bilateral_slice_bwd::Args { camera_grid, image, d_graded, d_image }, push, parts.teams());
            let push = bilateral_bwd::Push { width, height, rows, parts: down };
            rec.pass(bilateral_bwd::Args { image, d_graded, partials }, push, parts.teams());
        }
        let args = bilateral_sum::Args { partials, camera_grid, d_grid, sums: tv_sums };
        let push = bilateral_sum::Push { parts: down, tv_weight: tv_weight as f32 };
        rec.pass(args, push, Grid::Threads(ROWS as u32));
    }

    /// Appends the step of `camera`'s grid along [`Grids::d_grid`]; then, when it is due, the gauge. No step when the frame failed.
    ///
    /// The gauge reads and writes all grids, so it is restored once in as many steps as there are cameras. In between the mean strays
    /// by about one learning rate, since Adam moves one camera by that much a step.
    pub fn record_step(&self, rec: &mut Recording, camera: usize, step: &GridStep, frame_status: &Buf<Status>) {
        rec.section("bilateral");
        let [camera_grid, first, second] = [&self.grids, &self.first, &self.second].map(|b| self.of_camera(b, camera));
        let (camera_grid, first, second) = (&camera_grid, &first, &second);
        let args = bilateral_adam::Args { frame_status, camera_grid, d_grid: &self.d_grid, first, second };
        let push = bilateral_adam::Push {
            rate: (step.rate / correction(BETA1, step.camera_step)) as f32,
            beta1: BETA1 as f32,
            beta2: BETA2 as f32,
            inverse_c2: (1.0 / correction(BETA2, step.camera_step)) as f32,
            eps: EPS,
        };
        let work = if step.is_affine { Grid::Groups(3) } else { Grid::Threads(ROWS as u32) };
        rec.pass_variant(generated::bilateral_adam(step.is_affine), args, push, work);
        if step.is_free && step.step.is_multiple_of(self.n_cameras as u64) {
            rec.pass(
                bilateral_gauge::Args { frame_status, grids: &self.grids },
                bilateral_gauge::Push { n_cameras: self.n_cameras as u32, n_filming: self.n_filming as u32 },
                Grid::Threads(ROWS as u32),
            );
            rec.scale(self.n_cameras as f64);
        }
    }
}
