//! The cameras that take part, the frame that each shows, and whether its picture is cut out.

use crate::parallel::{in_parallel, threads};
use crate::scene::View;
use crate::scene::capture::{Camera, Capture};

const MOST_CAMERAS: usize = 32;
const MOST_DECIDING: usize = 8;

/// The training cameras that take part, or the photographs. Photographs are used apart: things may have stood
/// elsewhere when they were taken.
pub(super) fn cameras(capture: &Capture, are_photos: bool) -> Vec<usize> {
    let takes_part = |camera: &Camera| !camera.is_test && camera.is_photo == are_photos && !camera.shots.is_empty();
    let all: Vec<usize> = (0..capture.cameras.len()).filter(|index| takes_part(&capture.cameras[*index])).collect();
    picked(&all, MOST_CAMERAS)
}

/// The views of the training cameras that take part, at the reference frame or at the first that they have.
pub(super) fn views(capture: &Capture) -> Vec<View> {
    let view = |camera: &usize| {
        let frame = shown(capture, *camera, capture.reference_frame, true)?;
        capture.view(*camera, frame).ok()
    };
    cameras(capture, false).iter().filter_map(view).collect()
}

/// The frame that a camera shows for `frame`: another, if it has none there and `any` will do.
pub(super) fn shown(capture: &Capture, camera: usize, frame: u32, any: bool) -> Option<u32> {
    let camera = &capture.cameras[camera];
    camera.shot(frame).or_else(|| camera.shots.first().filter(|_| any)).map(|shot| shot.frame)
}

/// At most `most` of `all`, evenly chosen.
pub(crate) fn picked<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let n = all.len().min(most);
    (0..n).map(|i| all[i * all.len() / n]).collect()
}

/// Every n-th of `all`, at most `most`.
pub(crate) fn evenly_chosen<T>(all: Vec<T>, most: usize) -> Vec<T> {
    let each = all.len().div_ceil(most).max(1);
    all.into_iter().step_by(each).collect()
}

/// True if at least half of the training pictures, by a sample, are cut out: transparent along half of their rim. An
/// undistorted lens leaves transparent corners, too, but fewer.
pub(super) fn are_cut_out(capture: &Capture) -> bool {
    let tested = evenly_chosen(cameras(capture, false), MOST_DECIDING);
    let is_cut_out = |k: usize| {
        let Some(frame) = shown(capture, tested[k], capture.reference_frame, true) else { return Ok(false) };
        let width = capture.cameras[tested[k]].intrinsics.width as usize;
        // A picture that cannot be read is a fault where it is needed.
        let Ok(Some(opaque)) = capture.opaque(tested[k], frame) else { return Ok(false) };
        let n_rows = opaque.len() / width.max(1);
        let is_rim = |at: usize| [0, width - 1].contains(&(at % width)) || [0, n_rows - 1].contains(&(at / width));
        let rim: Vec<bool> = (0..opaque.len()).filter(|at| is_rim(*at)).map(|at| opaque[at]).collect();
        Ok(2 * rim.iter().filter(|is_opaque| !**is_opaque).count() >= rim.len())
    };
    let cut_out = in_parallel(tested.len(), threads(), is_cut_out, |_| {}).unwrap_or_default();
    !tested.is_empty() && 2 * cut_out.iter().filter(|is| **is).count() >= tested.len()
}
