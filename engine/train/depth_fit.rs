//! Depth priors aligned to the sparse points (SPEC 4): depth = scale * prior + shift, for each image by itself.
//!
//! The fit is robust: the line through two points that leaves the least median residual (Rousseeuw 1984), then least
//! squares over the points near it. Points that are wrong or hidden in the image may be almost half of all.

use crate::error::Result;
use crate::parallel::in_parallel;
use crate::random::Keyed;
use crate::report::statistics::{mean, median_high};
use crate::scene::capture::{Capture, FramePoint};
use crate::scene::prior::read_depth;
use crate::stage::DepthSpace;
use crate::train::pinhole::Pinhole;
use glam::DVec3;
use std::collections::BTreeMap;
use std::fmt;

/// Points that a fit needs.
const FEWEST: usize = 10;
/// Lines through two points that are tried.
const LINES: u64 = 500;
/// A residual is near within this many standard deviations.
const NEAR: f64 = 2.5;
/// Standard deviations in a median magnitude of normal numbers.
const PER_MEDIAN: f64 = 1.4826;
/// Least squares over the near points, each time anew.
const ITERATIONS: usize = 5;
/// Largest standard error of the scale, in units of the scale.
const UNSURE: f64 = 0.25;
/// Largest median residual, in units of the median depth.
const LOOSE: f64 = 0.1;
/// Key of the choice of lines.
const KEY: u64 = 0x0064_6570_7468;

/// The depth of an image is `scale * prior + shift`, in units of the capture's world.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DepthFit {
    /// Positive.
    pub scale: f64,
    /// In units of the depth.
    pub shift: f64,
    /// Points near the line.
    pub n_points: usize,
    /// Median magnitude of the residuals, in units of the median depth.
    pub residual: f64,
}

/// Why an image's prior is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unfit {
    /// It has no file.
    NoPrior,
    /// Fewer than 10 points are seen where the prior has a value.
    FewPoints,
    /// The points are too much alike, in the prior or in depth, to tell the scale.
    Flat,
    /// The prior falls where depth rises.
    Inverted,
    /// Half of the points lie farther from the line than a tenth of their depth.
    Loose,
}

impl Unfit {
    /// The reason in words.
    pub fn reason(self) -> &'static str {
        match self {
            Unfit::NoPrior => "no file",
            Unfit::FewPoints => "fewer than 10 points seen",
            Unfit::Flat => "the points do not tell the scale",
            Unfit::Inverted => "the scale is not positive",
            Unfit::Loose => "the points do not follow the prior",
        }
    }
}

/// The fits of the training images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthFits(BTreeMap<(usize, u32), std::result::Result<DepthFit, Unfit>>);

impl DepthFits {
    /// The fit of the image of `camera` at `frame`; `None` when it has no usable prior.
    pub fn get(&self, camera: usize, frame: u32) -> Option<DepthFit> {
        self.0.get(&(camera, frame))?.ok()
    }

    /// By (camera, frame): the fit, or why there is no fit.
    pub fn iter(&self) -> impl Iterator<Item = ((usize, u32), std::result::Result<DepthFit, Unfit>)> {
        self.0.iter().map(|(image, fit)| (*image, *fit))
    }

    /// How many images have a usable prior, and why the others not.
    pub fn summary(&self) -> DepthSummary {
        let mut residuals: Vec<f64> = self.0.values().flatten().map(|fit| fit.residual).collect();
        residuals.sort_by(f64::total_cmp);
        let mut unfit = BTreeMap::new();
        self.0.values().filter_map(|fit| fit.err()).for_each(|why| *unfit.entry(why).or_default() += 1);
        let residual = residuals.get(residuals.len() / 2).copied();
        DepthSummary { images: self.0.len(), usable: residuals.len(), unfit, residual }
    }
}

/// What a report says of the depth priors.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DepthSummary {
    /// Training images.
    pub images: usize,
    /// Of them with a usable prior.
    pub usable: usize,
    /// The others, by reason.
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
/// points that project into it. Depth is in the units of the capture's world. Each prior is read once and not kept.
/// `progress` is called as (frames done, frames in all).
///
/// # Errors
/// [`crate::Error::Data`] when a prior or the points of a frame cannot be read.
#[tracing::instrument(level = "info", name = "fit depths", skip_all)]
pub fn fit_depths(
    capture: &Capture,
    space: DepthSpace,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<DepthFits> {
    let sparse: Vec<[f64; 3]> = capture.points.iter().map(|point| point.position).collect();
    let mut by_frame: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    capture.training_frames().into_iter().for_each(|(camera, frame)| by_frame.entry(frame).or_default().push(camera));
    let n_frames = by_frame.len();
    let mut fits = BTreeMap::new();
    for (n_done, (frame, cameras)) in by_frame.into_iter().enumerate() {
        let points = if capture.has_frame_points() { Some(capture.points_of(frame)?) } else { None };
        let fit = |i: usize| {
            let seen = |points: &Vec<FramePoint>| {
                let seen = points.iter().filter(|point| point.seen_by.contains(&cameras[i]));
                seen.map(|point| point.position).collect::<Vec<_>>()
            };
            let pairs =
                pairs(capture, cameras[i], frame, space, points.as_ref().map(seen).as_ref().unwrap_or(&sparse))?;
            Ok(pairs.map_or(Err(Unfit::NoPrior), |pairs| fit_line(&pairs)))
        };
        let fitted = in_parallel(cameras.len(), threads, fit, |_| {})?;
        fits.extend(cameras.into_iter().zip(fitted).map(|(camera, fit)| ((camera, frame), fit)));
        progress(n_done + 1, n_frames);
    }
    Ok(DepthFits(fits))
}

/// (prior, depth) of the points in an image; `None` when the image has no prior.
fn pairs(
    capture: &Capture,
    camera: usize,
    frame: u32,
    space: DepthSpace,
    points: &[[f64; 3]],
) -> Result<Option<Vec<(f64, f64)>>> {
    let shot = capture.cameras[camera].shot(frame);
    let Some(path) = shot.and_then(|shot| shot.depth.as_ref()) else { return Ok(None) };
    let view = capture.view(camera, frame)?;
    let prior = read_depth(path, view.intrinsics.width, view.intrinsics.height)?;
    let camera = Pinhole::new(&view);
    let pair = |point: &[f64; 3]| {
        let (at, z) = camera.project(DVec3::from_array(*point))?;
        let value = f64::from(prior[camera.pixel(at)?]);
        let depth = if space == DepthSpace::Inverse { 1.0 / z } else { z };
        (value.is_finite() && depth.is_finite()).then_some((value, depth))
    };
    Ok(Some(points.iter().filter_map(pair).collect()))
}

/// The line depth = scale * prior + shift through `pairs`.
fn fit_line(pairs: &[(f64, f64)]) -> std::result::Result<DepthFit, Unfit> {
    let n = pairs.len();
    if n < FEWEST {
        return Err(Unfit::FewPoints);
    }
    // Of at least one value.
    let middle = |values: &mut dyn Iterator<Item = f64>| median_high(values).unwrap_or(f64::NAN);
    let random = Keyed::new(&[KEY, n as u64]);
    let mut best = (f64::INFINITY, (0.0, 0.0));
    for line in 0..LINES {
        let [(x0, y0), (x1, y1)] = [2 * line, 2 * line + 1].map(|i| pairs[(random.bits(i) % n as u64) as usize]);
        let scale = (y1 - y0) / (x1 - x0);
        let line = (scale, y0 - scale * x0);
        let off = middle(&mut pairs.iter().map(|pair| residual(line, pair).abs()));
        // Written so that a line through points of one prior, which is not finite, is not taken.
        if off < best.0 {
            best = (off, line);
        }
    }
    let (mut off, mut line) = best;
    if !off.is_finite() {
        return Err(Unfit::Flat);
    }
    let typical = middle(&mut pairs.iter().map(|(_, depth)| depth.abs()));
    let (mut n_near, mut spread, mut sigma) = (0, 0.0, 0.0);
    for _ in 0..ITERATIONS {
        // The floor keeps points that lie on the line but for rounding.
        let reach = NEAR * PER_MEDIAN * off + 1e-9 * typical;
        let near: Vec<(f64, f64)> = pairs.iter().copied().filter(|pair| residual(line, pair).abs() <= reach).collect();
        n_near = near.len();
        let mean = |of: fn(&(f64, f64)) -> f64| mean(near.iter().map(of)).unwrap_or(f64::NAN);
        let (mean_x, mean_y) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| near.iter().map(|(x, y)| of(x - mean_x, y - mean_y)).sum::<f64>();
        spread = sum(&|x, _| x * x);
        let scale = sum(&|x, y| x * y) / spread;
        line = (scale, mean_y - scale * mean_x);
        sigma = (sum(&|x, y| (y - scale * x).powi(2)) / n_near as f64).sqrt();
        off = middle(&mut near.iter().map(|pair| residual(line, pair).abs()));
    }
    let (scale, shift) = line;
    let fit = DepthFit { scale, shift, n_points: n_near, residual: off / typical };
    // Each test is written so that NaN fails it.
    let is_sure = sigma / spread.sqrt() <= UNSURE * scale.abs() && scale.is_finite() && shift.is_finite();
    match () {
        () if n_near < FEWEST => Err(Unfit::FewPoints),
        () if !is_sure => Err(Unfit::Flat),
        () if scale <= 0.0 => Err(Unfit::Inverted),
        () if fit.residual <= LOOSE => Ok(fit),
        () => Err(Unfit::Loose),
    }
}

fn residual((scale, shift): (f64, f64), (x, y): &(f64, f64)) -> f64 {
    y - (scale * x + shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on the line 0.5 x - 0.2 but for noise, every `every`-th anywhere.
    fn pairs(n: u64, noise: f64, every: u64) -> Vec<(f64, f64)> {
        let random = Keyed::new(&[3]);
        let pair = |i: u64| {
            let x = 1.0 + random.uniform(3 * i);
            let y = 0.5 * x - 0.2 + noise * random.normal(1000 + i);
            (x, if i % every == every - 1 { 2.0 * random.uniform(3 * i + 1) } else { y })
        };
        (0..n).map(pair).collect()
    }

    #[test]
    fn a_line_is_found_among_outliers() {
        for (n, every, tolerance) in [(200, 1000, 0.01), (200, 3, 0.02), (40, 4, 0.03)] {
            let fit = fit_line(&pairs(n, 0.005, every)).unwrap();
            assert!((fit.scale - 0.5).abs() < tolerance && (fit.shift + 0.2).abs() < 1.5 * tolerance, "{n}: {fit:?}");
        }
        let exact = fit_line(&pairs(10, 0.0, 1000)).unwrap();
        assert!((exact.scale - 0.5).abs() < 1e-9 && (exact.shift + 0.2).abs() < 1e-9 && exact.n_points == 10);
    }

    #[test]
    fn what_tells_no_scale_is_refused_with_its_reason() {
        assert_eq!(fit_line(&pairs(9, 0.0, 1000)).unwrap_err(), Unfit::FewPoints);
        assert_eq!(fit_line(&[(1.0, 2.0); 30]).unwrap_err(), Unfit::Flat);
        let alike: Vec<_> = pairs(100, 0.05, 1000).iter().map(|(x, y)| (1.0 + 1e-3 * x, *y)).collect();
        assert!(fit_line(&alike).is_ok(), "a small range of the prior is no fault");
        let flat: Vec<_> = pairs(100, 0.0, 1).into_iter().map(|(x, y)| (x, 1.0 + 1e-3 * y)).collect();
        assert_eq!(fit_line(&flat).unwrap_err(), Unfit::Flat);
        let inverted: Vec<_> = pairs(100, 0.005, 1000).into_iter().map(|(x, y)| (-x, y)).collect();
        assert_eq!(fit_line(&inverted).unwrap_err(), Unfit::Inverted);
        let loose: Vec<_> = pairs(100, 0.15, 1000);
        assert!([Unfit::Loose, Unfit::Flat].contains(&fit_line(&loose).unwrap_err()));
    }
}
