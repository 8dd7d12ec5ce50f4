//! Learnt corrections of the cameras' poses, and their steps.

use crate::scene::Pose;
use glam::{DMat3, DVec3};

/// Correction and moments of one camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseState {
    /// Turn about the world's axes, radians; shift along them, scene units.
    pub value: [DVec3; 2],
    /// First moments of the gradient.
    pub first: [DVec3; 2],
    /// Steps so far.
    pub n: i32,
}

/// Second moments of the lengths of the gradients by turn and shift, of all cameras together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseMoments {
    /// A third of the squared length, on average.
    pub second: [f64; 2],
    /// Steps so far.
    pub n: i32,
}

/// The inputs of a step of the poses beside the gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRule {
    /// Learning rates, radians and scene units.
    pub rates: [f64; 2],
    /// Longest turn and shift.
    pub most: [f64; 2],
}

/// `pose` turned and shifted: `x_camera = R exp([turn]x) (x - center - shift)`.
pub fn corrected(pose: &Pose, [turn, shift]: [DVec3; 2]) -> Pose {
    Pose::at(pose.center() + shift, pose.rotation * rotation(turn))
}

/// The rotation by the angle `|turn|` about `turn` (Rodrigues).
fn rotation(turn: DVec3) -> DMat3 {
    let angle = turn.length();
    if angle > 0.0 { DMat3::from_axis_angle(turn / angle, angle) } else { DMat3::IDENTITY }
}

/// A step of `camera`, whose loss has the gradient `d_turn`, `d_shift` along the camera's own axes and whose rotation is `seen`.
/// `centers` are those of the cameras whose poses are learnt, none of the others.
pub fn pose_step(
    poses: &mut [PoseState],
    all: &mut PoseMoments,
    centers: &[Option<DVec3>],
    camera: usize,
    seen: &DMat3,
    [d_turn, d_shift]: [DVec3; 2],
    rule: &PoseRule,
) {
    if centers[camera].is_none() {
        return;
    }
    let (beta1, beta2) = (f64::from(0.9_f32), f64::from(0.999_f32));
    let pose = &mut poses[camera];
    pose.n += 1;
    all.n += 1;
    for (k, g) in [seen.transpose() * d_turn, -(seen.transpose() * d_shift)].into_iter().enumerate() {
        pose.first[k] = beta1 * pose.first[k] + (1.0 - beta1) * g;
        all.second[k] = beta2 * all.second[k] + (1.0 - beta2) * g.length_squared() / 3.0;
        let root = (all.second[k] / (1.0 - beta2.powi(all.n))).sqrt();
        let size = rule.rates[k] / (1.0 - beta1.powi(pose.n)) / (root + 1e-15);
        pose.value[k] = (pose.value[k] - size * pose.first[k]).clamp_length_max(rule.most[k]);
    }
    take_off_what_is_common(poses, centers);
}

/// The gauge: no mean turn, no mean shift, no growth about the mean of the centres.
fn take_off_what_is_common(poses: &mut [PoseState], centers: &[Option<DVec3>]) {
    let learnt: Vec<(usize, DVec3)> = centers.iter().enumerate().filter_map(|(k, c)| Some((k, (*c)?))).collect();
    let n = learnt.len() as f64;
    let middle = learnt.iter().map(|(_, c)| *c).sum::<DVec3>() / n;
    let mean = |part: usize| learnt.iter().map(|(k, _)| poses[*k].value[part]).sum::<DVec3>() / n;
    let (turn, shift) = (mean(0), mean(1));
    let along: f64 = learnt.iter().map(|(k, c)| (*c - middle).dot(poses[*k].value[1])).sum();
    let spread: f64 = learnt.iter().map(|(_, c)| (*c - middle).length_squared()).sum();
    let growth = if spread > 0.0 { along / spread } else { 0.0 };
    for (k, c) in learnt {
        let from_middle = c - middle;
        let [own_turn, own_shift] = &mut poses[k].value;
        *own_turn -= turn;
        *own_shift -= shift + growth * from_middle;
    }
}
