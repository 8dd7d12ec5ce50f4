//! Depth priors aligned to the sparse points (SPEC 4): depth = scale * prior + shift, for each image by itself.

use super::cache::DepthCache;
use super::line::{DepthFit, Outcome, Unfit, fit_line};
use crate::error::Result;
use crate::parallel::in_parallel;
use crate::recon::{Pinhole, Progress};
use crate::report::statistics::median_high;
use crate::scene::View;
use crate::scene::capture::{Capture, FramePoint};
use crate::scene::prior::read_depth;
use crate::stage::DepthSpace;
use glam::DVec3;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthFits(BTreeMap<(usize, u32), std::result::Result<DepthFit, Unfit>>);

impl DepthFits {
    /// By (camera, frame): the fit, or why there is no fit.
    pub fn iter(&self) -> impl Iterator<Item = ((usize, u32), std::result::Result<DepthFit, Unfit>)> {
        self.0.iter().map(|(image, fit)| (*image, *fit))
    }

    pub fn summary(&self) -> DepthSummary {
        let residuals = || self.0.values().flatten().map(|fit| fit.residual);
        let mut unfit = BTreeMap::new();
        self.0.values().filter_map(|fit| fit.err()).for_each(|why| *unfit.entry(why).or_default() += 1);
        DepthSummary { images: self.0.len(), usable: residuals().count(), unfit, residual: median_high(residuals()) }
    }
}

#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DepthSummary {
    pub images: usize,
    pub usable: usize,
    /// By reason.
    pub unfit: BTreeMap<Unfit, usize>,
    /// Median over the images of [`DepthFit::residual`].
    pub residual: Option<f64>,
}

impl fmt::Display for DepthSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "depth priors of {} of {} images", self.usable, self.images)?;
        if let Some(residual) = self.residual {
            write!(f, ", {:.1} % off their points", 100.0 * residual)?;
        }
        self.unfit.iter().try_for_each(|(why, n)| write!(f, "; {n}: {}", why.reason()))
    }
}

/// Fits the depth prior of every training image to the points seen in it: those of its frame, else the capture's sparse
/// points. Depth is in the units of the capture's world. Fits are kept in `depth/fits.json` of the capture.
#[tracing::instrument(level = "info", name = "fit depths", skip_all)]
pub fn fit_depths(capture: &Capture, space: DepthSpace, threads: usize, progress: &mut Progress) -> Result<DepthFits> {
    let sparse: Vec<[f64; 3]> = capture.points.iter().map(|point| point.position).collect();
    let mut by_frame: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    capture.training_frames().into_iter().for_each(|(camera, frame)| by_frame.entry(frame).or_default().push(camera));
    let n_frames = by_frame.len();
    let cache = DepthCache::open(capture);
    let mut fits = BTreeMap::new();
    for (n_done, (frame, cameras)) in by_frame.into_iter().enumerate() {
        let points = if capture.has_frame_points() { Some(capture.points_of(frame)?) } else { None };
        let fit = |i: usize| {
            let seen = |points: &Vec<FramePoint>| {
                let seen = points.iter().filter(|point| point.seen_by.contains(&cameras[i]));
                seen.map(|point| point.position).collect::<Vec<_>>()
            };
            fit_prior(capture, cameras[i], frame, space, points.as_ref().map(seen).as_ref().unwrap_or(&sparse), &cache)
        };
        let fitted = in_parallel(cameras.len(), threads, fit, |_| {})?;
        fits.extend(cameras.into_iter().zip(fitted).map(|(camera, fit)| ((camera, frame), fit)));
        progress(n_done + 1, n_frames);
    }
    cache.close();
    Ok(DepthFits(fits))
}

fn fit_prior(
    capture: &Capture,
    camera: usize,
    frame: u32,
    space: DepthSpace,
    points: &[[f64; 3]],
    cache: &DepthCache,
) -> Result<Outcome> {
    let shot = capture.cameras[camera].shot(frame);
    let Some(path) = shot.and_then(|shot| shot.depth.as_ref()) else { return Ok(Err(Unfit::NoPrior)) };
    let view = capture.view(camera, frame)?;
    let key = DepthCache::key(path, &view, space, points);
    if let Some(known) = key.as_ref().and_then(|key| cache.get(path, key)) {
        return Ok(known);
    }
    let fit = fit_line(&pairs(path, &view, space, points)?);
    if let Some(key) = key {
        cache.note(path, key, fit);
    }
    Ok(fit)
}

/// (prior, depth) of the points in the image of `view`.
fn pairs(path: &Path, view: &View, space: DepthSpace, points: &[[f64; 3]]) -> Result<Vec<(f64, f64)>> {
    let prior = read_depth(path, view.intrinsics.width, view.intrinsics.height)?;
    let camera = Pinhole::new(view);
    let pair = |point: &[f64; 3]| {
        let (at, z) = camera.project(DVec3::from_array(*point))?;
        let value = f64::from(prior[camera.pixel(at)?]);
        let depth = if space == DepthSpace::Inverse { 1.0 / z } else { z };
        (value.is_finite() && depth.is_finite()).then_some((value, depth))
    };
    Ok(points.iter().filter_map(pair).collect())
}
