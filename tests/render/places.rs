//! Where a camera is, and what is in front of what.

use crate::common::frames::psnr;
use crate::common::prelude::*;
use crate::common::random::{scene, view};

#[test]
fn a_camera_is_where_its_numbers_put_it_however_far_away_the_world_begins() {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.5, 0.2));
    // As many formats write a rotation.
    let rounded = |digits: f64| DMat3::from_cols_array(&turn.to_cols_array().map(|x| (x * digits).round() / digits));
    // Places that floats hold exactly wherever the scene is.
    let grid = |x: f32| (x * 64.0).round() / 64.0;
    let mut splats = scene(33, 200, 1);
    splats.position.iter_mut().for_each(|p| *p = p.map(grid));
    splats.motion.iter_mut().for_each(|motion| motion.velocity = motion.velocity.map(grid));
    for rotation in [turn, rounded(1e6), rounded(1e4)] {
        let near = {
            let mut near = view();
            // The scene is about the z axis of the view.
            near.pose = Pose { rotation, translation: near.pose.translation };
            near
        };
        let truth = render(&splats, &near).0;
        for distance in [100.0, 1e3, 1e4, 1e5] {
            let away = DVec3::new(distance, -0.5 * distance, 0.25 * distance);
            let mut far = splats.clone();
            far.position.iter_mut().for_each(|p| {
                *p = std::array::from_fn(|k| (f64::from(p[k]) + away[k]) as f32);
            });
            // R (x + away) + t' is R x + t.
            let mut from = near.clone();
            from.pose.translation = near.pose.translation - rotation * away;
            let found = psnr(&render(&far, &from).0, &truth);
            assert!(found > 60.0, "{distance} units away: {found:.1} dB");
        }
    }
}

#[test]
fn at_equal_depth_what_rests_is_before_what_moves_and_then_the_order_of_the_file_counts() {
    let one = |color: [f64; 3], motion: Option<Motion>| One { motion, ..ball([0.0, 0.0, 4.0], 0.4, 0.9, color) };
    let ([red, green, blue], long) = ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 20.0);
    let moves = Motion { velocity: [0.0; 3], t_center: 0.5, t_scale: long };
    let front = |all: &[One]| {
        let (frame, _) = render(&scene_of(all), &View { background: [0.0; 3], ..view() });
        let brightest = frame.color.iter().max_by(|a, b| a.iter().sum::<f32>().total_cmp(&b.iter().sum::<f32>()));
        let color = *brightest.unwrap();
        (0..3).max_by(|a, b| color[*a].total_cmp(&color[*b])).unwrap()
    };
    assert_eq!(front(&[one(red, None), one(green, None)]), 0);
    assert_eq!(front(&[one(blue, None), one(green, Some(moves))]), 2);
    assert_eq!(front(&[one(red, Some(moves)), one(blue, Some(moves))]), 0);
    // A file that has them in another order.
    if let Some(case) = shared("cases/numerics/tie") {
        let splats = read_scene(&case.join("s.ply")).unwrap();
        let views = read_views(&case.join("c.json")).unwrap();
        let gpu = gpu();
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        let (frame, _) = renderer.render(&views[0], Outputs::Color).unwrap();
        assert!(frame.color.iter().any(|[r, g, _]| *g > 0.9 && *r < 0.1), "the static one is green");
    }
}
