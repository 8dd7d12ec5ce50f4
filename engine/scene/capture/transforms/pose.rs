//! Poses of frames, which some writers scale.

use super::document::{Unfit, numbers, unfit};
use crate::scene::Pose;
use glam::{DMat3, DVec3};
use serde_json::Value;

/// How far entries may lie from what they should be, relative to the scale of the matrix.
const TOLERANCE: f64 = 1e-6;
/// How far the lengths of a rotation's columns may differ, relative to them, for it to be a rotation times a number.
const EVEN: f64 = 1e-3;

#[derive(Default)]
pub(super) struct Scales {
    n: usize,
    largest: f64,
}

impl Scales {
    pub fn note(&self) -> Option<String> {
        let (n, scale) = (self.n, self.largest);
        (n > 0).then(|| format!("frames whose rotation is times a number ({scale:.4}): {n}; it is divided by that"))
    }
}

/// Inverts a rotation and translation after turning y and z around. A matrix times a number is divided by it, and so is its rotation.
pub(super) fn world_to_camera(matrix: &Value, scales: &mut Scales) -> Result<Pose, Unfit> {
    let all = numbers(matrix).unwrap_or_default();
    let (rows, rest) = all.as_chunks::<4>();
    // Some store the matrix times a number, that of its last place.
    let whole = rows.get(3).map_or(1.0, |last| last[3]);
    let is_last = |last: &[f64; 4]| last[..3].iter().all(|v| v.abs() <= TOLERANCE * whole.abs());
    let is_matrix = rest.is_empty() && (rows.len() == 3 || rows.len() == 4 && is_last(&rows[3]));
    if !is_matrix || !whole.is_finite() || whole <= 0.0 {
        return Err(no_matrix());
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]) / whole;
    let lengths = [0, 1, 2].map(|k| column(k).length());
    let scale = lengths.iter().sum::<f64>() / 3.0;
    let is_even = lengths.iter().all(|length| (length - scale).abs() <= EVEN * scale);
    if whole != 1.0 && (scale - 1.0).abs() > EVEN {
        return Err(no_matrix());
    }
    let is_scaled = is_even && scale.is_finite() && scale > 0.0 && (scale - 1.0).abs() > EVEN;
    if is_scaled || whole != 1.0 {
        scales.n += 1;
        scales.largest = scales.largest.max(if is_scaled { scale } else { whole });
    }
    let turn = if is_scaled { 1.0 / scale } else { 1.0 };
    let rotation = DMat3::from_cols(column(0) * turn, -column(1) * turn, -column(2) * turn).transpose();
    Ok(Pose::at(column(3), rotation))
}

fn no_matrix() -> Unfit {
    unfit("has a transform_matrix that is not 3 or 4 rows of 4 with [0, 0, 0, 1] at the end".to_owned())
}
