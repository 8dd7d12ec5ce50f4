//! The visual hull of what moves: the space that every camera sees as foreground.

use super::eye::{Eye, Ground};
use super::points::{Found, median_color};
use crate::train::random::permutation;
use glam::{IVec3, Vec2, Vec3};
use std::collections::HashSet;

/// Halvings of the cube: leaves are 1/256 of its side.
const LEVELS: u32 = 8;
/// Cells at which halving ends early: masks that are all foreground would fill the cube.
const MOST_CELLS: usize = 200_000;
/// Cameras that must see a cell, as a fraction of all and at least 3: fewer leave long phantoms.
const LEAST_SEEN: f32 = 1.0 / 3.0;
/// Cameras that may see no foreground where there is some, as a fraction of those that see the cell: masks have holes.
const MOST_MISSES: f32 = 0.1;

/// A cube that holds what the cameras look at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cube {
    /// Its middle, world.
    pub center: Vec3,
    /// Half of its side.
    pub half: f32,
}

/// A camera's foreground, summed from the first pixel on.
struct Silhouette<'a> {
    eye: &'a Eye,
    /// Of moving or unknown pixels in the rows above and the columns to the left; one row and one column more.
    sums: Vec<u32>,
}

/// What a camera says about a cell.
#[derive(PartialEq)]
enum Verdict {
    /// It is out of sight, in whole or in a part that could matter.
    Unseen,
    Empty,
    Possible,
}

impl<'a> Silhouette<'a> {
    fn new(eye: &'a Eye) -> Self {
        let stride = eye.width + 1;
        let mut sums = vec![0; stride * (eye.height + 1)];
        for (row, pixels) in eye.ground.chunks_exact(eye.width).enumerate() {
            let mut in_row = 0;
            for (column, ground) in pixels.iter().enumerate() {
                // Where nothing is known, nothing is carved.
                in_row += u32::from(*ground != Ground::Still);
                sums[(row + 1) * stride + column + 1] = sums[row * stride + column + 1] + in_row;
            }
        }
        Silhouette { eye, sums }
    }

    /// About the ball around a cell.
    fn verdict(&self, center: Vec3, radius: f32) -> Verdict {
        let eye = self.eye;
        let Some((at, depth)) = eye.project(center).filter(|(_, depth)| *depth > radius) else {
            return Verdict::Unseen;
        };
        let reach = Vec2::splat(radius) / (depth - radius) * eye.focal;
        let size = Vec2::new(eye.width as f32, eye.height as f32);
        let (low, high) = ((at - reach).floor(), (at + reach).ceil());
        let (first, last) = (low.max(Vec2::ZERO), high.min(size));
        if !(first.x < last.x && first.y < last.y) {
            return Verdict::Unseen;
        }
        let sum = |x: f32, y: f32| self.sums[y as usize * (eye.width + 1) + x as usize];
        let n = sum(last.x, last.y) + sum(first.x, first.y) - sum(first.x, last.y) - sum(last.x, first.y);
        match n {
            0 if (first, last) != (low, high) => Verdict::Unseen,
            0 => Verdict::Empty,
            _ => Verdict::Possible,
        }
    }
}

/// At most `most` points of the hull's surface, evenly spread, and the side of a cell. `key` seeds the choice.
pub(super) fn surface(eyes: &[Eye], cube: Cube, most: usize, key: &[u64]) -> (Vec<Found>, f32) {
    let silhouettes: Vec<Silhouette> = eyes.iter().map(Silhouette::new).collect();
    let (mut cells, mut side) = (vec![IVec3::ZERO], 2.0 * cube.half);
    let corner = cube.center - cube.half;
    let middle = |cell: IVec3, side: f32| corner + (cell.as_vec3() + 0.5) * side;
    for level in 1..=LEVELS {
        if cells.len() > MOST_CELLS {
            break;
        }
        side /= 2.0;
        // The ball around a cell; of a leaf the one inside it, so that the hull does not grow by a cell.
        let radius = if level == LEVELS { 0.5 * side } else { 0.87 * side };
        let halves = cells.iter().flat_map(|cell| {
            (0..8).map(move |part| 2 * *cell + IVec3::new(part & 1, part >> 1 & 1, part >> 2))
        });
        cells = halves.filter(|cell| may_be_inside(&silhouettes, middle(*cell, side), radius)).collect();
    }
    let inside: HashSet<IVec3> = cells.iter().copied().collect();
    let is_surface = |cell: &&IVec3| {
        [IVec3::X, IVec3::Y, IVec3::Z].iter().any(|axis| !inside.contains(&(**cell + axis)) || !inside.contains(&(**cell - axis)))
    };
    let shell: Vec<Vec3> = cells.iter().filter(is_surface).map(|cell| middle(*cell, side)).collect();
    let buffers: Vec<Vec<f32>> = eyes.iter().map(|eye| depth_buffer(eye, &shell, side)).collect();
    let chosen = permutation(shell.len(), key).into_iter().take(most).map(|i| shell[i]);
    let points = chosen.filter_map(|position| {
        let color = color(eyes, &buffers, position, side)?;
        Some(Found { position: position.as_dvec3().to_array(), color })
    });
    (points.collect(), side)
}

fn may_be_inside(silhouettes: &[Silhouette], center: Vec3, radius: f32) -> bool {
    let least = (LEAST_SEEN * silhouettes.len() as f32).max(3.0);
    let (mut n_seen, mut n_empty) = (0.0, 0.0);
    for (index, silhouette) in silhouettes.iter().enumerate() {
        let verdict = silhouette.verdict(center, radius);
        n_seen += f32::from(verdict != Verdict::Unseen);
        n_empty += f32::from(verdict == Verdict::Empty);
        // No more of those that are left can save it.
        let n_left = (silhouettes.len() - 1 - index) as f32;
        if n_empty > MOST_MISSES * (n_seen + n_left) || n_seen + n_left < least {
            return false;
        }
    }
    true
}

/// The least depth of the shell behind each pixel.
fn depth_buffer(eye: &Eye, shell: &[Vec3], side: f32) -> Vec<f32> {
    let mut nearest = vec![f32::INFINITY; eye.width * eye.height];
    for position in shell {
        let Some((at, depth)) = eye.project(*position) else { continue };
        let reach = 0.5 * side / depth * eye.focal;
        let (low, high) = ((at - reach).max(Vec2::ZERO), at + reach);
        for y in low.y as usize..(high.y.ceil().max(0.0) as usize).min(eye.height) {
            for x in low.x as usize..(high.x.ceil().max(0.0) as usize).min(eye.width) {
                let pixel = &mut nearest[y * eye.width + x];
                *pixel = pixel.min(depth);
            }
        }
    }
    nearest
}

/// The median over the cameras to which nothing hides the point.
fn color(eyes: &[Eye], buffers: &[Vec<f32>], position: Vec3, side: f32) -> Option<[f32; 3]> {
    let sees = |(eye, nearest): (&Eye, &Vec<f32>)| {
        let (pixel, depth) = eye.sees(position)?;
        let is_visible = eye.ground[pixel] == Ground::Moving && depth <= nearest[pixel] + 2.0 * side;
        is_visible.then(|| eye.color[pixel])
    };
    median_color(eyes.iter().zip(buffers).filter_map(sees).collect())
}
