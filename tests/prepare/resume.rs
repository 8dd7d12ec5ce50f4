//! A second run does nothing, a killed one is gone on with, and nothing is overwritten.

use super::{done, every, rate, run, settings};
use crate::capture::{assert_told, dynamic, png};
use crate::common::prelude::*;
use ivv::internals::prepare::{ImageFormat, Share, Stage, prepare_share};
use std::time::SystemTime;

fn tree(path: &Path) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
    let mut found = BTreeMap::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            if entry.path().is_dir() {
                folders.push(entry.path());
            } else {
                let changed = entry.metadata().unwrap().modified().unwrap();
                found.insert(entry.path(), (std::fs::read(entry.path()).unwrap(), changed));
            }
        }
    }
    found
}

fn capture(test: &str) -> (Folder, PrepareSettings) {
    let folder = Folder::new(test);
    dynamic::write_below(&folder, "source/", 3);
    // Half the size: every image is made here.
    let settings = PrepareSettings { scale: 0.5, ..settings(&folder) };
    (folder, settings)
}

#[test]
fn a_second_run_does_nothing() {
    let (folder, settings) = capture("prepare-again");
    let first = done(&settings);
    assert_eq!((first.report.n_cameras, first.report.n_test_cameras, first.report.n_images), (3, 1, 9));
    let before = tree(&folder.0.join("out"));
    assert!(before.len() >= 9 + 3 + 2);
    done(&settings);
    assert_eq!(tree(&folder.0.join("out")), before);
}

#[test]
fn a_killed_run_goes_on_where_it_stopped() {
    let (folder, settings) = capture("prepare-killed");
    done(&settings);
    let out = folder.0.join("out");
    let whole = tree(&out);
    // As a run that was killed while it wrote the third image of a camera.
    for name in ["capture.toml", "sparse/0/points3D.txt", "images/1/00002.png", "images/2/00000.png"] {
        std::fs::remove_file(out.join(name)).unwrap();
    }
    std::fs::write(out.join("images/1/.00002.png.77-0.tmp"), b"half").unwrap();
    // Until then it is no capture, though COLMAP's files are there.
    let says =
        ["is a capture that `ivv prepare` has not finished; run the same `ivv prepare` command again to continue it"];
    assert_told(&check_capture(&out, &CaptureSettings::default()), &says);
    let of_half = PrepareSettings { source: out.clone(), output: folder.0.join("of half"), ..settings.clone() };
    assert_told(&run(&of_half).unwrap().0.report, &says);
    done(&settings);
    let again = tree(&out);
    let bytes = |tree: &BTreeMap<PathBuf, (Vec<u8>, SystemTime)>| {
        tree.iter().map(|(path, (bytes, _))| (path.clone(), bytes.clone())).collect::<BTreeMap<_, _>>()
    };
    assert_eq!(bytes(&again), bytes(&whole));
    let image = out.join("images/0/00001.png");
    assert_eq!(again[&image], whole[&image], "an image that was there is not made again");
}

#[test]
fn shares_that_are_made_at_one_time_come_to_the_same_capture() {
    let (folder, settings) = capture("prepare-shares");
    done(&settings);
    let bytes = |path: &Path| -> BTreeMap<PathBuf, Vec<u8>> {
        let files = tree(path).into_iter().filter(|(file, _)| !file.ends_with("prepare.json"));
        files.map(|(file, (bytes, _))| (file.strip_prefix(path).unwrap().to_owned(), bytes)).collect()
    };
    let whole = bytes(&settings.output);
    let shared = PrepareSettings { output: folder.0.join("shared"), ..settings.clone() };
    let share = |stage: Stage, part: u32| prepare_share(&shared, stage, Share { part, of: 3 }, &|_| {});
    // What follows the images waits for them.
    let early = share(Stage::Points, 0).unwrap_err().to_string();
    assert!(early.contains("--only images first"), "{early}");
    // As on three machines that begin together.
    let together = |stage: Stage| {
        std::thread::scope(|scope| {
            let parts: Vec<_> = (0..3).map(|part| scope.spawn(move || share(stage, part))).collect();
            parts.into_iter().for_each(|part| part.join().unwrap().unwrap());
        });
    };
    share(Stage::Images, 1).unwrap();
    let n_images = |path: &Path| bytes(&path.join("images")).len();
    assert_eq!(n_images(&shared.output), n_images(&settings.output) / 3);
    together(Stage::Images);
    assert_eq!(bytes(&shared.output.join("images")), bytes(&settings.output.join("images")));
    together(Stage::Points);
    assert!(!shared.output.join("capture.toml").exists());
    done(&shared);
    assert_eq!(bytes(&shared.output), whole);
    // Other settings are no share of this.
    let other = PrepareSettings { scale: 0.25, ..shared.clone() };
    let told = prepare_share(&other, Stage::Images, Share::ALL, &|_| {}).unwrap_err().to_string();
    assert!(told.contains("scale was 0.5"), "{told}");
}

#[test]
fn other_settings_and_foreign_files_need_force() {
    let (folder, settings) = capture("prepare-force");
    done(&settings);
    let out = folder.0.join("out");
    let before = tree(&out);
    let other = PrepareSettings { scale: 1.0, ..settings.clone() };
    let error = run(&other).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    let told = error.to_string();
    assert!(told.contains("scale was 0.5 and is 1.0") && told.contains("--force"), "{told}");
    assert_eq!(tree(&out), before, "a refusal changes nothing");
    let forced = done(&PrepareSettings { force: true, ..other.clone() });
    assert_eq!(forced.report.n_images, 9);
    assert_eq!(image::image_dimensions(out.join("images/0/00000.png")).unwrap(), (6, 4));
    // Fewer test cameras change the points, not the pictures.
    let images = tree(&out.join("images"));
    let fewer = PrepareSettings {
        capture: CaptureSettings { test_cameras: Some(vec!["2".to_owned()]), ..rate(30.0) },
        ..other
    };
    assert!(run(&fewer).unwrap_err().to_string().contains("cameras have changed"));
    let (prepared, _) = run(&PrepareSettings { force: true, ..fewer }).unwrap();
    assert_eq!((prepared.report.n_faults, prepared.report.n_test_cameras), (0, 1));
    assert_eq!(tree(&out.join("images")), images);

    let foreign = Folder::new("prepare-foreign");
    foreign.write("out/notes.txt", "mine");
    foreign.write("out/images/a.png", "mine too");
    let into = PrepareSettings { output: foreign.0.join("out"), ..settings.clone() };
    let told = run(&into).unwrap_err().to_string();
    assert!(told.contains("is not empty and was not made by `ivv prepare`"), "{told}");
    run(&PrepareSettings { force: true, ..into }).unwrap();
    assert_eq!(std::fs::read(foreign.0.join("out/notes.txt")).unwrap(), b"mine");
    assert!(!foreign.0.join("out/images/a.png").exists());

    for output in [folder.0.clone(), folder.0.join("source")] {
        let told = run(&PrepareSettings { output, ..settings.clone() }).unwrap_err().to_string();
        assert!(told.contains("is the source or holds it"), "{told}");
    }
    for (change, says) in [
        (PrepareSettings { scale: 1.5, ..settings.clone() }, "--scale"),
        (PrepareSettings { frames: every(0, 0), ..settings.clone() }, "--frames"),
        (PrepareSettings { capture: rate(f64::NAN), ..settings.clone() }, "--fps"),
    ] {
        let error = run(&change).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains(says), "{error}");
    }
    let jpeg = PrepareSettings { format: ImageFormat::Jpeg, force: true, ..settings };
    done(&jpeg);
    assert!(out.join("images/0/00000.jpg").is_file() && !out.join("images/0/00000.png").exists());
}

/// With `force`, the folders of the output are removed before they are made: nothing that is read may lie there, however it is named.
#[test]
fn what_is_read_is_never_in_the_output() {
    let (folder, settings) = capture("prepare-inside");
    done(&settings);
    let out = folder.0.join("out");
    folder.write("out/photos/a.png", png(6, 4, 0));
    std::os::unix::fs::symlink(&out, folder.0.join("link")).unwrap();
    let before = tree(&out);
    let forced = PrepareSettings { force: true, ..settings };
    let photos = |path: PathBuf| PrepareSettings { photos: Some(path), ..forced.clone() };
    let footage = |path: PathBuf| PrepareSettings { footage: Some(path), ..forced.clone() };
    let images = CaptureSettings { images: out.join("images"), ..forced.capture.clone() };
    for (change, option) in [
        (photos(out.join("photos")), "--static"),
        (photos(folder.0.join("source/../out/photos")), "--static"),
        (footage(folder.0.join("link/images")), "--footage"),
        // As that of a plain COLMAP project: from the source on.
        (footage("../out/images".into()), "--footage"),
        (PrepareSettings { capture: images, ..forced.clone() }, "--images"),
    ] {
        let told = run(&change).unwrap_err().to_string();
        assert!(told.contains(&format!("is the folder of {option} or holds it")), "{told}");
        assert_eq!(tree(&out), before, "a refusal changes nothing");
    }
}
