//! COLMAP projects as people have them: several models, odd names, poses in other conventions, masks beside the images.

use super::model::{Model, STEMS, binary, sample, sample_project, text, write, write_images, write_text, write_to};
use super::{Folder, assert_told, encode, png, told};
use crate::common::prelude::*;
use crate::common::program;
use ivv::internals::scene::capture::Report;

/// The sample with its last image alone.
fn small() -> Model {
    let mut model = sample();
    model.images.drain(..2);
    model.points.clear();
    model
}

fn noted(report: &Report, says: &str) {
    assert!(report.notes.iter().any(|note| note.contains(says)), "no note says {says:?}: {:?}", report.notes);
}

#[test]
fn the_largest_of_several_models_is_read_or_the_one_that_is_asked_for() {
    let folder = Folder::new("models");
    write_images(&folder);
    write_to(&folder, "sparse/0", &small());
    write_to(&folder, "sparse/1", &sample());
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    noted(&report, "sparse has 2 models: 0 with 1 images, 1 with 3 images; taken: 1");
    // As text, too.
    fs::remove_dir_all(folder.0.join("sparse/0")).unwrap();
    write_text(&folder, "sparse/0", &small());
    noted(&folder.check(), "taken: 1");
    let asked = |model| CaptureSettings { model: Some(model), test_every: 0, ..CaptureSettings::default() };
    let report = check_capture(&folder.0, &asked(0));
    assert_eq!(report.n_cameras, 1);
    noted(&report, "pictures in images without a camera: 2 of 3, as ");
    assert_told(
        &check_capture(&folder.0, &asked(7)),
        &["there is no model 7 in sparse; choose one of: 0 with 1 images"],
    );
    // A run reads the same again.
    let capture = Capture::open_with(&folder.0, &asked(0)).unwrap();
    let kept = serde_json::to_string(capture.settings()).unwrap();
    assert_eq!(serde_json::from_str::<CaptureSettings>(&kept).unwrap(), asked(0));
    // The first may not be there at all.
    fs::remove_dir_all(folder.0.join("sparse/0")).unwrap();
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    // What is named in the project stands for it.
    for named in ["sparse", "sparse/1", "sparse/1/images.bin"] {
        let report = check_capture(&folder.0.join(named), &CaptureSettings::default());
        assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3), "{named}");
    }
    folder.write("capture.toml", "fps = 30.0\nframes = 1\n");
    assert_told(&check_capture(&folder.0, &asked(1)), &["--model: is for a plain COLMAP project"]);
}

#[test]
fn preparing_reads_the_model_that_is_asked_for_and_leaves_out_cameras() {
    let folder = Folder::new("models-prepare");
    write_images(&folder);
    write_to(&folder, "sparse/0", &small());
    write_to(&folder, "sparse/1", &sample());
    let (path, out) = (program::text(&folder.0), folder.0.join("out"));
    for (options, n) in [(&["--model", "0"][..], 1), (&["--exclude", "a,b"][..], 1), (&[], 3)] {
        let prepare = ["prepare", path, "-o", program::text(&out), "--triangulate", "none", "--force"];
        works(&[&prepare[..], &["--test-every", "0"], options].concat());
        assert_eq!(check_capture(&out, &CaptureSettings::default()).n_cameras, n, "{options:?}");
    }
    let output = program::ivv(&["check", path, "--exclude", "z"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stdout).contains("--exclude: no camera is named `z`"), "{output:?}");
}

#[test]
fn names_of_several_words_keep_every_image_with_or_without_blank_lines() {
    let folder = Folder::new("words");
    let mut model = sample();
    // Twelve fields, which are three times four, as those of four observations are.
    for (image, name) in model.images.iter_mut().zip(["my b 1.png", "my a 1.png", "my c d.png"]) {
        image.4 = name;
        image.5.clear();
        folder.write(&format!("images/{name}"), png(6, 4, 0));
    }
    let with_images = |images: &str| {
        let [cameras, _, points] = text(&model);
        for (stem, text) in STEMS.iter().zip([&cameras, images, &points]) {
            folder.write(&format!("sparse/0/{stem}.txt"), text);
        }
    };
    let [_, images, _] = text(&model);
    with_images(&images);
    let expected = folder.open();
    assert_eq!(expected.cameras.len(), 3);
    let lines: Vec<&str> = images.lines().filter(|line| !line.is_empty()).collect();
    with_images(&lines.join("\n"));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    noted(&report, "images without a line of observations behind them, not even a blank one: 2");
    assert_eq!(folder.open().cameras, expected.cameras);
}

#[test]
fn names_that_are_not_utf8_are_those_of_files() {
    let folder = Folder::new("encodings");
    write_images(&folder);
    // `照.png` in GBK, `Ä.png` in Windows' western code page.
    for (bytes, name) in [(&b"\xd5\xd5.png"[..], "照.png"), (&b"\xc4.png"[..], "Ä.png")] {
        for is_text in [false, true] {
            let _ = fs::remove_dir_all(folder.0.join("sparse"));
            let mut model = sample();
            model.images[1].4 = "@@@@";
            let replace = |file: &[u8]| {
                let at = file.windows(4).position(|window| window == b"@@@@").unwrap();
                [&file[..at], bytes, &file[at + 4..]].concat()
            };
            let files = if is_text { text(&model).map(String::into_bytes) } else { binary(&model) };
            for (index, (stem, file)) in STEMS.iter().zip(&files).enumerate() {
                let file = if index == 1 { replace(file) } else { file.clone() };
                folder.write(&format!("sparse/0/{stem}.{}", if is_text { "txt" } else { "bin" }), file);
            }
            let report = folder.check();
            assert_eq!(report.n_faults, 1, "{}", told(&report));
            noted(&report, "names that are not UTF-8: 1; no file has one of their readings");
            let image = folder.write(&format!("images/{name}"), png(6, 4, 0));
            let report = folder.check();
            assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
            noted(&report, "names that are not UTF-8: 1; they are those of files that are there");
            assert!(folder.open().cameras.iter().any(|camera| camera.shots[0].image == image));
            fs::remove_file(image).unwrap();
        }
    }
}

#[test]
fn quaternions_are_normalised_and_tracks_of_absent_images_are_counted() {
    let folder = Folder::new("lengths");
    write_images(&folder);
    write(&folder, &sample());
    let expected = folder.open();
    let mut model = sample();
    for image in &mut model.images {
        image.1 = image.1.map(|v| v * 1.01);
    }
    model.points[1].4.push((77, 0));
    write(&folder, &model);
    let report = folder.check();
    assert_eq!(told(&report), "");
    noted(&report, "quaternions that are not of length 1: 3 (up to 1.0100); they are normalised");
    noted(&report, "points seen in images that the model does not have: 1");
    let capture = folder.open();
    assert_eq!(capture.points, expected.points);
    for (a, b) in capture.cameras.iter().zip(&expected.cameras) {
        let [a, b] = [a, b].map(|camera| camera.world_to_camera.rows());
        assert!(a.as_flattened().iter().zip(b.as_flattened()).all(|(v, w)| (v - w).abs() < 1e-12), "{a:?} {b:?}");
    }
    // Without the images nothing is known of the tracks: one fault.
    fs::remove_file(folder.0.join("sparse/0/images.bin")).unwrap();
    let report = folder.check();
    assert_eq!(report.n_faults, 1, "{}", told(&report));
    assert_told(&report, &["images.bin: cannot be read"]);
}

/// What the cameras of [`ring`] look at.
const MIDDLE: DVec3 = DVec3::new(3.0, -2.0, 5.0);

/// Eight cameras around a place, which look at it, and points near it that all of them saw.
fn ring() -> Model {
    let mut images = Vec::new();
    let names = ["0.png", "1.png", "2.png", "3.png", "4.png", "5.png", "6.png", "7.png"];
    for (index, name) in names.into_iter().enumerate() {
        // About y, and a little about x, so that no quaternion is its own other reading.
        let (half, tilt) = (0.3 + std::f64::consts::PI * index as f64 / 8.0, 0.2_f64);
        let (w, y) = (half.cos(), half.sin());
        let quaternion = [w * tilt.cos(), w * tilt.sin(), y * tilt.cos(), y * tilt.sin()];
        let turn = Pose::of_quaternion(quaternion, DVec3::ZERO);
        let translation = DVec3::new(0.1, -0.2, 4.0) - turn.to_camera(MIDDLE);
        images.push((index as u32 + 1, quaternion, translation.to_array(), 1, name, vec![]));
    }
    let points = (0..20).map(|index| {
        let at = |k: u32| f64::from((index * k) % 7) * 0.1 - 0.3;
        let place = MIDDLE + DVec3::new(at(1), at(3), at(5));
        (u64::from(index), place.to_array(), [9; 3], 0.5, (1..9).map(|id| (id, 0)).collect())
    });
    Model { cameras: vec![(1, 1, "PINHOLE", 6, 4, vec![5.0, 5.0, 3.0, 2.0])], images, points: points.collect() }
}

#[test]
fn poses_of_another_convention_are_told_by_the_points_before_them() {
    let folder = Folder::new("facing");
    let model = ring();
    model.images.iter().for_each(|image| drop(folder.write(&format!("images/{}", image.4), png(6, 4, 0))));
    write(&folder, &model);
    let capture = folder.open();
    type Change = fn(&mut Model, &Capture);
    let cases: [(Change, &str, &str); 3] = [
        (
            |model, _| model.images.iter_mut().for_each(|image| image.1.rotate_left(1)),
            "the poses fit with quaternions x y z w",
            "write quaternions as w x y z",
        ),
        (
            |model, capture| {
                for (image, camera) in model.images.iter_mut().zip(&capture.cameras) {
                    image.2 = camera.world_to_camera.center().to_array();
                }
            },
            "the poses fit with centres of cameras in place of TX TY TZ",
            "in place of the centre C",
        ),
        (
            |model, capture| {
                for (image, camera) in model.images.iter_mut().zip(&capture.cameras) {
                    image.2 = camera.world_to_camera.center().to_array();
                    image.1[1..].iter_mut().for_each(|v| *v = -*v);
                }
            },
            "the poses fit from camera to world",
            "invert the poses",
        ),
    ];
    for (change, reason, remedy) in cases {
        let mut model = ring();
        change(&mut model, &capture);
        write(&folder, &model);
        let report = folder.check();
        assert_eq!(report.n_faults, 1, "{}", told(&report));
        assert_told(&report, &[reason, remedy]);
    }
    // Points that no convention explains are told, and no fault: the cameras may be right.
    let mut model = ring();
    model.points.iter_mut().for_each(|point| point.1[1] += 1000.0);
    write(&folder, &model);
    let report = folder.check();
    assert_eq!(told(&report), "");
    noted(&report, "poses or points may be wrong");
}

#[test]
fn lenses_of_colmap_4_are_read_and_panoramas_are_told() {
    let folder = Folder::new("colmap-4");
    write_images(&folder);
    for (number, name, parameters, says) in [
        (12, "SIMPLE_DIVISION", vec![5.0, 3.0, 2.0, -0.1], "the lens distorts (DIVISION)"),
        (13, "DIVISION", vec![5.0, 5.5, 3.0, 2.0, 0.1], "the lens distorts (DIVISION)"),
        (14, "SIMPLE_FISHEYE", vec![5.0, 3.0, 2.0], "the lens distorts (OPENCV_FISHEYE)"),
        (15, "FISHEYE", vec![5.0, 5.5, 3.0, 2.0], "the lens distorts (OPENCV_FISHEYE)"),
        (16, "EUCM", vec![5.0, 5.5, 3.0, 2.0, 0.5, 1.1], "the lens distorts (EUCM)"),
        (7, "FOV", vec![5.0, 5.5, 3.0, 2.0, 0.9], "the lens distorts (FOV)"),
        (
            17,
            "EQUIRECTANGULAR",
            vec![6.0, 4.0],
            "is a panorama (EQUIRECTANGULAR), which is not read; cut it into views",
        ),
    ] {
        let model =
            Model { cameras: vec![(3, number, name, 6, 4, parameters), sample().cameras[1].clone()], ..sample() };
        write(&folder, &model);
        assert_told(&folder.check(), &[says]);
        fs::remove_dir_all(folder.0.join("sparse")).unwrap();
        write_text(&folder, "sparse/0", &model);
        assert_told(&folder.check(), &[says]);
        fs::remove_dir_all(folder.0.join("sparse")).unwrap();
    }
}

#[test]
fn lenses_that_distort_are_one_fault_behind_those_of_images() {
    let folder = Folder::new("lenses");
    write_images(&folder);
    let radial = |id, f: f64| (id, 2, "SIMPLE_RADIAL", 6, 4, vec![f, 3.0, 2.0, 0.1]);
    write(&folder, &Model { cameras: vec![radial(3, 5.0), radial(9, 6.0)], ..sample() });
    fs::remove_file(folder.0.join("images/b.png")).unwrap();
    let report = folder.check();
    assert_eq!(report.n_faults, 2, "{}", told(&report));
    let [first, last] = report.faults.as_slice() else { panic!() };
    assert!(first.reason.contains("is missing") && first.remedy.contains("--skip-missing: 1 of 3"), "{first}");
    assert!(
        last.reason.contains("2 lenses distort (SIMPLE_RADIAL)") && last.remedy.contains("takes seconds"),
        "{last}"
    );
}

#[test]
fn masks_beside_the_images_are_used() {
    let folder = sample_project("masks-beside");
    let mask = |black: usize| {
        let pixels: Vec<u8> = (0..24).map(|i| if i < black { 0 } else { 255 }).collect();
        encode(&pixels, 6, 4, ExtendedColorType::L8)
    };
    folder.write("masks/a.png.png", mask(5));
    folder.write("masks/b.png", mask(24 - 7));
    folder.write("masks/c d.png", png(3, 2, 0));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_masks), ("", 2));
    noted(&report, "images that have a mask in masks: 2 of 3; what is black there is left out");
    noted(&report, "masks in masks that are not of the size of their images: 1");
    let capture = folder.open();
    let visible: Vec<u32> = (0..3).map(|camera| capture.picture(camera, 0).unwrap().n_visible).collect();
    assert_eq!(visible, [19, 7, 24]);
}
