//! Estimates as of networks: noisy optical flow, and depth in units of its own.

use super::cast::Picture;
use super::math::{self, Stream, value_noise};
use super::options::{Noise, Options};
use super::rig::Camera;
use glam::{DVec2, DVec3};

/// Noise of the flow, pixels: a constant part (at most 0.085, below SPEC 5's threshold of 0.1), and one that grows with the flow.
pub(super) const FLOW_NOISE: f64 = 0.017;
pub(super) const FLOW_RELATIVE_NOISE: f64 = 0.03;
/// Relative noise of the inverse depth: pixel by pixel, and smooth over the picture (largest magnitude).
pub(super) const DEPTH_NOISE: f64 = 0.01;
pub(super) const DEPTH_SMOOTH_NOISE: f64 = 0.03;

pub(super) fn flow(picture: &Picture, options: &Options, index: usize, frame: u32) -> Vec<[f32; 2]> {
    let mut random = math::random(options.seed, Stream::Flow, index, frame);
    let noisy = options.noise != Noise::None;
    let estimate = |&exact: &DVec2| {
        let spread = if noisy { FLOW_NOISE + FLOW_RELATIVE_NOISE * exact.length() } else { 0.0 };
        (exact + DVec2::new(random.nearly_normal(), random.nearly_normal()) * spread).as_vec2().to_array()
    };
    picture.flow.iter().map(estimate).collect()
}

/// The hidden (scale, shift) of a picture's depth prior: inverse depth = scale * prior + shift, up to the noise.
pub(super) fn depth_affine(options: &Options, index: usize, frame: u32) -> (f64, f64) {
    let mut random = math::random(options.seed, Stream::DepthAffine, index, frame);
    (random.uniform(0.4, 1.6), random.uniform(-0.15, 0.15))
}

pub(super) fn depth(picture: &Picture, options: &Options, index: usize, camera: &Camera, frame: u32) -> Vec<f32> {
    let (scale, shift) = depth_affine(options, index, frame);
    let mut random = math::random(options.seed, Stream::Depth, index, frame);
    let noisy = options.noise != Noise::None;
    let seed = random.bits();
    let width = camera.intrinsics.width as usize;
    let estimate = |(pixel, depth): (usize, &f64)| {
        let mut relative = 1.0;
        if noisy {
            let at = DVec3::new((pixel % width) as f64, (pixel / width) as f64, 0.0) * (5.0 / width as f64);
            relative += DEPTH_NOISE * random.nearly_normal() + DEPTH_SMOOTH_NOISE * (2.0 * value_noise(at, seed) - 1.0);
        }
        ((relative / depth - shift) / scale) as f32
    };
    picture.depth.iter().enumerate().map(estimate).collect()
}
