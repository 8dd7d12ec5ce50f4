//! A camera that a person moves, views in windows of other shapes, and the time of a clip that plays.

use crate::common::prelude::*;
use ivv::internals::scene::{Navigator, Playhead, Push, upright};

const SIZE: [u32; 2] = [320, 240];

/// A navigator at the first view of the demo, whose cameras look at one place.
fn demo_navigator() -> (Navigator, Vec<View>) {
    let (splats, views) = demo();
    (Navigator::new(&views, &splats), views)
}

fn axes(view: &View) -> [DVec3; 3] {
    [0, 1, 2].map(|row| view.pose.rotation.row(row))
}

/// Where a view has a point of the world, pixels, and its depth.
fn seen(view: &View, point: DVec3) -> (DVec2, f64) {
    let to: [f64; 3] = std::array::from_fn(|k| axes(view)[k].dot(point) + view.pose.translation[k]);
    (
        DVec2::new(
            view.intrinsics.fx * to[0] / to[2] + view.intrinsics.cx,
            view.intrinsics.fy * to[1] / to[2] + view.intrinsics.cy,
        ),
        to[2],
    )
}

fn pivot(navigator: &Navigator) -> DVec3 {
    navigator.center() + navigator.reach * navigator.forward()
}

fn is_rigid(view: &View) -> bool {
    let [x, y, z] = axes(view);
    let rows = DMat3::from_cols(x, y, z);
    (rows.transpose() * rows).abs_diff_eq(DMat3::IDENTITY, 1e-9) && rows.determinant() > 0.0
}

#[test]
fn a_navigator_begins_at_the_first_view_and_goes_to_any_other() {
    let (mut navigator, views) = demo_navigator();
    for view in [&views[0], &views[3], &views[7]] {
        navigator.go(view);
        let now = navigator.view([view.intrinsics.width, view.intrinsics.height]);
        for (a, b) in now.pose.rows().as_flattened().iter().zip(view.pose.rows().as_flattened()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
        let expected = View { pose: now.pose, ..view.clone() };
        assert_eq!(now, expected, "the rest is the view's own");
    }
}

#[test]
fn a_backdrop_leaves_where_a_scene_is_seen_from() {
    let (splats, _) = demo();
    let alone = Navigator::new(&[], &splats);
    // Some become one.
    let mut wide = splats;
    for k in 0..60 {
        let turn = k as f32 * 2.4;
        wide.position[80 * k] = [80.0 * turn.cos(), 5.0, 80.0 * turn.sin()];
    }
    let with = Navigator::new(&[], &wide);
    let (a, b) = (alone.view(SIZE).pose.center(), with.view(SIZE).pose.center());
    assert!(a.distance(b) < 0.3 * alone.reach && (with.reach / alone.reach - 1.0).abs() < 0.3, "{a} {b}");
}

#[test]
fn turning_keeps_what_is_looked_at_in_its_place_and_the_horizon_level() {
    let (mut navigator, views) = demo_navigator();
    let up = upright(&views).unwrap();
    let (point, reach) = (pivot(&navigator), navigator.reach);
    let tilt = |navigator: &Navigator| navigator.forward().cross(navigator.above()).dot(up);
    let level = tilt(&navigator);
    for k in 0..200 {
        navigator.drag(DVec2::new(7.0, if k % 50 < 25 { 3.0 } else { -3.0 }));
        assert!(pivot(&navigator).distance(point) < 1e-9 && (navigator.center().distance(point) - reach).abs() < 1e-9);
        assert!((tilt(&navigator) - level).abs() < 1e-9, "the horizon leans after {k} drags");
        assert!(is_rigid(&navigator.view(SIZE)));
    }
    // Back by as many pixels: where it was.
    let before = navigator.view(SIZE);
    navigator.drag(DVec2::new(60.0, 0.0));
    assert!(navigator.center().distance(point) > 0.0 && navigator.view(SIZE) != before);
    navigator.drag(DVec2::new(-60.0, 0.0));
    let after = navigator.view(SIZE);
    for (a, b) in before.pose.rows().as_flattened().iter().zip(after.pose.rows().as_flattened()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn in_flight_it_turns_about_itself_and_approaching_moves_what_is_looked_at_on() {
    let (mut navigator, _) = demo_navigator();
    let (center, reach) = (navigator.center(), navigator.reach);
    navigator.is_flying = true;
    navigator.drag(DVec2::new(40.0, -10.0));
    assert_eq!(navigator.center(), center);
    navigator.approach(0.5);
    assert!((navigator.center().distance(center) - 0.5 * reach).abs() < 1e-9);
    assert_eq!(navigator.reach, reach);
    navigator.is_flying = false;
    let point = pivot(&navigator);
    navigator.approach(0.5);
    assert!(pivot(&navigator).distance(point) < 1e-9 && (navigator.reach - 0.5 * reach).abs() < 1e-12);
    for _ in 0..100 {
        navigator.approach(0.1);
    }
    assert!(navigator.reach > 0.0, "it never arrives");
}

#[test]
fn it_looks_neither_straight_up_nor_straight_down_and_comes_back_from_there() {
    // Level cameras; one that leans may turn over, and goes on from there.
    let up = DVec3::new(0.2, -1.0, 0.1).normalize();
    let across = up.any_orthonormal_vector();
    let views = [across, up.cross(across), -across, -up.cross(across)]
        .map(|side| View::look_at((3.0 * side).into(), [0.0; 3], up.into(), Intrinsics::of_fov(32, 24, 50.0)));
    assert!(upright(&views).unwrap().distance(up) < 1e-9);
    let mut navigator = Navigator::new(&views, &demo().0);
    let steepness = |navigator: &Navigator| navigator.forward().dot(up);
    for sign in [1.0, -1.0] {
        let from = steepness(&navigator);
        for _ in 0..400 {
            navigator.drag(DVec2::new(0.0, sign * 5.0));
            assert!(steepness(&navigator).abs() < 0.9999, "{}", steepness(&navigator));
            assert!(navigator.above().dot(up) > 0.0, "it never hangs");
        }
        assert!(steepness(&navigator).abs() > 0.98 && (steepness(&navigator) - from).abs() > 0.1);
    }
}

#[test]
fn what_is_looked_at_follows_a_pointer_that_pans() {
    let (mut navigator, _) = demo_navigator();
    let (point, by) = (pivot(&navigator), DVec2::new(31.0, -17.0));
    let (before, depth) = seen(&navigator.view(SIZE), point);
    navigator.pan(by, SIZE);
    let (after, as_deep) = seen(&navigator.view(SIZE), point);
    assert!((after - before).distance(by) < 1e-9 && (depth - as_deep).abs() < 1e-9, "{before} {after}");
}

#[test]
fn keys_move_by_the_distance_of_what_is_looked_at() {
    let (mut navigator, _) = demo_navigator();
    let (center, reach, [right, down, forward]) = (navigator.center(), navigator.reach, axes(&navigator.view(SIZE)));
    let shift = DVec3::new(1.0, -1.0, 1.0);
    let direction = right - down + forward;
    navigator.advance(Push { shift, ..Push::default() }, 0.5);
    assert!((navigator.center() - center).distance(0.25 * reach * direction) < 1e-9);
    navigator.advance(Push { shift, is_fast: true, ..Push::default() }, 0.5);
    assert!((navigator.center() - center).distance(1.05 * reach * direction) < 1e-9);
    let (center, before) = (navigator.center(), navigator.forward());
    navigator.advance(Push { turn: DVec2::X, ..Push::default() }, 0.1);
    assert_eq!(navigator.center(), center);
    assert!(navigator.forward().dot(right) > 0.05, "to the right");
    navigator.advance(Push { turn: DVec2::NEG_X, ..Push::default() }, 0.1);
    assert!(navigator.forward().distance(before) < 1e-9);
}

#[test]
fn without_views_it_sees_all_of_the_scene_from_before_it() {
    let (splats, _) = demo();
    let navigator = Navigator::new(&[], &splats);
    let view = navigator.view([1280, 720]);
    let mean = splats.position.iter().map(|p| DVec3::from(p.map(f64::from))).sum::<DVec3>() / splats.len() as f64;
    let (at, _) = seen(&view, mean);
    assert!(at.distance(DVec2::new(640.0, 360.0)) < 100.0, "{at}");
    let is_in = |p: &&[f32; 3]| {
        let (at, depth) = seen(&view, DVec3::from(p.map(f64::from)));
        depth > 0.0 && (0.0..1280.0).contains(&at.x) && (0.0..720.0).contains(&at.y)
    };
    let n_in = splats.position.iter().filter(is_in).count();
    assert!(n_in as f64 > 0.95 * splats.len() as f64, "{n_in} of {}", splats.len());
    // Of nothing, and of what has no place.
    assert!(is_rigid(&Navigator::new(&[], &Splats::default()).view(SIZE)));
}

#[test]
fn a_view_in_a_window_of_its_shape_is_scaled_and_in_others_shows_all_or_is_cropped() {
    let (_, views) = demo();
    let mut view = views[0].clone();
    view.intrinsics.cx = 0.4 * f64::from(view.intrinsics.width);
    let same = view.fitted([2 * view.intrinsics.width, 2 * view.intrinsics.height]);
    for (a, b) in [
        (same.intrinsics.fx, view.intrinsics.fx),
        (same.intrinsics.fy, view.intrinsics.fy),
        (same.intrinsics.cx, view.intrinsics.cx),
        (same.intrinsics.cy, view.intrinsics.cy),
    ] {
        assert!((a - 2.0 * b).abs() < 1e-9, "{a} {b}");
    }
    let [w, h] = [view.intrinsics.width, view.intrinsics.height].map(f64::from);
    // A little wider: as high as it was, so that nothing is lost; by 1.35 no more of its height is shown.
    for (width, shown_of_height) in [(1.0, 1.0), (1.2, 1.0 / 1.2), (1.35, 1.0 / 1.35), (2.7, 1.0 / 1.35)] {
        let fitted = view.fitted([(1000.0 * width * w) as u32, (1000.0 * h) as u32]);
        let shown = |side: u32, focal: f64, old: f64, old_focal: f64| f64::from(side) / focal * old_focal / old;
        let [across, down] = [
            shown(fitted.intrinsics.width, fitted.intrinsics.fx, w, view.intrinsics.fx),
            shown(fitted.intrinsics.height, fitted.intrinsics.fy, h, view.intrinsics.fy),
        ];
        assert!((down - shown_of_height).abs() < 1e-3, "{width}: {down} of its height");
        assert!((across - down * width).abs() < 1e-3, "{width}: {across} of its width");
    }
}

#[test]
fn views_are_upright_on_average_and_some_are_not_at_all() {
    let up = DVec3::new(0.3, -1.0, 0.2).normalize();
    let at = |eye: [f64; 3], up: DVec3| View::look_at(eye, [0.0; 3], up.into(), Intrinsics::of_fov(32, 24, 50.0));
    let side = up.any_orthonormal_vector();
    let around = [at((2.0 * side).into(), up), at((-2.0 * side).into(), up)];
    assert!(upright(&around).unwrap().distance(up) < 1e-9);
    assert_eq!(upright(&[]), None);
    let hanging = at((2.0 * side).into(), -up);
    assert_eq!(upright(&[around[0].clone(), hanging]), None);
}

#[test]
fn a_playhead_goes_on_begins_again_at_the_end_and_rests() {
    let begun = Instant::now();
    let mut clip = Playhead::new(2.0, 1.5, true);
    assert_eq!((clip.at(begun), clip.version(), clip.length()), (1.5, 0, 2.0), "no moment is before its first");
    // Whatever the test itself takes: seconds of the clip from now on, all around it.
    let gone = |clip: &Playhead, ms: u64| {
        let now = Instant::now();
        let after = clip.at(now + Duration::from_millis(ms));
        assert!((0.0..=2.0).contains(&after), "{after}");
        (after - clip.at(now)).rem_euclid(2.0)
    };
    for (ms, expected) in [(300, 0.3), (1000, 1.0), (1700, 1.7), (5000, 1.0)] {
        assert!((gone(&clip, ms) - expected).abs() < 1e-9, "{ms} ms");
    }
    clip.set(1.0, true, 0.5);
    assert!(clip.version() == 1 && clip.is_playing() && (gone(&clip, 1000) - 0.5).abs() < 1e-9);
    clip.seek(0.3);
    assert_eq!((clip.version(), clip.speed(), clip.is_playing(), clip.at(begun)), (2, 0.5, true, 0.3));
    for (time, rests_at) in [(-3.0, 0.0), (0.7, 0.7), (9.0, 2.0), (f64::NAN, 0.0)] {
        clip.set(time, false, 1.0);
        assert_eq!((clip.now(), gone(&clip, 700)), (rests_at, 0.0));
    }
    // What does not change has no time to play.
    let still = Playhead::new(0.0, 3.0, true);
    assert!(!still.is_playing() && still.now() == 0.0);
}
