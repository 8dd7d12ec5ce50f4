//! Time offsets of cameras, from their pictures with the scene held fixed: the best values and their errors.

use super::{Trainer, spread};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::recon::Progress;
use crate::report::statistics::mean;
use crate::scene::View;
use crate::scene::capture::{Capture, Picture, Shot};
use crate::settings::Constants;
use crate::stage::{OFFSET_BOUND, Outputs, Renderer};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Half the step of the differences, frames.
const STEP: f64 = 0.1;
/// Longest step of an iteration, frames.
const LONGEST: f64 = 0.5;
/// Pictures of a camera that are rendered, twice each: with 12 of 27 cameras a check took as long as 100 steps.
const PICTURES: usize = 8;
/// Longest side of those pictures, pixels: a time shows in where things are, not in their detail.
const SIDE: u32 = 192;
/// Parts of a view along each side; errors of one part may be alike in all pictures.
const PARTS: usize = 4;
/// By how much errors are larger than with the scene held fixed: measured where all true offsets are 0 (52 offsets on the
/// tiny synthetic capture, 400 steps), half of the offsets are within 0.5 of these errors, and 4 are beyond 1.96.
const SCENE: f64 = 2.0;
/// Part of the differences between a rig's clocks that the scene may have taken up instead: it puts moving things
/// elsewhere, most of all in depth. Measured on four rigs (`assets/lab/2026-11-29-clocks.md`).
const TAKEN_UP: f64 = 0.75;
/// The part of the bound from which on an offset is taken to be at it.
const NEAR_BOUND: f64 = 0.95;
/// Standard error above which an offset is not identifiable, frames.
const LARGEST_ERROR: f64 = 0.25;

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OffsetFit {
    pub offset: f64,
    /// Frames, by the camera's own pictures with the scene held fixed; infinite where they say nothing.
    pub standard_error: f64,
    /// Frames from the offset to the best value of those pictures.
    pub rest: f64,
    /// Root mean square of the offsets that were learnt together with the scene, frames; 0 for a scene that was there.
    pub spread: f64,
}

impl OffsetFit {
    /// True if the fit ended where the search does, but for the mean of all offsets, which is kept at 0.
    pub fn is_at_bound(&self) -> bool {
        self.offset.abs() >= NEAR_BOUND * OFFSET_BOUND
    }

    /// Error of the offset, frames: the standard error, the rest, and what the scene may have taken up.
    pub fn error(&self) -> f64 {
        (SCENE * self.standard_error.hypot(self.rest)).hypot(TAKEN_UP * self.spread)
    }

    pub fn is_identifiable(&self) -> bool {
        self.standard_error <= LARGEST_ERROR
    }
}

/// How well learnt offsets agree with the true ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Root mean square of what is wrong with them, frames.
    pub rms_error: f64,
    /// Pearson's; none where all learnt or all true offsets are the same.
    pub correlation: Option<f64>,
}

impl Agreement {
    /// Of pairs of a learnt and a true offset, frames; none without a pair.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Agreement> {
        let mean = |of: &dyn Fn(f64, f64) -> f64| mean(pairs.iter().map(|(a, b)| of(*a, *b))).unwrap_or(f64::NAN);
        let (learnt, truth) = (mean(&|a, _| a), mean(&|_, b| b));
        let [both, spread, true_spread] = [
            mean(&|a, b| (a - learnt) * (b - truth)),
            mean(&|a, _| (a - learnt).powi(2)),
            mean(&|_, b| (b - truth).powi(2)),
        ];
        let correlation = (spread > 0.0 && true_spread > 0.0).then(|| both / (spread * true_spread).sqrt());
        let rms_error = mean(&|a, b| (a - b).powi(2)).sqrt();
        (!pairs.is_empty()).then_some(Agreement { rms_error, correlation })
    }
}

/// Pictures of `camera` with their views at offset 0 over `background`, evenly spread over the clip and reduced.
pub fn offset_pictures(capture: &Capture, background: [f32; 3], camera: usize) -> Result<Vec<(View, Picture)>> {
    let picture = |shot: Shot| {
        let view = View { background, ..capture.view(camera, shot.frame)? };
        let [width, height] = [view.intrinsics.width, view.intrinsics.height];
        let reduction = width.max(height).div_ceil(SIDE).min(width).min(height);
        Ok((view.reduced(reduction), capture.picture(camera, shot.frame)?.reduced(reduction)))
    };
    spread(&capture.cameras[camera].shots, PICTURES).into_iter().map(picture).collect()
}

/// The images that time offsets are fitted to, and how the scene is rendered for them.
#[derive(Clone, Copy)]
pub struct OffsetImages<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub capture: &'a Capture,
    pub constants: Constants,
    pub background: [f32; 3],
}

/// The learnt time offset of each camera, with its errors.
#[tracing::instrument(level = "info", name = "fit offsets", skip_all)]
pub fn learnt_offsets(
    trainer: &mut Trainer,
    images: &OffsetImages,
    progress: &mut Progress,
) -> Result<BTreeMap<usize, OffsetFit>> {
    let OffsetImages { gpu, capture, constants, background } = *images;
    let (offsets, learns) = trainer.offsets()?;
    if !learns.contains(&true) {
        return Ok(BTreeMap::new());
    }
    let poses = trainer.poses()?;
    let mut renderer = Renderer::new(gpu.clone(), &trainer.splats()?, constants)?;
    let cameras: Vec<usize> = (0..offsets.len()).filter(|camera| learns[*camera]).collect();
    let spread = mean(cameras.iter().map(|camera| offsets[*camera].powi(2))).unwrap_or(0.0).sqrt();
    let fit = |(done, camera): (usize, &usize)| {
        let mut pictures = offset_pictures(capture, background, *camera)?;
        if let Some(correction) = poses.get(camera) {
            pictures.iter_mut().for_each(|(view, _)| *view = correction.view(view));
        }
        let fit = fit_offset(&mut renderer, &pictures, offsets[*camera], 0)?;
        progress(done + 1, cameras.len());
        Ok((*camera, OffsetFit { spread, ..fit }))
    };
    cameras.iter().enumerate().map(fit).collect()
}

/// Fits a camera's offset to `pictures` by `iterations` Gauss-Newton steps on the squared error of the colours, from
/// `start` frames. The standard error is that of the gradient (White 1980), for errors that are alike within a picture
/// and within a part of the view in all pictures (two-way clusters: Cameron, Gelbach and Miller 2011). It is infinite
/// for one picture, which says nothing of how pictures differ.
pub fn fit_offset(
    renderer: &mut Renderer,
    pictures: &[(View, Picture)],
    start: f64,
    iterations: usize,
) -> Result<OffsetFit> {
    let mut fit = OffsetFit { offset: start, standard_error: f64::INFINITY, rest: 0.0, spread: 0.0 };
    for iteration in 0..=iterations {
        // By picture and part: gradient and curvature of half the squared error.
        let terms = pictures.iter().map(|(view, picture)| gradients(renderer, view, picture, fit.offset));
        let terms: Vec<[[f64; 2]; PARTS * PARTS]> = terms.collect::<Result<_>>()?;
        let sum = |k: usize| terms.iter().flatten().map(|term| term[k]).sum::<f64>();
        let (slope, curvature) = (sum(0), sum(1));
        if curvature.is_nan() || curvature <= 0.0 {
            return Ok(OffsetFit { standard_error: f64::INFINITY, ..fit });
        }
        let step = -slope / curvature;
        let variance = variance(&terms, step) / curvature.powi(2);
        (fit.standard_error, fit.rest) = (if terms.len() > 1 { variance.sqrt() } else { f64::INFINITY }, step.abs());
        if iteration < iterations {
            fit.offset = (fit.offset + step.clamp(-LONGEST, LONGEST)).clamp(-OFFSET_BOUND, OFFSET_BOUND);
        }
    }
    Ok(fit)
}

/// Variance of the sum of the gradients, from what is left of each after the Gauss-Newton `step`: by picture, by part of
/// the view, or by both, whichever is largest.
fn variance(terms: &[[[f64; 2]; PARTS * PARTS]], step: f64) -> f64 {
    let left = |[g, h]: &[f64; 2]| g + step * h;
    let by_picture = terms.iter().map(|parts| parts.iter().map(left).sum::<f64>().powi(2)).sum::<f64>();
    let of_part = |part: usize| terms.iter().map(|parts| left(&parts[part])).sum::<f64>().powi(2);
    // Parts in which nothing moves tell nothing.
    let moves = |part: &usize| terms.iter().any(|parts| parts[*part][1] > 0.0);
    let parts: Vec<usize> = (0..PARTS * PARTS).filter(moves).collect();
    let by_part = parts.iter().map(|part| of_part(*part)).sum::<f64>();
    let each = terms.iter().flatten().map(|term| left(term).powi(2)).sum::<f64>();
    // As the variance of a sample.
    let few = |n: usize| if n > 1 { n as f64 / (n - 1) as f64 } else { 0.0 };
    let [by_picture, by_part] = [few(terms.len()) * by_picture, few(parts.len()) * by_part];
    by_picture.max(by_part).max(by_picture + by_part - each)
}

/// By part of the view, gradient and Gauss-Newton curvature of half the squared error of a picture by the offset, at
/// `offset`. The colour there is the mean of those just before and just after.
fn gradients(
    renderer: &mut Renderer,
    view: &View,
    picture: &Picture,
    offset: f64,
) -> Result<[[f64; 2]; PARTS * PARTS]> {
    let mut at = |time_offset: f64| -> Result<Vec<[f32; 3]>> {
        Ok(renderer.render(&View { time_offset, ..view.clone() }, Outputs::Color)?.0.color)
    };
    let (before, after) = (at(offset - STEP)?, at(offset + STEP)?);
    let [width, height] = [picture.width, picture.height].map(|side| side as usize);
    let mut sums = [[0.0; 2]; PARTS * PARTS];
    for (i, word) in picture.pixels.iter().enumerate().filter(|(_, word)| **word >> 24 != 0) {
        let truth = word.to_le_bytes();
        let sums = &mut sums[i / width * PARTS / height * PARTS + i % width * PARTS / width];
        for c in 0..3 {
            let (before, after) = (f64::from(before[i][c]), f64::from(after[i][c]));
            let slope = (after - before) / (2.0 * STEP);
            let error = 0.5 * (before + after) - f64::from(truth[c]) / 255.0;
            sums[0] += slope * error;
            sums[1] += slope * slope;
        }
    }
    Ok(sums)
}
