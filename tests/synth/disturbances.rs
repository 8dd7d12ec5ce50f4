//! What the options disturb: clocks, colours, sensors, lens hoods.

use super::geometry::read_points;
use super::model::read_model;
use super::{bodies, exr, json, make, numbers, options, rgb};
use crate::common::prelude::*;
use ivv::internals::synth::{Noise, Options};

fn few() -> Options {
    Options { frames: 2, samples: 1, noise: Noise::None, points: 20, ..options() }
}

#[test]
fn pictures_are_of_the_time_that_the_cameras_clock_shifts_them_to() {
    let still = make("clocks-true", &few(), 2);
    let shifted = make("clocks-off", &Options { offsets: true, ..few() }, 2);
    let truth = json(&shifted.join("truth.json"));
    let offset = |index: usize| truth["time_offsets_frames"][format!("cam{index:02}")].as_f64().unwrap();
    let offsets: Vec<f64> = (0..4).map(offset).collect();
    assert_eq!(offsets[2], 0.0, "the test camera keeps the true time");
    assert!(offsets.iter().sum::<f64>().abs() < 1e-12 && offsets.iter().any(|o| o.abs() > 0.2), "{offsets:?}");
    let bodies = bodies(&shifted);
    let ball = bodies.iter().position(|b| b.name == "ball").unwrap();
    let [(_, from), (_, to)] = [bodies[ball].pose(0), bodies[ball].pose(1)];
    let radius = bodies[ball].shape["radius"].as_f64().unwrap();
    let mut n = 0;
    for (index, camera) in read_model(&shifted).0.iter().enumerate() {
        for frame in 0..2_u32 {
            let center = from + (to - from) * (f64::from(frame) + offsets[index]);
            let name = format!("{}/{frame:05}", camera.name);
            let exact = exr(&shifted.join(format!("truth/exact/{name}.exr")));
            for (i, depth) in exact["depth.Z"].iter().enumerate().filter(|(i, _)| exact["body"][*i] == ball as f32) {
                let pixel = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
                let off = (camera.unproject(pixel, f64::from(*depth)) - center).length() - radius;
                assert!(off.abs() < 2e-6, "{name} {pixel}: {off} off the ball at its shifted place");
                n += 1;
            }
            let pictures = [&still, &shifted].map(|capture| rgb(&capture.join(format!("images/{name}.png"))));
            assert_eq!(pictures[0] == pictures[1], offsets[index] == 0.0, "{name}");
        }
    }
    assert!(n > 50, "the ball covers {n} pixels");
}

#[test]
fn colours_are_transformed_as_the_truth_says() {
    let true_colors = make("colors-true", &few(), 2);
    let own_colors = make("colors-own", &Options { colors: true, ..few() }, 2);
    let truth = json(&own_colors.join("truth.json"));
    let mut mean = [[0.0; 4]; 3];
    for index in 0..4 {
        let name = format!("cam{index:02}");
        let rows: Vec<Vec<f64>> = truth["color_transforms"][&name].as_array().unwrap().iter().map(numbers).collect();
        let identity: Vec<Vec<f64>> = (0..3).map(|i| (0..4).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        assert_eq!(rows == identity, index == 2, "{name}: {rows:?}");
        if index != 2 {
            for (i, j) in (0..3).flat_map(|i| (0..4).map(move |j| (i, j))) {
                mean[i][j] += rows[i][j] / 3.0;
            }
        }
        let path = format!("images/{name}/00001.png");
        let [before, after] = [&true_colors, &own_colors].map(|capture| rgb(&capture.join(&path)));
        for (a, b) in before.pixels().zip(after.pixels()) {
            let color = DVec3::from_array(a.0.map(f64::from));
            for (c, row) in rows.iter().enumerate() {
                let expected = (DVec3::from_slice(&row[..3]).dot(color) + 255.0 * row[3]).clamp(0.0, 255.0);
                assert!((expected - f64::from(b[c])).abs() < 1.3, "{name}: {a:?} became {b:?}");
            }
        }
    }
    for (i, j) in (0..3).flat_map(|i| (0..4).map(move |j| (i, j))) {
        assert!((mean[i][j] - f64::from(u8::from(i == j))).abs() < 1e-12, "mean {mean:?}");
    }
}

#[test]
fn sensors_are_noisy_and_hoods_are_masked() {
    let clean = make("sensor-clean", &few(), 2);
    let noisy = make("sensor-noisy", &Options { noise: Noise::All, masks: true, ..few() }, 2);
    let (mut squares, mut n, mut n_hidden) = (0.0, 0.0, 0);
    for index in 0..4 {
        let mask = noisy.join(format!("masks/cam{index:02}/00000.png"));
        // Training cameras are 0, 1 and 3; the second of them has a hood.
        assert_eq!(mask.exists(), index == 1, "{}", mask.display());
        let mask = mask.exists().then(|| rgb(&mask));
        let path = format!("images/cam{index:02}/00000.png");
        let [before, after] = [&clean, &noisy].map(|capture| rgb(&capture.join(&path)));
        for (x, y, pixel) in after.enumerate_pixels() {
            if mask.as_ref().is_some_and(|mask| mask[(x, y)][0] == 0) {
                assert!(pixel.0.iter().all(|c| *c < 30), "the hood is {pixel:?} at ({x}, {y})");
                n_hidden += 1;
                continue;
            }
            for c in (0..3).filter(|c| (20..235).contains(&before[(x, y)][*c])) {
                squares += (f64::from(pixel[c]) - f64::from(before[(x, y)][c])).powi(2);
                n += 1.0;
            }
        }
    }
    let spread = (squares / n).sqrt() / 255.0;
    assert!((0.0095..0.0108).contains(&spread), "noise of {spread} of the range");
    assert!((40..400).contains(&n_hidden), "{n_hidden} pixels are hidden");
}

#[test]
fn things_that_stand_still_first_do_later_what_they_would_have_done() {
    let usual = make("late-usual", &Options { frames: 4, ..few() }, 2);
    let late = make("late", &Options { frames: 4, still_frames: 2, ..few() }, 2);
    let [usual, bodies] = [&usual, &late].map(|folder| bodies(folder));
    let mut moved = 0;
    for (usual, late) in usual.iter().zip(&bodies).filter(|(usual, _)| usual.dynamic) {
        for frame in 0..=2 {
            assert_eq!(late.pose(frame), usual.pose(0), "{} at {frame}", late.name);
        }
        assert_eq!(late.pose(4), usual.pose(2), "{}", late.name);
        moved += usize::from(late.pose(3) != late.pose(2));
    }
    assert!(moved > 3, "{moved} bodies move at last");
    // Where nothing moves yet, the flow is none.
    let flow = |frame: u32| exr(&late.join(format!("truth/exact/cam00/{frame:05}.exr")))["flow.X"].clone();
    assert!((0..2).all(|frame| flow(frame).iter().all(|x| *x == 0.0)) && flow(2).iter().any(|x| x.abs() > 0.1));
}

#[test]
fn a_bent_rig_is_told_wrong_and_shows_what_it_shows_straight() {
    let straight = make("rig-straight", &few(), 2);
    let bent = make("rig-bent", &Options { bent: true, ..few() }, 2);
    let poses = [&straight, &bent].map(|capture| read_model(capture).0);
    for (index, (true_pose, told)) in poses[0].iter().zip(&poses[1]).enumerate() {
        let turn = (told.rotation() * true_pose.rotation().transpose()).to_cols_array();
        let angle = ((turn[0] + turn[4] + turn[8] - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
        let shift = (told.center() - true_pose.center()).length();
        // Camera 2 is a test camera.
        let expected = if index == 2 { [0.0, 0.0] } else { [0.2, 0.01] };
        assert!((angle - expected[0]).abs() < 1e-5 && (shift - expected[1]).abs() < 1e-9, "{index}: {angle}, {shift}");
        let pictures =
            [&straight, &bent].map(|capture| rgb(&capture.join(format!("images/{}/00001.png", true_pose.name))));
        assert_eq!(pictures[0], pictures[1], "{index}");
    }
}

#[test]
fn rough_points_are_eight_times_as_wrong_and_the_pictures_the_same() {
    let [fine, rough] = [("points-fine", Noise::Priors), ("points-rough", Noise::Rough)]
        .map(|(name, noise)| make(name, &Options { noise, points: 300, ..few() }, 2));
    let [fine_truth, rough_truth] = [&fine, &rough].map(|capture| json(&capture.join("truth.json")));
    assert_eq!((&fine_truth["noise"]["points_sd"], &rough_truth["noise"]["points_sd"]), (&0.004.into(), &0.03.into()));
    let outliers = |truth: &serde_json::Value| {
        truth["point_outliers"].as_array().unwrap().iter().map(|rows| rows.as_array().unwrap().len()).sum::<usize>()
    };
    assert!((5..40).contains(&outliers(&fine_truth)) && (70..160).contains(&outliers(&rough_truth)));
    let off = |capture: &Path| {
        let bodies = bodies(capture);
        let rows: BTreeSet<u64> = json(&capture.join("truth.json"))["point_outliers"][0]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_u64().unwrap())
            .collect();
        let points = read_points(capture, 0);
        let inliers = points.iter().enumerate().filter(|(row, _)| !rows.contains(&(*row as u64)));
        let squares: Vec<f64> = inliers
            .map(|(_, (at, ..))| {
                let alive = bodies.iter().filter(|b| b.exists(0.0));
                alive.map(|b| b.distance(b.local(b.pose(0), *at))).min_by(f64::total_cmp).unwrap().powi(2)
            })
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    // The nearest surface is nearer than the one that the point was on.
    let ratio = off(&rough) / off(&fine);
    assert!((5.0..8.0).contains(&ratio), "{ratio} times as far");
    let image = "images/cam00/00001.png";
    assert_eq!(rgb(&fine.join(image)), rgb(&rough.join(image)));
}
