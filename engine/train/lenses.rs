//! Lenses: views before which density control leaves room.
//!
//! What lies just before a lens veils its picture. In a training camera's own picture that shows, and training mends it. Before a
//! place where no camera stands nothing does: a wall that the cameras across the room see may bulge into the room there. People look
//! at a scene from between its cameras, so views between neighbours are lenses too, where a camera looks at their place. Not those of
//! cameras that move: the places between theirs are of many times, and what moves may rightly be there at another.

use crate::scene::capture::Capture;
use crate::scene::{Intrinsics, Pose, View};
use glam::DVec3;
use std::collections::BTreeSet;

/// Lenses of cameras, and lenses between them, at most: a round of density control asks each Gaussian about all.
const MOST: usize = 64;
const MOST_BETWEEN: usize = 512;
/// Neighbours of a camera.
const N_NEIGHBOURS: usize = 6;
/// Cosine of the angle between the axes of neighbours, at least: who looks elsewhere stands elsewhere, perhaps behind a wall.
const LEAST_ALIKE: f64 = 0.5;

/// Views of every pose of every training camera, and those that somebody named: at most `MOST`, evenly chosen.
pub(super) fn of_cameras(capture: &Capture) -> Vec<View> {
    evenly_chosen(capture.lens_views(), MOST)
}

/// Views halfway between a camera and each of its neighbours, and in the middle of it and any two of them, where a camera sees the
/// place: at most `MOST_BETWEEN`, evenly chosen. None where one of them moves, or in a clip that is no
/// rig's ([`Capture::is_rig_clip`]): its cameras may be the places of one that moved.
pub(super) fn between_cameras(capture: &Capture) -> Vec<View> {
    let moves = capture.cameras.iter().any(|camera| !camera.is_test && camera.moves());
    if moves || (capture.n_frames > 1 && !capture.is_rig_clip()) {
        return Vec::new();
    }
    // Those that somebody named come first.
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
    let is_seen = |lens: &View| cameras.iter().any(|camera| depth(camera, lens.pose.center()).is_some());
    evenly_chosen(sets.into_iter().filter_map(amid).filter(is_seen).collect(), MOST_BETWEEN)
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

/// The depth of a point that `view` sees, were nothing before it.
pub(super) fn depth(view: &View, point: DVec3) -> Option<f64> {
    let DVec3 { x, y, z } = view.pose.to_camera(point);
    let is_within = |at: f64, side: u32| (0.0..f64::from(side)).contains(&at);
    let Intrinsics { width, height, fx, fy, cx, cy } = view.intrinsics;
    (z > 0.0 && is_within(fx * x / z + cx, width) && is_within(fy * y / z + cy, height)).then_some(z)
}

/// At most `most` of `views`, every so many.
pub(super) fn evenly_chosen(views: Vec<View>, most: usize) -> Vec<View> {
    let each = views.len().div_ceil(most).max(1);
    views.into_iter().step_by(each).collect()
}
