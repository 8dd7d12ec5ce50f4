//! The numbers of a camera and where it is.

use crate::common::prelude::*;
const INTRINSICS: Intrinsics = Intrinsics { width: 320, height: 240, fx: 300.0, fy: 310.0, cx: 150.0, cy: 130.0 };

#[test]
fn a_place_of_the_picture_shows_the_ray_that_is_seen_there() {
    let at = DVec3::new(0.4, -0.3, 2.0);
    // 300 * 0.2 + 150 and 310 * -0.15 + 130.
    assert!((INTRINSICS.project(at) - DVec2::new(210.0, 83.5)).length() < 1e-12);
    assert!((2.0 * INTRINSICS.ray(INTRINSICS.project(at)) - at).length() < 1e-12);
    assert_eq!(INTRINSICS.ray(INTRINSICS.principal()), DVec3::Z);
    let corners = [(0.0, 0.0), (319.9, 239.9), (320.0, 0.0), (0.0, 240.0), (-1e-9, 0.0), (f64::NAN, 1.0)];
    let held = corners.map(|(x, y)| INTRINSICS.holds(DVec2::new(x, y)));
    assert_eq!(held, [true, true, false, false, false, false]);
    // Half the width, a third of the height: the same ray lies at half and a third of the place.
    let small = INTRINSICS.scaled(160, 80);
    let expected = INTRINSICS.project(at) / DVec2::new(2.0, 3.0);
    assert!((small.project(at) - expected).length() < 1e-12 && small.n_pixels() == 160 * 80);
}

#[test]
fn a_pose_goes_from_the_world_to_the_camera() {
    let (eye, target) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(3.0, 1.0, 4.0));
    let pose = Pose::look_at(eye, target, DVec3::NEG_Y);
    assert!((pose.center() - eye).length() < 1e-12 && pose.to_camera(eye).length() < 1e-12);
    let ahead = pose.to_camera(target);
    assert!(ahead.truncate().length() < 1e-12 && (ahead.z - eye.distance(target)).abs() < 1e-12);
    // The rows are the axes: a step along each is a step along x, y and z.
    for (axis, step) in [(pose.right(), DVec3::X), (pose.down(), DVec3::Y), (pose.forward(), DVec3::Z)] {
        assert!((pose.to_camera(eye + axis) - step).length() < 1e-12);
    }
    assert!(pose.down().y > 0.0 && (pose.rotation.determinant() - 1.0).abs() < 1e-12);
    assert_eq!(Pose::of_rows(&pose.rows()), pose);
    assert_eq!(Pose::at(eye, pose.rotation), pose);
    // A file has the rows.
    assert_eq!(serde_json::to_value(pose).unwrap(), serde_json::json!(pose.rows()));
    assert_eq!(serde_json::from_value::<Pose>(serde_json::json!(pose.rows())).unwrap(), pose);
}

#[test]
fn a_quaternion_of_nearly_length_1_is_a_rotation() {
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, -0.8), 2.5);
    let written = [turn.w, turn.x, turn.y, turn.z].map(|v| 1.000_5 * v);
    let pose = Pose::of_quaternion(written, DVec3::ONE);
    let off = pose.rotation - DMat3::from_quat(turn);
    assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-15) && pose.translation == DVec3::ONE);
}
