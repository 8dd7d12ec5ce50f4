//! What comes along with a source's pictures: priors, points of frames, the cameras' clocks, sound and keypoints.

use super::sources::{IDENTITY, sequence};
use super::{done, every, open, rate, run, settings};
use crate::capture::model::{Model, write_cameras};
use crate::capture::{assert_told, dynamic, encode, png};
use crate::common::npy_rows;
use crate::common::prelude::*;
use ivv::internals::scene::capture::FramePoint;
use ivv::internals::scene::prior::{write_depth, write_flow};
use serde_json::json;

/// The project's own folder whose lens distorts: what was estimated from the pictures is undistorted with them.
#[test]
fn priors_of_a_capture_folder_are_undistorted() {
    let folder = Folder::new("prepare-priors");
    let model = Model {
        cameras: vec![(1, 2, "SIMPLE_RADIAL", 64, 48, vec![50.0, 32.0, 24.0, 0.3])],
        images: vec![
            (1, IDENTITY, [0.0, 0.0, 4.0], 1, "a/00000.png", vec![]),
            (2, IDENTITY, [1.0, 0.0, 4.0], 1, "b/00000.png", vec![]),
        ],
        points: vec![],
    };
    write_cameras(&folder, "source/sparse/0", &model);
    let manifest = Manifest { fps: 12.0, frames: 2, masks: true, covisible: true, ..Manifest::default() };
    let manifest = Manifest { flow: true, depth: true, ..manifest };
    manifest.write(&folder.0.join("source")).unwrap();
    sequence_of_folder(&folder);
    let settings = settings(&folder);
    let capture = open(&settings);
    assert_eq!((capture.fps, capture.n_frames), (12.0, 2));
    let camera = &capture.cameras[0];
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    // Pincushion distortion leaves less than the picture.
    assert!(width < 64 && height < 48 && width > 40, "{width} x {height}");
    let shot = &camera.shots[0];
    let flow = read_flow(shot.flow.as_ref().unwrap(), width, height).unwrap();
    let depth = read_depth(shot.depth.as_ref().unwrap(), width, height).unwrap();
    // At the centre the lens does nothing; towards the border the picture is compressed, and flow with it.
    let index = |column: u32, row: u32| (row * width + column) as usize;
    let (center, right) = (index(camera.intrinsics.cx as u32, height / 2), index(width - 4, height / 2));
    assert!((flow[center][0] - 1.0).abs() < 0.01, "{:?}", flow[center]);
    assert!(flow[right][0] < 0.9 && flow[right][0] > 0.6, "{:?}", flow[right]);
    assert!(depth.iter().all(|z| [2.0, 3.0].contains(z)) && depth.contains(&2.0) && depth.contains(&3.0));
    assert!(camera.shots[1].flow.is_none(), "the last frame leads nowhere");
    assert!(shot.mask.is_some());
    let covisible = capture.covisible(0, 0).unwrap().unwrap();
    let is_left = |pixel: usize| ((pixel % width as usize) as f64) < camera.intrinsics.cx - 0.5;
    assert!(covisible.len() == (width * height) as usize);
    assert!(covisible.iter().enumerate().all(|(pixel, seen)| *seen == is_left(pixel)));
    let scaled = PrepareSettings { scale: 0.5, output: folder.0.join("scaled"), ..settings };
    let capture = open(&scaled);
    let (camera, shot) = (&capture.cameras[0], &capture.cameras[0].shots[0]);
    assert!(camera.intrinsics.width.abs_diff(width / 2) <= 1 && camera.intrinsics.height.abs_diff(height / 2) <= 1);
    let flow = read_flow(shot.flow.as_ref().unwrap(), camera.intrinsics.width, camera.intrinsics.height).unwrap();
    let center = flow[(camera.intrinsics.height / 2 * camera.intrinsics.width + camera.intrinsics.cx as u32) as usize];
    assert!((center[0] - 0.5).abs() < 0.01, "{center:?}");
    let depth = read_depth(shot.depth.as_ref().unwrap(), camera.intrinsics.width, camera.intrinsics.height).unwrap();
    assert!(depth.iter().all(|z| [2.0, 3.0].contains(z)) && depth.contains(&2.0) && depth.contains(&3.0));
}

/// Flow is in pixels of its picture, depth is not; an unknown flow stays one, and no more are.
#[test]
fn priors_of_a_capture_folder_are_scaled_and_cut_with_its_pictures() {
    let folder = Folder::new("prepare-scaled");
    let is_known = |flow: &[f32; 2]| flow.iter().all(|v| v.abs() < 1e9);
    // As halves have it: 11 bits.
    let is_close = |found: f32, told: f32| (found - told).abs() <= told.abs() / 2048.0 + 1e-5;
    let is_near = |found: &[f32; 2], told: [f32; 2]| (0..2).all(|axis| is_close(found[axis], told[axis]));
    let flow_at = |column: u32, row: u32| [0.1 * column as f32, 3.0 - 0.05 * row as f32];
    let model = |width: u32| Model {
        cameras: vec![(1, 1, "PINHOLE", width.into(), 48, vec![50.0, 50.0, f64::from(width) / 2.0, 24.0])],
        images: vec![
            (1, IDENTITY, [0.0, 0.0, 4.0], 1, "a/00000.png", vec![]),
            (2, IDENTITY, [1.0, 0.0, 4.0], 1, "b/00000.png", vec![]),
        ],
        points: vec![],
    };
    let write_model = |width: u32| {
        write_cameras(&folder, "source/sparse/0", &model(width));
    };
    write_model(64);
    Manifest { fps: 30.0, frames: 3, flow: true, depth: true, ..Manifest::default() }
        .write(&folder.0.join("source"))
        .unwrap();
    let pixels = || (0..64 * 48_u32).map(|i| (i % 64, i / 64));
    let mut flow: Vec<[f32; 2]> = pixels().map(|(column, row)| flow_at(column, row)).collect();
    flow[20 * 64 + 31] = [1e10; 2];
    let depth: Vec<f32> = (0..64 * 48_u32).map(|i| 1.0 + i as f32).collect();
    for (camera, frame) in [("a", 0), ("a", 1), ("a", 2), ("b", 0), ("b", 1), ("b", 2)] {
        let path = |kind: &str, ending: &str| format!("source/{kind}/{camera}/{frame:05}.{ending}");
        let bars = pixels().flat_map(|(_, row)| if (1..46).contains(&row) { [200, 100, 50] } else { [0; 3] });
        folder.write(&path("images", "png"), encode(&bars.collect::<Vec<_>>(), 64, 48, ExtendedColorType::Rgb8));
        write_flow(&folder.write(&path("flow", "flo"), ""), &flow, 64, 48).unwrap();
        write_depth(&folder.write(&path("depth", "npy"), ""), &depth, 64, 48).unwrap();
    }
    let priors = |settings: &PrepareSettings| {
        let capture = open(settings);
        let (camera, shot) = (&capture.cameras[0], &capture.cameras[0].shots[0]);
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let flow = read_flow(shot.flow.as_ref().unwrap(), width, height).unwrap();
        (width, height, flow, read_depth(shot.depth.as_ref().unwrap(), width, height).unwrap())
    };

    let whole = settings(&folder);
    let (width, height, same, same_depth) = priors(&whole);
    assert!((width, height) == (64, 48) && same_depth == depth);
    let is_same = |(a, b): (&[f32; 2], &[f32; 2])| if is_known(b) { a == b } else { !is_known(a) };
    assert!(same.iter().zip(&flow).all(is_same), "nothing to do: to the bit");
    let half = PrepareSettings { scale: 0.5, output: folder.0.join("half"), ..whole.clone() };
    let (width, height, halved, half_depth) = priors(&half);
    assert_eq!((width, height), (32, 24));
    for (i, (found, z)) in (0_u32..).zip(halved.iter().zip(&half_depth)) {
        let (column, row) = (i % 32, i / 32);
        // The mean of the four pixels below one, in pixels twice as large.
        let (first, last) = (flow_at(2 * column, 2 * row), flow_at(2 * column + 1, 2 * row + 1));
        let expected = [0, 1].map(|axis| 0.25 * (first[axis] + last[axis]));
        let is_as_told = if (column, row) == (15, 10) { !is_known(found) } else { is_near(found, expected) };
        assert!(is_as_told, "{column}, {row}: {found:?}");
        let below = |dx: u32, dy: u32| depth[((2 * row + dy) * 64 + 2 * column + dx) as usize];
        let some = [below(0, 0), below(1, 0), below(0, 1), below(1, 1)];
        assert!(some.into_iter().any(|told| is_close(*z, told)), "{column}, {row}: {z}");
    }

    let sparse = PrepareSettings { frames: every(2, 0), output: folder.0.join("sparse"), ..whole.clone() };
    assert!(done(&sparse).notes.iter().any(|note| note.contains("flow does not skip frames")));
    let manifest = Manifest::read(&sparse.output).unwrap();
    assert!((manifest.frames, manifest.flow, manifest.depth) == (2, false, true));

    // Pictures for a lens of 68 x 48 that were fitted into 64 x 48: 64 x 45 below a row of black.
    write_model(68);
    let cut = PrepareSettings { output: folder.0.join("cut"), ..whole };
    let (width, height, cut_flow, cut_depth) = priors(&cut);
    assert_eq!((width, height), (64, 45));
    assert!(cut_depth.len() == 45 * 64 && cut_depth.iter().zip(&depth[64..]).all(|(z, told)| is_close(*z, *told)));
    let is_as_told = |(a, b): (&[f32; 2], &[f32; 2])| if is_known(b) { is_near(a, *b) } else { !is_known(a) };
    assert!(cut_flow.iter().zip(&flow[64..]).all(is_as_told));
}

/// A capture folder of three cameras and four frames, whose pictures and points tell their frame.
fn capture_with_points(folder: &Folder) {
    let camera = |id| (id, 1, "PINHOLE", 64, 48, vec![50.0, 50.0, 32.0, 24.0]);
    let image = |id, x, name| (id, IDENTITY, [x, 0.0, 4.0], id, name, vec![]);
    // Ids that go against the order of names.
    let images = vec![image(3, 0.0, "a/00000.png"), image(2, 1.0, "b/00000.png"), image(1, 2.0, "c/00000.png")];
    let model = Model { cameras: vec![camera(1), camera(2), camera(3)], images, points: vec![] };
    write_cameras(folder, "source/sparse/0", &model);
    let manifest = Manifest { fps: 30.0, frames: 4, points: true, ..Manifest::default() };
    manifest.write(&folder.0.join("source")).unwrap();
    for name in ["a", "b", "c"] {
        for frame in 0..4_u32 {
            folder.write(&format!("source/images/{name}/{frame:05}.png"), png(64, 48, frame as u8));
        }
    }
    for frame in 0..4_u8 {
        let position = [f64::from(frame), 0.5, 2.0];
        let of_frame = [SeenPoint { position, rgb: [frame, 2, 3], camera_ids: vec![3, 2] }];
        write_points(&folder.write(&format!("source/points/{frame:05}.ply"), ""), &of_frame).unwrap();
    }
}

/// Points of single frames are where they were whatever size the pictures have, and are not triangulated again.
#[test]
fn points_of_frames_come_along() {
    let folder = Folder::new("prepare-frame-points");
    capture_with_points(&folder);
    let of_source = PrepareSettings { scale: 0.5, frames: every(2, 1), triangulate: None, ..settings(&folder) };
    let prepared = done(&of_source);
    assert_eq!(prepared.points, [(0, 1), (1, 1)]);
    let capture = Capture::open(&of_source.output).unwrap();
    assert_eq!((capture.n_frames, capture.cameras[0].intrinsics.width), (2, 32));
    assert_eq!((capture.points.len(), capture.points[0].position), (1, [1.0, 0.5, 2.0]));
    for (frame, x) in [(0, 1), (1, 3)] {
        let point = FramePoint { position: [f64::from(x), 0.5, 2.0], color: [x, 2, 3], seen_by: vec![0, 1] };
        assert_eq!(capture.points_of(frame).unwrap(), [point]);
    }
    assert_eq!(run(&of_source).unwrap().1.iter().filter(|piece| piece.starts_with("points")).count(), 0);
    let stopped = Manifest { fps: 0.0, ..Manifest::read(&of_source.source).unwrap() };
    stopped.write(&of_source.source).unwrap();
    let of_stopped = PrepareSettings { output: folder.0.join("stopped"), ..of_source };
    assert_told(&run(&of_stopped).unwrap().0.report, &["has 0 frames per second, 0.0001 to 100000 are allowed"]);
    assert!(!of_stopped.output.exists());
}

/// A camera that began earlier or later than the others shows other times, at which the points are not.
#[test]
fn cameras_that_did_not_begin_together_are_shifted() {
    let folder = Folder::new("prepare-shifts");
    capture_with_points(&folder);
    let shift = |b: f64, c: f64| [("b".to_owned(), b), ("c".to_owned(), c)].into();
    let shifted = PrepareSettings { shifts: shift(1.0, -1.0), frames: every(1, 1), ..settings(&folder) };
    let capture = open(&shifted);
    assert_eq!((capture.n_frames, capture.has_frame_points()), (2, false));
    for (camera, first) in [(0, 1), (1, 2), (2, 0)] {
        for frame in 0..2 {
            let image = std::fs::read(&capture.cameras[camera].shots[frame as usize].image).unwrap();
            assert_eq!(image, png(64, 48, first + frame), "camera {camera}, frame {frame}");
        }
    }
    // What is known of the cameras' clocks is known of the shifted ones; each other frame is taken.
    assert!(capture.true_offsets.is_empty());
    folder.write("source/truth.json", r#"{"seed": 3, "time_offsets_frames": {"a": 0.25, "b": -0.5}}"#);
    let timed = PrepareSettings { frames: every(2, 1), output: folder.0.join("timed"), ..shifted.clone() };
    let offsets = open(&timed).true_offsets;
    assert_eq!(offsets, [("a".to_owned(), 0.125), ("b".to_owned(), 0.25)].into());
    for (text, says) in [
        (r#"{"time_offsets_frames": {"e": 1}}"#, "time_offsets_frames: no camera is named `e`"),
        ("{\n\"time_offsets_frames\": [1]}", "is no truth of a capture"),
    ] {
        folder.write("source/truth.json", text);
        assert_told(&run(&timed).unwrap().0.report, &[says]);
    }
    std::fs::remove_file(folder.0.join("source/truth.json")).unwrap();
    let unlike = PrepareSettings { shifts: shift(1.0, 0.0), ..shifted.clone() };
    assert!(run(&unlike).unwrap_err().to_string().contains("made with other settings"));
    let early = PrepareSettings { shifts: shift(0.0, -3.0), ..shifted.clone() };
    assert_told(
        &run(&early).unwrap().0.report,
        &["camera `c`: is to begin 2 frames before its footage; begin at frame 3 or later: --frames 3:"],
    );
    let unknown = PrepareSettings { shifts: [("d".to_owned(), 1.0)].into(), ..shifted };
    assert_told(&run(&unknown).unwrap().0.report, &["--shift: no camera is named `d`"]);
}

/// For the cameras `a` and `b`: images, masks, co-visibility of the left half, flow of one pixel to the right, depth of two
/// planes.
fn sequence_of_folder(folder: &Folder) {
    let flow = vec![[1.0_f32, 0.0]; 64 * 48];
    let depth: Vec<f32> = (0..64 * 48).map(|i| if i % 64 < 32 { 2.0 } else { 3.0 }).collect();
    for camera in ["a", "b"] {
        for frame in 0..2 {
            let path = |kind: &str, ending: &str| format!("source/{kind}/{camera}/{frame:05}.{ending}");
            folder.write(&path("images", "png"), png(64, 48, frame));
            folder.write(&path("masks", "png"), encode(&[255; 64 * 48], 64, 48, ExtendedColorType::L8));
            let left: Vec<u8> = (0..64 * 48).map(|i| if i % 64 < 32 { 255 } else { 0 }).collect();
            folder.write(&path("covisible", "png"), encode(&left, 64, 48, ExtendedColorType::L8));
            let flow_file = folder.write(&path("flow", "flo"), "");
            write_flow(&flow_file, &flow, 64, 48).unwrap();
            let depth_file = folder.write(&path("depth", "npy"), "");
            write_depth(&depth_file, &depth, 64, 48).unwrap();
        }
    }
}

#[test]
fn sound_and_keypoints_come_along() {
    let folder = Folder::new("prepare-sound");
    dynamic::write_below(&folder, "source/", 2);
    folder.write("source/audio/room.wav", b"RIFF....WAVE");
    let frame = |id: u32| {
        json!({ "frame_id": id, "instances": [{ "keypoints": [[3.0, 2.0], [5.0, 1.0]], "keypoint_scores": [0.9, 0.8],
            "bbox": [[1.0, 1.0, 5.0, 3.0]], "bbox_score": 0.5 }] })
    };
    folder.write("source/keypoints/2.json", json!([frame(0), frame(1)]).to_string());
    let settings = PrepareSettings { scale: 0.5, frames: Frames::first(1), ..settings(&folder) };
    done(&settings);
    assert!(Manifest::read(&settings.output).unwrap().audio);
    let read = |path: &Path| std::fs::read(settings.output.join(path)).unwrap();
    assert_eq!(read("audio/room.wav".as_ref()), b"RIFF....WAVE");
    // That of a camera whose frames are shifted would be early.
    folder.write("source/audio/2.wav", b"RIFF....WAVE");
    let shifts = [("2".to_owned(), 1.0)].into();
    let shifted = PrepareSettings { shifts, output: folder.0.join("shifted"), ..settings.clone() };
    done(&shifted);
    let is_there = |name: &str| shifted.output.join("audio").join(name).exists();
    assert!(is_there("room.wav") && !is_there("2.wav"));
    let moved: serde_json::Value = serde_json::from_slice(&read("keypoints/2.json".as_ref())).unwrap();
    assert_eq!(moved.as_array().map(Vec::len), Some(1));
    let instance = &moved[0]["instances"][0];
    assert_eq!(instance["keypoints"], json!([[1.5, 1.0], [2.5, 0.5]]));
    assert_eq!((&instance["keypoint_scores"], &instance["bbox"]), (&json!([0.9, 0.8]), &json!([[0.5, 0.5, 2.5, 1.5]])));
}

/// A lost image is missed, and does not move those behind it; names that are times are counted.
#[test]
fn numbers_of_images_are_frames() {
    let folder = Folder::new("prepare-gap");
    let row = [[0.0, 1.0, 0.0, 0.0, 48.0], [1.0, 0.0, 0.0, 0.0, 64.0], [0.0, 0.0, -1.0, 0.0, 50.0]].concat();
    let row = [row, vec![1.0, 100.0]].concat();
    folder.write("source/poses_bounds.npy", npy_rows(2, &[row.clone(), row].concat()));
    sequence(&folder, "cam00", 6);
    for (k, time) in [1_000, 1_033, 1_066, 1_101, 1_133, 1_166].iter().enumerate() {
        folder.write(&format!("source/cam01/{time}.png"), png(64, 48, 10 * k as u8));
    }
    let settings = PrepareSettings { capture: rate(30.0), ..settings(&folder) };
    assert_eq!(open(&settings).n_frames, 6);
    std::fs::remove_file(folder.0.join("source/cam00/0003.png")).unwrap();
    let lost = PrepareSettings { output: folder.0.join("lost"), ..settings };
    assert_told(&run(&lost).unwrap().0.report, &["camera `cam00`: has no image of frame 3"]);
    let before = PrepareSettings { frames: Frames::first(3), ..lost };
    assert_eq!(open(&before).n_frames, 3);
}
