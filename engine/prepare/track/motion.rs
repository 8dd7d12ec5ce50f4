//! The motion of a rig, from those of its cameras that were placed.

use glam::{DMat3, DQuat, DVec3, DVec4};

use crate::report::statistics::median_high;
use crate::scene::Pose;

/// A camera is misplaced that is farther from where its rig puts it than so many times what half of the cameras are.
const MISPLACED: f64 = 5.0;
/// Allowed in any case: a part of the rig's size, and radians.
const TOLERANCE: [f64; 2] = [0.02, 0.02];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    turn: DMat3,
    shift: DVec3,
}

impl Motion {
    fn of_camera((before, after): (Pose, Pose)) -> Motion {
        let turn = after.rotation.transpose() * before.rotation;
        Motion { turn, shift: after.center() - turn * before.center() }
    }

    /// The mean motion of cameras: the mean turn, and the shift that is best with it.
    fn of_cameras(pairs: &[(Pose, Pose)]) -> Motion {
        let turns: Vec<DVec4> =
            pairs.iter().map(|pair| DVec4::from(DQuat::from_mat3(&Motion::of_camera(*pair).turn))).collect();
        let first = turns.first().copied().unwrap_or(DVec4::W);
        // A turn has two quaternions, one the negative of the other.
        let sum: DVec4 = turns.iter().map(|turn| if turn.dot(first) < 0.0 { -*turn } else { *turn }).sum();
        let turn = DMat3::from_quat(DQuat::from_vec4(sum.try_normalize().unwrap_or(DVec4::W)));
        let shifts = pairs.iter().map(|(before, after)| after.center() - turn * before.center());
        Motion { turn, shift: shifts.sum::<DVec3>() / pairs.len().max(1) as f64 }
    }

    pub fn of(&self, pose: &Pose) -> Pose {
        Pose::at(self.turn * pose.center() + self.shift, pose.rotation * self.turn.transpose())
    }

    /// How far a camera is from where the motion takes it: distance, and radians.
    fn error(&self, (before, after): &(Pose, Pose)) -> [f64; 2] {
        let moved = self.of(before);
        [moved.center().distance(after.center()), angle(&moved.rotation, &after.rotation)]
    }
}

fn angle(a: &DMat3, b: &DMat3) -> f64 {
    let turn = *a * b.transpose();
    (0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos()
}

/// The rig's motion from the `first` poses to those that were placed, and which of these agree with it; none where fewer than `least` do.
pub(super) fn rigid(first: &[Pose], now: &[Option<Pose>], least: usize) -> Option<(Motion, Vec<bool>)> {
    let pairs: Vec<Option<(Pose, Pose)>> = first.iter().zip(now).map(|(a, b)| b.map(|b| (*a, b))).collect();
    let placed: Vec<(Pose, Pose)> = pairs.iter().flatten().copied().collect();
    let errors = |motion: &Motion| -> [f64; 2] {
        std::array::from_fn(|k| median_high(placed.iter().map(|pair| motion.error(pair)[k])).unwrap_or(f64::INFINITY))
    };
    // The camera whose motion most others share; a mean would follow those that are far off.
    let candidates = placed.iter().map(|pair| Motion::of_camera(*pair));
    let best = candidates.min_by(|a, b| errors(a)[0].total_cmp(&errors(b)[0]))?;
    let size = placed.iter().map(|(a, _)| a.center().distance(placed[0].0.center())).fold(0.0, f64::max);
    let typical = errors(&best);
    let bounds = [TOLERANCE[0] * size, TOLERANCE[1]];
    let agrees = |pair: &(Pose, Pose)| {
        let error = best.error(pair);
        (0..2).all(|k| error[k] <= (MISPLACED * typical[k]).max(bounds[k]))
    };
    let agree: Vec<bool> = pairs.iter().map(|pair| pair.as_ref().is_some_and(agrees)).collect();
    let good: Vec<(Pose, Pose)> = pairs.iter().zip(&agree).filter_map(|(pair, good)| pair.filter(|_| *good)).collect();
    (good.len() >= least).then(|| (Motion::of_cameras(&good), agree))
}

/// Takes poses of `now` to the scale and place of `before`: COLMAP shifts and scales a model, and does not turn it.
pub(super) fn back(before: &[Pose], now: &[Pose]) -> impl Fn(&Pose) -> Pose + use<> {
    let mean = |poses: &[Pose]| poses.iter().map(Pose::center).sum::<DVec3>() / poses.len().max(1) as f64;
    let spread =
        |poses: &[Pose], mean: DVec3| poses.iter().map(|pose| pose.center().distance_squared(mean)).sum::<f64>().sqrt();
    let (to, from) = (mean(before), mean(now));
    let scale = spread(before, to) / spread(now, from).max(f64::MIN_POSITIVE);
    move |pose| Pose::at(to + scale * (pose.center() - from), pose.rotation)
}

/// The pose a part of the way from one to the other: the shortest turn, and a straight line.
pub(super) fn between(a: &Pose, b: &Pose, part: f64) -> Pose {
    let [from, to] = [a, b].map(|pose| DQuat::from_mat3(&pose.rotation));
    Pose::at(a.center().lerp(b.center(), part), DMat3::from_quat(from.slerp(to, part)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(angle: f64) -> DMat3 {
        DMat3::from_rotation_y(angle)
    }

    fn rig() -> Vec<Pose> {
        let at = |k: usize| DVec3::new(k as f64, 0.3 * (k % 2) as f64, 0.1 * k as f64);
        (0..4).map(|k| Pose::at(at(k), DMat3::from_rotation_x(0.2 * k as f64))).collect()
    }

    fn assert_near(a: &Pose, b: &Pose) {
        assert!(a.center().distance(b.center()) < 1e-9 && angle(&a.rotation, &b.rotation) < 1e-6, "{a:?} {b:?}");
    }

    #[test]
    fn what_lies_between_is_turned_and_shifted_evenly() {
        let (a, b) = (Pose::at(DVec3::X, turn(0.2)), Pose::at(DVec3::new(3.0, 2.0, 0.0), turn(1.0)));
        assert_near(&between(&a, &b, 0.25), &Pose::at(DVec3::new(1.5, 0.5, 0.0), turn(0.4)));
        assert_near(&between(&a, &b, 0.0), &a);
        assert_near(&between(&a, &b, 1.0), &b);
    }

    #[test]
    fn the_rig_tells_where_a_camera_is_that_was_not_placed_or_misplaced() {
        let first = rig();
        let truth = Motion { turn: turn(0.7), shift: DVec3::new(0.5, -1.0, 2.0) };
        let mut now: Vec<Option<Pose>> = first.iter().map(|pose| Some(truth.of(pose))).collect();
        now[2] = None;
        let (motion, agree) = rigid(&first, &now, 3).unwrap();
        assert_near(&motion.of(&first[2]), &truth.of(&first[2]));
        assert_eq!(agree, [true, true, false, true]);
        // Too few.
        now[0] = None;
        assert!(rigid(&first, &now, 3).is_none() && rigid(&first, &[None; 4], 1).is_none());
        // One that is far off does not draw the others with it.
        now = first.iter().map(|pose| Some(truth.of(pose))).collect();
        now[1] = Some(Pose::at(DVec3::splat(9.0), turn(3.0)));
        let (motion, agree) = rigid(&first, &now, 3).unwrap();
        assert_near(&motion.of(&first[1]), &truth.of(&first[1]));
        assert_eq!(agree, [true, false, true, true]);
    }

    #[test]
    fn a_model_that_was_shifted_and_scaled_is_taken_back() {
        let before = rig();
        let now: Vec<Pose> =
            before.iter().map(|pose| Pose::at(3.0 * pose.center() - DVec3::Y, pose.rotation)).collect();
        let back = back(&before, &now);
        before.iter().zip(&now).for_each(|(before, now)| assert_near(&back(now), before));
    }
}
