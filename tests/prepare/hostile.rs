//! Names, files and calibrations that are not what they should be; programs that are not there.

use super::{done, rate, run, settings, video};
use crate::capture::{assert_told, png};
use crate::common::prelude::*;

/// caliscope's calibration of two cameras, the numbers of the first as they are given.
fn caliscope(folder: &Folder, matrix: &str, distortions: &str) {
    let camera = |id: u32, matrix: &str, distortions: &str| {
        format!(
            "[cameras.{id}]\nsize = [64, 48]\nmatrix = {matrix}\ndistortions = {distortions}\n\
             translation = [0.0, 0.0, {id}.5]\nrotation = [0.0, 0.0, 0.0]\n"
        )
    };
    let good = camera(1, "[[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]", "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    folder.write("source/camera_array.toml", camera(0, matrix, distortions) + &good);
    for id in 0..2 {
        folder.write(&format!("source/cam_{id}/0000.png"), png(64, 48, 0));
    }
}

#[test]
fn a_calibration_that_no_camera_has_is_refused_before_anything_is_written() {
    let folder = Folder::new("prepare-bounds");
    let matrix = |f: &str, c: &str| format!("[[{f}, 0.0, {c}], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]");
    for (matrix, distortions, says) in [
        (matrix("50.0", "31.0"), "[1e30, 0.0, 0.0, 0.0, 0.0]", "k1 = 1e30"),
        (matrix("50.0", "31.0"), "[0.0, 0.0, 1e37, 0.0, 0.0]", "p1 = 1e37"),
        (matrix("1e-320", "31.0"), "[0.1, 0.0, 0.0, 0.0, 0.0]", "fx = 1e-320"),
        (matrix("50.0", "-1e9"), "[0.0, 0.0, 0.0, 0.0, 0.0]", "cx = -999999999.5"),
    ] {
        caliscope(&folder, &matrix, distortions);
        let (prepared, _) = run(&settings(&folder)).unwrap();
        assert_told(&prepared.report, &["camera `cam_0`", says]);
        assert!(!folder.0.join("out").exists(), "{says}");
    }
    caliscope(&folder, &matrix("50.0", "31.0"), "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    done(&settings(&folder));
}

fn prepare_with(programs: &Path, folder: &Folder, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.arg("prepare").arg(folder.0.join("source")).arg("-o").arg(folder.0.join("out"));
    command.args(more).env("PATH", programs).output().unwrap()
}

#[test]
fn a_program_that_is_missing_is_told_before_anything_is_decoded() {
    let folder = Folder::new("prepare-without");
    let programs = folder.0.join("programs");
    std::fs::create_dir_all(&programs).unwrap();
    let matrix = "[[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]";
    caliscope(&folder, matrix, "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    let fails = |more: &[&str], says: [&str; 2]| {
        let output = prepare_with(&programs, &folder, more);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{told}");
        assert!(says.iter().all(|say| told.contains(say)) && told.lines().count() == 1, "{told}");
        assert!(!folder.0.join("out").exists(), "{told}");
    };
    fails(&[], ["needs the program colmap", "apt-get install colmap"]);
    for id in 0..2 {
        folder.write(&format!("source/cam_{id}.mp4"), b"no video");
    }
    fails(&[], ["needs the program ffmpeg", "apt-get install ffmpeg"]);
    (0..2).for_each(|id| std::fs::remove_file(folder.0.join(format!("source/cam_{id}.mp4"))).unwrap());
    // Flow is between two frames. Debian's own Python is asked wherever the path leads.
    (0..2).for_each(|id| {
        folder.write(&format!("source/cam_{id}/0001.png"), png(64, 48, 1));
    });
    let opencv = Command::new("/usr/bin/python3").args(["-c", "import cv2, numpy"]).output();
    if !opencv.is_ok_and(|output| output.status.success()) {
        fails(&["--triangulate", "none", "--flow", "dis"], ["OpenCV", "python3-opencv"]);
    }
    // What needs no program is done without.
    assert!(prepare_with(&programs, &folder, &["--triangulate", "none"]).status.success());
}

#[test]
fn a_colon_in_a_path_is_no_protocol() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-colon");
    let matrix = "[[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]";
    caliscope(&folder, matrix, "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    for id in 0..2 {
        std::fs::remove_dir_all(folder.0.join(format!("source/cam_{id}"))).unwrap();
        video(&folder.0.join(format!("source/cam_{id}.mp4")), 2);
    }
    for name in ["v:s", "-v", "http:"] {
        std::fs::rename(folder.0.join("source"), folder.0.join(name)).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
        let arguments = ["prepare", "--triangulate", "none", "-o", "out", "--force", "--", name];
        let output = command.args(arguments).current_dir(&folder.0).output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        std::fs::rename(folder.0.join(name), folder.0.join("source")).unwrap();
    }
}

#[test]
fn a_video_that_is_a_list_of_files_opens_none_of_them() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-playlist");
    let matrix = "[[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]";
    caliscope(&folder, matrix, "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    let secret = folder.0.join("source/secret.mp4");
    video(&secret, 2);
    video(&folder.0.join("source/cam_1.mp4"), 2);
    std::fs::remove_dir_all(folder.0.join("source/cam_0")).unwrap();
    std::fs::remove_dir_all(folder.0.join("source/cam_1")).unwrap();
    let settings = PrepareSettings { ..settings(&folder) };
    for list in
        ["ffconcat version 1.0\nfile secret.mp4\n", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nsecret.mp4\n"]
    {
        folder.write("source/cam_0.mp4", list);
        let (prepared, _) = run(&settings).unwrap();
        assert_told(&prepared.report, &["cam_0.mp4"]);
        assert!(!folder.0.join("out").exists(), "{list}");
    }
}

#[test]
fn a_rate_that_no_camera_has_is_refused() {
    let folder = Folder::new("prepare-rate");
    for fps in [1e300, 1e-300, 0.0, f64::NAN] {
        let error = run(&PrepareSettings { capture: rate(fps), ..settings(&folder) }).unwrap_err().to_string();
        assert!(error.contains("--fps") && error.contains("0.0001 to 100000"), "{error}");
    }
}

#[test]
fn one_training_camera_is_told_before_anything_is_written() {
    let folder = Folder::new("prepare-one");
    caliscope(&folder, "[[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]", "[-0.1, 0.02, 0.0, 0.0, 0.0]");
    let settings = PrepareSettings {
        triangulate: Some(Triangulate::Reference),
        capture: CaptureSettings { test_cameras: Some(vec!["cam_1".to_owned()]), ..rate(30.0) },
        ..settings(&folder)
    };
    let error = run(&settings).unwrap_err().to_string();
    assert!(error.contains("has one training camera") && !settings.output.exists(), "{error}");
}
