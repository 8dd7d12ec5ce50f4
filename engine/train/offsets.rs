//! What pictures say of a camera's time offset, with the scene held fixed: its best value and how far it can be trusted.

use crate::error::Result;
use crate::scene::View;
use crate::scene::capture::Capture;
use crate::stage::{OFFSET_BOUND, Outputs, Renderer};

/// Half the step of the differences, frames.
const STEP: f64 = 0.1;
/// Longest step of an iteration, frames.
const LONGEST: f64 = 0.5;
/// Pictures of a camera that are looked at, at most, evenly spread over the clip.
const PICTURES: usize = 12;
/// Standard error above which an offset is not identifiable, frames.
const LARGEST_ERROR: f64 = 0.25;

/// A camera's time offset.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OffsetFit {
    /// Frames.
    pub offset: f64,
    /// Frames; infinite where the pictures say nothing. With the scene held fixed, so of the camera's own pictures alone.
    pub standard_error: f64,
}

impl OffsetFit {
    /// Whether the pictures say what the offset is.
    pub fn is_identifiable(&self) -> bool {
        self.standard_error <= LARGEST_ERROR
    }
}

/// Fits the offset of `camera` to its pictures by `iterations` Gauss-Newton steps on the squared error of the colours, from
/// `start` frames; with none it stays there and gets its standard error. That is robust to errors that the pixels of one
/// picture share: squared gradients are added up by picture (sandwich estimator, White 1980).
///
/// # Errors
/// Those of the renderer and of the capture's pictures.
pub fn fit_offset(
    renderer: &mut Renderer,
    capture: &Capture,
    background: [f32; 3],
    camera: usize,
    start: f64,
    iterations: usize,
) -> Result<OffsetFit> {
    let mut fit = OffsetFit { offset: start, standard_error: f64::INFINITY };
    let frames: Vec<u32> = capture.cameras[camera].shots.iter().map(|shot| shot.frame).collect();
    let n = frames.len().min(PICTURES);
    for iteration in 0..=iterations {
        // By picture: gradient and curvature of half the squared error.
        let mut terms = Vec::new();
        for k in 0..n {
            let frame = frames[(2 * k + 1) * frames.len() / (2 * n)];
            let picture = capture.picture(camera, frame)?;
            let mut at = |offset: f64| -> Result<Vec<[f32; 3]>> {
                let view = View { background, time_offset: offset, ..capture.view(camera, frame)? };
                Ok(renderer.render(&view, Outputs::Color)?.0.color)
            };
            let (before, now, after) = (at(fit.offset - STEP)?, at(fit.offset)?, at(fit.offset + STEP)?);
            let (mut gradient, mut curvature) = (0.0, 0.0);
            for (i, word) in picture.pixels.iter().enumerate().filter(|(_, word)| **word >> 24 != 0) {
                let truth = word.to_le_bytes();
                for c in 0..3 {
                    let slope = f64::from(after[i][c] - before[i][c]) / (2.0 * STEP);
                    let error = f64::from(now[i][c]) - f64::from(truth[c]) / 255.0;
                    gradient += slope * error;
                    curvature += slope * slope;
                }
            }
            terms.push((gradient, curvature));
        }
        let gradient: f64 = terms.iter().map(|(g, _)| g).sum();
        let curvature: f64 = terms.iter().map(|(_, h)| h).sum();
        if !(curvature > 0.0) {
            return Ok(OffsetFit { standard_error: f64::INFINITY, ..fit });
        }
        let step = (-gradient / curvature).clamp(-LONGEST, LONGEST);
        let spread: f64 = terms.iter().map(|(g, h)| (g - gradient / curvature * h).powi(2)).sum();
        let few = n as f64 / (n as f64 - 1.0).max(0.5);
        fit.standard_error = (few * spread).sqrt() / curvature;
        if iteration < iterations {
            fit.offset = (fit.offset + step).clamp(-OFFSET_BOUND, OFFSET_BOUND);
        }
    }
    Ok(fit)
}
