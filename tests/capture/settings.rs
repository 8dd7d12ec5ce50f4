//! How a capture is read: folders of smaller images, sizes, alpha, and what a report says of many faults of one kind.

use super::model::{sample, sample_project, write};
use super::{Folder, assert_told, encode, png, told};
use crate::common::prelude::*;
use crate::common::program;
use ivv::internals::scene::capture::Alpha;

/// A project whose images are in `folders`, of 6 x 4 pixels divided by a number.
fn project(folder: &Folder, folders: &[(&str, u32)]) {
    write(folder, &sample());
    for (name, by) in folders {
        for (index, image) in ["a.png", "b.png", "c d.png"].iter().enumerate() {
            folder.write(&format!("{name}/{image}"), png(6 / by, 4 / by, index as u8));
        }
    }
}

fn ivv(arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = program::ivv(arguments);
    (status.code(), String::from_utf8(stdout).unwrap() + &String::from_utf8(stderr).unwrap())
}

#[test]
fn folders_of_smaller_images_are_found_and_chosen() {
    let folder = Folder::new("downscale");
    project(&folder, &[("images_4", 2), ("images_2", 2)]);
    let check = |settings: &CaptureSettings| check_capture(&folder.0, settings);
    let report = check(&CaptureSettings::default());
    assert_eq!(told(&report), "");
    assert_eq!(report.notes[0], "there is no folder images: images_2 is taken");
    assert!(report.notes[1].contains("1/2 of the calibration's size in all cameras"), "{:?}", report.notes);
    assert_eq!(report.notes.len(), 2);
    let capture = folder.open();
    let camera = &capture.cameras[1];
    assert_eq!((camera.intrinsics.width, camera.intrinsics.fx, camera.intrinsics.cx), (3, 2.75, 1.5625));
    assert!(camera.shots[0].image.starts_with(folder.0.join("images_2")));

    let four = CaptureSettings { downscale: Some(4), ..CaptureSettings::default() };
    let image = |settings| Capture::open_with(&folder.0, settings).unwrap().cameras[0].shots[0].image.clone();
    assert_eq!(image(&four), folder.0.join("images_4/a.png"));
    let eight = CaptureSettings { downscale: Some(8), ..CaptureSettings::default() };
    assert_told(&check(&eight), &["images_8: is missing"]);
    assert_eq!(check(&eight).n_faults, 1);
    // With all of them, the one of full size.
    project(&folder, &[("images", 1)]);
    assert_eq!(image(&CaptureSettings::default()), folder.0.join("images/a.png"));
    assert!(check(&CaptureSettings::default()).notes.is_empty());
    // Only such a project has them.
    folder.write("capture.toml", "fps = 30.0\nframes = 1\n");
    assert_told(&check(&four), &["--downscale: is for a plain COLMAP project"]);
}

#[test]
fn one_image_of_another_size_is_a_fault_and_so_is_another_shape() {
    let folder = Folder::new("factor");
    project(&folder, &[("images", 2)]);
    folder.write("images/b.png", png(6, 4, 1));
    assert_told(&folder.check(), &["a.png: is 3 x 2, its camera is calibrated for 6 x 4"]);
    for (image, size) in [("a.png", (4, 6)), ("b.png", (4, 6)), ("c d.png", (4, 6))] {
        folder.write(&format!("images/{image}"), png(size.0, size.1, 1));
    }
    let report = folder.check();
    assert_told(&report, &["b.png: is 4 x 6"]);
    assert_eq!(report.n_faults, 3);
}

#[test]
fn faults_of_one_kind_are_told_together_and_nothing_is_counted_that_could_not_be_read() {
    let folder = Folder::new("grouped");
    project(&folder, &[("images", 1)]);
    // Faults that differ in their numbers alone.
    folder.write("images/b.png", png(5, 4, 0));
    folder.write("images/c d.png", png(7, 4, 0));
    folder.write("images/a.png", png(8, 4, 0));
    let report = folder.check();
    assert_eq!((report.n_faults, report.grouped().len()), (3, 1));
    let path = folder.0.to_str().unwrap();
    let (code, told) = ivv(&["check", path]);
    assert_eq!(code, Some(3));
    assert_eq!(told.lines().filter(|line| line.starts_with("fault:")).count(), 1, "{told}");
    assert!(
        told.contains("3 times, as: is 8 x 4, its camera is") && told.contains("b.png, ") && told.contains("c d.png"),
        "{told}"
    );
    let nothing = Folder::new("grouped-nothing");
    let (code, told) = ivv(&["check", nothing.0.to_str().unwrap()]);
    assert!(code == Some(3) && told.contains("fault:") && !told.contains("cameras: 0"), "{told}");
}

#[test]
fn alpha_is_told_and_is_a_foreground_mask_where_that_is_asked_for() {
    let folder = sample_project("alpha");
    // The left half of `a` is opaque, of which one pixel less than half.
    let alpha = |i: usize| {
        if i == 1 {
            100
        } else if i % 6 < 3 {
            255
        } else {
            0
        }
    };
    let rgba: Vec<u8> = (0..24).flat_map(|i| [200, 10, 20, alpha(i)]).collect();
    folder.write("images/a.png", encode(&rgba, 6, 4, ExtendedColorType::Rgba8));
    let report = folder.check();
    assert_eq!((report.n_alphas, report.n_foregrounds), (1, 0));
    assert!(report.notes[0].contains("images with an alpha channel: 1") && report.notes[0].contains("--alpha mask"));
    let as_mask = CaptureSettings { alpha: Alpha::Mask, ..CaptureSettings::default() };
    let report = check_capture(&folder.0, &as_mask);
    assert_eq!((report.n_alphas, report.n_foregrounds), (1, 1));
    assert!(report.notes[0].contains("foreground mask"), "{:?}", report.notes);
    let (plain, masked) = (folder.open(), Capture::open_with(&folder.0, &as_mask).unwrap());
    assert_eq!(plain.foreground(0, 0).unwrap(), None);
    let moves = masked.foreground(0, 0).unwrap().unwrap();
    assert!(moves.iter().enumerate().all(|(i, moves)| *moves == (alpha(i) >= 128)), "{moves:?}");
    assert_eq!(masked.foreground(1, 0).unwrap(), None);
    // The picture itself is the same.
    assert_eq!(plain.picture(0, 0).unwrap(), masked.picture(0, 0).unwrap());
}
