//! Depth priors aligned to the sparse points (SPEC 4): depth = scale * prior + shift, for each image by itself.

use super::line::{DepthFit, Outcome, Unfit, fit_line};
use crate::error::Result;
use crate::files::{read_file, write_atomic};
use crate::parallel::in_parallel;
use crate::recon::{Pinhole, Progress};
use crate::report::statistics::median_high;
use crate::scene::View;
use crate::scene::capture::{Capture, FramePoint};
use crate::scene::prior::read_depth;
use crate::stage::DepthSpace;
use glam::DVec3;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::UNIX_EPOCH;

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

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Kept {
    key: String,
    fit: Outcome,
}

/// `depth/fits.json` of a capture, because a long clip has terabytes of priors. Where it cannot be read or written, fits
/// are found anew.
struct DepthCache {
    capture: PathBuf,
    /// By file, relative to the capture.
    before: BTreeMap<String, Kept>,
    found: Mutex<BTreeMap<String, Kept>>,
}

impl DepthCache {
    fn open(capture: &Capture) -> Self {
        let file = Self::file(&capture.path);
        let before = read_file(&file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        DepthCache { capture: capture.path.clone(), before, found: Mutex::default() }
    }

    fn file(capture: &Path) -> PathBuf {
        capture.join("depth/fits.json")
    }

    /// All that the fit of a prior depends on; none without the file.
    fn key(path: &Path, view: &View, space: DepthSpace, points: &[[f64; 3]]) -> Option<String> {
        let of_file = std::fs::metadata(path).ok()?;
        let changed = of_file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        let mut hash = Sha256::new();
        hash.update(of_file.len().to_le_bytes());
        hash.update(changed.as_nanos().to_le_bytes());
        hash.update([u8::from(space == DepthSpace::Inverse)]);
        let lens = view.intrinsics;
        hash.update([lens.width, lens.height].map(u32::to_le_bytes).as_flattened());
        let numbers = [lens.fx, lens.fy, lens.cx, lens.cy];
        let rows = view.pose.rows();
        for number in numbers.iter().chain(rows.as_flattened()).chain(points.as_flattened()) {
            hash.update(number.to_le_bytes());
        }
        Some(format!("{:x}", hash.finalize()))
    }

    fn get(&self, path: &Path, key: &str) -> Option<Outcome> {
        self.before.get(&self.name(path)?).filter(|kept| kept.key == key).map(|kept| kept.fit)
    }

    fn note(&self, path: &Path, key: String, fit: Outcome) {
        if let Some(name) = self.name(path) {
            self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(name, Kept { key, fit });
        }
    }

    fn name(&self, path: &Path) -> Option<String> {
        path.strip_prefix(&self.capture).ok().and_then(Path::to_str).map(str::to_owned)
    }

    fn close(self) {
        let found = self.found.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut all = self.before;
        let file = Self::file(&self.capture);
        if found.is_empty() {
            return;
        }
        all.extend(found);
        if let Err(fault) = write_atomic(&file, |to| Ok(serde_json::to_writer(to, &all)?)) {
            tracing::debug!("the fits of depth priors are not kept: {fault}");
        }
    }
}
