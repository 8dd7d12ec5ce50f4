//! Points that the depths of several cameras confirm, and guesses in the gaps.

use super::eye::{Ground, ViewBuffers};
use super::points::{Found, median_color};
use super::sweep::Depths;
use crate::error::Result;
use crate::parallel::in_parallel;
use crate::report::statistics::median_high;
use crate::scene::capture::{Point, TRAINING_RADIUS};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Another camera's inverse depth confirms a point if it is off by at most so many steps.
const TOLERANCE: f32 = 1.5;
/// Steps beyond which another camera sees through a point.
const THROUGH: f32 = 3.0;

/// A pixel so far from the nearest known depth gets a guess. A narrower gap, unlike a plain wall, closes from its rim
/// sooner than training mends a wrong guess in it.
const GAP: u32 = 16;

/// A point and the cameras that saw it there; 0 where it is guessed, `usize::MAX` where it was known before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Agreed {
    pub found: Found,
    pub n_cameras: usize,
}

/// The points that cameras see, then guesses in the gaps between them and `before`; no guesses if nothing is known.
pub(super) fn agree(eyes: &[ViewBuffers], depths: &[Depths], before: &[Found], threads: usize) -> Result<Vec<Agreed>> {
    let mut all = Vec::new();
    let mut known: Vec<Vec<f32>> = Vec::new();
    let of_eye = |i: usize| Ok((0..eyes[i].ground.len()).map(|pixel| confirm(eyes, depths, i, pixel)).collect());
    let confirmed: Vec<Vec<Option<Agreed>>> = in_parallel(eyes.len(), threads, of_eye, |_| ())?;
    for (confirmed, depths) in confirmed.into_iter().zip(depths) {
        let inverse = confirmed.iter().zip(&depths.inverse);
        known.push(inverse.map(|(found, inverse)| if found.is_some() { *inverse } else { f32::NAN }).collect());
        all.extend(confirmed.into_iter().flatten());
    }
    let places: Vec<Vec3> = before.iter().chain(all.iter().map(|point| &point.found)).map(Found::at).collect();
    for (eye, known) in eyes.iter().zip(&mut known) {
        for (at, depth) in places[..before.len()].iter().filter_map(|place| eye.sees(*place)) {
            known[at] = known[at].max(1.0 / depth);
        }
    }
    let guesses = in_parallel(eyes.len(), threads, |i| Ok(guess(eyes, &known, i, &places)), |_| ())?;
    all.extend(guesses.into_iter().flatten());
    Ok(all)
}

/// The pixels of an eye that are far from all known depths.
fn guess(eyes: &[ViewBuffers], known: &[Vec<f32>], i: usize, places: &[Vec3]) -> Vec<Agreed> {
    let eye = &eyes[i];
    let Some(distance) = median_high(places.iter().map(|place| eye.center.distance(*place).into())) else {
        return Vec::new();
    };
    let near = spread(eye, &known[i]);
    let of_pixel = |pixel: usize| {
        // A picture in which nothing is known at all shows something as far away as the rest.
        let inverse = match near[pixel] {
            Some((_, steps)) if steps < GAP => return None,
            Some((inverse, _)) => inverse,
            None => eye.ray(pixel).length() / distance as f32,
        };
        let position = place(eye, pixel, inverse);
        let is_known =
            |(other, known): (&ViewBuffers, &Vec<f32>)| other.sees(position).is_some_and(|(at, _)| known[at] > 0.0);
        let found = Found { position: position.as_dvec3().to_array(), color: eye.color[pixel] };
        (!eyes.iter().zip(known).any(is_known)).then_some(Agreed { found, n_cameras: 0 })
    };
    (0..eye.ground.len()).filter(|pixel| eye.ground[*pixel] == Ground::Still).filter_map(of_pixel).collect()
}

/// The static points of a capture: most foreground masks that see a point say so.
pub(super) fn still(points: &[Point], eyes: &[ViewBuffers]) -> Vec<Found> {
    let rests = |found: &Found| {
        let position = found.at();
        let grounds: Vec<Ground> = eyes.iter().filter_map(|eye| Some(eye.ground[eye.sees(position)?.0])).collect();
        let n_other = grounds.iter().filter(|ground| matches!(ground, Ground::Moving | Ground::Empty)).count();
        2 * n_other <= grounds.len()
    };
    points.iter().map(Found::from).filter(rests).collect()
}

fn place(eye: &ViewBuffers, pixel: usize, inverse_depth: f32) -> Vec3 {
    eye.center + eye.ray(pixel) / inverse_depth
}

/// The point of a pixel, if another camera's depth confirms it and fewer see through it.
fn confirm(eyes: &[ViewBuffers], depths: &[Depths], i: usize, pixel: usize) -> Option<Agreed> {
    let eye = &eyes[i];
    let inverse = depths[i].inverse[pixel];
    if inverse.is_nan() {
        return None;
    }
    let position = place(eye, pixel, inverse);
    // Each camera's own idea of the point, in pixels of its own.
    let mut places = position;
    let mut colors = vec![eye.color[pixel]];
    let mut n_through = 0;
    for (j, (other, there)) in eyes.iter().zip(depths).enumerate() {
        let Some((at, depth)) = other.sees(position).filter(|_| j != i) else { continue };
        // NaN, where it has no depth, is neither.
        let nearer = (1.0 / depth - there.inverse[at]) / there.step;
        if nearer.abs() <= TOLERANCE {
            colors.push(other.color[at]);
            places += place(other, at, there.inverse[at]);
        }
        n_through += usize::from(nearer > THROUGH);
    }
    let n_cameras = colors.len();
    if n_cameras < 2 || 2 * n_through >= n_cameras {
        return None;
    }
    let position = (places / n_cameras as f32).as_dvec3().to_array();
    Some(Agreed { found: Found { position, color: median_color(colors)? }, n_cameras })
}

/// For each pixel the nearest known inverse depth, along rows and columns, and how many pixels away it is.
fn spread(eye: &ViewBuffers, known: &[f32]) -> Vec<Option<(f32, u32)>> {
    let mut all: Vec<Option<(f32, u32)>> =
        known.iter().map(|inverse| (*inverse > 0.0).then_some((*inverse, 0))).collect();
    let mut edge: Vec<usize> = (0..all.len()).filter(|pixel| all[*pixel].is_some()).collect();
    while !edge.is_empty() {
        let mut next = Vec::new();
        for pixel in edge {
            let (column, row) = (pixel % eye.width, pixel / eye.width);
            let beside = [
                (column > 0).then(|| pixel - 1),
                (column + 1 < eye.width).then_some(pixel + 1),
                (row > 0).then(|| pixel - eye.width),
                (row + 1 < eye.height).then_some(pixel + eye.width),
            ];
            for at in beside.into_iter().flatten() {
                if all[at].is_none() {
                    all[at] = all[pixel].map(|(inverse, steps)| (inverse, steps + 1));
                    next.push(at);
                }
            }
        }
        edge = next;
    }
    all
}

/// At most `most` of the points, evenly spread: of each cell of a grid the one that most cameras saw. The cells are
/// larger beyond the cameras, where pictures show less.
pub(super) fn thin(points: &[Agreed], most: usize) -> Vec<Found> {
    let kept = |side: f64| -> Vec<usize> {
        let mut cells: HashMap<[i64; 4], usize> = HashMap::new();
        for (index, point) in points.iter().enumerate() {
            let position = DVec3::from(point.found.position);
            let shell = (position.length() / TRAINING_RADIUS).log2().ceil().max(0.0);
            let [x, y, z] = (position / (side * shell.exp2())).floor().to_array().map(|x| x as i64);
            let held = cells.entry([x, y, z, shell as i64]).or_insert(index);
            if points[*held].n_cameras < point.n_cameras {
                *held = index;
            }
        }
        let mut kept: Vec<usize> = cells.into_values().collect();
        kept.sort_unstable();
        kept
    };
    let (mut low, mut high) = (0.0, 2.0 * TRAINING_RADIUS);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if kept(middle).len() > most { low = middle } else { high = middle }
    }
    kept(high).into_iter().take(most).map(|index| points[index].found).collect()
}
