//! The cameras' learnt poses, told and written.

use crate::screen::out;
use crate::verbs::eval::Scorer;
use ivv::report::statistics::median_high;
use ivv::scene::{View, write_views};
use ivv::train::{LearntPose, Trainer, learnt_poses};
use ivv::words::count;
use std::path::Path;

/// The learnt poses, which also become `cameras.json` in `output`: the views of the training cameras from there, in the capture's
/// own world, for other programs and `ivv render`. Empty where none are learnt.
pub fn table(trainer: &mut Trainer, scorer: &Scorer, output: &Path) -> ivv::Result<Vec<LearntPose>> {
    let Scorer { capture, run, .. } = scorer;
    let world = run.world.inverse();
    let learnt = trainer.poses()?;
    let mut views = Vec::new();
    for (index, correction) in &learnt {
        let camera = &capture.cameras[*index];
        // One view of a camera that stays where it is.
        let moves = camera.shots.iter().any(|shot| shot.world_to_camera.is_some());
        let shots = if moves { &camera.shots[..] } else { &camera.shots[..camera.shots.len().min(1)] };
        for shot in shots {
            let view = correction.view(&capture.view(*index, shot.frame)?);
            let next_pose = view.next_pose.map(|pose| world.pose(&pose));
            views.push(View { pose: world.pose(&view.pose), next_pose, ..view });
        }
    }
    if !views.is_empty() {
        write_views(&output.join("cameras.json"), &views)?;
    }
    let in_capture = learnt.into_iter().map(|(camera, correction)| (camera, correction.in_world(&run.world)));
    Ok(learnt_poses(capture, &in_capture.collect()))
}

/// In a line, for people.
pub fn print(poses: &[LearntPose]) {
    let median = |of: &dyn Fn(&LearntPose) -> f64| median_high(poses.iter().map(of)).unwrap_or(0.0);
    let largest = poses.iter().max_by(|a, b| a.turn_degrees.total_cmp(&b.turn_degrees));
    let Some(largest) = largest else { return };
    out!(
        "poses of {}: turned by {:.3} degrees and shifted by {:.3e} in the median; {} most, by {:.3} degrees",
        count(poses.len(), "camera"),
        median(&|pose| pose.turn_degrees),
        median(&|pose| pose.shift),
        largest.camera,
        largest.turn_degrees
    );
}
