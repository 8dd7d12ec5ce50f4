//! Colours of surfaces as functions of a point in the surface's own frame.

use super::math::{fractal_noise, value_noise};
use crate::random::hash;
use glam::DVec3;

/// A procedural texture; colours are albedos in [0, 1], lengths scene units.
#[derive(Clone, Copy, Debug)]
pub(super) enum Texture {
    Plain(DVec3),
    /// Squares of this side in two colours; solid, so that a sphere can wear it too.
    Checker(DVec3, DVec3, f64),
    /// Boards of this width along z, each of its own tone.
    Planks(DVec3, DVec3, f64),
    /// Bricks of this length and their joints.
    Bricks(DVec3, DVec3, f64),
    /// Clouds between two colours, of this wavelength.
    Clouds(DVec3, DVec3, f64),
    /// Upright stripes (the backs of books) of this width, each of its own colour.
    Books(f64),
    /// Wallpaper: broad stripes of this width with a row of dots.
    Wallpaper(DVec3, DVec3, f64),
    /// A head of this radius that looks along -z: skin, hair, eyes, mouth.
    Head(DVec3, DVec3, f64),
    Octants(DVec3, DVec3),
}

impl Texture {
    pub fn albedo(&self, at: DVec3, face: usize, seed: u64) -> DVec3 {
        match *self {
            Texture::Plain(color) => color,
            Texture::Checker(a, b, side) => {
                // Shifted off the faces, where rounding would decide.
                let cell = (at / side + DVec3::splat(0.25)).floor();
                if (cell.x + cell.y + cell.z).rem_euclid(2.0) < 1.0 { a } else { b }
            }
            Texture::Planks(a, b, width) => {
                let board = (at.x / width).floor();
                let length = 1.1;
                let start = tone(board as i64, 0, seed) * length;
                let piece = ((at.z + start) / length).floor();
                let grain = value_noise(DVec3::new(at.x * 40.0, 0.0, at.z * 5.0), seed ^ 3);
                let along = ((at.z + start) / length - piece).min(1.0 - ((at.z + start) / length - piece)) * length;
                let across = (at.x / width - board).min(1.0 - (at.x / width - board)) * width;
                let joint = if along.min(across) < 0.008 { 0.55 } else { 1.0 };
                a.lerp(b, 0.65 * tone(board as i64, piece as i64, seed) + 0.35 * grain) * joint
            }
            Texture::Bricks(brick, joint, length) => {
                let (u, v) = across(at, face);
                let height = length * 0.4;
                let row = (v / height).floor();
                let shift = if row.rem_euclid(2.0) < 1.0 { 0.0 } else { 0.5 };
                let column = (u / length + shift).floor();
                let gap = 0.06 * length;
                if (u / length + shift - column) * length < gap || v - row * height < gap {
                    return joint;
                }
                let grain = fractal_noise(at * 9.0, seed);
                brick * (0.65 + 0.35 * tone(column as i64, row as i64, seed) + 0.25 * (grain - 0.5))
            }
            Texture::Clouds(a, b, wavelength) => {
                let t = (fractal_noise(at / wavelength, seed) * 2.2 - 0.6).clamp(0.0, 1.0);
                a.lerp(b, t)
            }
            Texture::Books(width) => {
                let (u, v) = across(at, face);
                let book = (u / width).floor() as i64;
                let color = DVec3::new(tone(book, 0, seed), tone(book, 1, seed), tone(book, 2, seed)) * 0.65 + 0.15;
                let label = (v * 3.0 + tone(book, 3, seed)).rem_euclid(1.0);
                if (0.35..0.5).contains(&label) { DVec3::new(0.92, 0.88, 0.75) } else { color }
            }
            Texture::Wallpaper(a, b, width) => {
                let (u, v) = across(at, face);
                let (column, row) = ((u / width).floor(), (v / width).floor());
                let (du, dv) = (u / width - column - 0.5, v / width - row - 0.5);
                let even = column.rem_euclid(2.0) < 1.0;
                let dot = du * du + dv * dv < 0.06;
                let base = if even { a } else { a.lerp(b, 0.35) };
                if dot { b * (0.7 + 0.5 * tone(column as i64, row as i64, seed)) } else { base }
            }
            Texture::Head(skin, hair, radius) => {
                let unit = at / radius;
                if unit.y < -0.55 || unit.z > 0.25 {
                    return hair * (0.8 + 0.4 * value_noise(at * 30.0, seed));
                }
                let spot = |x: f64, y: f64| (unit.x - x) * (unit.x - x) + (unit.y - y) * (unit.y - y);
                if spot(-0.33, -0.15).min(spot(0.33, -0.15)) < 0.02 {
                    DVec3::splat(0.1)
                } else if spot(0.0, 0.1) < 0.012 {
                    skin * 0.8
                } else if unit.x.abs() < 0.3 && (unit.y - MOUTH_Y).abs() < 0.09 {
                    DVec3::new(0.7, 0.15, 0.18)
                } else {
                    skin
                }
            }
            Texture::Octants(a, b) => {
                let even = (at.x > 0.0) ^ (at.y > 0.0) ^ (at.z > 0.0);
                if even { a } else { b }
            }
        }
    }

    /// How easily a feature detector finds points on it, in [0, 1].
    pub fn detail(&self) -> f64 {
        match self {
            Texture::Plain(_) => 0.02,
            Texture::Clouds(..) => 0.5,
            Texture::Planks(..) => 0.6,
            _ => 1.0,
        }
    }
}

/// Height of the mouth below the centre of a head of radius 1.
pub(super) const MOUTH_Y: f64 = 0.42;

/// The coordinates along a face: horizontal and vertical on walls.
fn across(at: DVec3, face: usize) -> (f64, f64) {
    match face / 2 {
        0 => (at.z, at.y),
        1 => (at.x, at.z),
        _ => (at.x, at.y),
    }
}

fn tone(i: i64, j: i64, seed: u64) -> f64 {
    (hash(&[seed, i as u64, j as u64]) >> 40) as f64 / (1 << 24) as f64
}
