//! The circle about what views look at.

use crate::common::prelude::*;
use ivv::internals::scene::Orbit;

/// A view from `lens` towards `at` with its top towards `up`.
fn view(lens: DVec3, at: DVec3, up: DVec3) -> View {
    View {
        name: "a".into(),
        intrinsics: Intrinsics { width: 32, height: 24, fx: 30.0, fy: 30.0, cx: 16.0, cy: 12.0 },
        pose: HeadPose { t: 0.0, p: lens, q: HeadPose::looking(at - lens, up) }.world_to_camera(),
        time: 0.0,
        time_offset: 0.0,
        flow_dt: 1.0,
        background: [0.0; 3],
        flow_model: FlowModel::Velocity,
        next_pose: None,
    }
}

#[test]
fn an_orbit_goes_around_what_cameras_look_at_as_far_and_as_high_as_they_are() {
    let (middle, up) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(0.2, -1.0, 0.1).normalize());
    let side = up.any_orthonormal_vector();
    let lens = |turn: f64, height: f64, radius: f64| {
        let (sin, cos) = turn.sin_cos();
        middle + height * up + radius * (cos * side + sin * up.cross(side))
    };
    // Not evenly around: the mean of the lenses is elsewhere. Distances of 4.12, 5.10 and 6.08, heights of 1.
    let views: Vec<View> = [(0.1, 4.0), (0.5, 5.0), (1.0, 6.0), (1.4, 5.0), (1.6, 5.0)]
        .map(|(turn, radius)| view(lens(turn, 1.0, radius), middle, up))
        .to_vec();
    let orbit = Orbit::new(&views).unwrap();
    assert!(orbit.middle.distance(middle) < 1e-9, "{orbit:?}");
    // The mean of the cameras' tops leans towards where they stand.
    let distance = 26_f64.sqrt();
    for index in 0..12 {
        let at = orbit.at(f64::from(index) / 12.0);
        assert!((at.distance(middle) - distance).abs() < 1e-9, "{at}");
        assert!((orbit.up.dot(at - middle) - orbit.height).abs() < 1e-9, "{at}");
    }
    assert!(
        orbit.at(0.25).distance(orbit.at(0.75)) > 1.9 * orbit.radius && orbit.at(1.0).distance(orbit.at(0.0)) < 1e-9
    );
    let first = (lens(0.1, 1.0, 4.0) - middle).reject_from_normalized(orbit.up);
    assert!((orbit.at(0.0) - middle).reject_from_normalized(orbit.up).angle_between(first) < 1e-6);
    assert!(orbit.up.angle_between(up) < 0.3);
}

#[test]
fn views_that_do_not_look_at_one_place_have_no_orbit() {
    let up = DVec3::NEG_Y;
    let parallel = |x: f64| view(DVec3::new(x, 0.0, 0.0), DVec3::new(x, 0.0, 1.0), up);
    let outward = |x: f64, z: f64| view(DVec3::new(x, 0.0, z), 2.0 * DVec3::new(x, 0.0, z), up);
    assert_eq!(Orbit::new(&[]), None);
    assert_eq!(Orbit::new(&[parallel(0.0)]), None);
    assert_eq!(Orbit::new(&[parallel(0.0), parallel(1.0), parallel(2.0)]), None);
    assert_eq!(Orbit::new(&[outward(1.0, 0.0), outward(0.0, 1.0), outward(-1.0, 0.0)]), None);
}
