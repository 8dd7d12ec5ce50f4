//! The cameras' learnt poses: cameras.json and its summary.

use crate::run::scoring::Scorer;
use crate::ui::screen::out;
use ivv::internals::report::statistics::median_high;
use ivv::internals::scene::{View, write_views};
use ivv::internals::train::Trainer;
use ivv::internals::words::count;
use std::path::Path;

/// A camera with a learnt pose, as in train.json.
#[derive(serde::Serialize)]
pub struct PoseRow {
    camera: String,
    turn_degrees: f64,
    /// Distance between the learnt centre and the capture's, in the capture's units.
    shift: f64,
}

/// The cameras with learnt poses. Writes the training views from these, in the capture's world, to `cameras.json` in `output`.
pub fn table(trainer: &mut Trainer, scorer: &Scorer, output: &Path) -> ivv::Result<Vec<PoseRow>> {
    let Scorer { capture, run, .. } = scorer;
    let world = run.world.inverse();
    let (mut rows, mut views) = (Vec::new(), Vec::new());
    for (index, correction) in trainer.poses()? {
        let camera = &capture.cameras[index];
        // A static camera has one view.
        for shot in camera.shots.iter().take(if camera.moves() { usize::MAX } else { 1 }) {
            let view = correction.view(&capture.view(index, shot.frame)?);
            let next_pose = view.next_pose.map(|pose| world.pose(&pose));
            views.push(View { pose: world.pose(&view.pose), next_pose, ..view });
        }
        let in_capture = correction.in_capture(&run.world);
        let (turn_degrees, shift) = (in_capture.turn.length().to_degrees(), in_capture.shift.length());
        rows.push(PoseRow { camera: camera.name.clone(), turn_degrees, shift });
    }
    if !views.is_empty() {
        write_views(&output.join("cameras.json"), &views)?;
    }
    Ok(rows)
}

pub fn verdict(pixels: f64, are_learnt: bool) -> String {
    let consequence = match are_learnt {
        true => "the calibration is off: training refines the poses to the end",
        false => "the calibration is right: the poses of the capture are back",
    };
    format!("refined poses shift the images by {pixels:.2} pixels (median); {consequence}")
}

pub fn print(rows: &[PoseRow]) {
    let median = |of: fn(&PoseRow) -> f64| median_high(rows.iter().map(of)).unwrap_or(0.0);
    let Some(most) = rows.iter().max_by(|a, b| a.turn_degrees.total_cmp(&b.turn_degrees)) else { return };
    let (cameras, turn, shift) = (count(rows.len(), "camera"), median(|row| row.turn_degrees), median(|row| row.shift));
    out!(
        "poses of {cameras}: turned by {turn:.3} degrees and shifted by {shift:.4} of the capture's units (medians); {} turned \
         most, by {:.3} degrees",
        most.camera,
        most.turn_degrees
    );
}
