//! Cut-out pictures, which are transparent all around an object.

use super::chosen::{cameras, shown};
use crate::parallel::{in_parallel, threads};
use crate::scene::capture::Capture;

/// So many pictures decide.
const MOST_DECIDING: usize = 8;

/// True if at least half of the training pictures, by a sample, are cut out: transparent along half of their rim. An
/// undistorted lens leaves transparent corners, too, but fewer.
pub(super) fn are(capture: &Capture) -> bool {
    let cameras = cameras(capture, false);
    let some: Vec<usize> = cameras.iter().step_by(cameras.len().div_ceil(MOST_DECIDING).max(1)).copied().collect();
    let is_cut_out = |k: usize| {
        let Some(frame) = shown(capture, some[k], capture.reference_frame, true) else { return Ok(false) };
        let width = capture.cameras[some[k]].intrinsics.width as usize;
        // A picture that cannot be read is a fault where it is needed.
        let Ok(Some(opaque)) = capture.opaque(some[k], frame) else { return Ok(false) };
        let n_rows = opaque.len() / width.max(1);
        let is_rim = |at: usize| [0, width - 1].contains(&(at % width)) || [0, n_rows - 1].contains(&(at / width));
        let rim: Vec<bool> = (0..opaque.len()).filter(|at| is_rim(*at)).map(|at| opaque[at]).collect();
        Ok(2 * rim.iter().filter(|is_opaque| !**is_opaque).count() >= rim.len())
    };
    let cut_out = in_parallel(some.len(), threads(), is_cut_out, |_| {}).unwrap_or_default();
    !some.is_empty() && 2 * cut_out.iter().filter(|is| **is).count() >= some.len()
}

/// True if the alpha of its pictures marks the moving objects of `capture`: in the clip of a rig, the cut-out may move.
pub(super) fn tells_what_moves(capture: &Capture) -> bool {
    capture.is_rig_clip() && are(capture)
}
