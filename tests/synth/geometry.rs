//! Exact depth, flow and masks against the poses of truth.json and COLMAP's cameras, and the points of the frames.

use super::model::{Camera, read_model};
use super::{bodies, exr, json, options, rgb, shared};
use crate::common::prelude::*;
use std::collections::HashSet;

fn for_each_pixel(mut each: impl FnMut(&Camera, usize, DVec2, DVec3, usize, DVec2)) {
    for camera in &read_model(shared()).0 {
        for frame in 0..options().frames as usize {
            let truth = exr(&shared().join(format!("truth/exact/{}/{frame:05}.exr", camera.name)));
            assert_eq!(truth["depth.Z"].len(), (camera.size[0] * camera.size[1]) as usize);
            for (i, depth) in truth["depth.Z"].iter().enumerate() {
                let width = options().width as usize;
                let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                let world = camera.unproject(pixel, f64::from(*depth));
                let flow = DVec2::new(f64::from(truth["flow.X"][i]), f64::from(truth["flow.Y"][i]));
                each(camera, frame, pixel, world, truth["body"][i] as usize, flow);
            }
        }
    }
}

#[test]
fn exact_depth_puts_every_pixel_on_the_surface_of_its_body_and_nothing_is_in_front() {
    let bodies = bodies(shared());
    let mut seen = BTreeSet::new();
    for_each_pixel(|camera, frame, pixel, world, body, _| {
        let off = bodies[body].distance(bodies[body].local(bodies[body].pose(frame), world));
        assert!(off < 2e-6, "{} frame {frame} {pixel}: {off} off {}", camera.name, bodies[body].name);
        assert!(bodies[body].exists(frame as f64), "{} is seen when it does not exist", bodies[body].name);
        // Balls that the ray meets before the pixel's body would hide it.
        for ball in bodies.iter().filter(|b| b.shape["kind"] == "sphere" && b.exists(frame as f64)) {
            let ahead = (world - camera.center()).normalize();
            let to_ball = ball.pose(frame).1 - camera.center();
            let along = to_ball.dot(ahead).clamp(0.0, (world - camera.center()).length());
            let radius = ball.shape["radius"].as_f64().unwrap();
            let near = (to_ball - ahead * along).length();
            assert!(near > radius - 1e-5, "{} frame {frame} {pixel}: {} is in front", camera.name, ball.name);
        }
        seen.insert(body);
    });
    let named = |name: &str| bodies.iter().position(|b| b.name == name).unwrap();
    for name in ["room", "ball", "turning crate", "fast ball", "balloon", "speaker's head", "table top"] {
        assert!(seen.contains(&named(name)), "nobody sees the {name}");
    }
}

#[test]
fn exact_flow_is_the_reprojection_of_the_moved_surface_point() {
    let bodies = bodies(shared());
    let (mut n_moving, mut largest) = (0, 0.0_f64);
    for_each_pixel(|camera, frame, pixel, world, body, flow| {
        let body = &bodies[body];
        if !body.dynamic {
            assert_eq!(flow, DVec2::ZERO, "the {} moves", body.name);
            return;
        }
        let local = body.local(body.pose(frame), world);
        let (rotation, position) = body.pose(frame + 1);
        let (moved, _) = camera.project(rotation * local + position);
        let error = (moved - pixel - flow).length();
        assert!(error < 1e-4, "{} frame {frame} {pixel}: flow {flow}, {error} off on the {}", camera.name, body.name);
        n_moving += 1;
        largest = largest.max(flow.length());
    });
    assert!(n_moving > 500 && largest > 5.0, "{n_moving} moving pixels, the fastest by {largest}");
}

#[test]
fn poses_are_rotations_and_turn_evenly() {
    let bodies = bodies(shared());
    assert_eq!(bodies.iter().filter(|b| b.dynamic).count(), 6);
    for body in &bodies {
        for (rotation, _) in &body.poses {
            let defect = *rotation * rotation.transpose() - DMat3::IDENTITY;
            let largest = defect.to_cols_array().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!(largest < 1e-14 && rotation.determinant() > 0.0, "{}: {largest}", body.name);
        }
        let steps: Vec<DMat3> = body.poses.windows(2).map(|pair| pair[1].0 * pair[0].0.transpose()).collect();
        for pair in steps.windows(2) {
            assert!(pair[0].abs_diff_eq(pair[1], 1e-13), "{} turns unevenly", body.name);
        }
    }
}

#[test]
fn pictures_change_where_something_moves_and_nowhere_else() {
    let (mut inside, mut n_inside, mut n_outside) = (0.0, 0_u32, 0_u32);
    for camera in &read_model(shared()).0 {
        let path = |kind: &str, frame: u32| shared().join(format!("{kind}/{}/{frame:05}.png", camera.name));
        for frame in 1..options().frames {
            let [before, after] = [frame - 1, frame].map(|f| rgb(&path("images", f)));
            let masks = [frame - 1, frame].map(|f| rgb(&path("foreground", f)));
            assert!(after.pixels().collect::<HashSet<_>>().len() > 300, "{} is nearly constant", camera.name);
            for (x, y, pixel) in after.enumerate_pixels() {
                let change: i32 = (0..3).map(|c| (i32::from(pixel[c]) - i32::from(before[(x, y)][c])).abs()).sum();
                if masks.iter().any(|mask| mask[(x, y)][0] == 255) {
                    inside += f64::from(change);
                    n_inside += 1;
                } else {
                    assert_eq!(
                        change, 0,
                        "{} frame {frame} ({x}, {y}) changes though nothing moves there",
                        camera.name
                    );
                    n_outside += 1;
                }
            }
        }
    }
    let mean = inside / f64::from(n_inside) / 3.0;
    assert!(mean > 8.0 && n_inside > 1000 && n_outside > n_inside, "mean change {mean} of {n_inside}, {n_outside}");
}

#[test]
fn what_a_training_camera_sees_too_is_bright_in_the_masks_of_test_cameras() {
    let cameras = read_model(shared()).0;
    let is_test = |camera: &&Camera| shared().join("covisible").join(&camera.name).is_dir();
    let (tests, trained): (Vec<&Camera>, Vec<&Camera>) = cameras.iter().partition(is_test);
    assert_eq!((tests.len(), trained.len()), (1, 3));
    let (width, height) = (options().width as i64, options().height as i64);
    let mut sure = [0; 2];
    for frame in 0..options().frames as usize {
        let path = |camera: &Camera| shared().join(format!("truth/exact/{}/{frame:05}.exr", camera.name));
        let depths = |camera: &Camera| exr(&path(camera))["depth.Z"].clone();
        let before: Vec<(&Camera, Vec<f32>)> = trained.iter().map(|camera| (*camera, depths(camera))).collect();
        let mask = rgb(&shared().join(format!("covisible/{}/{frame:05}.png", tests[0].name)));
        for ((x, y, level), depth) in mask.enumerate_pixels().zip(depths(tests[0])) {
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let point = tests[0].unproject(pixel, f64::from(depth));
            // Where a training picture's surface is, about the place of the point: at its depth or behind it, or before it.
            let parts = before.iter().map(|(camera, depths)| {
                let (at, z) = camera.project(point);
                let (column, row) = (at.x.floor() as i64, at.y.floor() as i64);
                let near = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (column + dx, row + dy)));
                let inside = |(x, y): &(i64, i64)| (0..width).contains(x) && (0..height).contains(y);
                let depth = |(x, y)| f64::from(depths[(y * width + x) as usize]);
                let depths: Vec<f64> = near.map(|at| if z > 0.0 && inside(&at) { depth(at) } else { 0.0 }).collect();
                (depths.iter().all(|depth| *depth > 0.99 * z), depths.iter().any(|depth| *depth > 0.9 * z))
            });
            let (seen, maybe) = parts.fold((false, false), |all, one| (all.0 || one.0, all.1 || one.1));
            assert!(level[0] == 0 || level[0] == 255);
            if seen || !maybe {
                assert_eq!(level[0] == 255, seen, "frame {frame} ({x}, {y})");
                sure[usize::from(seen)] += 1;
            }
        }
    }
    assert!(sure[0] > 150 && sure[1] > 1500, "{sure:?}");
}

/// (place, colour, numbers of cameras) of the points of a frame.
pub fn read_points(capture: &Path, frame: u32) -> Vec<(DVec3, [u8; 3], Vec<i32>)> {
    let bytes = fs::read(capture.join(format!("points/{frame:05}.ply"))).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let n: usize = header.split("element vertex ").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    assert!(header.contains("property list uchar int camera_ids"));
    let mut rest = &bytes[end..];
    let mut points = Vec::new();
    for _ in 0..n {
        let f = |i: usize| f64::from(f32::from_le_bytes(rest[4 * i..4 * i + 4].try_into().unwrap()));
        let (at, color, n_ids) = (DVec3::new(f(0), f(1), f(2)), [rest[12], rest[13], rest[14]], usize::from(rest[15]));
        let ids = (0..n_ids).map(|i| i32::from_le_bytes(rest[16 + 4 * i..20 + 4 * i].try_into().unwrap())).collect();
        points.push((at, color, ids));
        rest = &rest[16 + 4 * n_ids..];
    }
    assert!(rest.is_empty());
    points
}

#[test]
fn points_lie_on_surfaces_within_the_noise_except_the_outliers() {
    let (bodies, truth) = (bodies(shared()), json(&shared().join("truth.json")));
    let (cameras, _) = read_model(shared());
    let sd = truth["noise"]["points_sd"].as_f64().unwrap();
    // The noise is bounded: 2 sqrt 3 standard deviations along each of three axes, here 6.
    let most = 6.0 * sd + 1e-6;
    let (mut n_outliers, mut n_off, mut n, mut n_dynamic, mut spread) = (0, 0, 0, 0, 0.0);
    for frame in 0..options().frames {
        let points = read_points(shared(), frame);
        assert_eq!(points.len(), options().points as usize);
        let outliers = &truth["point_outliers"][frame as usize];
        let outliers: BTreeSet<u64> = outliers.as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        for (row, (at, _, ids)) in points.iter().enumerate() {
            assert!(ids.len() >= 2 && ids.is_sorted() && !ids.contains(&3), "{ids:?}; camera 3 is for test");
            for id in ids {
                let (pixel, depth) = cameras[*id as usize - 1].project(*at);
                assert!(depth > 0.0 && cameras[*id as usize - 1].holds(pixel + DVec2::splat(1e-4)), "{id} {pixel}");
            }
            let alive = bodies.iter().filter(|b| b.exists(f64::from(frame)));
            let off = alive.map(|b| (b.distance(b.local(b.pose(frame as usize), *at)), b.dynamic));
            let (off, dynamic) = off.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            n += 1;
            if outliers.contains(&(row as u64)) {
                n_outliers += 1;
                n_off += u32::from(off > most);
            } else {
                assert!(off <= most, "frame {frame} point {row} is {off} off");
                n_dynamic += u32::from(dynamic);
                spread += off * off;
            }
        }
    }
    let spread = (spread / f64::from(n)).sqrt() / sd;
    assert!((0.8..1.1).contains(&spread), "distances have {spread} of the stated deviation");
    assert!((9..60).contains(&n_outliers) && n_off * 10 > n_outliers * 8, "{n_off} of {n_outliers} outliers are off");
    assert!(n_dynamic > 60, "{n_dynamic} of {n} points are on moving things");
}
