//! The losses against priors of depth and flow on the device, against dual numbers.

use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::gpu::Recording;
use ivv::scene::capture::prior_word;
use ivv::stage::{DepthSpace, PriorLoss, PriorWeights};
use ivv::twin::{Dual, depth_loss, flow_loss};

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];
const SPACES: [DepthSpace; 2] = [DepthSpace::Inverse, DepthSpace::Metric];

/// A rendered picture's depth, inverse depth and flow, and its priors.
struct Case {
    image1: Vec<[f32; 4]>,
    depth: Vec<f32>,
    flow: Vec<[f32; 2]>,
    counts: Vec<bool>,
}

struct Found {
    values: [f64; 2],
    d_image1: Vec<[f32; 4]>,
}

impl Case {
    /// Noise; some pixels are hidden, some have no prior, some are exactly right.
    fn random(seed: u64, n: usize) -> Case {
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

    fn weights(&self) -> PriorWeights {
        let zeros = vec![0.0; self.depth.len()];
        let n_depth = depth_loss(&zeros, &self.depth, &self.counts).1 as u32;
        let n_flow = flow_loss(&vec![[0.0; 2]; zeros.len()], &self.flow, &self.counts).1 as u32;
        PriorWeights { depth: 0.7, flow: 1.3, n_depth, n_flow }
    }

    fn on_device(&self, space: DepthSpace) -> Found {
        let gpu = gpu();
        let (n, weights) = (self.image1.len(), self.weights());
        let loss = PriorLoss::new(&gpu, n + 5, space).unwrap();
        let words: Vec<[u32; 2]> = self.depth.iter().zip(&self.flow).map(|(d, f)| prior_word(*d, *f)).collect();
        gpu.write(&loss.priors, &words).unwrap();
        let truth: Vec<u32> =
            self.counts.iter().map(|counts| if *counts { 0xff12_3456 } else { 0x0012_3456 }).collect();
        let truth = gpu.upload("truth", &truth).unwrap();
        let image1 = gpu.upload("image 1", &self.image1).unwrap();
        let d_image1 = gpu.upload("d image 1", &vec![GUARD; n + 1]).unwrap();
        let mut rec = Recording::new();
        loss.record(&mut rec, &image1, &truth, &d_image1, n as u32, &weights);
        gpu.run(&rec).unwrap();
        let mut d_image1 = gpu.read(&d_image1).unwrap();
        assert_eq!(d_image1.pop(), Some(GUARD), "the pixel past the end was overwritten");
        Found { values: PriorLoss::values(gpu.read(&loss.sums).unwrap()[0], &weights), d_image1 }
    }

    /// The weighted loss with a derivative along `w`.
    fn dual(&self, space: DepthSpace, w: &[[f32; 4]]) -> [Dual; 2] {
        let dual = |i: usize, k: usize| Dual::new(self.image1[i][k].into(), w[i][k].into());
        let column = if space == DepthSpace::Metric { 0 } else { 1 };
        let depth: Vec<Dual> = (0..w.len()).map(|i| dual(i, column)).collect();
        let flow: Vec<[Dual; 2]> = (0..w.len()).map(|i| [dual(i, 2), dual(i, 3)]).collect();
        [depth_loss(&depth, &self.depth, &self.counts).0, flow_loss(&flow, &self.flow, &self.counts).0]
    }
}

#[test]
fn values_and_cotangents_are_those_of_dual_numbers() {
    for n in [1, 2, 63, 64, 65, 1000] {
        for space in SPACES {
            let case = Case::random(5, n);
            let found = case.on_device(space);
            let weights = case.weights();
            let mut random = Random::new(6);
            let w: Vec<[f32; 4]> = (0..n).map(|_| random.vector(-1.0, 1.0)).collect();
            let [depth, flow] = case.dual(space, &w);
            for (found, truth) in found.values.into_iter().zip([depth, flow]) {
                assert!((found - truth.value).abs() <= 1e-6 * truth.value, "{n}: {found} for {truth:?}");
            }
            let along = |a: &[f32; 4], b: &[f32; 4]| (0..4).map(|k| f64::from(a[k]) * f64::from(b[k])).sum::<f64>();
            let sum: f64 = found.d_image1.iter().zip(&w).map(|(d, w)| along(d, w)).sum();
            let truth = weights.depth * depth.tangent + weights.flow * flow.tangent;
            let norm = found.d_image1.iter().map(|d| along(d, d)).sum::<f64>().sqrt();
            assert!(n < 63 || norm > 0.0, "{n}: no cotangent");
            assert!((sum - truth).abs() <= 1e-6 * norm * (4.0 * n as f64).sqrt(), "{n}, {space:?}: {sum} for {truth}");
            for (i, d) in found.d_image1.iter().enumerate() {
                assert!(case.counts[i] || *d == [0.0; 4], "{n}: hidden pixel {i} has {d:?}");
                let other = if space == DepthSpace::Metric { d[1] } else { d[0] };
                assert!(d.iter().all(|x| x.is_finite()) && other == 0.0, "{n}: pixel {i} has {d:?}");
                assert!(case.depth[i].is_finite() || d[..2] == [0.0; 2], "{n}: pixel {i} has no prior of depth: {d:?}");
            }
        }
    }
}

#[test]
fn n20_no_error_has_exactly_no_cotangent() {
    let mut case = Case::random(8, 300);
    // Sizes down to where squares underflow; the first is not a half, and is given as one that is.
    for (i, pixel) in case.image1.iter_mut().enumerate() {
        let scale = f32::exp2(-((i % 24) as f32));
        *pixel = [0.75 * scale, 1.25 * scale, 0.5 * scale, -scale];
        (case.depth[i], case.flow[i], case.counts[i]) = (pixel[1], [pixel[2], pixel[3]], true);
    }
    let found = case.on_device(DepthSpace::Inverse);
    assert_eq!(case.weights().n_flow, 300);
    assert_eq!(found.values, [0.0; 2]);
    assert!(found.d_image1.iter().all(|d| d.iter().all(|x| *x == 0.0)), "{:?}", found.d_image1);
    // An error whose square underflows has no direction.
    case.image1.iter_mut().for_each(|pixel| *pixel = [0.0, 1e-30, 1e-30, -1e-30]);
    case.depth.fill(0.0);
    case.flow.fill([0.0; 2]);
    let found = case.on_device(DepthSpace::Inverse);
    assert!(found.d_image1.iter().all(|d| d.iter().all(|x| x.is_finite())));
    assert!(found.d_image1.iter().all(|d| d[1] > 0.0), "the depth's error has a sign at any size");
}

#[test]
fn poison_in_the_picture_stays_in_its_pixel() {
    let mut case = Case::random(9, 200);
    case.counts.fill(true);
    case.image1[70] = [f32::NAN, f32::INFINITY, f32::NAN, f32::NEG_INFINITY];
    let found = case.on_device(DepthSpace::Inverse);
    let others = found.d_image1.iter().enumerate().filter(|(i, _)| *i != 70);
    assert!(others.clone().all(|(_, d)| d.iter().all(|x| x.is_finite())));
    assert!(others.filter(|(_, d)| **d != [0.0; 4]).count() > 100);
}
