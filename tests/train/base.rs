//! Runs on top of another: what rests and what was learnt of the cameras is taken over.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::scene::capture::Calibration;
use ivv::internals::train::Base;

const SHORT: [&str; 6] = ["--sh-degree", "1", "--set", "init_points=200", "--eval-every", "0"];

/// Bits of the static Gaussians of a scene file, in any order.
fn at_rest(scene: &Splats) -> Vec<Vec<u32>> {
    let k = scene.n_coefficients();
    let row = |i: usize| {
        let sh = scene.sh[i * k..(i + 1) * k].as_flattened();
        let numbers = scene.position[i].iter().chain(&scene.rotation[i]).chain(&scene.scale[i]).chain(sh);
        numbers.chain([&scene.opacity[i]]).map(|x| x.to_bits()).collect()
    };
    let mut rows: Vec<Vec<u32>> = (0..scene.n_static).map(row).collect();
    rows.sort_unstable();
    rows
}

#[test]
fn a_part_of_a_clip_is_trained_on_top_of_a_run_over_the_clip() {
    let tiny = Tiny::new("base");
    let (capture, base, part) = (text(&tiny.folder), tiny.folder.join("over"), tiny.folder.join("part"));
    let still = ["--set", "init_static_tau=0", "--steps", "40"];
    works(&[&["train", capture, "-o", text(&base), "--frames", "::2"], &still[..], &SHORT[..]].concat());
    let of_part = ["train", capture, "-o", text(&part), "--frames", "1:3", "--base", text(&base), "--steps", "30"];
    let told = tells(&[&of_part[..], &SHORT[2..]].concat());
    assert!(told.contains("of moving surfaces, by the flow"), "{told}");

    let scene = |run: &Path| read_ply(&run.join("scene.ply")).unwrap();
    let (whole, on_top) = (scene(&base), scene(&part));
    assert!(whole.n_static > 50 && on_top.n_static == whole.n_static, "{} {}", whole.n_static, on_top.n_static);
    assert!(!on_top.motion.is_empty() && on_top.sh_degree == 1);
    // Through the frame of training and back: equal to the rounding there.
    let (a, b) = (at_rest(&whole), at_rest(&on_top));
    let near =
        |a: &u32, b: &u32| (f32::from_bits(*a) - f32::from_bits(*b)).abs() <= 1e-5 * f32::from_bits(*a).abs().max(1.0);
    assert!(a.iter().zip(&b).all(|(a, b)| a.iter().zip(b).all(|(a, b)| near(a, b))));

    // The clocks are those of the run below, in seconds, and are not learnt again.
    let run = Run::read(&part).unwrap();
    let config: Config = serde_json::from_value(json(&part.join("config.json"))).unwrap();
    assert!(
        !config.offsets && config.holds_static && json(&part.join("train.json"))["offsets"] == serde_json::json!([])
    );
    let below = Checkpoint::newest(&base.join("checkpoints")).unwrap().unwrap();
    let fps = Run::read(&base).unwrap().held.fps;
    assert!(run.calibration.len() > 1 && fps == tiny.capture.fps / 2.0);
    for (camera, clock) in tiny.capture.cameras.iter().zip(&below.cameras.clocks) {
        let offset = run.calibration.get(&camera.name).map_or(0.0, |known| known.offset);
        assert_eq!(offset, f64::from(clock[0]) / fps, "{}", camera.name);
        assert!(!camera.is_test || offset == 0.0);
    }

    // It goes on, and is scored, as any other run.
    works(&["train", "--resume", "-o", text(&part), "--steps", "34", "--eval-every", "0"]);
    assert_eq!(at_rest(&scene(&part)), b);
    works(&["eval", text(&part)]);

    // Its settings alone are those of no run by itself.
    let alone = tiny.folder.join("alone");
    let settings = part.join("config.json");
    let told = fails(&["train", capture, "-o", text(&alone), "--config", text(&settings)], 3);
    assert!(told.contains("holds_static") && told.contains("--base") && !alone.exists(), "{told}");

    let other = tiny.folder.join("other");
    let first = tiny.capture.cameras[0].name.as_str();
    let of_others = ["train", capture, "-o", text(&other), "--base", text(&base), "--test-cameras", first];
    assert!(fails(&of_others, 3).contains("give a run on the same cameras"));
    let drawn = ["train", capture, "-o", text(&other), "--base", text(&base), "--set", "density.strategy=mcmc"];
    assert!(fails(&drawn, 3).contains("density.strategy=mcmc") && !other.exists(), "nothing is written");
    works(&[&["train", capture, "-o", text(&other), "--steps", "9"], &SHORT[..]].concat());
    std::fs::remove_dir_all(other.join("checkpoints")).unwrap();
    assert!(
        fails(&["train", capture, "-o", text(&tiny.folder.join("x")), "--base", text(&other)], 3)
            .contains("no checkpoint")
    );
    assert!(Base::read(&other).is_err());
}

#[test]
fn a_calibration_corrects_poses_and_times() {
    let tiny = Tiny::new("calibrated");
    let name = tiny.capture.cameras[1].name.clone();
    let known = Calibration { offset: 0.5 / tiny.capture.fps, turn: [0.0, 0.0, 0.01], shift: [0.1, 0.0, 0.0] };
    let corrected = tiny.capture.clone().calibrated(&BTreeMap::from([(name, known)]));
    let view = |capture: &Capture, camera: usize| capture.view(camera, 1).unwrap();
    assert_eq!(view(&corrected, 0), view(&tiny.capture, 0));
    let (before, after) = (view(&tiny.capture, 1), view(&corrected, 1));
    assert!((after.time_offset - 0.5).abs() < 1e-12 && after.time == before.time);
    let moved = after.pose.center() - before.pose.center();
    assert!((moved - glam::DVec3::new(0.1, 0.0, 0.0)).length() < 1e-9, "{moved}");
    assert_eq!(after.pose, before.pose.corrected(known.turn.into(), known.shift.into()));
}

/// Where the colours of what rests are held, what all cameras have in common is no longer free: the maps follow the light.
#[test]
#[ignore = "slow: two trainings of 520 steps"]
fn maps_follow_the_light_of_a_part() {
    let tiny = Tiny::new("base-light");
    let (capture, base, part) = (text(&tiny.folder), tiny.folder.join("over"), tiny.folder.join("part"));
    works(
        &[&["train", capture, "-o", text(&base), "--set", "init_static_tau=0", "--steps", "120"], &SHORT[..]].concat(),
    );
    for (camera, frame) in tiny.capture.training_frames() {
        let file = &tiny.capture.cameras[camera].shot(frame).unwrap().image;
        let mut darker = image::open(file).unwrap().to_rgb8();
        darker.iter_mut().for_each(|level| *level = (0.7 * f64::from(*level)).round() as u8);
        darker.save(file).unwrap();
    }
    let on_top = ["train", capture, "-o", text(&part), "--base", text(&base), "--steps", "1200"];
    works(&[&on_top[..], &SHORT[2..]].concat());
    let mean_gain = |run: &Path| {
        let cameras = Checkpoint::newest(&run.join("checkpoints")).unwrap().unwrap().cameras;
        let gains =
            cameras.grids.iter().flat_map(|state| state.grid.chunks(12)).flat_map(|map| [map[0], map[5], map[10]]);
        let gains: Vec<f32> = gains.collect();
        assert!(!gains.is_empty());
        gains.iter().sum::<f32>() / gains.len() as f32
    };
    let (before, after) = (mean_gain(&base), mean_gain(&part));
    assert!((before - 1.0).abs() < 0.02 && after < 0.85, "{before} {after}");
}
