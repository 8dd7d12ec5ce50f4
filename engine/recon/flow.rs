//! Flow-guided sparse initialisation (SPEC 5): static Gaussians from the points of the reference frame, dynamic ones
//! from the points of every frame that move.
//! Frames are read one after another, so that memory grows with the result alone.

use super::Progress;
use super::chosen::picked;
use super::pinhole::Pinhole;
use super::points::{Found, OPACITY, Reach, push, spacings};
use super::settings::{Init, Settings};
use crate::error::Result;
use crate::parallel::{in_parallel, threads};
use crate::scene::capture::{Capture, FramePoint};
use crate::scene::prior::read_flow;
use crate::scene::{Motion, Splats};
use glam::{DMat3, DVec2, DVec3};
use std::fmt;

/// Views of a point that its velocity is taken from, evenly chosen: every pair of them is tried.
const MOST_VIEWS: usize = 8;
/// A point with more flow than this moves, pixels per frame (SPEC 5).
const THRESHOLD: f64 = 0.1;
/// How long a Gaussian from the points of one frame is visible, frames; twice as long made no difference.
const POINT_TAU: f64 = 2.0;
/// Flow agrees with a movement within this many thresholds and this part of its length.
const AGREE_THRESHOLDS: f64 = 2.0;
const AGREE_PART: f64 = 0.15;
/// Variance of the flow in units of its square: a movement of which all views show far less is not believed.
const RIDGE: f64 = 1e-3;
/// Steps of Gauss and Newton: a projection is nearly linear over the way of a frame.
const STEPS: usize = 4;

/// The fate of the points of all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PointCounts {
    pub before: usize,
    /// Gaussians from points that stand still.
    pub n_static: usize,
    /// Gaussians from points that belong to their frame.
    pub n_dynamic: usize,
    pub with_velocity: usize,
    /// Points without flow in any view; they count as static.
    pub without_flow: usize,
}

impl PointCounts {
    pub fn after(&self) -> usize {
        self.n_static + self.n_dynamic
    }

    pub fn ratio(&self) -> f64 {
        self.after() as f64 / self.before.max(1) as f64
    }
}

impl fmt::Display for PointCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (percent, after) = (100.0 * self.ratio(), self.after());
        write!(f, "{} points of all frames -> {after} ({percent:.1} %), ", self.before)?;
        write!(f, "{} of them with a velocity", self.with_velocity)
    }
}

pub(super) struct FromFrames {
    /// Static points of the reference frame, with the standard deviations of their Gaussians.
    pub still: (Vec<Found>, Vec<f64>),
    pub moving: Splats,
    pub counts: PointCounts,
}

/// The motion that static points of the reference frame begin with, unless they are static for good.
pub(super) fn motion_at_rest(capture: &Capture, settings: &Settings) -> Option<Motion> {
    let t_center = (f64::from(capture.reference_frame) / f64::from(capture.n_frames)) as f32;
    let t_scale = settings.static_tau.ln() as f32;
    let may_move = settings.static_tau > 0.0 && !capture.has_photos();
    may_move.then_some(Motion { velocity: [0.0; 3], t_center, t_scale })
}

/// Reads the points and the flow of all frames.
pub(super) fn from_frames(
    capture: &Capture,
    settings: &Settings,
    rule: Init,
    progress: &mut Progress,
) -> Result<FromFrames> {
    let threads = threads();
    let reach = Reach::new(capture);
    let dt = 1.0 / f64::from(capture.n_frames);
    let by_flow = rule != Init::Concat;
    let mut counts = PointCounts::default();
    let mut still = (Vec::new(), Vec::new());
    let mut moving = Splats::new(settings.sh_degree);
    for frame in 0..capture.n_frames {
        let points = capture.points_of(frame)?;
        let color = |point: &FramePoint| point.color.map(|c| f32::from(c) / 255.0);
        let found: Vec<Found> =
            points.iter().map(|point| Found { position: point.position, color: color(point) }).collect();
        let sizes = spacings(&found, &reach);
        let sights = if by_flow { sights(capture, &points, frame, threads)? } else { Vec::new() };
        counts.before += points.len();
        for (i, (found, &size)) in found.iter().zip(&sizes).enumerate() {
            let sights = sights.get(i).map_or(&[][..], Vec::as_slice);
            counts.without_flow += usize::from(by_flow && sights.is_empty());
            let is_dynamic = !by_flow || moves(sights, rule);
            if is_dynamic && capture.n_frames > 1 {
                let way = movement(DVec3::from_array(found.position), sights);
                let motion = Motion {
                    velocity: (way / dt).as_vec3().to_array(),
                    t_center: (f64::from(frame) * dt) as f32,
                    t_scale: (POINT_TAU * dt).ln() as f32,
                };
                push(&mut moving, found, size, OPACITY, Some(motion));
                counts.with_velocity += usize::from(way != DVec3::ZERO);
            } else if frame == capture.reference_frame {
                still.0.push(*found);
                still.1.push(size);
            }
        }
        progress(frame as usize + 1, capture.n_frames as usize);
    }
    (counts.n_static, counts.n_dynamic) = (still.0.len(), moving.len());
    Ok(FromFrames { still, moving, counts })
}

/// The movement of a point as a camera saw it.
#[derive(Clone, Copy)]
struct Sight {
    /// The camera at the frame in which the movement ends.
    camera: Pinhole,
    /// Where the point is then, pixels.
    to: DVec2,
    /// How far the point itself moved, pixels: the flow without the camera's own movement.
    moved: f64,
    /// The four pixels around the point agree on whether it moves; at the rim of a moving thing they do not.
    is_clear: bool,
}

/// True if a point moves in two views, or in the only one: one of many is often wrong, if its clock is off or something
/// passed before the point. Unclear views count only if there is no clear one. By the paper's rule one view is enough.
fn moves(sights: &[Sight], rule: Init) -> bool {
    let moving = |sight: &&Sight| sight.moved > THRESHOLD;
    if rule == Init::AnyView {
        return sights.iter().any(|sight| moving(&sight));
    }
    match sights.iter().filter(|sight| sight.is_clear).count() {
        0 => sights.iter().any(|sight| moving(&sight)),
        n_clear => sights.iter().filter(|sight| sight.is_clear).filter(moving).count() >= n_clear.min(2),
    }
}

/// By point, the views that have flow there. A camera without flow of the frame uses that of the frame before.
fn sights(capture: &Capture, points: &[FramePoint], frame: u32, threads: usize) -> Result<Vec<Vec<Sight>>> {
    let of_camera = |camera: usize| -> Result<Vec<(usize, Sight)>> {
        let has_flow = |from: &u32| capture.cameras[camera].shot(*from).is_some_and(|shot| shot.flow.is_some());
        let from = [Some(frame), frame.checked_sub(1)].into_iter().flatten().find(has_flow);
        let is_used = !capture.cameras[camera].is_test && points.iter().any(|point| point.seen_by.contains(&camera));
        let Some(from) = from.filter(|_| is_used) else { return Ok(Vec::new()) };
        let Some(path) = capture.cameras[camera].shot(from).and_then(|shot| shot.flow.as_ref()) else {
            return Ok(Vec::new());
        };
        let view = capture.view(camera, from)?;
        let flow = read_flow(path, view.intrinsics.width, view.intrinsics.height)?;
        let before = Pinhole::new(&view);
        let after = if from + 1 < capture.n_frames { Pinhole::new(&capture.view(camera, from + 1)?) } else { before };
        let sight = |point: &FramePoint| {
            let position = DVec3::from_array(point.position);
            let (at, _) = before.project(position)?;
            let (at_rest, _) = after.project(position)?;
            // The pixel's own flow: interpolation would mix moving things with the background.
            let to = at + DVec2::from(flow[before.pixel(at)?].map(f64::from));
            let moved = |at: DVec2, flow: [f32; 2]| (at + DVec2::from(flow.map(f64::from)) - at_rest).length();
            let own = (to - at_rest).length();
            let corners = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)];
            let mut nearest = corners.into_iter().filter_map(|corner| before.pixel(at + DVec2::from(corner)));
            let is_clear = nearest.all(|pixel| (moved(at, flow[pixel]) > THRESHOLD) == (own > THRESHOLD));
            to.is_finite().then_some(Sight { camera: after, to, moved: own, is_clear })
        };
        let seen = points.iter().enumerate().filter(|(_, point)| point.seen_by.contains(&camera));
        Ok(seen.filter_map(|(i, point)| Some((i, sight(point)?))).collect())
    };
    let mut by_point: Vec<Vec<Sight>> = vec![Vec::new(); points.len()];
    for (point, sight) in in_parallel(capture.cameras.len(), threads, of_camera, |_| {})?.into_iter().flatten() {
        by_point[point].push(sight);
    }
    Ok(by_point)
}

/// The movement of a point in a frame on which most of its views agree, two at least; zero if there is none.
fn movement(position: DVec3, sights: &[Sight]) -> DVec3 {
    let sights = picked(sights, MOST_VIEWS);
    let n = sights.len();
    let agreeing = |way: DVec3| -> Vec<Sight> {
        let agrees = |sight: &&Sight| {
            let tolerance = AGREE_THRESHOLDS * THRESHOLD + AGREE_PART * sight.moved;
            sight.camera.project(position + way).is_some_and(|(at, _)| (sight.to - at).length() <= tolerance)
        };
        sights.iter().filter(agrees).copied().collect()
    };
    let mut best: Vec<Sight> = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))) {
        let Some(way) = solve(position, &[sights[i], sights[j]]) else { continue };
        let agreed = agreeing(way);
        if agreed.len() > best.len() {
            best = agreed;
        }
    }
    let is_seen = best.len() >= 2 && best.iter().any(|sight| sight.moved > THRESHOLD);
    let way = if is_seen { solve(position, &best) } else { None };
    way.filter(|way| agreeing(*way).len() >= 2).unwrap_or_default()
}

/// The movement from `position` that ends nearest to where all of `sights` see it, in least squares; the linear part
/// is J R v dt = flow. `None` if it leads behind a camera.
fn solve(position: DVec3, sights: &[Sight]) -> Option<DVec3> {
    let mut way = DVec3::ZERO;
    for _ in 0..STEPS {
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for sight in sights {
            let (at, slopes) = sight.camera.linearised(position + way)?;
            let off = sight.to - at;
            for (slope, off) in slopes.into_iter().zip(off.to_array()) {
                normal += DMat3::from_cols(slope * slope.x, slope * slope.y, slope * slope.z);
                right += slope * off;
            }
        }
        let trace = normal.x_axis.x + normal.y_axis.y + normal.z_axis.z;
        let ridge = RIDGE * trace / 3.0;
        way += (normal + DMat3::from_diagonal(DVec3::splat(ridge))).inverse() * (right - ridge * way);
    }
    way.is_finite().then_some(way)
}
