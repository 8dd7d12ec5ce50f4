//! A picture through a bilateral grid, on the device, in the twin and in dual numbers.

use crate::extremes::random::Random;
use crate::gpu::generated::Status;
use crate::gpu::{Buf, Gpu, Recording};
use crate::stage::{GridState, GridStep, Grids};
use crate::twin::{BilateralGrid, Dual};
use anyhow::{Result, ensure};

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];
const ALPHA: f32 = 0.25;

/// A picture, its cotangent, and the grid that it is seen through.
#[derive(Clone)]
pub struct Case {
    /// Width and height.
    pub size: [u32; 2],
    /// The camera's grid.
    pub state: GridState,
    /// Colours.
    pub image: Vec<[f32; 3]>,
    /// The cotangent of the graded picture.
    pub d_graded: Vec<[f32; 3]>,
}

/// What the device makes of a case.
#[derive(Clone, Debug)]
pub struct Found {
    /// The picture through the grid.
    pub graded: Vec<[f32; 3]>,
    /// The cotangent of the picture.
    pub d_image: Vec<[f32; 3]>,
    /// The gradient of the grid.
    pub d_grid: Vec<f32>,
}

/// A grid that differs from the identity by up to `amount` everywhere.
pub fn random_grid(random: &mut Random, amount: f64) -> GridState {
    let mut state = GridState::identity();
    state.grid.iter_mut().for_each(|x| *x += random.uniform(-amount, amount) as f32);
    state
}

impl Case {
    /// Noise through a random grid.
    pub fn random(seed: u64, size: [u32; 2]) -> Self {
        let mut random = Random::new(seed);
        let n = size[0] * size[1];
        let image = (0..n).map(|_| random.vector(-0.1, 1.1)).collect();
        let d_graded = (0..n).map(|_| random.vector(-1.0, 1.0)).collect();
        Case { size, state: random_grid(&mut random, 0.2), image, d_graded }
    }

    /// The device's, with a guard behind the last pixel.
    ///
    /// # Errors
    /// Those of the device, and a number that was written and should not have been.
    pub fn on_device(&self, gpu: &Gpu) -> Result<Found> {
        // The camera in the middle of three, and scratch for a larger picture.
        let other = random_grid(&mut Random::new(99), 5.0);
        let mut grids = Grids::upload(gpu, &[other.clone(), self.state.clone(), other])?;
        grids.fit(gpu, self.size[1] + 40)?;
        let with = |colors: &[[f32; 3]], alpha| -> Vec<[f32; 4]> {
            colors.iter().map(|[r, g, b]| [*r, *g, *b, alpha]).chain([GUARD]).collect()
        };
        let image = gpu.upload("image", &with(&self.image, ALPHA))?;
        let d_graded = gpu.upload("d graded", &with(&self.d_graded, 7.0))?;
        let guarded = vec![GUARD; self.image.len() + 1];
        let (graded, d_image) = (gpu.upload("graded", &guarded)?, gpu.upload("d image", &guarded)?);
        let mut rec = Recording::new();
        grids.record_slice(&mut rec, 1, &image, &graded, self.size);
        grids.record_backward(&mut rec, 1, &image, &d_graded, &d_image, self.size);
        gpu.run(&rec)?;
        let read = |buffer: &Buf<[f32; 4]>, fourth: f32| -> Result<Vec<[f32; 3]>> {
            let mut all = gpu.read(buffer)?;
            ensure!(all.pop() == Some(GUARD), "the pixel past the end was overwritten");
            ensure!(all.iter().all(|pixel| pixel[3] == fourth), "{:?}: fourth channel", self.size);
            Ok(all.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
        };
        let d_grid = gpu.read(&grids.d_grid)?.as_flattened().to_vec();
        Ok(Found { graded: read(&graded, ALPHA)?, d_image: read(&d_image, 0.0)?, d_grid })
    }

    fn size(&self) -> [usize; 2] {
        self.size.map(|n| n as usize)
    }

    /// The graded picture.
    pub fn truth(&self) -> Vec<[f64; 3]> {
        let numbers: Vec<f64> = self.state.grid.iter().map(|x| f64::from(*x)).collect();
        let image: Vec<[f64; 3]> = self.image.iter().map(|c| c.map(f64::from)).collect();
        BilateralGrid::new(&numbers).slice(&image, self.size())
    }

    /// The derivative of the graded picture along a direction of the grid and of the picture.
    pub fn along(&self, of_grid: &[f64], of_image: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let grid: Vec<Dual> = self.state.grid.iter().zip(of_grid).map(|(x, t)| Dual::new((*x).into(), *t)).collect();
        let dual = |(x, t): (&[f32; 3], &[f64; 3])| std::array::from_fn(|k| Dual::new(x[k].into(), t[k]));
        let image: Vec<[Dual; 3]> = self.image.iter().zip(of_image).map(dual).collect();
        let graded = BilateralGrid::new(&grid).slice(&image, self.size());
        graded.iter().map(|pixel| pixel.map(|x| x.tangent)).collect()
    }
}

/// One step of `camera` along `d_grid`.
///
/// # Errors
/// Those of the device.
pub fn step(gpu: &Gpu, grids: &Grids, camera: usize, d_grid: &[f32], step: &GridStep, failed: u32) -> Result<()> {
    let status = gpu.upload("status", &[Status { failed, ..Status::default() }])?;
    gpu.write(&grids.d_grid, d_grid.as_chunks().0)?;
    let mut rec = Recording::new();
    grids.record_step(&mut rec, camera, step, &status);
    Ok(gpu.run(&rec)?)
}
