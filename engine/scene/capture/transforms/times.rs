//! From times to frames.

use super::entry::Entry;
use crate::scene::capture::builder::MAX_FRAMES;

/// Two times closer than this are one.
const TIME_TOLERANCE: f64 = 1e-6;
/// How far a time may lie from the grid of frames, in frames.
const GRID_TOLERANCE: f64 = 0.05;
/// Most frames between the two closest times: irregular times have a fine common grid too, but not one of a clip.
const MAX_DIVISION: f64 = 8.0;

/// Each image's frame and the number of frames. The times must lie on a grid whose step is their greatest common
/// divisor; the first is frame 0, whatever the unit.
pub(super) fn frames_of(entries: &[Entry]) -> Result<(Vec<u32>, u32), String> {
    let times: Vec<f64> = entries.iter().filter_map(|entry| entry.time).collect();
    if times.is_empty() {
        return Ok((vec![0; entries.len()], 1));
    }
    if times.len() != entries.len() {
        return Err(format!("{} of {} frames have one", times.len(), entries.len()));
    }
    if let Some(time) = times.iter().find(|time| !time.is_finite()) {
        return Err(format!("is {time}"));
    }
    let mut sorted = times.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, span) = (sorted[0], sorted[sorted.len() - 1] - sorted[0]);
    let tolerance = TIME_TOLERANCE * span.max(f64::MIN_POSITIVE);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > tolerance);
    let smallest_gap = gaps.clone().fold(f64::INFINITY, f64::min);
    // Rounded times leave remainders that a smaller step would only follow, hence the bound.
    let step = gaps.fold(0.0_f64, |step, gap| {
        let (mut a, mut b) = (step.max(gap), step.min(gap));
        let smallest = GRID_TOLERANCE * if b > 0.0 { b } else { a };
        while b > smallest {
            (a, b) = (b, (a % b).min(b - a % b));
        }
        a
    });
    if step == 0.0 {
        return Ok((vec![0; entries.len()], 1));
    }
    let n_frames = (span / step).round() + 1.0;
    let grid = times.iter().map(|time| (time - first) / step);
    let too_fine = step * MAX_DIVISION < smallest_gap || n_frames > f64::from(MAX_FRAMES);
    if too_fine || grid.clone().any(|f| (f - f.round()).abs() > GRID_TOLERANCE) {
        return Err(format!("the {} times lie on no common grid of frames", times.len()));
    }
    Ok((grid.map(|f| f.round() as u32).collect(), n_frames as u32))
}
