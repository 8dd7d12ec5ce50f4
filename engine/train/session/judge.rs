//! The comparison of learnt poses with the capture's.

use crate::error::Result;
use crate::internals::train::lenses::seen;
use crate::internals::train::{Correction, Trainer};
use crate::report::statistics::median_high;
use crate::scene::Splats;
use crate::scene::capture::Capture;
use glam::Vec3;
use std::collections::BTreeMap;

/// Learnt poses that shift the image by less than this, pixels, count as the capture's. The shift is 0.07 to 0.09 pixels
/// if those are right, and 0.26 to 0.41 if they are 0.2 degrees and 10 mm off (`assets/lab/techniques.md`).
const LEAST_DISPLACEMENT: f64 = 0.15;
/// Gaussians whose centres are compared, at most.
const MOST_CENTERS: usize = 2000;

/// Goes on with the capture's poses if those that `trainer` learns hardly differ. Gives the [`displacement`] and true if
/// the poses are learnt to the end; none if none are learnt.
pub(super) fn judge_poses(trainer: &mut Trainer, capture: &Capture) -> Result<Option<(f64, bool)>> {
    let learnt = trainer.poses()?;
    let Some(pixels) = displacement(capture, &learnt, &trainer.splats()?)? else { return Ok(None) };
    let are_learnt = pixels > LEAST_DISPLACEMENT;
    if !are_learnt {
        let mut checkpoint = trainer.checkpoint()?;
        checkpoint.cameras.poses.clear();
        trainer.replace(&checkpoint)?;
    }
    Ok(Some((pixels, are_learnt)))
}

/// The shift of a camera's image by the correction of its pose, pixels: the root mean square over centres of `splats`,
/// and of this the median over the cameras in `learnt`; none if they see no centre.
fn displacement(capture: &Capture, learnt: &BTreeMap<usize, Correction>, splats: &Splats) -> Result<Option<f64>> {
    let each = splats.len().div_ceil(MOST_CENTERS).max(1);
    let mut of_cameras = Vec::new();
    for (camera, correction) in learnt {
        let Some(shot) = capture.cameras[*camera].shots.first() else { continue };
        let view = capture.view(*camera, shot.frame)?;
        let corrected = correction.view(&view);
        let centers = splats.position.iter().step_by(each).map(|center| Vec3::from_array(*center).as_dvec3());
        let moved =
            centers.filter_map(|center| Some(seen(&view, center)?.0.distance_squared(seen(&corrected, center)?.0)));
        let (sum, n) = moved.fold((0.0, 0u32), |(sum, n), squared| (sum + squared, n + 1));
        if n > 0 {
            of_cameras.push((sum / f64::from(n)).sqrt());
        }
    }
    Ok(median_high(of_cameras))
}
