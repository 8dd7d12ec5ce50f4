//! Rigs that look outward, and those that look at a scene among them: how large a scene is taken for.

use crate::common::prelude::*;
use ivv::internals::scene::capture::TRAINING_RADIUS;
use ivv::internals::synth::{Options, Rig};

fn capture(test: &str, rig: Rig) -> Capture {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("train-rigs-{test}-{rig:?}"));
    let options = Options { rig, frames: 2, samples: 1, ..Preset::Small.options(5) };
    write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
    Capture::open(&folder).unwrap()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// 1.1 times the largest distance of a lens of a training camera from `center`.
fn reach_of_lenses(capture: &Capture, center: [f64; 3]) -> f64 {
    let training = capture.cameras.iter().filter(|camera| !camera.is_test);
    let poses = training.flat_map(|camera| camera.shots.iter().map(|shot| camera.pose(shot.frame).center()));
    1.1 * poses.map(|lens| distance(lens.to_array(), center)).fold(0.0, f64::max)
}

/// The first Gaussians from the points, and of each the mean distance to its three nearest neighbours; in the frame of training.
fn first(capture: &Capture) -> (Capture, Splats, Vec<f64>) {
    let capture = capture.clone().transformed(&capture.normalisation());
    let splats = from_points(&capture.points, &capture, &Config { sh_degree: 0, ..exact() });
    let spacing = |at: &ivv::internals::scene::capture::Point| {
        let mut all: Vec<f64> = capture.points.iter().map(|other| distance(at.position, other.position)).collect();
        all.sort_unstable_by(f64::total_cmp);
        all[1..4].iter().sum::<f64>() / 3.0
    };
    let spacings = capture.points.iter().map(spacing).collect();
    (capture, splats, spacings)
}

#[test]
fn a_small_rig_is_measured_by_what_it_sees_and_one_around_its_scene_by_its_lenses() {
    for rig in Rig::ALL {
        let capture = capture("extent", rig);
        let extent = capture.extent();
        let lenses = reach_of_lenses(&capture, extent.center);
        let mut far: Vec<f64> = capture.points.iter().map(|point| distance(point.position, extent.center)).collect();
        far.sort_unstable_by(f64::total_cmp);
        let median = far[far.len() / 2];
        println!("{rig:?}: lenses {lenses:.2}, median {median:.2}, extent {:.2}", extent.radius);
        if rig == Rig::Inward {
            assert!((extent.radius - lenses).abs() <= 1e-12 * lenses, "{} is not {lenses}", extent.radius);
        } else {
            // By its lenses it would have rates of positions for things ten times nearer than they are.
            assert!(median > 4.0 * lenses && (extent.radius - median).abs() <= 1e-12 * median, "{}", extent.radius);
        }
        let normal = capture.clone().transformed(&capture.normalisation());
        assert!((normal.extent().radius - TRAINING_RADIUS).abs() < 1e-9);
    }
}

#[test]
fn first_gaussians_far_from_a_small_rig_are_as_wide_as_their_neighbours_are_far() {
    let (_, splats, spacings) = first(&capture("far", Rig::Outward));
    let mut parts: Vec<f64> =
        splats.scale.iter().zip(&spacings).map(|(scale, spacing)| f64::from(scale[0]).exp() / spacing).collect();
    parts.sort_unstable_by(f64::total_cmp);
    println!("parts of the spacing: {:.3} {:.3} {:.3}", parts[0], parts[parts.len() / 4], parts[parts.len() / 2]);
    assert!(parts[parts.len() / 2] > 0.5, "half of them are narrower than {:.3} of that", parts[parts.len() / 2]);
}

#[test]
fn first_gaussians_of_an_inward_rig_are_at_most_a_tenth_of_the_extent() {
    let (capture, splats, spacings) = first(&capture("inward", Rig::Inward));
    let mut n_limited = 0;
    for (i, (scale, spacing)) in splats.scale.iter().zip(&spacings).enumerate() {
        let limit = 0.1 * capture.extent().radius;
        let expected = spacing.min(limit).ln() as f32;
        assert!((scale[0] - expected).abs() < 1e-5, "{i}: {} is not {expected}", scale[0]);
        n_limited += usize::from(*spacing > limit);
    }
    assert!(n_limited > 5, "the limit holds for {n_limited} only");
}

#[test]
fn first_gaussians_fill_the_pictures_of_an_outward_rig_its_plain_ceilings_too() {
    let capture = capture("fill", Rig::Outward);
    let capture = capture.clone().transformed(&capture.normalisation());
    let config = Config { sh_degree: 0, ..exact() };
    let splats = initialise(&capture, &config, &mut |_, _| {}).unwrap().splats;
    for (index, camera) in capture.cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test) {
        let view = capture.view(index, 0).unwrap();
        let mut is_filled = [[false; 8]; 6];
        for position in &splats.position {
            let at: [f64; 3] = std::array::from_fn(|row| {
                let m = view.pose.rows()[row];
                (0..3).map(|k| m[k] * f64::from(position[k])).sum::<f64>() + m[3]
            });
            let (x, y) = (
                view.intrinsics.fx * at[0] / at[2] + view.intrinsics.cx,
                view.intrinsics.fy * at[1] / at[2] + view.intrinsics.cy,
            );
            let (column, row) =
                (8.0 * x / f64::from(view.intrinsics.width), 6.0 * y / f64::from(view.intrinsics.height));
            if at[2] > 0.0 && (0.0..8.0).contains(&column) && (0.0..6.0).contains(&row) {
                is_filled[row as usize][column as usize] = true;
            }
        }
        // Nothing grows where nothing is: a picture without Gaussians stays black to the end.
        let n_empty = is_filled.iter().flatten().filter(|is_filled| !**is_filled).count();
        println!("{}: {n_empty} of 48 cells are empty", camera.name);
        assert!(n_empty <= 4, "{}: {n_empty} of 48 cells have no Gaussian", camera.name);
    }
}

/// The lenses before which training leaves room: those of cameras, and those between them.
fn lenses(capture: &Capture) -> (Vec<View>, Vec<View>) {
    let of_cameras = capture.lens_views();
    let mut all = Setup::new(capture, &exact()).lenses;
    let between = all.split_off(of_cameras.len());
    assert_eq!(all, of_cameras);
    (of_cameras, between)
}

#[test]
fn room_is_left_amid_neighbours_that_look_the_same_way() {
    let capture = capture("between", Rig::Inward);
    let (cameras, between) = lenses(&capture);
    assert!(!between.is_empty());
    let is_amid = |lens: &View, set: &[&View]| {
        let mean = set.iter().map(|view| view.pose.center()).sum::<glam::DVec3>() / set.len() as f64;
        let looks_as_they_do = set.iter().all(|view| view.pose.forward().dot(lens.pose.forward()) > 0.0);
        mean.distance(lens.pose.center()) < 1e-9 && looks_as_they_do
    };
    for lens in &between {
        let found = cameras.iter().enumerate().any(|(i, a)| {
            cameras[..i]
                .iter()
                .enumerate()
                .any(|(j, b)| is_amid(lens, &[a, b]) || cameras[..j].iter().any(|c| is_amid(lens, &[a, b, c])))
        });
        assert!(found, "a lens at {} is not amid two or three cameras", lens.pose.center());
        let looks_at_it = |camera: &View| camera.pose.to_camera(lens.pose.center()).z > 0.0;
        assert!(cameras.iter().any(looks_at_it), "no camera looks at {}", lens.pose.center());
    }
}

#[test]
fn no_room_is_left_where_no_camera_looks_or_cameras_move() {
    for rig in [Rig::Outward, Rig::Moving] {
        let (cameras, between) = lenses(&capture("nowhere", rig));
        assert!(cameras.len() > 4 && between.is_empty(), "{rig:?}: {} lenses", between.len());
    }
}

#[test]
fn the_places_of_a_camera_that_moved_are_no_rig() {
    let rig = capture("one-shot", Rig::Inward);
    let config = exact();
    // A clip that one camera took, a place for each image: a camera each, as in transforms.json with times.
    let mut walk = rig.clone();
    for (index, camera) in walk.cameras.iter_mut().enumerate() {
        camera.shots.retain(|shot| shot.frame == index as u32 % 2);
        assert_eq!(camera.shots.len(), 1);
    }
    let learnt = |capture: &Capture| {
        let Setup { has_grid, learns_pose, learns_offset, .. } = Setup::new(capture, &config);
        [!has_grid.is_empty(), !learns_pose.is_empty(), !learns_offset.is_empty(), !lenses(capture).1.is_empty()]
    };
    assert_eq!((rig.is_rig_clip(), learnt(&rig)), (true, [true; 4]));
    assert_eq!((walk.is_rig_clip(), learnt(&walk)), (false, [false; 4]));
    // Those of one moment are no clip, and views between them are of that moment.
    walk.n_frames = 1;
    walk.cameras.iter_mut().for_each(|camera| camera.shots.iter_mut().for_each(|shot| shot.frame = 0));
    assert_eq!((walk.is_rig_clip(), learnt(&walk)), (false, [false, false, false, true]));
}

#[test]
fn between_cameras_that_look_in_opposite_directions_no_room_is_left() {
    let mut capture = capture("opposite", Rig::Inward);
    let views = capture.lens_views();
    let first = capture.cameras.iter().position(|camera| !camera.is_test).unwrap();
    let forward = capture.view(first, 0).unwrap().pose.forward();
    let opposite = |view: &View| view.pose.forward().dot(forward);
    let across = views.iter().min_by(|a, b| opposite(a).total_cmp(&opposite(b))).unwrap();
    assert!(opposite(across) < 0.0, "all look the same way");
    // No other camera is trained on.
    for (index, camera) in capture.cameras.clone().iter().enumerate() {
        let is_across = !camera.is_test && capture.view(index, 0).unwrap().pose == across.pose;
        capture.cameras[index].is_test = index != first && !is_across;
    }
    let (cameras, between) = lenses(&capture);
    assert_eq!((cameras.len(), between.len()), (2, 0));
}
