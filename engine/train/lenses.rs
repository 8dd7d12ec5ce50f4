//! Lenses: views before which density control removes floaters, and spaces before them that are kept clear.
//!
//! A Gaussian just before a lens veils its picture. Training mends that in the pictures of its own cameras, but not
//! where people look from between them, so views between neighbours are lenses too, if a camera sees their place. Not
//! with moving cameras: something may rightly be at their places at another time.

use crate::recon::evenly_chosen;
use crate::scene::capture::{Capture, TRAINING_RADIUS};
use crate::scene::{Clearing, Pose, View};
use glam::{DMat3, DVec2, DVec3};
use std::collections::BTreeSet;

/// Lenses of cameras, and lenses between them, at most: a round of density control tests each Gaussian against all.
const MOST: usize = 64;
const MOST_BETWEEN: usize = 512;
const N_NEIGHBOURS: usize = 6;
/// Cosine of the angle between the axes of neighbours, at least: others may stand behind a wall.
const LEAST_ALIKE: f64 = 0.5;

/// Points whose depths bound the spaces before lenses, at most.
const MOST_POINTS: usize = 10_000;
/// Weight, against that of a neighbour, of a surface through a lens that is flat and at right angles to its axis.
const FLAT: f64 = 0.01;
/// Slope, and bend over the distance to a neighbour, of such a surface at most.
const STEEPEST: f64 = 1.0;

/// Views of every pose of every training camera, and [`Capture::viewpoints`]: at most `MOST`, evenly chosen.
pub(super) fn of_cameras(capture: &Capture) -> Vec<View> {
    evenly_chosen(capture.lens_views(), MOST)
}

/// Views halfway between a camera and each of its neighbours, and amid it and any two of them, if a camera sees the
/// place: at most `MOST_BETWEEN`. None if a camera moves, or unless the clip is a rig's ([`Capture::is_rig_clip`]).
pub(super) fn between_cameras(capture: &Capture) -> Vec<View> {
    if !stand(capture) {
        return Vec::new();
    }
    // The viewpoints come first.
    let cameras = evenly_chosen(capture.lens_views().split_off(capture.viewpoints.len()), MOST);
    let mut sets = BTreeSet::new();
    for i in 0..cameras.len() {
        let neighbours = neighbours(&cameras, i);
        for (at, j) in neighbours.iter().enumerate() {
            sets.insert(BTreeSet::from([i, *j]));
            sets.extend(neighbours[..at].iter().map(|k| BTreeSet::from([i, *j, *k])));
        }
    }
    let amid = |set: BTreeSet<usize>| {
        let sum = |of: fn(&Pose) -> DVec3| set.iter().map(|i| of(&cameras[*i].pose)).sum::<DVec3>();
        let (center, forward) = (sum(Pose::center) / set.len() as f64, sum(Pose::forward));
        let pose = Pose::look_at(center, center + forward, -sum(Pose::down));
        set.first().map(|first| View { pose, ..cameras[*first].clone() })
    };
    let is_seen = |lens: &View| cameras.iter().any(|camera| seen(camera, lens.pose.center()).is_some());
    evenly_chosen(sets.into_iter().filter_map(amid).filter(is_seen).collect(), MOST_BETWEEN)
}

/// True if no training camera moves: a place before or between them is then free at all times.
fn stand(capture: &Capture) -> bool {
    let moves = capture.cameras.iter().any(|camera| !camera.is_test && camera.moves());
    !moves && (capture.n_frames == 1 || capture.is_rig_clip())
}

/// The spaces before training cameras and [`Capture::viewpoints`] in which no Gaussian may be; none if cameras move.
/// Each lies over the surface through a lens and its neighbours, and is a twentieth of the rig's radius deep, but at
/// most half as deep as the nearest points that training cameras see.
pub(super) fn clearings(capture: &Capture) -> Vec<Clearing> {
    if !stand(capture) {
        return Vec::new();
    }
    let cameras = of_cameras(capture);
    let depth = (TRAINING_RADIUS / 20.0).min(0.5 * nearest(capture, &cameras));
    (0..cameras.len()).map(|i| clearing(&cameras, i, depth)).collect()
}

/// All depths of points, before the cameras that see them, are at least this, but for one in a hundred.
fn nearest(capture: &Capture, cameras: &[View]) -> f64 {
    let each = capture.points.len().div_ceil(MOST_POINTS).max(1);
    let points = || capture.points.iter().step_by(each);
    let of_view =
        |view| points().filter_map(move |point| Some(seen(view, point.position.into())?.1)).collect::<Vec<_>>();
    let mut depths: Vec<f64> = cameras.iter().flat_map(of_view).collect();
    depths.sort_unstable_by(f64::total_cmp);
    depths.get(depths.len() / 100).copied().unwrap_or(f64::INFINITY)
}

fn clearing(cameras: &[View], i: usize, depth: f64) -> Clearing {
    let view = &cameras[i];
    let (place, axis) = (view.pose.center(), view.pose.forward());
    let down = view.pose.down();
    let right = down.cross(axis);
    let others = neighbours(cameras, i);
    let others: Vec<DVec3> = others.into_iter().map(|j| cameras[j].pose.center() - place).collect();
    let spacing = others.get(1).or(others.first()).map_or(0.0, |offset| offset.length());
    // Least squares in units of the spacing: height = slope . (x, y) + bend (x^2 + y^2) / 2.
    let (mut system, mut sides) = (DMat3::from_diagonal(DVec3::splat(FLAT)), DVec3::ZERO);
    for offset in others.iter().filter(|_| spacing > 0.0).map(|offset| *offset / spacing) {
        let (x, y) = (offset.dot(right), offset.dot(down));
        let square = x * x + y * y;
        let row = DVec3::new(x, y, 0.5 * square);
        let weight = 1.0 / square.max(FLAT);
        system += weight * DMat3::from_cols(row.x * row, row.y * row, row.z * row);
        sides += weight * offset.dot(axis) * row;
    }
    let fit = (system.inverse() * sides).clamp(DVec3::splat(-STEEPEST), DVec3::splat(STEEPEST));
    let cone = view.cone([0.0; 3]);
    Clearing {
        place: place.as_vec3().to_array(),
        radius: spacing.max(depth * f64::from(cone.reach)) as f32,
        axis: axis.as_vec3().to_array(),
        curvature: if spacing > 0.0 { (fit.z / spacing) as f32 } else { 0.0 },
        slope: (fit.x * right + fit.y * down).as_vec3().to_array(),
        depth: depth as f32,
    }
}

/// The cameras nearest to camera `i` of those that look the same way, more or less.
fn neighbours(cameras: &[View], i: usize) -> Vec<usize> {
    let pose = &cameras[i].pose;
    let looks_alike = |other: &Pose| other.forward().dot(pose.forward()) > LEAST_ALIKE;
    let others = cameras.iter().enumerate().filter(|(j, other)| *j != i && looks_alike(&other.pose));
    let mut near: Vec<(f64, usize)> =
        others.map(|(j, other)| (other.pose.center().distance(pose.center()), j)).collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.into_iter().take(N_NEIGHBOURS).map(|(_, j)| j).collect()
}

/// The place of a point in the picture of `view`, pixels, and its depth; none outside of it.
pub(super) fn seen(view: &View, point: DVec3) -> Option<(DVec2, f64)> {
    let DVec3 { x, y, z } = view.pose.to_camera(point);
    let lens = &view.intrinsics;
    let at = DVec2::new(lens.fx * x / z + lens.cx, lens.fy * y / z + lens.cy);
    (z > 0.0 && lens.holds(at)).then_some((at, z))
}
