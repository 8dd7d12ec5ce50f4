//! Which of the places found in each frame are of the same person.

use super::smooth::{Motion, State};
use super::triangulate::Fix;

/// Squared Mahalanobis distance beyond which a place is of someone else: 0.999 of chi squared with three degrees.
const GATE: f64 = 16.27;

/// The places of each person: (frame, index among its fixes), in order of time. The filter of each person predicts where it
/// is; the likeliest pairs of persons and places are taken first, and a place that nobody explains begins a new person.
pub fn associate(fixes: &[Vec<Fix>], dt: f64, motion: Motion) -> Vec<Vec<(usize, usize)>> {
    let mut persons: Vec<(State, Vec<(usize, usize)>)> = Vec::new();
    for (frame, found) in fixes.iter().enumerate() {
        let mut pairs = Vec::new();
        for (person, (state, places)) in persons.iter().enumerate() {
            let steps = places.last().map_or(0, |(last, _)| frame - last);
            let state = state.predicted(dt * steps as f64, motion);
            for (index, fix) in found.iter().enumerate() {
                let (distance, spread) = state.distance(fix.p, fix.cov);
                // The spread keeps one who was lost long ago from explaining everything.
                if distance < GATE {
                    pairs.push((distance + spread, person, index, state));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut has_place, mut is_taken) = (vec![false; persons.len()], vec![false; found.len()]);
        for (_, person, index, state) in pairs {
            if has_place[person] || is_taken[index] {
                continue;
            }
            (has_place[person], is_taken[index]) = (true, true);
            persons[person].0 = state.updated(found[index].p, found[index].cov);
            persons[person].1.push((frame, index));
        }
        for (index, fix) in found.iter().enumerate().filter(|(index, _)| !is_taken[*index]) {
            persons.push((State::new(fix.p, fix.cov, motion), vec![(frame, index)]));
        }
    }
    persons.into_iter().map(|(_, places)| places).collect()
}
