//! Every source arrives, and everything that is wrong with it is told.

use super::{done, every, open, rate, run, settings};
use crate::capture::model::{Model, binary, write_cameras};
use crate::capture::{assert_told, dynamic, encode, png};
use crate::common::npy_rows;
use crate::common::prelude::*;
use serde_json::json;

pub(super) const IDENTITY: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// `n` images of 64 x 48 in `source/<name>/`.
pub(super) fn sequence(folder: &Folder, name: &str, n: u32) {
    for frame in 0..n {
        folder.write(&format!("source/{name}/{frame:04}.png"), png(64, 48, (10 * frame) as u8));
    }
}

fn close(found: &[[f64; 4]; 4], expected: [[f64; 4]; 3]) {
    for (found, expected) in found.iter().zip(&expected) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} is not {expected:?}");
    }
}

#[test]
fn n3v_arrives() {
    let folder = Folder::new("prepare-n3v");
    // A camera at (1, 2, 3) that looks along +x of a world with z up: right is -y, down is -z; and one that stands elsewhere.
    let row = |center: [f64; 3]| {
        let (down, right, back) = ([0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]);
        let hwf = [96.0, 128.0, 100.0];
        let mut row: Vec<f64> = (0..3).flat_map(|k| [down[k], right[k], back[k], center[k], hwf[k]]).collect();
        row.extend([1.0, 100.0]);
        row
    };
    let rows = [row([1.0, 2.0, 3.0]), row([0.0; 3])].concat();
    folder.write("source/poses_bounds.npy", npy_rows(2, &rows));
    sequence(&folder, "cam00", 5);
    sequence(&folder, "cam07/images", 4);
    // What macOS leaves on foreign drives is neither a picture nor a video.
    ["cam00/._0000.png", "._cam00.mp4"]
        .iter()
        .for_each(|name| drop(folder.write(&format!("source/{name}"), "Mac OS X")));
    let settings = PrepareSettings {
        frames: every(2, 1),
        capture: CaptureSettings { test_cameras: Some(vec!["cam07".into()]), ..rate(30.0) },
        ..settings(&folder)
    };
    let prepared = done(&settings);
    assert_eq!(prepared.source_format, "N3V");
    let notes = prepared.notes.join("\n");
    assert!(notes.contains("different numbers of frames, 4 (`cam07`) to 5 (`cam00`)"), "{notes}");
    assert!(
        notes.contains("all 2 cameras: the pictures are 64 x 48") && notes.matches("it is scaled").count() == 1,
        "{notes}"
    );
    let capture = Capture::open(&settings.output).unwrap();
    // Frames 1 and 3 of the four that both have.
    assert_eq!((capture.n_frames, capture.fps), (2, 15.0));
    let [first, second] = capture.cameras.as_slice() else { panic!() };
    assert_eq!(
        (first.name.as_str(), first.is_test, second.name.as_str(), second.is_test),
        ("cam00", false, "cam07", true)
    );
    // The poses are for pictures of twice the size.
    assert_eq!(
        (first.intrinsics.fx, first.intrinsics.cx, first.intrinsics.cy, first.intrinsics.width),
        (50.0, 32.0, 24.0, 64)
    );
    close(&first.world_to_camera.rows(), [[0.0, -1.0, 0.0, 2.0], [0.0, 0.0, -1.0, 3.0], [1.0, 0.0, 0.0, -1.0]]);
    assert_eq!(capture.picture(0, 1).unwrap().pixels[0].to_le_bytes(), [30, 0, 7, 255]);

    folder.write("source/poses_bounds.npy", npy_rows(3, &[rows, row([0.0; 3])].concat()));
    let (prepared, _) = run(&settings).unwrap();
    assert_told(&prepared.report, &["describes 3 cameras, there are 2: cam00, cam07"]);
    folder.write("source/poses_bounds.npy", b"no array");
    assert_told(&run(&settings).unwrap().0.report, &["is no .npy array"]);
}

#[test]
fn google_immersive_arrives() {
    let folder = Folder::new("prepare-immersive");
    let model = |name: &str, x: f64| {
        json!({ "name": name, "width": 64.0, "height": 48.0, "focal_length": 30.0, "principal_point": [31.0, 24.5],
            "radial_distortion": [0.05, -0.01, 0.0], "projection_type": "fisheye", "pixel_aspect_ratio": 1.0,
            "position": [x, 0.0, 0.0], "orientation": [0.0, 0.0, std::f64::consts::FRAC_PI_2] })
    };
    let mut models = json!([model("camera_0001", 0.0), model("camera_0002", 2.0)]);
    folder.write("source/models.json", models.to_string());
    (1..=2).for_each(|k| sequence(&folder, &format!("camera_000{k}"), 2));
    let settings = settings(&folder);
    let capture = open(&settings);
    let second = &capture.cameras[1];
    // World to camera turns x to y; its centre is (2, 0, 0).
    close(&second.world_to_camera.rows(), [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, -2.0], [0.0, 0.0, 1.0, 0.0]]);
    assert!(
        second.intrinsics.fx == 30.0 && second.intrinsics.width > 64 && second.intrinsics.width <= 128,
        "{second:?}"
    );
    assert_eq!(capture.n_frames, 2);
    models[1]["projection_type"] = json!("equirect");
    models[0]["name"] = json!("../camera_0001");
    folder.write("source/models.json", models.to_string());
    assert_told(&run(&settings).unwrap().0.report, &["projection type `equirect`", "`..`, which leads out"]);
}

#[test]
fn pose2sim_arrives_from_both_of_its_calibrations() {
    let folder = Folder::new("prepare-pose2sim");
    // Sides and coefficients as Qualisys writes them; the picture is 4 columns narrower than its calibration.
    let camera = |serial: &str, x: f64| {
        format!(
            r#"<camera serial="{serial}" viewrotation="0"><fov_video left="0" top="0" right="67" bottom="47"/>
            <transform x="{x}" y="0" z="1500" r11="0" r12="1" r13="0" r21="0" r22="0" r23="1" r31="1" r32="0" r33="0"/>
            <intrinsic focalLengthU="3200" focalLengthV="3264" centerPointU="2048" centerPointV="1536" skew="0"
            radialDistortion1="-0.05" radialDistortion2="0.1" radialDistortion3="0" tangentalDistortion1="0.001"
            tangentalDistortion2="0"/></camera>"#
        )
    };
    let cameras = [camera("cam01", 0.0), camera("cam02", 1000.0)].concat();
    let qualisys =
        format!("<?xml version='1.0' encoding='ASCII'?><calibration><cameras>{cameras}</cameras></calibration>");
    folder.write("source/calibration/Calib.qca.txt", &qualisys);
    sequence(&folder, "videos/cam01", 2);
    sequence(&folder, "videos/cam02", 2);
    let first = settings(&folder);
    let prepared = done(&first);
    assert!(prepared.notes.iter().any(|note| note.contains("taken as cut off at the right")), "{:?}", prepared.notes);
    let capture = Capture::open(&first.output).unwrap();
    let second = &capture.cameras[1];
    assert_eq!((second.name.as_str(), second.intrinsics.fx, second.intrinsics.fy), ("cam02", 50.0, 51.0));
    // The file's rows are the camera's axes with y up and z backward, in millimetres.
    close(&second.world_to_camera.rows(), [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.5], [-1.0, 0.0, 0.0, 1.0]]);
    for (from, to, says) in [
        ("viewrotation=\"0\"", "viewrotation=\"90\"", "is turned"),
        ("focalLengthU=\"3200\"", "focalLengthU=\"nan\"", "focalLengthU = NaN"),
        ("skew=\"0\"", "", "has no skew"),
        ("</cameras>", "", "is no XML"),
    ] {
        folder.write("source/calibration/Calib.qca.txt", qualisys.replace(from, to));
        assert_told(&run(&first).unwrap().0.report, &[says]);
    }

    let section = |name: &str, turn: f64| {
        format!(
            "[{name}]\nname = '{name}'\nsize = [64.0, 48.0]\nmatrix = [[50.0, 0.0, 31.5], [0.0, 51.0, 23.5], [0.0, 0.0, 1.0]]\n\
             distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.0, {turn}, 0.0]\ntranslation = [1.0, 2.0, 3.0]\nfisheye = false\n"
        )
    };
    let toml =
        [section("cam_01", 0.0), section("int_cam02_img", std::f64::consts::PI), "[metadata]\nerror = 0.0\n".into()];
    folder.write("source/calibration/Calib_scene.toml", toml.concat());
    let second = PrepareSettings { output: folder.0.join("out2"), ..first };
    let capture = open(&second);
    let names: Vec<_> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["cam01", "cam02"]);
    assert_eq!((capture.cameras[0].intrinsics.cx, capture.cameras[0].intrinsics.cy), (32.0, 24.0));
    close(
        &capture.cameras[1].world_to_camera.rows(),
        [[-1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, -1.0, 3.0]],
    );
}

/// Pictures of 68 x 48 that were fitted into 64 x 48: 64 x 45 between a row of black above and two below.
#[test]
fn black_bars_are_cut_and_other_shapes_refused() {
    let folder = Folder::new("prepare-bars");
    let camera = |id: u32| {
        format!(
            "[cameras.{id}]\nsize = [68, 48]\nmatrix = [[51.0, 0.0, 33.5], [0.0, 51.0, 23.5], [0.0, 0.0, 1.0]]\n\
             distortions = []\ntranslation = [0.0, 0.0, 1.0]\nrotation = [0.0, 0.0, 0.0]\n"
        )
    };
    folder.write("source/camera_array.toml", [camera(0), camera(1)].concat());
    let picture = |bars: u8| {
        let inside = |row: u32| (1..46).contains(&row);
        let pixels = (0..64 * 48_u32).flat_map(|i| if inside(i / 64) { [200, 100, (i / 64) as u8] } else { [bars; 3] });
        encode(&pixels.collect::<Vec<_>>(), 64, 48, ExtendedColorType::Rgb8)
    };
    let write = |bars: u8| {
        for name in ["cam_0/0.png", "cam_0/1.png", "cam_1/0.png", "cam_1/1.png"] {
            folder.write(&format!("source/{name}"), picture(bars));
        }
    };
    write(3);
    let settings = settings(&folder);
    let prepared = done(&settings);
    assert!(
        prepared.notes.iter().any(|note| note.contains("scaled to 64 x 45 between black bars")),
        "{:?}",
        prepared.notes
    );
    let capture = Capture::open(&settings.output).unwrap();
    let camera = &capture.cameras[0];
    assert_eq!(
        (camera.intrinsics.width, camera.intrinsics.height, camera.intrinsics.fx, camera.intrinsics.cx),
        (64, 45, 48.0, 32.0)
    );
    let picture = capture.picture(0, 0).unwrap();
    assert_eq!(picture.pixels[0].to_le_bytes(), [200, 100, 1, 255]);
    assert!(picture.pixels.iter().all(|pixel| pixel & 0xff == 200));
    // Bright bars are none: four columns fewer are taken as cut off.
    write(90);
    let cut = PrepareSettings { output: folder.0.join("cut"), ..settings.clone() };
    assert!(done(&cut).notes.iter().any(|note| note.contains("cut off at the right")));
    // As for black ones that are in the wrong places.
    folder.write("source/camera_array.toml", camera_of_other_shape());
    assert_told(&run(&settings).unwrap().0.report, &["is calibrated for 100 x 48, its pictures are 64 x 48"]);
}

fn camera_of_other_shape() -> String {
    "[cameras.0]\nsize = [100, 48]\nmatrix = [[51.0, 0.0, 50.0], [0.0, 51.0, 23.5], [0.0, 0.0, 1.0]]\n\
     distortions = []\ntranslation = [0.0, 0.0, 1.0]\nrotation = [0.0, 0.0, 0.0]\n"
        .to_owned()
}

#[test]
fn caliscope_arrives() {
    let folder = Folder::new("prepare-caliscope");
    let camera = |id: u32, more: &str| {
        format!(
            "[cameras.{id}]\nsize = [64, 48]\nmatrix = [[50.0, 0.0, 31.0], [0.0, 51.0, 23.0], [0.0, 0.0, 1.0]]\n\
             distortions = [-0.1, 0.02, 0.001, -0.001, 0.003]\ntranslation = [0.0, 0.0, {id}.5]\n\
             rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n{more}"
        )
    };
    let ignored = "[cameras.2]\nignore = true\nsize = [64, 48]\n";
    folder.write("source/camera_array.toml", [&camera(0, ""), &camera(1, ""), ignored].concat());
    (0..2).for_each(|id| sequence(&folder, &format!("calibration/extrinsic/cam_{id}"), 2));
    let settings = settings(&folder);
    let capture = open(&settings);
    assert_eq!((capture.cameras.len(), capture.cameras[1].world_to_camera.translation.z), (2, 1.5));
    // Barrel distortion: the pinhole shows more than the picture's size at its centre.
    assert!(capture.cameras[0].intrinsics.width > 64);
    assert!(capture.true_offsets.is_empty() && !settings.output.join("truth.json").exists());
    // Frames of 2 a second: cam_0 is at 1 and 1.5 s, cam_1 a quarter of a second later and on time.
    let timestamps = "calibration/extrinsic/timestamps.csv";
    let timed = PrepareSettings { capture: rate(2.0), output: folder.0.join("timed"), ..settings.clone() };
    let write = |text: &str| folder.write(&format!("source/{timestamps}"), text);
    write("sync_index,cam_id,frame_time\n3,1,1.25\n3,0,1.0\n\n4,0,1.5\n4,1,1.5\n");
    let offsets = open(&timed).true_offsets;
    assert_eq!(offsets, [("cam_0".to_owned(), -0.125), ("cam_1".to_owned(), 0.125)].into());
    // A time that was not taken, and one beyond the frames that are chosen.
    write("sync_index,cam_id,frame_time\n3,1,1.25\n3,0,1.0\n4,0,1.5\n4,1,\n");
    let first = PrepareSettings { frames: Frames::first(1), output: folder.0.join("first"), ..timed.clone() };
    assert_eq!(open(&first).true_offsets["cam_1"], 0.25);
    let whole = PrepareSettings { output: folder.0.join("whole"), ..timed.clone() };
    assert_eq!(open(&whole).true_offsets, [("cam_0".to_owned(), 0.0)].into());
    for (text, says) in [
        ("sync_index,frame_time\n", "line 1: has no column `cam_id`"),
        ("cam_id,frame_time\n0,1.0\n1\n", "line 3: has 1 fields, the first line 2"),
        ("cam_id,frame_time\n0,inf\n", "line 2: has the time `inf`"),
        ("", "line 1: has no column `cam_id`"),
    ] {
        write(text);
        assert_told(&run(&timed).unwrap().0.report, &[says]);
    }
    std::fs::remove_file(folder.0.join("source").join(timestamps)).unwrap();
    folder.write("source/camera_array.toml", [camera(0, "rotation_count = 1\n"), camera(7, "")].concat());
    let says = ["is turned (rotation_count = 1)", "camera `cam_7`: has neither a video nor images"];
    assert_told(&run(&settings).unwrap().0.report, &says);
}

/// OPENCV, a rig of two that stand and one that moves, and image sequences for a model of one image of each camera.
#[test]
fn colmap_beside_image_sequences_arrives() {
    let folder = Folder::new("prepare-rig");
    let mut model = Model {
        cameras: vec![(4, 4, "OPENCV", 64, 48, vec![50.0, 51.0, 32.0, 24.0, -0.05, 0.01, 1e-3, 0.0])],
        images: vec![
            (1, IDENTITY, [0.0, 0.0, 1.0], 4, "left/000010.jpg", vec![]),
            (2, IDENTITY, [5.0, 0.0, 1.0], 4, "right.jpg", vec![]),
            (3, IDENTITY, [0.0, 1.0, 1.0], 4, "rig/00001.jpg", vec![]),
            (4, IDENTITY, [0.0, 2.0, 1.0], 4, "rig/00002.jpg", vec![]),
            (5, IDENTITY, [0.0, 3.0, 1.0], 4, "rig/00003.jpg", vec![]),
        ],
        points: vec![],
    };
    let write = |model: &Model| {
        let [cameras, images, _] = binary(model);
        folder.write("source/cameras.bin", cameras);
        folder.write("source/images.bin", images);
    };
    write(&model);
    for name in ["left", "right", "rig"] {
        for frame in 0..3 {
            folder.write(&format!("footage/{name}/{frame:03}.png"), png(64, 48, 10 * frame as u8));
        }
    }
    let settings = PrepareSettings { footage: Some(folder.0.join("footage")), ..settings(&folder) };
    let prepared = done(&settings);
    assert_eq!(prepared.source_format, "COLMAP rig");
    assert!(prepared.notes.iter().any(|note| note.contains("counted from 1")));
    let capture = Capture::open(&settings.output).unwrap();
    assert_eq!(capture.n_frames, 3);
    let y = |frame| capture.view(1, frame).unwrap().pose.translation.y;
    assert_eq!([y(0), y(1), y(2)], [1.0, 2.0, 3.0]);
    assert_eq!(capture.view(2, 2).unwrap().pose.translation.x, 5.0);
    model.images.pop();
    write(&model);
    assert_told(&run(&settings).unwrap().0.report, &["moves and has no pose at 1 frames, the first is 2"]);
    model.images[3].4 = "../x.jpg";
    write(&model);
    assert_told(&run(&settings).unwrap().0.report, &["camera `x`: has neither a video nor images"]);
}

#[test]
fn plain_colmap_is_undistorted_with_its_points() {
    let folder = Folder::new("prepare-colmap");
    let model = Model {
        cameras: vec![
            (1, 2, "SIMPLE_RADIAL", 64, 48, vec![50.0, 32.0, 24.0, -0.1]),
            (2, 1, "PINHOLE", 64, 48, vec![50.0, 60.0, 32.0, 24.0]),
        ],
        images: vec![
            (10, IDENTITY, [0.0, 0.0, 4.0], 1, "a.png", vec![(32.0, 24.0, 7)]),
            (11, IDENTITY, [1.0, 0.0, 4.0], 2, "b.png", vec![(40.0, 24.0, 7)]),
        ],
        points: vec![(7, [0.0, 0.0, 0.0], [9, 8, 7], 0.5, vec![(10, 0), (11, 0)])],
    };
    let [cameras, images, points] = binary(&model);
    for (name, bytes) in [("cameras", cameras), ("images", images), ("points3D", points)] {
        folder.write(&format!("source/sparse/0/{name}.bin"), bytes);
    }
    ["a", "b"].iter().for_each(|name| drop(folder.write(&format!("source/images/{name}.png"), png(64, 48, 1))));
    let settings = PrepareSettings {
        triangulate: None,
        capture: CaptureSettings { test_every: 0, ..rate(30.0) },
        ..settings(&folder)
    };
    // Photographs of LLFF and Mip-NeRF 360 have this beside.
    folder.write("source/poses_bounds.npy", "");
    let capture = open(&settings);
    assert_eq!((capture.n_frames, capture.cameras.len(), capture.points.len()), (1, 2, 1));
    assert_eq!(capture.points[0].color, [9, 8, 7]);
    let [a, b] = capture.cameras.as_slice() else { panic!() };
    assert!(a.intrinsics.width > 64 && a.intrinsics.height > 48);
    // A pinhole passes through, also one with two focal lengths, and its file is taken over.
    assert_eq!((b.intrinsics.width, b.intrinsics.height, b.intrinsics.fx, b.intrinsics.fy), (64, 48, 50.0, 60.0));
    assert_eq!(std::fs::read(&b.shots[0].image).unwrap(), png(64, 48, 1));
    // Whoever edits the capture's image in place leaves the source as it is.
    std::fs::write(&b.shots[0].image, png(64, 48, 9)).unwrap();
    assert_eq!(std::fs::read(folder.0.join("source/images/b.png")).unwrap(), png(64, 48, 1));
}

#[test]
fn dynamic_3d_gaussians_arrive_with_what_moves() {
    let folder = Folder::new("prepare-dynamic");
    dynamic::write_below(&folder, "source/", 3);
    let moves: Vec<u8> = (0..24).map(|i| if i > 11 { 255 } else { 0 }).collect();
    for frame in 0..3 {
        folder.write(&format!("source/seg/2/{frame:06}.png"), encode(&moves, 6, 4, ExtendedColorType::L8));
    }
    let settings = PrepareSettings { frames: Frames::first(2), capture: rate(25.0), ..settings(&folder) };
    let capture = open(&settings);
    assert_eq!((capture.n_frames, capture.fps), (2, 25.0));
    let tests: Vec<_> = capture.cameras.iter().map(|camera| camera.is_test).collect();
    assert_eq!(tests, [false, true, false]);
    let found = capture.foreground(2, 1).unwrap().unwrap();
    assert!(found.iter().enumerate().all(|(i, moves)| *moves == (i > 11)));
    assert!(Manifest::read(&settings.output).unwrap().foreground);
    std::fs::remove_file(folder.0.join("source/ims/1/000001.png")).unwrap();
    std::fs::remove_file(folder.0.join("source/ims/2/000000.png")).unwrap();
    assert_told(&run(&settings).unwrap().0.report, &["1/000001.png: is missing", "2/000000.png: is missing"]);
}

pub(super) fn transforms(n: usize, change: impl Fn(usize, &mut serde_json::Value)) -> String {
    let frames = (0..n).map(|i| {
        let rows = [[1.0, 0.0, 0.0, i as f64], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]];
        let mut frame = json!({ "file_path": format!("images/{i:04}.png"), "transform_matrix": rows });
        change(i, &mut frame);
        frame
    });
    let frames: Vec<_> = frames.collect();
    json!({ "w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0, "camera_model": "OPENCV",
        "k1": -0.1, "k2": 0.01, "p1": 0.001, "p2": 0.0, "frames": frames })
    .to_string()
}

#[test]
fn frames_of_a_sequence_follow_as_people_count() {
    let folder = Folder::new("prepare-counted");
    let model = Model {
        cameras: vec![(1, 1, "PINHOLE", 64, 48, vec![50.0, 50.0, 32.0, 24.0])],
        images: ["a", "b"]
            .into_iter()
            .zip(1..)
            .map(|(name, id)| (id, IDENTITY, [f64::from(id); 3], 1, name, vec![]))
            .collect(),
        points: vec![],
    };
    write_cameras(&folder, "source", &model);
    for (name, frame) in ["a", "b"].iter().flat_map(|name| (0..12_u8).map(move |frame| (name, frame))) {
        folder.write(&format!("source/{name}/{frame}.png"), png(64, 48, 10 * frame));
    }
    let capture =
        open(&PrepareSettings { capture: CaptureSettings { test_every: 0, ..rate(30.0) }, ..settings(&folder) });
    for frame in 0..12 {
        let picture = std::fs::read(&capture.cameras[1].shot(frame).unwrap().image).unwrap();
        assert_eq!(picture, png(64, 48, 10 * frame as u8), "frame {frame}");
    }
}

#[test]
fn transforms_take_no_points_of_a_model_beside_and_know_fisheyes() {
    let folder = Folder::new("prepare-beside");
    (0..4).for_each(|i| drop(folder.write(&format!("source/images/{i:04}.png"), png(64, 48, i))));
    let cameras = vec![(1, 1, "PINHOLE", 64, 48, vec![50.0, 50.0, 32.0, 24.0])];
    let points = vec![(7, [0.0, 0.0, 0.0], [9, 8, 7], 0.5, vec![])];
    let [_, _, points] = binary(&Model { cameras, images: vec![], points });
    folder.write("source/sparse/0/points3D.bin", points);
    folder.write("source/transforms.json", transforms(4, |_, _| ()));
    let turned = open(&PrepareSettings { triangulate: None, ..settings(&folder) });
    assert!(turned.points.is_empty());
    // instant-ngp says no model.
    let width = |fisheye: bool, name: &str| {
        let mut told: serde_json::Value = serde_json::from_str(&transforms(4, |_, _| ())).unwrap();
        told.as_object_mut().unwrap().remove("camera_model");
        (told["is_fisheye"], told["p1"]) = (fisheye.into(), 0.0.into());
        folder.write("source/transforms.json", told.to_string());
        let settings = PrepareSettings { triangulate: None, output: folder.0.join(name), ..settings(&folder) };
        open(&settings).cameras[0].intrinsics.width
    };
    assert_ne!(width(true, "fisheye"), width(false, "brown"));
}

#[test]
fn transforms_arrive_still_and_moving() {
    let folder = Folder::new("prepare-transforms");
    (0..4).for_each(|i| drop(folder.write(&format!("source/images/{i:04}.png"), png(64, 48, i))));
    let half: Vec<u8> = (0..64 * 48).map(|i| if i % 64 < 32 { 0 } else { 255 }).collect();
    folder.write("source/masks/2.png", encode(&half, 64, 48, ExtendedColorType::L8));
    let masked = |i: usize, frame: &mut serde_json::Value| {
        if i == 2 {
            frame["mask_path"] = json!("masks/2.png");
        }
    };
    folder.write("source/transforms.json", transforms(4, masked));
    let still = settings(&folder);
    let capture = open(&still);
    assert_eq!((capture.n_frames, capture.cameras.len()), (1, 4));
    let picture = capture.picture(2, 0).unwrap();
    assert!(picture.width > 64);
    let valid = |column: u32| picture.pixels[(10 * picture.width + column) as usize] >> 24 == 255;
    assert!(!valid(3) && valid(picture.width - 4));

    folder.write("source/transforms.json", transforms(4, |i, frame| frame["time"] = json!(i as f64 / 4.0)));
    let moving = PrepareSettings { output: folder.0.join("moving"), ..still.clone() };
    let capture = open(&moving);
    assert_eq!((capture.n_frames, capture.cameras.len(), capture.test_frames().len()), (4, 1, 0));
    let x = |frame| capture.view(0, frame).unwrap().pose.translation.x;
    assert_eq!([x(0), x(1), x(3)], [0.0, -1.0, -3.0]);

    // Two images at one time and none at another: no capture folder holds that.
    folder.write("source/transforms.json", transforms(4, |i, frame| frame["time"] = json!([0.0, 0.0, 0.25, 0.5][i])));
    let (prepared, _) = run(&PrepareSettings { output: folder.0.join("none"), ..still }).unwrap();
    assert_told(&prepared.report, &["a capture folder has all frames of every camera"]);
}

#[test]
fn what_is_no_source_is_told() {
    let folder = Folder::new("prepare-nothing");
    let mut given = settings(&folder);
    assert!(run(&given).unwrap_err().to_string().contains("no such folder"));
    folder.write("source/x.txt", "x");
    assert!(run(&given).unwrap_err().to_string().contains("not a recognised recording"));
    folder.write("source/models.json", "[]");
    assert_told(&run(&given).unwrap().0.report, &["holds no camera"]);
    dynamic::write_below(&folder, "source/", 2);
    std::fs::remove_file(folder.0.join("source/models.json")).unwrap();
    given.frames.from = 9;
    assert_told(&run(&given).unwrap().0.report, &["begins at frame 9, the cameras have 2"]);
    given.frames.from = 0;
    given.capture.test_cameras = Some(vec!["7".into()]);
    assert_told(&run(&given).unwrap().0.report, &["no camera is named `7`"]);
    given.capture.test_cameras = Some(["0", "1", "2"].map(String::from).to_vec());
    assert_told(&run(&given).unwrap().0.report, &["has only test cameras"]);
    assert!(!given.output.exists(), "nothing is made of a faulty source");
}
