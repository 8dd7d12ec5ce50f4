//! The losses of depth and flow against priors, on the device and in dual numbers.

use crate::extremes::random::Random;
use crate::gpu::{Gpu, Recording};
use crate::scene::capture::prior_word;
use crate::stage::{DepthSpace, PriorLoss, PriorWeights};
use crate::twin::{Dual, depth_loss, flow_loss};
use anyhow::{Result, ensure};

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];

/// A rendered picture's depth, inverse depth and flow, and its priors.
#[derive(Clone)]
pub struct Case {
    /// Depth, inverse depth, flow.
    pub image1: Vec<[f32; 4]>,
    /// The prior, in the space that is compared.
    pub depth: Vec<f32>,
    /// The prior, pixels.
    pub flow: Vec<[f32; 2]>,
    /// Whether the mask shows the pixel.
    pub counts: Vec<bool>,
}

/// What the device makes of a case.
pub struct Found {
    /// Losses of depth and of flow.
    pub values: [f64; 2],
    /// The cotangent of `image1`.
    pub d_image1: Vec<[f32; 4]>,
}

impl Case {
    /// Noise; some pixels are hidden, some have no prior, some are exactly right.
    pub fn random(seed: u64, n: usize) -> Case {
        let mut random = Random::new(seed);
        let image1: Vec<[f32; 4]> = (0..n).map(|_| random.vector(-3.0, 3.0)).collect();
        let depth = (0..n).map(|i| match i % 7 {
            3 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3],
            5 => image1[i][1],
            _ => random.uniform(-3.0, 3.0) as f32,
        });
        let depth = depth.collect();
        // Halves, so that the device is given what the twin is.
        let flow = (0..n).map(|i| match i % 6 {
            1 => [f32::NAN, 0.0],
            4 => [0.5, f32::INFINITY],
            _ => random.vector::<2>(-40.0, 40.0).map(|x| (x * 8.0).round() / 8.0),
        });
        Case { image1, depth, flow: flow.collect(), counts: (0..n).map(|i| i % 5 != 2).collect() }
    }

    /// Both losses weighted.
    pub fn weights(&self) -> PriorWeights {
        let zeros = vec![0.0; self.depth.len()];
        let n_depth = depth_loss(&zeros, &self.depth, &self.counts).1 as u32;
        let n_flow = flow_loss(&vec![[0.0; 2]; zeros.len()], &self.flow, &self.counts).1 as u32;
        PriorWeights { depth: 0.7, flow: 1.3, n_depth, n_flow }
    }

    /// The device's, in a scratch for more pixels, with a guard behind the last.
    ///
    /// # Errors
    /// Those of the device, and a pixel that was written and should not have been.
    pub fn on_device(&self, gpu: &Gpu, space: DepthSpace) -> Result<Found> {
        let (n, weights) = (self.image1.len(), self.weights());
        let loss = PriorLoss::new(gpu, n + 5, space)?;
        let words: Vec<[u32; 2]> = self.depth.iter().zip(&self.flow).map(|(d, f)| prior_word(*d, *f)).collect();
        gpu.write(&loss.priors, &words)?;
        let truth: Vec<u32> =
            self.counts.iter().map(|counts| if *counts { 0xff12_3456 } else { 0x0012_3456 }).collect();
        let truth = gpu.upload("truth", &truth)?;
        let image1 = gpu.upload("image 1", &self.image1)?;
        let d_image1 = gpu.upload("d image 1", &vec![GUARD; n + 1])?;
        let mut rec = Recording::new();
        loss.record(&mut rec, &image1, &truth, &d_image1, n as u32, &weights);
        gpu.run(&rec)?;
        let mut d_image1 = gpu.read(&d_image1)?;
        ensure!(d_image1.pop() == Some(GUARD), "the pixel past the end was overwritten");
        Ok(Found { values: PriorLoss::values(gpu.read(&loss.sums)?[0], &weights), d_image1 })
    }

    /// The weighted loss with a derivative along `w`.
    pub fn dual(&self, space: DepthSpace, w: &[[f32; 4]]) -> [Dual; 2] {
        let dual = |i: usize, k: usize| Dual::new(self.image1[i][k].into(), w[i][k].into());
        let column = if space == DepthSpace::Metric { 0 } else { 1 };
        let depth: Vec<Dual> = (0..w.len()).map(|i| dual(i, column)).collect();
        let flow: Vec<[Dual; 2]> = (0..w.len()).map(|i| [dual(i, 2), dual(i, 3)]).collect();
        [depth_loss(&depth, &self.depth, &self.counts).0, flow_loss(&flow, &self.flow, &self.counts).0]
    }
}
