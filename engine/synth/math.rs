//! Arithmetic that gives the same bits on every machine: IEEE 754 fixes +, -, *, / and sqrt, not sin or cos.

use crate::random::{Random, hash, unit};
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

pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = sin_cos(angle);
    let column = |unit: DVec3| unit * cos + axis.cross(unit) * sin + axis * (axis.dot(unit) * (1.0 - cos));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// The use of a stream of random numbers; each stream is independent of the others.
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
    Bends,
    Photos,
}

/// The numbers for one purpose and one item, whatever was drawn for other items, and in whatever order.
pub(super) fn random(seed: u64, stream: Stream, camera: usize, frame: u32) -> Random {
    Random::of_key(&[seed, stream as u64, camera as u64, u64::from(frame)])
}

pub(super) fn normal3(random: &mut Random) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.nearly_normal()))
}

/// Smooth noise in [0, 1]: random values on the integer lattice, blended between.
pub(super) fn value_noise(at: DVec3, seed: u64) -> f64 {
    let cell = at.floor();
    let fraction = at - cell;
    let blend = fraction * fraction * (DVec3::splat(3.0) - 2.0 * fraction);
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let side = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let lattice = (cell + side).to_array().map(|v| v as i64 as u64);
        let value = unit(hash(&[seed, lattice[0], lattice[1], lattice[2]]));
        let weight = side * blend + (DVec3::ONE - side) * (DVec3::ONE - blend);
        sum += value * weight.x * weight.y * weight.z;
    }
    sum
}

pub(super) fn fractal_noise(at: DVec3, seed: u64) -> f64 {
    (4.0 * value_noise(at, seed) + 2.0 * value_noise(at * 2.0, seed ^ 1) + value_noise(at * 4.0, seed ^ 2)) / 7.0
}
