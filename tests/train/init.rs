//! The first Gaussians against the true surfaces of a synthetic capture.

use super::{drive, test_psnr, trainer};
use crate::common::prelude::*;
use crate::synth::{Body, bodies};
use ivv::internals::scene::capture::Shot;
use ivv::internals::synth::Options;
use ivv::internals::train::{Initial, random_points};

/// Eight cameras on an arc around a room, and two for testing; without points. Made once.
fn room() -> &'static (PathBuf, Capture) {
    static ROOM: OnceLock<(PathBuf, Capture)> = OnceLock::new();
    ROOM.get_or_init(|| {
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("train-init");
        let options = Options { frames: 4, samples: 2, ..Preset::Small.options(5) };
        write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
        let manifest = std::fs::read_to_string(folder.join("capture.toml")).unwrap();
        std::fs::write(folder.join("capture.toml"), manifest.replace("points = true", "points = false")).unwrap();
        let mut capture = Capture::open(&folder).unwrap();
        capture.points.clear();
        (folder, capture)
    })
}

/// The capture in the frame of training, with what moves where `with_foreground`, and the way back.
fn training(with_foreground: bool) -> (Capture, Similarity) {
    let (folder, capture) = room();
    let mut capture = capture.clone();
    for camera in &mut capture.cameras {
        for Shot { frame, foreground, .. } in &mut camera.shots {
            let file = folder.join("foreground").join(&camera.name).join(format!("{frame:05}.png"));
            assert!(file.exists());
            *foreground = with_foreground.then_some(file);
        }
    }
    let world = capture.normalisation();
    (capture.transformed(&world), world.inverse())
}

fn config() -> Config {
    Config { sh_degree: 0, init_points: 3000, ..exact() }
}

fn first(capture: &Capture, config: &Config) -> Initial {
    let mut last = (0, 1);
    let initial = initialise(capture, config, &mut |done, total| {
        assert!(done == last.0 + 1 && done <= total, "{done} of {total} after {last:?}");
        last = (done, total);
    });
    assert!(last.0 == 0 || last.0 == last.1, "it ended at {last:?}");
    initial.unwrap()
}

/// The first Gaussians of the capture without masks, and with them, made once.
fn found(with_foreground: bool) -> &'static Initial {
    static FOUND: [OnceLock<Initial>; 2] = [const { OnceLock::new() }; 2];
    FOUND[usize::from(with_foreground)].get_or_init(|| first(&training(with_foreground).0, &config()))
}

#[test]
fn cameras_without_masks_do_not_carve() {
    let (capture, _) = training(true);
    let without = |n: usize| {
        let mut capture = capture.clone();
        let trained = capture.cameras.iter_mut().filter(|camera| !camera.is_test);
        trained.take(n).flat_map(|camera| &mut camera.shots).for_each(|shot| shot.foreground = None);
        first(&capture, &config())
    };
    let moving = |initial: &Initial| initial.splats.motion.len();
    let (all, most, two) = (found(true), without(1), without(6));
    assert!(moving(&most) as f64 > 0.7 * moving(all) as f64, "{all}; {most}");
    // Two cameras make no hull. What they show may move, rather than nothing.
    assert!(two.n_hulls == 0 && two.from == Init::Frustum && two.splats.n_static == 0, "{two}");
    assert!(two.splats.len() > 100 && two.to_string().contains("no hull of three cameras"), "{two}");
}

/// Distance of each point of `range`, in the capture's units, from the nearest surface that `is_meant`.
fn off(splats: &Splats, range: std::ops::Range<usize>, frame: usize, is_meant: impl Fn(&Body) -> bool) -> Vec<f64> {
    let bodies: Vec<Body> = bodies(&room().0).into_iter().filter(|b| is_meant(b) && b.exists(frame as f64)).collect();
    let distance = |at: DVec3| {
        let each = bodies.iter().map(|body| body.distance(body.local(body.pose(frame), at)));
        each.fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = range.map(|i| distance(DVec3::from_array(splats.position[i].map(f64::from)))).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn the_sweep_finds_the_surfaces_of_what_stands_still() {
    let (capture, back) = training(false);
    let initial = found(false);
    assert_eq!(initial.from, Init::Frustum);
    let splats = back.splats(&initial.splats);
    assert!(splats.len() > 1500 && splats.len() <= 3000 && splats.n_static == 0, "{initial}");
    assert!(splats.motion.iter().all(|m| m.t_center == 0.5 && m.t_scale == 0.0 && m.velocity == [0.0; 3]));
    let swept = off(&splats, 0..splats.len(), 0, |_| true);
    let blind = back.splats(&from_points(&random_points(&capture, &config()), &capture, &config()));
    let blind = off(&blind, 0..blind.len(), 0, |_| true);
    // The cameras are 3.1 from the middle of the room. A third of the points are guesses, where the walls are plain or one
    // camera alone sees them.
    let part = |all: &[f64], tenths: usize| all[all.len() * tenths / 10];
    assert!(part(&swept, 3) < 0.05 && part(&swept, 5) < 0.12, "{} {}", part(&swept, 3), part(&swept, 5));
    assert!(part(&blind, 5) > 4.0 * part(&swept, 5), "random points are {} off", part(&blind, 5));
}

#[test]
fn hulls_find_what_moves_at_each_frame_and_the_rest_stands_still() {
    let (initial, back) = (found(true), training(true).1);
    assert_eq!((initial.from, initial.n_hulls), (Init::Hull, 2));
    let splats = back.splats(&initial.splats);
    let n_static = splats.n_static;
    assert!(n_static > 1500 && splats.motion.len() > 150, "{initial}");
    let still = off(&splats, 0..n_static, 0, |body| !body.dynamic);
    assert!(still[n_static / 2] < 0.15, "{}", still[n_static / 2]);
    for frame in [1, 3] {
        let is_of = |i: &usize| splats.motion[*i].t_center == frame as f32 / 4.0;
        let of: Vec<usize> = (0..splats.motion.len()).filter(is_of).collect();
        let (from, to) = (n_static + of[0], n_static + of[of.len() - 1] + 1);
        assert!(to - from == of.len() && of.len() > 50, "frame {frame}: {} Gaussians", of.len());
        assert!(of.iter().all(|i| (splats.motion[*i].t_scale.exp() - 0.5 * 0.7).abs() < 1e-6));
        let moving = off(&splats, from..to, frame, |body| body.dynamic);
        // Hulls of eight cameras on one side reach beyond the things.
        assert!(moving[of.len() / 2] < 0.05, "frame {frame}: {}", moving[of.len() / 2]);
    }
}

#[test]
fn of_a_single_frame_nothing_moves_on_top_of_what_rests() {
    let (mut capture, _) = training(true);
    capture.n_frames = 1;
    capture.cameras.iter_mut().for_each(|camera| camera.shots.retain(|shot| shot.frame == 0));
    let initial = first(&capture, &Config { holds_static: true, ..config() });
    assert!(initial.n_hulls == 1 && initial.splats.is_empty(), "{initial}");
}

#[test]
fn training_from_pictures_is_ahead_of_training_from_random_points() {
    let (capture, _) = training(true);
    let _device = gpu();
    let score = |init: Init| {
        let config = Config { init, ..config() };
        let begin = first(&capture, &config).splats;
        let mut trainer = trainer(&capture, &config, &begin, 500);
        drive(&mut trainer, &capture, 1, 40);
        test_psnr(&capture, &trainer.splats().unwrap())
    };
    let (hull, random) = (score(Init::Hull), score(Init::Random));
    assert!(hull > random + 1.0, "PSNR {hull:.2} dB from pictures, {random:.2} dB from random points");
}

#[test]
fn the_same_seed_gives_the_same_gaussians() {
    let (capture, _) = training(true);
    let with = |seed: u64| first(&capture, &Config { seed, ..config() }).splats;
    let one = &found(true).splats;
    assert_eq!(*one, with(config().seed));
    assert_ne!(one.position, with(config().seed + 1).position);
}

#[test]
fn the_source_is_what_the_capture_has_or_what_is_asked_for_and_what_it_lacks_is_told() {
    let (capture, _) = training(false);
    let ask = |capture: &Capture, init: Init| initialise(capture, &Config { init, ..config() }, &mut |_, _| {});
    let mut with_points = capture.clone();
    with_points.points = random_points(&capture, &config());
    let joined = ask(&with_points, Init::Auto).unwrap();
    assert!(joined.from == Init::Frustum && joined.joined, "{joined}");
    assert_eq!(ask(&with_points, Init::Random).unwrap().from, Init::Random);
    let alone = ask(&with_points, Init::Frustum).unwrap();
    assert!(!alone.joined && alone.splats == found(false).splats, "{alone}");
    // Few surfaces are still better than random places.
    let few = first(&capture, &Config { init_points: 100, ..config() });
    assert!(few.from == Init::Frustum && (1..=100).contains(&few.splats.len()), "{few}");
    let asked = ask(&with_points, Init::Points).unwrap();
    assert!(asked.from == Init::Points && (1..=3000).contains(&asked.splats.len()), "{asked}");
    for (init, says) in [(Init::Points, "has no points"), (Init::Hull, "has no foreground masks")] {
        let error = ask(&capture, init).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains(says), "{error}");
    }
    // One camera alone finds no surface.
    let mut alone = capture.clone();
    let n = alone.cameras.iter().position(|camera| !camera.is_test).unwrap();
    alone.cameras.iter_mut().enumerate().for_each(|(index, camera)| camera.is_test |= index != n);
    let initial = ask(&alone, Init::Auto).unwrap();
    assert_eq!((initial.from, initial.splats.len()), (Init::Random, config().init_points));
    assert!(initial.to_string().contains("no surface was found"), "{initial}");
    // A picture that does not decode is told by name.
    let mut broken = capture.clone();
    broken.cameras[n].shots[0].image = "absent.png".into();
    let error = ask(&broken, Init::Auto).unwrap_err();
    assert!(error.to_string().contains("absent.png"), "{error}");
}

/// A hundred points on the walls: no picture is covered by them, and no surface is lost to them.
#[test]
fn the_points_of_a_capture_are_joined_with_the_surfaces_that_its_pictures_show() {
    let (capture, back) = training(true);
    let alone = found(true);
    let still = |initial: &Initial| initial.splats.position[..initial.splats.n_static].to_vec();
    let swept = still(alone);
    // Every thirtieth surface, and as many points of what moves, most of which is there in the first frame too.
    let (every, moving) = (swept.iter().step_by(30), &alone.splats.position[alone.splats.n_static..]);
    let point = |at: &[f32; 3]| Point { position: at.map(f64::from), color: [255, 0, 255] };
    let mut with_points = capture.clone();
    let n = every.len();
    with_points.points = every.map(point).chain(moving.iter().take(n).map(point)).collect();
    let joined = first(&with_points, &config());
    assert!(joined.joined && joined.to_string().contains("the capture's points"), "{joined}");
    let is_pink = |i: &usize| joined.splats.sh[i * joined.splats.n_coefficients()][1] < -1.7;
    let pink: Vec<usize> = (0..joined.splats.len()).filter(is_pink).collect();
    assert!(10 * pink.len() >= 8 * n && 10 * pink.len() <= 14 * n, "{} of {n} points stand still", pink.len());
    assert!(pink.iter().all(|i| *i < joined.splats.n_static), "a point that moves stands still");
    assert!(still(&joined).len() > 10 * n, "{joined}");
    // Wide gaps alone are filled by guesses.
    let off = off(&back.splats(&joined.splats), 0..joined.splats.n_static, 0, |body| !body.dynamic);
    assert!(off[off.len() * 7 / 10] < 0.2, "{}", off[off.len() * 7 / 10]);
}
