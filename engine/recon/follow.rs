//! First velocities: where the points of one frame's surface are in frames nearby.
//!
//! The points of two frames were drawn independently, so no two correspond. But a patch of neighbours, moved as a
//! whole onto the points of the other frame, finds the surface again: rounds of nearest points, as in ICP (Besl and
//! McKay 1992), with colour as a further distance and the median as the shift.

use super::points::{Found, cube};
use crate::error::Result;
use crate::parallel::{in_parallel, threads};
use crate::report::statistics::median;
use glam::DVec3;
use std::collections::HashMap;

const PATCH: usize = 16;
const ROUNDS: usize = 6;
/// Side of a cell, in spacings; a nearest point is looked for in the cells around.
const CELL: f64 = 3.0;
/// Black and white of one channel are as far apart as so many spacings.
const COLOR: f64 = 10.0;
const PIECE: usize = 64;

struct Cells<'a> {
    found: &'a [Found],
    side: f64,
    cells: HashMap<[i64; 3], Vec<usize>>,
}

impl<'a> Cells<'a> {
    fn new(found: &'a [Found], spacing: f64) -> Self {
        let mut own = Cells { found, side: CELL * spacing, cells: HashMap::new() };
        for (i, point) in found.iter().enumerate() {
            own.cells.entry(own.cell(point.position.into())).or_default().push(i);
        }
        own
    }

    fn cell(&self, at: DVec3) -> [i64; 3] {
        (at / self.side).floor().to_array().map(|x| x as i64)
    }

    /// The points in the cells around a place, in a fixed order.
    fn around(&self, at: DVec3) -> impl Iterator<Item = usize> {
        let center = self.cell(at);
        let cell = move |offset: [i64; 3]| std::array::from_fn(|k| center[k].saturating_add(offset[k]));
        cube(1).filter_map(move |offset| self.cells.get(&cell(offset))).flatten().copied()
    }

    /// The patch around point `i`, itself among it.
    fn patch(&self, i: usize) -> Vec<usize> {
        let at = DVec3::from(self.found[i].position);
        let mut near: Vec<(f64, usize)> =
            self.around(at).map(|j| (at.distance_squared(self.found[j].position.into()), j)).collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(PATCH);
        near.into_iter().map(|(_, j)| j).collect()
    }

    /// From `at` to the point most like `point`; `None` where none is near.
    fn way(&self, point: &Found, at: DVec3) -> Option<DVec3> {
        let distance = |j: usize| {
            let other = &self.found[j];
            let color: f64 = (0..3).map(|k| f64::from(point.color[k] - other.color[k]).powi(2)).sum();
            at.distance_squared(other.position.into()) + (COLOR / CELL * self.side).powi(2) * color
        };
        let nearest = self.around(at).map(|j| (distance(j), j)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map(|(_, j)| DVec3::from(self.found[j].position) - at)
    }
}

/// How far the points `patch` of `here` have moved in `there`; `None` if they are lost.
fn shift(here: &Cells, there: &Cells, patch: &[usize]) -> Option<DVec3> {
    let mut shift = DVec3::ZERO;
    for _ in 0..ROUNDS {
        let way = |&j: &usize| there.way(&here.found[j], DVec3::from(here.found[j].position) + shift);
        let ways: Vec<DVec3> = patch.iter().filter_map(way).collect();
        if ways.is_empty() {
            return None;
        }
        // Axis by axis.
        let step = DVec3::from_array([0, 1, 2].map(|k| median(&ways.iter().map(|way| way[k]).collect::<Vec<_>>())));
        shift += step;
        if step == DVec3::ZERO {
            break;
        }
    }
    Some(shift)
}

/// The velocity of each of the points `here`, scene units per unit of time, from where it is in `others`, each with the
/// time from here to there; 0 where it is found in none. `spacing`, above 0, is the distance from a point to its
/// neighbours.
pub(super) fn velocities(here: &[Found], others: &[(f64, &[Found])], spacing: f64) -> Result<Vec<[f32; 3]>> {
    let cells = Cells::new(here, spacing);
    let others: Vec<(f64, Cells)> = others.iter().map(|(time, found)| (*time, Cells::new(found, spacing))).collect();
    let of = |i: usize| {
        let patch = cells.patch(i);
        let mut sum = (DVec3::ZERO, 0.0);
        for (time, there) in &others {
            if let Some(shift) = shift(&cells, there, &patch) {
                sum = (sum.0 + shift * time.signum(), sum.1 + time.abs());
            }
        }
        if sum.1 > 0.0 { (sum.0 / sum.1).as_vec3().to_array() } else { [0.0; 3] }
    };
    let n = here.len();
    let piece = |k: usize| Ok((k * PIECE..n.min((k + 1) * PIECE)).map(&of).collect::<Vec<_>>());
    Ok(in_parallel(n.div_ceil(PIECE), threads(), piece, |_| {})?.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Keyed;

    /// Points of a ball of radius 1 that turns and moves, drawn anew for each `key`, coloured by where they are on it.
    fn ball(key: u64, turn: f64, shift: DVec3) -> Vec<Found> {
        let random = Keyed::new(&[key]);
        let point = |i: u64| {
            let z = 2.0 * random.uniform(2 * i) - 1.0;
            let angle = std::f64::consts::TAU * random.uniform(2 * i + 1);
            let place = DVec3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z);
            let color = place.to_array().map(|x| (0.5 + 0.5 * (4.0 * x).sin()) as f32);
            Found { position: (DVec3::from_array(turned(place.to_array(), turn)) + shift).to_array(), color }
        };
        (0..1200).map(point).collect()
    }

    fn turned([x, y, z]: [f64; 3], by: f64) -> [f64; 3] {
        [by.cos() * x - by.sin() * y, by.sin() * x + by.cos() * y, z]
    }

    #[test]
    fn points_that_are_drawn_anew_in_each_frame_have_the_velocity_of_their_surface() {
        let (turn, shift, time, spacing) = (0.12, DVec3::new(0.05, -0.1, 0.08), 0.1, 0.08);
        let [before, here, after] = [-1.0, 0.0, 1.0].map(|step| ball((step + 5.0) as u64, step * turn, step * shift));
        let found = velocities(&here, &[(-time, &before), (time, &after)], spacing).unwrap();
        let mut errors: Vec<f64> = here
            .iter()
            .zip(&found)
            .map(|(point, v)| {
                let [x, y, _] = point.position;
                let truth = (DVec3::new(-y, x, 0.0) * turn + shift) / time;
                DVec3::from(v.map(f64::from)).distance(truth) * time / spacing
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        // Without velocities they were 1.7 spacings and more: that is how far the shift alone goes from one frame to
        // the next.
        let [half, most] = [errors[errors.len() / 2], errors[errors.len() * 9 / 10]];
        assert!(half < 0.3 && most < 0.6, "errors in spacings: half within {half}, nine in ten within {most}");
    }

    #[test]
    fn a_surface_that_stays_has_no_velocity_and_one_that_is_lost_has_none_either() {
        let here = ball(1, 0.0, DVec3::ZERO);
        let far = ball(1, 0.0, DVec3::splat(1e3));
        for others in [vec![(0.1, here.as_slice())], vec![(0.1, far.as_slice())], vec![(0.1, &[][..])], vec![]] {
            assert!(velocities(&here, &others, 0.08).unwrap().iter().all(|v| *v == [0.0; 3]));
        }
        assert!(velocities(&[], &[(0.1, &here)], 0.08).unwrap().is_empty());
    }
}
