//! The project's own capture folder.

use super::model::{Model, write_cameras};
use super::{Case, Folder, assert_told, encode, png};
use crate::common::prelude::*;

fn manifest() -> Manifest {
    Manifest {
        fps: 25.0,
        frames: 3,
        reference_frame: 1,
        test_cameras: vec!["side".to_owned()],
        masks: true,
        foreground: true,
        covisible: true,
        ..Manifest::default()
    }
}

/// `front` stands still, `rig` moves, `side` is a test camera without masks.
fn write(folder: &Folder, change: impl FnOnce(&mut Model)) {
    let turn = [1.0, 0.0, 0.0, 0.0];
    let mut model = Model {
        cameras: vec![(1, 1, "PINHOLE", 6, 4, vec![5.0, 5.0, 3.0, 2.0])],
        images: vec![
            (1, turn, [0.0, 0.0, 4.0], 1, "front/00000.png", vec![]),
            (2, turn, [1.0, 0.0, 4.0], 1, "rig/00000.png", vec![]),
            (3, turn, [2.0, 0.0, 4.0], 1, "rig/00001.png", vec![]),
            (4, turn, [3.0, 0.0, 4.0], 1, "rig/00002.png", vec![]),
            (5, turn, [9.0, 0.0, 4.0], 1, "side.png", vec![]),
        ],
        points: vec![],
    };
    change(&mut model);
    write_cameras(folder, "sparse/0", &model);
    manifest().write(&folder.0).unwrap();
    for (index, camera) in ["front", "rig", "side"].iter().enumerate() {
        for frame in 0..3 {
            folder.write(&format!("images/{camera}/{frame:05}.png"), png(6, 4, (10 * index + frame) as u8));
            if *camera != "side" {
                let mask: Vec<u8> = (0..24).map(|i| if i == frame { 0 } else { 200 }).collect();
                folder.write(&format!("masks/{camera}/{frame:05}.png"), encode(&mask, 6, 4, ExtendedColorType::L8));
            }
            if *camera == "side" {
                let seen: Vec<u8> = (0..24).map(|i| if i % 6 < 4 { 255 } else { 0 }).collect();
                folder.write(&format!("covisible/side/{frame:05}.png"), encode(&seen, 6, 4, ExtendedColorType::L8));
            }
            if *camera == "rig" {
                let moves: Vec<u8> = (0..24).map(|i| if i > 20 { 255 } else { 0 }).collect();
                folder.write(&format!("foreground/rig/{frame:05}.png"), encode(&moves, 6, 4, ExtendedColorType::L8));
            }
        }
    }
}

#[test]
fn a_folder_arrives_with_its_moving_camera_masks_and_test_camera() {
    let folder = Folder::new("folder");
    write(&folder, |_| {});
    assert_eq!(Manifest::read(&folder.0).unwrap(), manifest());
    let capture = folder.open();
    assert_eq!((capture.fps, capture.n_frames, capture.reference_frame), (25.0, 3, 1));
    let names: Vec<_> = capture.cameras.iter().map(|camera| (camera.name.as_str(), camera.is_test)).collect();
    assert_eq!(names, [("front", false), ("rig", false), ("side", true)]);
    let x = |camera, frame| capture.view(camera, frame).unwrap().pose.translation.x;
    assert_eq!([x(0, 0), x(0, 2), x(1, 0), x(1, 1), x(1, 2), x(2, 1)], [0.0, 0.0, 1.0, 2.0, 3.0, 9.0]);
    let rig = capture.picture(1, 2).unwrap();
    assert_eq!(rig.pixels[1].to_le_bytes(), [13, 1, 7, 255]);
    assert_eq!(rig.pixels[2].to_le_bytes(), [14, 2, 7, 0]);
    assert!(capture.picture(2, 0).unwrap().pixels.iter().all(|pixel| pixel >> 24 == 255));
    let report = folder.check();
    assert_eq!((report.n_images, report.n_masks, report.n_foregrounds), (9, 6, 3));
    let moves = capture.foreground(1, 1).unwrap().unwrap();
    assert!(moves.iter().enumerate().all(|(i, moves)| *moves == (i > 20)) && moves.len() == 24);
    assert_eq!((capture.foreground(0, 1).unwrap(), capture.covisible(1, 1).unwrap()), (None, None));
    let seen = capture.covisible(2, 1).unwrap().unwrap();
    assert!(seen.iter().enumerate().all(|(i, seen)| *seen == (i % 6 < 4)) && seen.len() == 24);
}

#[test]
fn every_fault_of_a_folder_is_told() {
    let folder = Folder::new("folder-faults");
    let cases: [Case<Model>; 5] = [
        (|m| drop(m.images.remove(2)), "moves and has no pose at 1 frames, the first is 1"),
        (|m| m.images[2].4 = "rig/x.png", "one named `rig/x.png`"),
        (|m| m.images[4].4 = "rig/1.png", "has two poses at frame 1"),
        (|m| m.images[4].4 = "a/b/c.png", "is nested too deep"),
        (|m| m.images[4].4 = "other.png", "no camera is named `side`"),
    ];
    for (change, says) in cases {
        write(&folder, change);
        assert_told(&folder.check(), &[says]);
    }
    write(&folder, |_| {});
    assert_eq!(folder.check().n_faults, 0);
    std::fs::remove_file(folder.0.join("images/rig/00001.png")).unwrap();
    std::fs::remove_file(folder.0.join("masks/front/00002.png")).unwrap();
    std::fs::remove_file(folder.0.join("foreground/rig/00000.png")).unwrap();
    std::fs::remove_file(folder.0.join("covisible/side/00002.png")).unwrap();
    folder.write("images/side/00000.png", b"");
    folder.write("images/side/00001.png", b"text");
    folder.write("images/side/00002.png", png(4, 6, 0));
    let says = [
        "rig/00001.png: is missing",
        "front/00002.png: is missing",
        "foreground/rig/00000.png",
        "covisible/side/00002.png",
        "has 0 bytes",
        "is 4 x 6",
        "neither a PNG",
    ];
    assert_told(&folder.check(), &says);
    assert_eq!(folder.check().n_faults, 7);
}

#[test]
fn every_fault_of_the_manifest_is_told() {
    let folder = Folder::new("folder-manifest");
    write(&folder, |_| {});
    for (text, says) in [
        ("fps = 30.0", "missing field `frames`"),
        ("fps = 30.0\nframes = 3\nframe = 1", "capture.toml, line 3: unknown field `frame`"),
        ("fps = 30.0\nframes = -1", "line 2"),
        ("fps = 0.0\nframes = 3", "has 0 frames per second"),
        ("fps = nan\nframes = 3", "has NaN frames per second"),
        ("fps = 30.0\nframes = 0", "has 0 frames, 1 to"),
        ("fps = 30.0\nframes = 3\nreference_frame = 3", "is 3, the clip has 3 frames"),
        ("fps = 30.0\nframes = 3\nflow = true", "flow: is missing"),
        ("fps = 30.0\nframes = 3\ntest_cameras = ['../x']", "no camera is named `../x`"),
        ("fps = 30.0\nframes = 5", "front/00004.png: is missing"),
        ("fps = 30.0\nframes = 1000000", "has 3 files, the clip has"),
        ("fps = 30.0\nframes = 4294967295", "has 4294967295 frames, 1 to"),
        ("{", "capture.toml, line 1"),
        ("", "missing field"),
    ] {
        folder.write("capture.toml", text);
        assert_told(&folder.check(), &[says]);
    }
    folder.write("capture.toml", [0xff, 0xfe]);
    assert_told(&folder.check(), &["is not UTF-8"]);
    let nothing = Folder::new("folder-nothing");
    assert_told(&nothing.check(), &["not a recognised capture"]);
    assert!(Capture::open_with(&nothing.0.join("x"), &CaptureSettings::default()).is_err());
}
