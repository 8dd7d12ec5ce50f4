//! `transforms.json` as different programs write it.

use super::transforms::{document, write};
use super::{Folder, assert_told, png, told};
use crate::common::prelude::*;
use ivv::internals::scene::capture::Report;
use serde_json::json;

fn noted(report: &Report, says: &str) {
    assert!(report.notes.iter().any(|note| note.contains(says)), "no note says {says:?}: {:?}", report.notes);
}

fn numbers(capture: &Capture) -> Vec<f64> {
    let of = |camera: &ivv::internals::scene::capture::Camera| {
        let lens = camera.intrinsics;
        [vec![lens.fx, lens.fy, lens.cx, lens.cy], camera.world_to_camera.rows().concat()].concat()
    };
    capture.cameras.iter().flat_map(of).collect()
}

fn assert_same(capture: &Capture, expected: &[f64], what: &str) {
    let found = numbers(capture);
    assert_eq!(found.len(), expected.len(), "{what}");
    assert!(found.iter().zip(expected).all(|(v, w)| (v - w).abs() < 1e-9), "{what}: {found:?} {expected:?}");
}

fn frames(document: &mut Value) -> &mut Vec<Value> {
    document["frames"].as_array_mut().unwrap()
}

#[test]
fn the_same_cameras_are_read_from_every_dialect() {
    let folder = Folder::new("dialects");
    write(&folder, 3, &document(3));
    let expected = numbers(&folder.open());
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 6] = [
        ("a matrix K in each frame", |d| {
            for frame in frames(d) {
                frame["K"] = json!([[5.0, 0, 3.25], [0, 5.5, 2.0], [0, 0, 1]]);
            }
            ["fl_x", "fl_y", "cx", "cy"].iter().for_each(|key| drop(d.as_object_mut().unwrap().remove(*key)));
        }),
        ("one flat matrix of the file", |d| {
            ["fl_x", "fl_y", "cx", "cy"].iter().for_each(|key| drop(d.as_object_mut().unwrap().remove(*key)));
            d["K"] = json!([5.0, 0, 3.25, 0, 5.5, 2.0, 0, 0, 1]);
        }),
        ("a list of frames with `transform`", |d| {
            let keys = ["w", "h", "fl_x", "fl_y", "cx", "cy"].map(|key| (key, d[key].clone()));
            for frame in frames(d) {
                keys.iter().for_each(|(key, value)| frame[*key] = value.clone());
                let rows = frame.as_object_mut().unwrap().remove("transform_matrix").unwrap();
                frame["transform"] = json!(rows.as_array().unwrap()[..3]);
            }
            *d = d["frames"].clone();
        }),
        ("matrices times a number", |d| {
            for frame in frames(d) {
                for value in
                    frame["transform_matrix"].as_array_mut().unwrap().iter_mut().flat_map(|r| r.as_array_mut().unwrap())
                {
                    *value = json!(value.as_f64().unwrap() * 2.5);
                }
            }
        }),
        ("rotations times a number", |d| {
            for frame in frames(d) {
                for row in &mut frame["transform_matrix"].as_array_mut().unwrap()[..3] {
                    row.as_array_mut().unwrap()[..3].iter_mut().for_each(|v| *v = json!(v.as_f64().unwrap() * 0.3));
                }
            }
        }),
        ("a last row but for rounding, as one list", |d| {
            for frame in frames(d) {
                let rows = frame["transform_matrix"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .flat_map(|row| row.as_array().unwrap().clone());
                let mut flat: Vec<Value> = rows.collect();
                flat[12] = json!(3e-9);
                frame["transform_matrix"] = json!(flat);
            }
        }),
    ];
    for (what, change) in cases {
        let mut changed = document(3);
        change(&mut changed);
        folder.write("transforms.json", changed.to_string());
        let report = folder.check();
        assert_eq!(told(&report), "", "{what}");
        assert_same(&folder.open(), &expected, what);
        if what.contains("times a number") {
            noted(&report, "frames whose rotation is times a number");
        }
    }
    let mut changed = document(3);
    changed["K"] = json!([[5.0, 0.5, 3.0], [0, 5.5, 2.0], [0, 0, 1]]);
    folder.write("transforms.json", changed.to_string());
    assert_told(&folder.check(), &["which is no pinhole without skew"]);
}

#[test]
fn keys_that_may_be_meant_and_numbers_that_differ_are_told() {
    let folder = Folder::new("dialects-keys");
    let mut changed = document(3);
    changed["c1_x"] = json!(9.0);
    changed["frames"][1]["fl_x"] = json!(7.0);
    changed["aabb_scale"] = json!(16);
    write(&folder, 3, &changed);
    let report = folder.check();
    assert_eq!(told(&report), "");
    noted(&report, "`c1_x` is not read: `cx` may be meant");
    noted(&report, "fl_x stand in the file and, with other values, in its frames: those of the frames are taken");
    assert!(!report.notes.iter().any(|note| note.contains("aabb")), "{:?}", report.notes);
    assert_eq!(folder.open().cameras[1].intrinsics.fx, 7.0);
}

#[test]
fn a_file_stands_for_its_folder() {
    let folder = Folder::new("dialects-file");
    write(&folder, 3, &document(3));
    folder.write("scene_b.json", document(2).to_string());
    for (name, n) in [("transforms.json", 3), ("scene_b.json", 2), ("", 3)] {
        let path = if name.is_empty() { folder.0.clone() } else { folder.0.join(name) };
        let report = check_capture(&path, &CaptureSettings::default());
        assert_eq!((told(&report).as_str(), report.n_cameras), ("", n), "{name}");
        assert_eq!(Capture::open(&path).unwrap().path, path);
    }
    let report = check_capture(&folder.write("notes.txt", "none"), &CaptureSettings::default());
    assert_told(&report, &["is a file of no capture"]);
    assert_told(&check_capture(&folder.0.join("nothing"), &CaptureSettings::default()), &["no such folder"]);
}

#[test]
fn points_depths_and_masks_that_are_named_are_read() {
    let folder = Folder::new("dialects-points");
    let mut changed = document(2);
    changed["ply_file_path"] = json!("sparse_pc.ply");
    changed["applied_transform"] = json!([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]]);
    for (index, frame) in frames(&mut changed).iter_mut().enumerate() {
        frame["mask_path"] = json!(format!("masks\\{index:04}.png"));
        frame["depth_file_path"] = json!(format!("depths/{index:04}.png"));
    }
    write(&folder, 2, &changed);
    let report = folder.check();
    assert_eq!(told(&report), "");
    noted(&report, "mask files that are not there: 2 of 2; they are not used");
    noted(&report, "depth files that are not there: 2 of 2; they are not used");
    noted(&report, "the points of `sparse_pc.ply` are not there");
    noted(&report, "there are no points");
    let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    folder.write("sparse_pc.ply", format!("{header}{colors}0.5 1 -2 255 0 7\n1 2 3 4 5 6\n"));
    (0..2).for_each(|i| drop(folder.write(&format!("masks/{i:04}.png"), png(6, 4, 1))));
    let grey = super::encode(&[9; 24], 6, 4, image::ExtendedColorType::L8);
    (0..2).for_each(|i| drop(folder.write(&format!("depths/{i:04}.png"), &grey)));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_points, report.n_masks, report.n_depths), ("", 2, 2, 2));
    // Those of a telephone are smaller than its pictures.
    folder.write("depths/0001.png", super::encode(&[9; 6], 3, 2, image::ExtendedColorType::L8));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_depths), ("", 1));
    noted(&report, "depth files that cannot be read, or are not of the size of their images: 1 of 2");
    // The points are in the world of the frames as they stand.
    let points = folder.open().points;
    assert_eq!((points[0].position, points[0].color), ([0.5, 1.0, -2.0], [255, 0, 7]));
    folder.write("sparse_pc.ply", format!("{header}{colors}0.5 nan -2 255 0 7\n1 2 3 4 5 6\n"));
    assert_told(&folder.check(), &["element `vertex`, row 0"]);
}

#[test]
fn a_world_that_mirrors_is_turned_around_and_one_camera_is_a_fault() {
    let folder = Folder::new("dialects-mirrored");
    let mirror = |frame: &mut Value| {
        for value in frame["transform_matrix"][0].as_array_mut().unwrap() {
            *value = json!(-value.as_f64().unwrap());
        }
    };
    let mut all = document(3);
    write(&folder, 3, &all);
    let expected = numbers(&folder.open());
    frames(&mut all).iter_mut().for_each(mirror);
    folder.write("transforms.json", all.to_string());
    let report = folder.check();
    assert_eq!(told(&report), "");
    noted(&report, "all 3 poses mirror, as in a left-handed world");
    assert_same(&folder.open(), &expected, "mirrored");
    let mut one = document(3);
    mirror(&mut one["frames"][1]);
    folder.write("transforms.json", one.to_string());
    let report = folder.check();
    assert_told(&report, &["mirrors", "from camera to world, the camera's axes x right, y up, z back"]);
    assert_eq!(report.n_faults, 1);
}

/// Training and test views of two files: so many of the first, and of these the test views, in a folder of their own.
fn split(folder: &Folder, n: usize, tests: std::ops::Range<usize>, at: &str) {
    let mut train = document(n);
    write(folder, n, &train);
    fs::rename(folder.0.join("transforms.json"), folder.0.join("transforms_train.json")).unwrap();
    let mut kept = Vec::new();
    for index in tests {
        let mut frame = frames(&mut train)[index].clone();
        frame["file_path"] = json!(format!("{at}/{index:04}.png"));
        folder.write(&format!("{at}/{index:04}.png"), png(6, 4, index as u8));
        kept.push(frame);
    }
    train["frames"] = json!(kept);
    folder.write("transforms_test.json", train.to_string());
}

#[test]
fn a_test_view_that_is_a_training_view_is_not_trained_on() {
    let folder = Folder::new("dialects-split");
    // Some of them, in another folder or the same.
    for at in ["test", "images"] {
        split(&folder, 8, 5..8, at);
        let report = folder.check();
        assert_eq!((told(&report).as_str(), report.n_cameras, report.n_test_cameras), ("", 8, 3), "{at}");
        noted(&report, "3 of 3 test views are training views: they are left out of training");
    }
    // All of them: the training keeps its views, and others are held out.
    split(&folder, 8, 0..8, "test");
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.n_test_cameras), ("", 8, 1));
    noted(&report, "8 of 8 test views are training views: they are left out of the test views");
    // Another picture from the same place is no training view.
    split(&folder, 8, 5..8, "test");
    (5..8).for_each(|index| drop(folder.write(&format!("test/{index:04}.png"), png(6, 4, 100))));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.n_test_cameras), ("", 11, 3));
    assert!(!report.notes.iter().any(|note| note.contains("training views")), "{:?}", report.notes);
    // What is not read of a split is told.
    folder.write("transforms_val.json", "{}");
    noted(&folder.check(), "transforms_val.json is not read");
}

#[test]
fn a_frame_that_is_listed_again_as_it_was_is_read_once() {
    let folder = Folder::new("dialects-twice");
    let mut changed = document(3);
    let again = changed["frames"][1].clone();
    frames(&mut changed).push(again);
    write(&folder, 3, &changed);
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    noted(&report, "frames that are listed twice: 1; they are read once");
}
