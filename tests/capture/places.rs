//! Where images are: names of other machines, folders beside, endings and cases that differ, and what is said of those that are
//! nowhere.

use super::model::{Model, STEMS, sample, text, write, write_text, write_to};
use super::transforms::document;
use super::{Folder, assert_told, png, told};
use crate::common::prelude::*;
use ivv::internals::scene::capture::Report;
use serde_json::json;

fn noted(report: &Report, says: &str) {
    let n = report.notes.iter().filter(|note| note.contains(says)).count();
    assert_eq!(n, 1, "no note, or several, say {says:?}: {:?}", report.notes);
}

/// A `transforms.json` whose names are made of `0000.png` and so on.
fn named(n: usize, name: impl Fn(&str) -> String) -> Value {
    let mut document = document(n);
    for (index, frame) in document["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
        frame["file_path"] = json!(name(&format!("{index:04}.png")));
    }
    document
}

fn images(folder: &Folder, at: &str, n: usize) {
    (0..n).for_each(|i| drop(folder.write(&format!("{at}{i:04}.png"), png(6, 4, i as u8))));
}

#[test]
fn names_of_other_machines_are_found_below_the_capture() {
    for (case, spell, at, says) in [
        ("backslash", "images\\", "images/", "names with backslashes, as Windows writes them: 3"),
        ("absolute", "/home/me/data/images/", "images/", "images that are not where transforms.json says"),
        ("drive", "C:\\me\\images\\", "images/", "images that are not where transforms.json says"),
        ("parent", "../../data/me/images/", "images/", "images that are not where transforms.json says"),
        ("up", "../images/", "images/", "names that lead out of the capture: 3"),
        ("beside", "images/", "", "3; taken from 0000.png"),
        ("other", "images/", "rgb/train/", "3; taken from rgb/train/0000.png"),
        ("deeper", "data/phone/images/", "images/", "3; taken from images/0000.png"),
        ("case", "images/", "Images/", "in upper and lower case: 3; Images/0000.png is taken for images/0000.png"),
    ] {
        let folder = Folder::new(&format!("places-{case}"));
        folder.write("transforms.json", named(3, |name| format!("{spell}{name}")).to_string());
        images(&folder, at, 3);
        // Pictures that are none of photographs.
        images(&folder, "masks/", 3);
        let report = folder.check();
        assert_eq!((told(&report).as_str(), report.n_images), ("", 3), "{case}: {:?}", report.notes);
        noted(&report, says);
        let capture = folder.open();
        for (index, camera) in capture.cameras.iter().enumerate() {
            assert_eq!(camera.shots[0].image, folder.0.join(format!("{at}{index:04}.png")), "{case}");
            assert!((camera.world_to_camera.center().x - index as f64).abs() < 1e-12, "{case}");
        }
    }
}

#[test]
fn a_file_outside_of_the_capture_is_never_taken() {
    let folder = Folder::new("places-outside");
    images(&folder, "secret/", 3);
    let inside = Folder(folder.0.join("capture"));
    for spell in ["../secret/", "/etc/../", &format!("{}/secret/", folder.0.display())] {
        inside.write("transforms.json", named(3, |name| format!("{spell}{name}")).to_string());
        let report = inside.check();
        assert_eq!(report.n_faults, 1, "{spell}: {}", told(&report));
        assert_told(&report, &["none of the 3 images that it names is there", "found no picture in the capture"]);
    }
}

#[test]
fn where_several_folders_fit_none_is_taken_and_the_option_chooses() {
    let folder = Folder::new("places-several");
    folder.write("transforms.json", named(3, |name| format!("images/{name}")).to_string());
    images(&folder, "left/", 3);
    images(&folder, "right/", 3);
    let report = folder.check();
    assert_told(
        &report,
        &["images of these names lie in left and in right: choose one, as with `ivv check ", "--images left`"],
    );
    let settings = CaptureSettings { images: "right".into(), ..CaptureSettings::default() };
    let capture = Capture::open_with(&folder.0, &settings).unwrap();
    assert!(capture.cameras.iter().all(|camera| camera.shots[0].image.starts_with(folder.0.join("right"))));
    // Two cameras' images never become one file.
    folder.write("transforms.json", named(2, |name| format!("cam{name}/0000.png")).to_string());
    assert!(folder.check().n_faults > 0);
}

#[test]
fn some_that_are_missing_are_counted_and_all_are_one_fault() {
    let folder = Folder::new("places-some");
    folder.write("transforms.json", document(5).to_string());
    images(&folder, "images/", 3);
    // Of the same names, but of another size: the two that are missing are not among these.
    (0..5).for_each(|i| drop(folder.write(&format!("images_2/{i:04}.png"), png(3, 2, i as u8))));
    let report = folder.check();
    assert_eq!((report.n_faults, report.grouped().len()), (2, 1));
    assert_told(
        &report,
        &["images/0003.png: is missing", "leave out those that are missing with --skip-missing: 2 of 5"],
    );
    let skip = CaptureSettings { skip_missing: true, ..CaptureSettings::default() };
    let report = check_capture(&folder.0, &skip);
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    noted(&report, "2 images are missing and left out");
    fs::remove_dir_all(folder.0.join("images")).unwrap();
    fs::remove_dir_all(folder.0.join("images_2")).unwrap();
    folder.write("pictures/other.jpg", png(6, 4, 0));
    for settings in [CaptureSettings::default(), skip] {
        let report = check_capture(&folder.0, &settings);
        assert_eq!(report.n_faults, 1, "{}", told(&report));
        assert_told(&report, &["looked for images/0000.png, found pictures of other names, as pictures/other.jpg"]);
    }
}

#[test]
fn endings_and_cases_may_differ_and_cameras_are_not_mixed_up() {
    let folder = Folder::new("places-endings");
    let mut model = sample();
    for (image, name) in model.images.iter_mut().zip(["rig\\B.JPG", "rig\\A.JPG", "rig\\C.JPG"]) {
        image.4 = name;
    }
    write(&folder, &model);
    for name in ["a", "b", "c"] {
        folder.write(&format!("images_2/rig/{name}.png"), png(3, 2, 0));
    }
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_images), ("", 3));
    noted(&report, "names with backslashes, as Windows writes them: 3");
    noted(&report, "images with another ending than images.bin says: 3; images_2/rig/");
    noted(&report, "there is no folder images: images_2 is taken");
    let capture = folder.open();
    let names: Vec<&str> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["rig_A", "rig_B", "rig_C"]);
    assert!(capture.cameras[0].shots[0].image.ends_with("rig/a.png"));
    // A camera whose folder is gone does not get the pictures of another.
    let mut model = sample();
    for (image, name) in model.images.iter_mut().zip(["one/0.png", "two/0.png", "two/1.png"]) {
        image.4 = name;
    }
    let folder = Folder::new("places-cameras");
    write(&folder, &model);
    folder.write("images/one/0.png", png(6, 4, 0));
    let report = folder.check();
    assert_eq!(report.n_faults, 2, "{}", told(&report));
    assert_told(&report, &["two/0.png: is missing", "two/1.png: is missing"]);
}

#[test]
fn captures_below_a_folder_are_read_or_named() {
    let folder = Folder::new("places-below");
    let inside = Folder(folder.0.join("data/scene"));
    super::transforms::write(&inside, 3, &document(3));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.format.as_str()), ("", 3, "transforms.json"));
    noted(&report, "data/scene is read, the only capture in ");
    assert_eq!((&report.path, &folder.open().path), (&inside.0, &inside.0));
    // Beside videos it may be no more than a part of a recording.
    folder.write("videos/a.mp4", b"");
    let refused = |says: &str| {
        let report = folder.check();
        assert_told(&report, &["not a recognised capture; name the capture in it that is meant"]);
        assert!(report.notes.iter().any(|note| note.ends_with(says)), "{:?}", report.notes);
    };
    refused("data/scene`");
    fs::remove_dir_all(folder.0.join("videos")).unwrap();
    let other = Folder(folder.0.join("other"));
    super::transforms::write(&other, 3, &document(3));
    refused("data/scene`");
    refused("other`");
}

#[test]
fn images_may_lie_beside_the_folder_in_which_colmap_worked() {
    let folder = Folder::new("places-colmap");
    super::model::write_images(&folder);
    write_to(&folder, "colmap/sparse/0", &sample());
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.n_points), ("", 3, 2));
    assert!(folder.open().cameras[0].shots[0].image.starts_with(folder.0.join("images")));
    // Its points may have been kept as a PLY alone, and a program of Windows may have marked its texts.
    fs::remove_dir_all(folder.0.join("colmap/sparse/0")).unwrap();
    for (stem, text) in STEMS.iter().zip(text(&sample())).take(2) {
        folder.write(&format!("colmap/sparse/0/{stem}.txt"), format!("\u{feff}{text}"));
    }
    let header =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    folder.write("colmap/sparse/0/points3D.ply", format!("{header}1 2 3\n"));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.n_points), ("", 3, 1));
}

#[test]
fn an_undistorted_copy_inside_is_read_where_the_images_are_gone() {
    let folder = Folder::new("places-workspace");
    let radial = |id| (id, 2, "SIMPLE_RADIAL", 6, 4, vec![5.0, 3.0, 2.0, 0.1]);
    write(&folder, &Model { cameras: vec![radial(3), radial(9)], ..sample() });
    let dense = Folder(folder.0.join("dense/0"));
    write_text(&dense, "sparse", &sample());
    super::model::write_images(&dense);
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras), ("", 3));
    noted(&report, "none of the images that sparse/0/images.bin names is there; dense/0/sparse/images.txt");
    assert!(folder.open().cameras[0].shots[0].image.starts_with(&dense.0));
}
