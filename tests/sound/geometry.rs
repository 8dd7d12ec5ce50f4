//! Directions and gains from places: T1, T2, T4, T5, T7.

use super::{head, noise};
use crate::common::prelude::*;
use ivv::internals::sound::geometry::{Mode, SoundPlane, bearing, gain, signed_angle};

fn plane() -> SoundPlane {
    SoundPlane::new(DVec3::Z, DVec3::Y).unwrap()
}

fn vectors(n: usize, seed: u64) -> Vec<DVec3> {
    noise(3 * n, seed).chunks(3).map(|v| 3.0 * DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect()
}

#[test]
fn t1_the_table_of_signs() {
    assert_eq!((plane().x, plane().y, plane().up), (DVec3::X, DVec3::Y, DVec3::Z));
    let angle = |yaw: f64, x: f64, y: f64| {
        let pose = head(DVec3::ZERO, yaw).at(0.0);
        bearing(Mode::Paper2d, &plane(), &pose, DVec3::X, DVec3::new(x, y, 0.0)).az.to_degrees()
    };
    let rows = [
        (0.0, 0.0, 2.0, 0.0),
        (0.0, -2.0, 0.0, 90.0),
        (0.0, 2.0, 0.0, -90.0),
        (90.0, -2.0, 0.0, 0.0),
        (90.0, 0.0, 2.0, -90.0),
    ];
    for (yaw, x, y, expected) in rows {
        assert!((angle(yaw, x, y) - expected).abs() < 1e-12 * 180.0, "yaw {yaw}, ({x}, {y}): {}", angle(yaw, x, y));
    }
    assert!((angle(0.0, 0.0, -2.0).abs() - 180.0).abs() < 1e-12);
    assert_eq!(signed_angle(0.0, DVec2::new(-0.0, -2.0)), std::f64::consts::PI);
}

#[test]
fn t2_without_its_sign_it_is_the_arc_cosine_of_the_paper() {
    for (a, b) in vectors(10_000, 1).iter().zip(vectors(10_000, 2)) {
        let (yaw, offset) = (a.z, DVec2::new(a.x, b.y));
        let facing = DVec2::new(-yaw.sin(), yaw.cos());
        let cosine = facing.dot(offset) / offset.length();
        let (unsigned, signed) = (cosine.clamp(-1.0, 1.0).acos(), signed_angle(yaw, offset));
        // The arc cosine itself is only good to the square root of rounding near 0 and pi.
        let near_ends = unsigned.sin() < 1e-4;
        assert!(near_ends || (signed.abs() - unsigned).abs() < 1e-9);
        assert!((signed.cos() - cosine).abs() < 1e-12);
    }
}

#[test]
fn t4_moving_turning_and_scaling_the_world_changes_nothing() {
    let v = vectors(40, 3);
    for (at, mode) in [Mode::Paper2d, Mode::Paper3d, Mode::Physical].into_iter().cycle().take(36).enumerate() {
        let (listener, microphone, source, shift) = (v[at], v[at + 1], v[at + 2], v[at + 3]);
        let turn = HeadPose::looking(v[at + 1], v[at + 2]);
        let scale = 0.3 + at as f64;
        let pose = HeadPose { t: 0.0, p: listener, q: HeadPose::looking(v[at + 3], DVec3::Z) };
        let plane = SoundPlane::new(DVec3::Z, DVec3::Y).unwrap();
        let moved = |p: DVec3| turn * p * scale + shift;
        let plane_moved = SoundPlane::new(turn * DVec3::Z, turn * DVec3::Y).unwrap();
        let pose_moved = HeadPose { p: moved(listener), q: turn * pose.q, ..pose };
        let a = bearing(mode, &plane, &pose, microphone, source);
        let b = bearing(mode, &plane_moved, &pose_moved, moved(microphone), moved(source));
        assert!((a.az - b.az).abs() < 1e-9 && (a.el - b.el).abs() < 1e-9, "{mode:?}: {a:?} {b:?}");
        let (from, to) = (gain(mode, &a, 0.1), gain(mode, &b, 0.1 * scale));
        assert!((from - to).abs() < 1e-9 * from, "{mode:?}: {from} {to}");
    }
}

#[test]
fn t5_on_the_plane_the_two_paper_modes_agree() {
    let v = vectors(60, 4);
    for at in 0..57 {
        let flat = |p: DVec3| DVec3::new(p.x, p.y, 0.0);
        let pose = head(flat(v[at]), 40.0 * v[at].z).at(0.0);
        let [two, three] =
            [Mode::Paper2d, Mode::Paper3d].map(|mode| bearing(mode, &plane(), &pose, flat(v[at + 1]), flat(v[at + 2])));
        assert!((two.az - three.az).abs() < 1e-9 && three.el.abs() < 1e-9);
        assert!((two.r_l - three.r_l).abs() < 1e-9 && (two.r_m - three.r_m).abs() < 1e-9);
    }
}

#[test]
fn t7_a_moving_microphone_is_an_origin_and_no_more() {
    // Along with the microphone, source and listener move by the same; nothing changes.
    let way = DVec3::new(0.7, -1.3, 0.4);
    let microphone = PoseTrack::new(vec![
        HeadPose { t: 0.0, p: DVec3::ZERO, q: DQuat::IDENTITY },
        HeadPose { t: 2.0, p: 2.0 * way, q: DQuat::IDENTITY },
    ])
    .unwrap();
    for t in [0.0, 0.3, 1.0, 1.9] {
        let (source, listener) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-0.5, 0.2, 0.1));
        let still = bearing(Mode::Paper3d, &plane(), &head(listener, 20.0).at(t), DVec3::ZERO, source);
        let pose = head(listener + t * way, 20.0).at(t);
        let moved = bearing(Mode::Paper3d, &plane(), &pose, microphone.at(t).p, source + t * way);
        assert!((still.az - moved.az).abs() < 1e-9 && (still.r_m - moved.r_m).abs() < 1e-9);
        assert!((gain(Mode::Paper3d, &still, 0.2) - gain(Mode::Paper3d, &moved, 0.2)).abs() < 1e-9);
    }
}

#[test]
fn a_head_that_looks_up_keeps_the_yaw_of_its_sides() {
    let upright = head(DVec3::ZERO, 30.0).at(0.0);
    for pitch in [-90.0f64, -89.0, 45.0, 90.0] {
        let pose = HeadPose { q: upright.q * DQuat::from_rotation_y(-pitch.to_radians()), ..upright };
        assert!((plane().yaw(&pose) - 30f64.to_radians()).abs() < 1e-6, "{pitch}: {}", plane().yaw(&pose));
    }
    assert!(SoundPlane::new(DVec3::Z, DVec3::Z).is_none() && SoundPlane::new(DVec3::ZERO, DVec3::Y).is_none());
}

#[test]
fn poses_between_and_beyond_those_given() {
    let turned = DQuat::from_rotation_z(1.0);
    let track = PoseTrack::new(vec![
        HeadPose { t: 1.0, p: DVec3::ZERO, q: DQuat::IDENTITY },
        HeadPose { t: 3.0, p: DVec3::new(2.0, 0.0, 4.0), q: turned },
    ])
    .unwrap();
    let between = track.at(1.5);
    assert!((between.p - DVec3::new(0.5, 0.0, 1.0)).length() < 1e-12);
    assert!(between.q.dot(DQuat::from_rotation_z(0.25)) > 1.0 - 1e-12);
    assert_eq!((track.at(0.0).p, track.at(9.0).p), (DVec3::ZERO, DVec3::new(2.0, 0.0, 4.0)));
    let pose = |t: f64, q: DQuat| HeadPose { t, p: DVec3::ZERO, q };
    for wrong in [
        vec![],
        vec![pose(1.0, turned), pose(1.0, turned)],
        vec![pose(f64::NAN, turned)],
        vec![pose(0.0, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0))],
    ] {
        assert!(PoseTrack::new(wrong).is_err());
    }
}
