//! Calibrations of others: which row, section or matrix is which camera's, and where the file lies.

use super::sources::sequence;
use super::{done, rate, run, settings};
use crate::capture::assert_told;
use crate::common::npy_rows;
use crate::common::prelude::*;
use ivv::internals::prepare::recognise;

fn row(x: f64) -> Vec<f64> {
    let (down, right, back) = ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
    let (center, hwf) = ([x, 0.0, 0.0], [48.0, 64.0, 50.0]);
    let rows = (0..3).flat_map(|k| [down[k], right[k], back[k], center[k], hwf[k]]);
    rows.chain([1.0, 100.0]).collect()
}

fn xs(capture: &Capture) -> Vec<(String, f64)> {
    capture.cameras.iter().map(|camera| (camera.name.clone(), -camera.world_to_camera.translation.x)).collect()
}

#[test]
fn rows_of_poses_go_to_cameras_in_the_order_of_their_numbers() {
    let folder = Folder::new("prepare-numbers");
    let rows: Vec<f64> = (0..12).flat_map(|k| row(f64::from(k))).collect();
    folder.write("source/poses_bounds.npy", npy_rows(12, &rows));
    (0..12).for_each(|k| sequence(&folder, &format!("cam_{k}"), 1));
    let settings = PrepareSettings { capture: rate(30.0), ..settings(&folder) };
    let prepared = done(&settings);
    let capture = Capture::open(&settings.output).unwrap();
    for (name, x) in xs(&capture) {
        assert_eq!(name, format!("cam_{}", x as i32), "a camera has the row of another");
    }
    assert_eq!(prepared.notes.iter().filter(|note| note.contains("order of their numbers")).count(), 1);

    // Some cameras are absent, but not the last one: each has the row of its number.
    for k in [3, 10] {
        std::fs::remove_dir_all(folder.0.join(format!("source/cam_{k}"))).unwrap();
    }
    let some = PrepareSettings { output: folder.0.join("some"), ..settings.clone() };
    let prepared = done(&some);
    assert!(prepared.notes.iter().any(|note| note.contains("3, 10 are absent")), "{:?}", prepared.notes);
    for (name, x) in xs(&Capture::open(&some.output).unwrap()) {
        assert_eq!(name, format!("cam_{}", x as i32));
    }
    // Without the last nobody knows how they were counted.
    std::fs::remove_dir_all(folder.0.join("source/cam_11")).unwrap();
    let none = PrepareSettings { output: folder.0.join("none"), ..settings };
    assert_told(&run(&none).unwrap().0.report, &["describes 12 cameras, there are 9", "--exclude"]);
}

fn matrix(key: &str, rows: usize, numbers: &[f64]) -> String {
    let elements: Vec<String> = numbers.iter().map(f64::to_string).collect();
    let (first, rest) = elements.split_at(elements.len() / 2);
    let cols = numbers.len() / rows;
    let data = format!("[ {},\n       {} ]", first.join(", "), rest.join(", "));
    format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data}\n")
}

/// EasyMocap's files of two cameras; the second is turned by half a turn about y.
fn easymocap(folder: &Folder, sizes: &str, turn: [f64; 3]) {
    let names = "%YAML:1.0\n---\nnames:\n   - \"00\"\n   - \"01\"\n";
    let k = [50.0, 0.0, 31.5, 0.0, 51.0, 23.5, 0.0, 0.0, 1.0];
    let camera = |name: &str| {
        matrix(&format!("K_{name}"), 3, &k) + &matrix(&format!("dist_{name}"), 1, &[0.0; 5]) + &sizes.replace('@', name)
    };
    folder.write("source/intri.yml", names.to_owned() + &camera("00") + &camera("01"));
    let half = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
    let pose = [
        matrix("R_00", 3, &[0.0; 3]),
        matrix("T_00", 3, &[1.0, 2.0, 3.0]),
        matrix("R_01", 3, &turn),
        matrix("Rot_01", 3, &half),
        matrix("T_01", 3, &[0.0, 0.0, 4.0]),
    ];
    folder.write("source/extri.yml", names.to_owned() + &pose.concat());
}

#[test]
fn easymocap_arrives() {
    let folder = Folder::new("prepare-easymocap");
    easymocap(&folder, "", [0.0, std::f64::consts::PI, 0.0]);
    (0..2).for_each(|k| sequence(&folder, &format!("images/0{k}"), 2));
    let first = settings(&folder);
    assert_eq!(recognise(&first.source).unwrap().what, "an EasyMocap recording");
    let prepared = done(&first);
    assert_eq!((prepared.source_format, prepared.report.n_frames), ("EasyMocap", 2));
    assert!(!prepared.notes.iter().any(|note| note.contains("Rot")), "{:?}", prepared.notes);
    let capture = Capture::open(&first.output).unwrap();
    // The size is that of the pictures, since the file has none.
    let size = capture.cameras[0].intrinsics;
    assert_eq!((size.width, size.height, size.fx, size.fy, size.cx, size.cy), (64, 48, 50.0, 51.0, 32.0, 24.0));
    assert_eq!(capture.cameras[0].world_to_camera.translation.to_array(), [1.0, 2.0, 3.0]);
    let rows = capture.cameras[1].world_to_camera.rows();
    assert!((rows[0][0] + 1.0).abs() < 1e-9 && (rows[1][1] - 1.0).abs() < 1e-9 && rows[2][3] == 4.0, "{rows:?}");

    // The calibration may be of another size, and a rotation vector is not as good as the matrix.
    easymocap(&folder, "H_@: 96\nW_@: 128.\n", [0.0; 3]);
    let second = PrepareSettings { output: folder.0.join("out2"), ..first.clone() };
    let notes = done(&second).notes.join("\n");
    assert!(notes.contains("different rotations of 01") && notes.contains("it is scaled"), "{notes}");
    // A missing key is named.
    let text = std::fs::read_to_string(folder.0.join("source/extri.yml")).unwrap();
    folder.write("source/extri.yml", text.replace("T_01", "T_02"));
    let third = PrepareSettings { output: folder.0.join("out3"), ..first };
    assert_told(&run(&third).unwrap().0.report, &["camera `01`: has no T_01 of three numbers in extri.yml"]);
}

fn section(name: &str, x: f64) -> String {
    format!(
        "[{name}]\nname = '{name}'\nsize = [64, 48]\nmatrix = [[50.0, 0.0, 31.5], [0.0, 50.0, 23.5], [0.0, 0.0, 1.0]]\n\
         distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\nrotation = [0.0, 0.0, 0.0]\ntranslation = [{x}, 0.0, 3.0]\n"
    )
}

#[test]
fn a_calibration_beside_the_videos_is_read_whatever_its_name() {
    for name in ["calibration.toml", "session_3_camera_calibration.toml"] {
        let folder = Folder::new(&format!("prepare-{name}"));
        folder.write(
            &format!("source/{name}"),
            section("cam0", 0.0) + &section("cam1", 1.0) + "[metadata]\nerror = 0.1\n",
        );
        folder.write("source/Config.toml", "[project]\nframe_rate = 30\n");
        (0..2).for_each(|k| sequence(&folder, &format!("cam{k}"), 2));
        let settings = settings(&folder);
        assert_eq!(recognise(&settings.source).unwrap().what, "an anipose recording");
        let prepared = done(&settings);
        assert_eq!((prepared.source_format, prepared.report.n_cameras), ("anipose", 2));
        let capture = Capture::open(&settings.output).unwrap();
        assert_eq!(capture.cameras[1].world_to_camera.translation.x, 1.0);
    }
}

#[test]
fn a_trial_has_the_calibration_one_folder_up() {
    let folder = Folder::new("prepare-trials");
    folder.write("source/calibration/Calib.toml", section("cam0", 0.0) + &section("cam1", 1.0));
    for trial in ["Trial_1", "Trial_2"] {
        (0..2).for_each(|k| sequence(&folder, &format!("{trial}/videos/cam{k}"), 2));
    }
    let root = settings(&folder);
    let first = root.source.join("Trial_1");
    let known = recognise(&root.source).unwrap();
    assert_eq!((known.what.as_str(), &known.source), ("a Pose2Sim project of 2 trials", &first));
    let (prepared, _) = run(&root).unwrap();
    let command = format!("`ivv prepare {} -o CAPTURE`", first.display());
    assert_told(&prepared.report, &["holds 2 trials and no footage of its own: Trial_1, Trial_2", &command]);

    assert_eq!(recognise(&first).unwrap().what, "a Pose2Sim recording");
    let prepared = done(&PrepareSettings { source: first, ..root.clone() });
    assert!(prepared.notes.iter().any(|note| note.contains("the folder above")), "{:?}", prepared.notes);
    // Whose videos have other names has nothing of it.
    let other = folder.0.join("source/other");
    (0..2).for_each(|k| sequence(&folder, &format!("other/videos/left{k}"), 2));
    assert_eq!(recognise(&other), None);
}
