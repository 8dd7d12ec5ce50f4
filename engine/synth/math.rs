//! Arithmetic that gives the same bits on every machine: IEEE 754 fixes +, -, *, / and sqrt, not sin or cos.

use crate::scene;
use glam::{DMat3, DVec3};
use std::f64::consts::FRAC_2_PI;

/// pi / 2 in two parts: the first has 33 significant bits, so that small multiples of it are exact.
const FRAC_PI_2_HIGH: f64 = 1.570_796_326_734_125_6;
const FRAC_PI_2_LOW: f64 = 6.077_100_506_506_192e-11;

/// Sine and cosine of an angle of at most about 1e6 radians, to a few units of 1e-16.
pub(super) fn sin_cos(angle: f64) -> (f64, f64) {
    let quarter = (angle * FRAC_2_PI).round();
    let r = (angle - quarter * FRAC_PI_2_HIGH) - quarter * FRAC_PI_2_LOW;
    // Taylor's series about 0 for |r| <= pi / 4, up to r^17: the next term is below 1e-18.
    let square = r * r;
    let series = |first: f64, mut order: f64| {
        let (mut term, mut sum) = (first, first);
        for _ in 0..8 {
            term *= -square / ((order + 1.0) * (order + 2.0));
            sum += term;
            order += 2.0;
        }
        sum
    };
    let (sin, cos) = (series(r, 1.0), series(1.0, 0.0));
    match (quarter as i64).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The rotation by `angle` about the unit vector `axis` (Rodrigues).
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = sin_cos(angle);
    let column = |unit: DVec3| unit * cos + axis.cross(unit) * sin + axis * (axis.dot(unit) * (1.0 - cos));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// The unit quaternion (w, x, y, z), w >= 0, of a rotation.
pub(super) fn quaternion(rotation: &DMat3) -> [f64; 4] {
    scene::quaternion(&rotation.transpose().to_cols_array_2d())
}

/// Steele, Lea and Flood's mixing function.
fn mix(value: u64) -> u64 {
    let z = (value ^ value >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// A hash of several numbers.
pub(super) fn hash(parts: &[u64]) -> u64 {
    parts.iter().fold(0, |state: u64, part| mix(state.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ mix(*part)))
}

/// What a stream of random numbers is for; each stream is independent of the others.
#[derive(Clone, Copy)]
pub(super) enum Stream {
    World,
    Rig,
    TimeOffsets,
    Colors,
    Sensor,
    Flow,
    DepthAffine,
    Depth,
    Points,
    Observations,
    Sound,
    Keypoints,
}

/// SplitMix64.
pub(super) struct Random(u64);

impl Random {
    /// The stream for one purpose and one item, whatever was drawn for other items, and in whatever order.
    pub fn new(seed: u64, stream: Stream, camera: usize, frame: u32) -> Self {
        Random(hash(&[seed, stream as u64, camera as u64, u64::from(frame)]))
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in `[low, high)`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Nearly normal with mean 0 and standard deviation 1: four uniform numbers summed, so never beyond
    /// [`NORMAL_BOUND`].
    pub fn normal(&mut self) -> f64 {
        let bits = self.bits();
        let sum: u64 = (0..4).map(|i| bits >> (16 * i) & 0xffff).sum();
        // Each of the four has the variance 1/12 of its range.
        (sum as f64 / 65_536.0 - 2.0) * NORMAL_BOUND / 2.0
    }

    pub fn normal3(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// Largest magnitude of [`Random::normal`], 2 sqrt 3.
pub(super) const NORMAL_BOUND: f64 = 3.464_101_615_137_755;

/// Smooth noise in [0, 1]: random values on the integer lattice, blended between.
pub(super) fn value_noise(at: DVec3, seed: u64) -> f64 {
    let cell = at.floor();
    let fraction = at - cell;
    let blend = fraction * fraction * (DVec3::splat(3.0) - 2.0 * fraction);
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let side = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let lattice = (cell + side).to_array().map(|v| v as i64 as u64);
        let value = (hash(&[seed, lattice[0], lattice[1], lattice[2]]) >> 11) as f64 / (1_u64 << 53) as f64;
        let weight = side * blend + (DVec3::ONE - side) * (DVec3::ONE - blend);
        sum += value * weight.x * weight.y * weight.z;
    }
    sum
}

/// Three octaves of [`value_noise`], in [0, 1].
pub(super) fn fractal_noise(at: DVec3, seed: u64) -> f64 {
    (4.0 * value_noise(at, seed) + 2.0 * value_noise(at * 2.0, seed ^ 1) + value_noise(at * 4.0, seed ^ 2)) / 7.0
}
