//! Plain COLMAP projects.

use super::model::{Model, STEMS, binary, sample, sample_project, text, write, write_images, write_text};
use super::{Case, Folder, assert_told, told};
use crate::common::prelude::*;
use crate::common::program;

#[test]
fn every_number_of_a_binary_model_arrives() {
    let folder = sample_project("colmap");
    let capture = folder.open();
    assert_eq!((capture.n_frames, capture.reference_frame), (1, 0));
    let names: Vec<_> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c d"]);
    assert_eq!(capture.test_frames(), [(0, 0)]);
    assert_eq!(capture.training_frames(), [(1, 0), (2, 0)]);
    let a = capture.view(0, 0).unwrap();
    assert_eq!((a.name.as_str(), a.intrinsics.width, a.intrinsics.height, a.time, a.flow_dt), ("a", 6, 4, 0.0, 1.0));
    assert_eq!([a.intrinsics.fx, a.intrinsics.fy, a.intrinsics.cx, a.intrinsics.cy], [4.75, 4.75, 3.0, 1.875]);
    // A rotation about x whose half angle has cosine 0.6 and sine 0.8.
    let expected = [[1.0, 0.0, 0.0, 1.0], [0.0, -0.28, -0.96, 2.0], [0.0, 0.96, -0.28, 3.0], [0.0, 0.0, 0.0, 1.0]];
    for (row, expected) in a.pose.rows().iter().zip(expected) {
        row.iter().zip(expected).for_each(|(v, e)| assert!((v - e).abs() < 1e-12, "{:?}", a.pose));
    }
    let b = capture.view(1, 0).unwrap();
    assert_eq!([b.intrinsics.fx, b.intrinsics.fy, b.intrinsics.cx, b.intrinsics.cy], [5.5, 5.25, 3.125, 2.0]);
    assert_eq!(
        capture.points,
        [
            Point { position: [0.125, -2.0, 3.0], color: [255, 0, 17] },
            Point { position: [1e-3, 1e3, -0.1], color: [1, 2, 3] }
        ]
    );
    assert!(capture.view(3, 0).is_err() && capture.view(0, 1).is_err() && capture.picture(0, 1).is_err());
}

#[test]
fn text_and_binary_models_are_equal_in_every_place_a_model_may_stand() {
    let folder = sample_project("colmap-text");
    let expected = folder.open();
    assert_eq!(expected.cameras.len(), 3);
    std::fs::remove_dir_all(folder.0.join("sparse/0")).unwrap();
    for place in [".", "sparse", "sparse/0"] {
        write_text(&folder, place, &sample());
        assert_eq!(folder.open(), expected, "{place}");
    }
}

#[test]
fn points_are_optional_and_test_views_are_a_setting() {
    let folder = sample_project("colmap-settings");
    std::fs::remove_file(folder.0.join("sparse/0/points3D.bin")).unwrap();
    assert!(folder.open().points.is_empty());
    let open = |settings| Capture::open_with(&folder.0, &settings);
    let every = open(CaptureSettings { test_every: 2, ..Default::default() }).unwrap();
    assert_eq!(every.test_frames(), [(0, 0), (2, 0)]);
    assert!(open(CaptureSettings { test_every: 0, ..Default::default() }).unwrap().test_frames().is_empty());
    let chosen = Some(vec!["b".to_owned()]);
    let chosen = open(CaptureSettings { test_cameras: chosen, ..Default::default() }).unwrap();
    assert_eq!(chosen.test_frames(), [(1, 0)]);
    let unknown = CaptureSettings { test_cameras: Some(vec!["z".to_owned()]), ..Default::default() };
    assert_told(&check_capture(&folder.0, &unknown), &["no camera is named `z`"]);
}

#[test]
fn every_fault_of_the_values_is_told_in_both_formats() {
    let folder = Folder::new("colmap-faults");
    write_images(&folder);
    let cases: [Case<Model>; 19] = [
        (
            |m| (m.cameras[0].3, m.cameras[0].4, m.cameras[0].5) = (65_536, 65_536, vec![5e4; 4]),
            "has 65536 x 65536 pixels, at most 268435456",
        ),
        (|m| m.cameras[1].0 = 3, "has the id of an earlier camera"),
        (|m| m.cameras[0].3 = 0, "has 0 x 4 pixels"),
        (|m| m.cameras[0].4 = 65_537, "has 6 x 65537 pixels"),
        (|m| m.cameras[0].3 = 1 << 40, "pixels, 1 to 65536"),
        (|m| m.cameras[0].5[0] = 0.0, "has fx = 0.0 pixels"),
        (|m| m.cameras[0].5[1] = f64::NAN, "has fy = NaN pixels"),
        (|m| m.cameras[0].5[3] = f64::INFINITY, "has cy = inf pixels"),
        (|m| m.cameras[1] = (9, 4, "OPENCV", 6, 4, vec![1.0; 8]), "`ivv prepare "),
        (|m| m.images[2].0 = 10, "has the id of an earlier image"),
        (|m| m.images[0].1 = [0.0; 4], "has a quaternion of length 0"),
        (|m| m.images[0].1[1] = f64::NAN, "a number is not finite"),
        (|m| m.images[0].2[1] = f64::NEG_INFINITY, "a number is not finite"),
        (|m| m.images[0].2[1] = 1e300, "too large"),
        (|m| m.images[0].3 = 4, "was taken by camera 4, which is not in the list"),
        (|m| m.images[2].4 = "b.png", "has the name of an earlier image"),
        (|m| m.images[2].4 = "b.jpg", "has the name of an earlier one"),
        (|m| m.points[1].0 = 7, "has the id of an earlier point"),
        (|m| m.points[1].1[2] = f64::NAN, "not finite or beyond"),
    ];
    for (change, says) in cases {
        let mut model = sample();
        change(&mut model);
        let _ = std::fs::remove_dir_all(folder.0.join("sparse"));
        write(&folder, &model);
        let report = folder.check();
        assert_told(&report, &[says]);
        assert_eq!(report.format, "COLMAP");
        assert!(Capture::open(&folder.0).unwrap_err().exit_code() == 3);
        std::fs::remove_dir_all(folder.0.join("sparse/0")).unwrap();
        write_text(&folder, "sparse/0", &model);
        assert_told(&folder.check(), &[says]);
    }
}

#[test]
fn a_name_leads_nowhere_but_below_the_capture() {
    let folder = Folder::new("colmap-names");
    write_images(&folder);
    for (name, says) in [
        ("a\u{1}.png", "a control character"),
        (".", "is empty"),
        ("", "is empty"),
        ("/etc/passwd", "images/etc/passwd.png: is missing"),
        ("../../secret.png", "images/secret.png: is missing"),
    ] {
        let mut model = sample();
        model.images[1].4 = name;
        write(&folder, &model);
        assert_told(&folder.check(), &[says]);
    }
    for name in ["../a.png", "x/../../a.png", "/home/me/a.png", "C:\\me\\a.png", "..\\a.png", "C:a.png"] {
        let mut model = sample();
        model.images[1].4 = name;
        write(&folder, &model);
        let report = folder.check();
        assert_eq!(told(&report), "", "{name}");
        assert!(!report.notes.is_empty(), "{name}");
        assert!(folder.open().cameras.iter().any(|camera| camera.shots[0].image == folder.0.join("images/a.png")));
    }
}

#[test]
fn all_faults_of_a_capture_come_in_one_report() {
    let folder = Folder::new("colmap-all");
    let mut model = sample();
    model.points[0].1[0] = f64::NAN;
    model.images[0].1 = [0.0; 4];
    write(&folder, &model);
    folder.write("images/a.png", b"");
    folder.write("images/c d.png", super::png(4, 6, 0));
    let report = folder.check();
    assert_told(&report, &["quaternion of length 0", "not finite", "a.png: has 0 bytes", "is 4 x 6, its camera is"]);
    assert_eq!(report.n_faults, 4);
    let first = Capture::open(&folder.0).unwrap_err().to_string();
    assert!(first.contains("(3 more: `ivv check") && first.contains("quaternion of length 0"), "{first}");
}

#[test]
fn binary_models_cut_anywhere_or_with_wrong_counts_are_told() {
    let folder = Folder::new("colmap-cut");
    write_images(&folder);
    let files = binary(&sample());
    for (stem, bytes) in STEMS.iter().zip(&files) {
        write(&folder, &sample());
        let name = format!("sparse/0/{stem}.bin");
        assert!(bytes.len() > 100 && folder.check().n_faults == 0);
        for n in 0..bytes.len() {
            folder.write(&name, &bytes[..n]);
            assert_told(&folder.check(), &[&format!("{stem}.bin")]);
        }
        for count in [0_u64, 1, 4, 1000, 1 << 32, u64::MAX / 64, u64::MAX] {
            let mut wrong = bytes.clone();
            wrong[..8].copy_from_slice(&count.to_le_bytes());
            folder.write(&name, wrong);
            assert_told(&folder.check(), &[&format!("{stem}.bin")]);
        }
        folder.write(&name, [bytes.as_slice(), &[0]].concat());
        assert_told(&folder.check(), &["1 bytes follow the last record"]);
    }
}

#[test]
fn no_changed_byte_of_a_model_is_worse_than_a_fault() {
    let folder = Folder::new("colmap-bytes");
    write_images(&folder);
    let mut n_faulty = 0;
    for (stem, bytes) in STEMS.iter().zip(binary(&sample())) {
        write(&folder, &sample());
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0xff;
            folder.write(&format!("sparse/0/{stem}.bin"), changed);
            let report = folder.check();
            told(&report);
            n_faulty += usize::from(report.n_faults > 0);
        }
    }
    assert!(n_faulty > 100, "{n_faulty}");
}

#[test]
fn damaged_text_models_are_told_with_their_line() {
    let folder = Folder::new("colmap-lines");
    write_images(&folder);
    let files = text(&sample());
    for (file, from, to, says) in [
        (0, "3 PINHOLE 6", "3 PINHOLE six", "cameras.txt, line 2: the width is `six`"),
        (0, " 2\n", "\n", "ends before the parameter"),
        (0, "PINHOLE 6", "HOLE 6", "the model `HOLE` is unknown"),
        (0, " 2\n", " 2 9\n", "has 1 parameters more"),
        (1, "\n1.5 2.25 -1", "\n1.5 2.25", "images.txt, line 2: the line of its observations has 5 fields"),
        (1, "10 1 0", "x 1 0", "the id of the image is `x`"),
        (1, " 3 b.png", "", "ends before the id of the camera"),
        (2, "255 0 17", "256 0 17", "points3D.txt, line 3: the colour is `256`"),
        (2, "10 1 12 1 10 0", "10 1 12 1 10", "ends before the observation"),
        (2, "10 1 12", "10 1 y", "the track has the image `y`"),
    ] {
        for (index, (stem, text)) in STEMS.iter().zip(&files).enumerate() {
            assert!(index != file || text.contains(from), "{from:?} is not in {text}");
            let text = if index == file { text.replacen(from, to, 1) } else { text.clone() };
            folder.write(&format!("sparse/0/{stem}.txt"), text);
        }
        assert_told(&folder.check(), &[says]);
    }
    folder.write("sparse/0/images.txt", [0xff, 0xfe, b'\n']);
    assert_told(&folder.check(), &["images.txt"]);
    std::fs::remove_file(folder.0.join("sparse/0/images.txt")).unwrap();
    assert_told(&folder.check(), &["images.txt: cannot be read"]);
}

#[test]
fn check_prints_every_fault_and_exits_with_3() {
    let folder = sample_project("colmap-verb");
    let check = |json: bool| {
        let mut command = program::command(&["check", program::text(&folder.0)]);
        let output = command.args(json.then_some("--json")).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let (code, text) = check(false);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("cameras: 3, of which 1 for testing") && text.contains("points:  2"), "{text}");
    folder.write("images/a.png", b"");
    folder.write("images/b.png", b"GIF89a");
    let (code, text) = check(false);
    assert_eq!(code, 3, "{text}");
    assert_eq!(text.lines().filter(|line| line.starts_with("fault:")).count(), 2, "{text}");
    let (code, json) = check(true);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((code, json["n_faults"].as_u64(), json["n_cameras"].as_u64()), (3, Some(2), Some(3)));
    assert!(json["faults"][0]["file"].as_str().unwrap().ends_with("a.png"));
}
