//! The cameras that take part, and the frame that each shows.

use crate::scene::View;
use crate::scene::capture::{Camera, Capture};

/// Training cameras that take part, evenly chosen.
const MOST_CAMERAS: usize = 32;

/// The training cameras that take part, or the photographs. Photographs are used apart: things may have stood
/// elsewhere when they were taken.
pub(super) fn cameras(capture: &Capture, are_photos: bool) -> Vec<usize> {
    let takes_part = |camera: &Camera| !camera.is_test && camera.is_photo == are_photos && !camera.shots.is_empty();
    let all: Vec<usize> = (0..capture.cameras.len()).filter(|index| takes_part(&capture.cameras[*index])).collect();
    let n = all.len().min(MOST_CAMERAS);
    (0..n).map(|i| all[i * all.len() / n]).collect()
}

/// The views of the training cameras that take part, at the reference frame or at the first that they have.
pub(super) fn views(capture: &Capture) -> Vec<View> {
    let view = |camera: &usize| {
        let frame = shown(capture, *camera, capture.reference_frame, true)?;
        capture.view(*camera, frame).ok()
    };
    cameras(capture, false).iter().filter_map(view).collect()
}

/// The frame that a camera shows for `frame`: another, if it has none there and `any` will do. In a monocular clip each
/// has one frame of its own.
pub(super) fn shown(capture: &Capture, camera: usize, frame: u32, any: bool) -> Option<u32> {
    let camera = &capture.cameras[camera];
    camera.shot(frame).or_else(|| camera.shots.first().filter(|_| any)).map(|shot| shot.frame)
}

/// Every n-th of `views`, at most `most`.
pub(crate) fn evenly_chosen(views: Vec<View>, most: usize) -> Vec<View> {
    let each = views.len().div_ceil(most).max(1);
    views.into_iter().step_by(each).collect()
}
