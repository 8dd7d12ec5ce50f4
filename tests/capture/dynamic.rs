//! Dynamic3DGaussians' layout.

use super::{Case, Folder, assert_told, encode, png};
use crate::common::prelude::*;
use serde_json::json;

const IDENTITY: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 4.0], [0.0, 0.0, 0.0, 1.0]];

fn meta(n_frames: usize, ids: &[u32]) -> Value {
    let pose = |id: u32| {
        let mut pose = IDENTITY;
        pose[0][3] = f64::from(id);
        pose
    };
    let names = |t: usize| ids.iter().map(|id| format!("{id}/{t:06}.png")).collect::<Vec<_>>();
    json!({
        "w": 6, "h": 4,
        "k": vec![vec![[[5.0, 0.0, 3.0], [0.0, 5.5, 2.0], [0.0, 0.0, 1.0]]; ids.len()]; n_frames],
        "w2c": vec![ids.iter().map(|id| pose(*id)).collect::<Vec<_>>(); n_frames],
        "fn": (0..n_frames).map(names).collect::<Vec<_>>(),
        "cam_id": vec![ids; n_frames],
    })
}

/// Cameras 0 and 2 for training and 1 for testing, 6 x 4 pixels.
pub fn write(folder: &Folder, n_frames: usize) {
    write_below(folder, "", n_frames);
}

/// The same in a folder below, whose name ends in a slash.
pub fn write_below(folder: &Folder, below: &str, n_frames: usize) {
    folder.write(&format!("{below}train_meta.json"), meta(n_frames, &[0, 2]).to_string());
    folder.write(&format!("{below}test_meta.json"), meta(n_frames, &[1]).to_string());
    for camera in 0..3 {
        for frame in 0..n_frames {
            let first = (17 * camera + 5 * frame) as u8;
            folder.write(&format!("{below}ims/{camera}/{frame:06}.png"), png(6, 4, first));
        }
    }
}

/// One training camera with one image, a JPEG of this size.
pub fn write_sized(folder: &Folder, width: u32, height: u32, jpeg: &[u8]) {
    let mut meta = meta(1, &[0]);
    (meta["w"], meta["h"], meta["fn"]) = (json!(width), json!(height), json!([["0/000000.jpg"]]));
    folder.write("train_meta.json", meta.to_string());
    folder.write("ims/0/000000.jpg", jpeg);
}

#[test]
fn cameras_frames_times_and_pixels_arrive() {
    let folder = Folder::new("dynamic");
    write(&folder, 4);
    let capture = folder.open();
    assert_eq!((capture.cameras.len(), capture.n_frames), (3, 4));
    assert_eq!(capture.test_frames(), [(1, 0), (1, 1), (1, 2), (1, 3)]);
    assert_eq!(capture.training_frames()[..3], [(0, 0), (2, 0), (0, 1)]);
    let view = capture.view(2, 3).unwrap();
    assert_eq!((view.name.as_str(), view.time, view.flow_dt), ("2_00003", 0.75, 0.25));
    assert_eq!(
        (view.intrinsics.fx, view.intrinsics.fy, view.intrinsics.cx, view.intrinsics.cy, view.pose.translation.x),
        (5.0, 5.5, 3.0, 2.0, 2.0)
    );
    let picture = capture.picture(2, 3).unwrap();
    assert_eq!((picture.width, picture.height, picture.pixels.len()), (6, 4, 24));
    assert_eq!(picture.pixels[5].to_le_bytes(), [17 * 2 + 5 * 3 + 5, 5, 7, 255]);
    // Centres at x = 0 and x = -2.
    let extent = capture.extent();
    assert!((extent.center[0] + 1.0).abs() < 1e-12 && (extent.radius - 1.1).abs() < 1e-12, "{extent:?}");
}

#[test]
fn the_end_that_no_camera_has_is_left_out_and_a_hole_is_a_fault() {
    let folder = Folder::new("dynamic-end");
    write(&folder, 3);
    folder.write("train_meta.json", meta(9, &[0, 2]).to_string());
    let report = folder.check();
    assert_eq!((report.n_faults, report.n_frames, report.n_images), (0, 3, 9));
    assert!(report.notes.iter().any(|note| note.contains("9 frames are listed, images of the first 3 exist")));
    std::fs::remove_file(folder.0.join("ims/2/000001.png")).unwrap();
    std::fs::remove_file(folder.0.join("ims/1/000002.png")).unwrap();
    assert_told(&folder.check(), &["ims/2/000001.png: is missing", "ims/1/000002.png: is missing"]);
    assert_eq!(folder.check().n_faults, 2);
    let settings = CaptureSettings { skip_missing: true, frames: Frames::first(2), ..CaptureSettings::default() };
    let capture = Capture::open_with(&folder.0, &settings).unwrap();
    assert_eq!(capture.n_frames, 2);
    assert_eq!(capture.training_frames(), [(0, 0), (2, 0), (0, 1)]);
    assert_eq!(capture.view(0, 1).unwrap().time, 0.5);
}

#[test]
fn a_moving_camera_has_a_pose_at_each_frame() {
    let folder = Folder::new("dynamic-moving");
    write(&folder, 3);
    let mut moving = meta(3, &[0, 2]);
    moving["w2c"][1][1][1][3] = json!(5.0);
    folder.write("train_meta.json", moving.to_string());
    let capture = folder.open();
    let y = |camera, frame| capture.view(camera, frame).unwrap().pose.translation.y;
    assert_eq!([y(2, 0), y(2, 1), y(2, 2)], [0.0, 5.0, 0.0]);
    assert_eq!([y(0, 0), y(0, 1), y(0, 2)], [0.0; 3]);
}

#[test]
fn foreground_masks_are_used_only_when_asked_for() {
    let folder = Folder::new("dynamic-masks");
    write(&folder, 1);
    let mask: Vec<u8> = (0..24).map(|i| if i % 3 == 0 { 130 } else { 0 }).collect();
    folder.write("seg/0/000000.png", encode(&mask, 6, 4, ExtendedColorType::L8));
    let plain = folder.open();
    assert!(plain.cameras[0].shots[0].mask.is_none());
    // What moves is known all the same, for the first Gaussians.
    let shots = plain.cameras.iter().map(|camera| camera.shots[0].foreground.is_some());
    assert_eq!(shots.collect::<Vec<_>>(), [true, false, false]);
    assert_eq!(folder.check().n_foregrounds, 1);
    let settings = CaptureSettings { foreground_masks: true, ..CaptureSettings::default() };
    let masked = Capture::open_with(&folder.0, &settings).unwrap();
    assert!(masked.cameras[0].shots[0].mask.is_some() && masked.cameras[1].shots[0].mask.is_none());
    let (with, without) = (masked.picture(0, 0).unwrap(), plain.picture(0, 0).unwrap());
    for (i, (a, b)) in with.pixels.iter().zip(&without.pixels).enumerate() {
        assert_eq!(a & 0x00ff_ffff, b & 0x00ff_ffff);
        assert_eq!((a >> 24, b >> 24), (if i % 3 == 0 { 255 } else { 0 }, 255));
    }
    let foreground = plain.foreground(0, 0).unwrap().unwrap();
    assert!(foreground.iter().enumerate().all(|(i, moves)| *moves == (i % 3 == 0)) && foreground.len() == 24);
    assert_eq!(plain.foreground(2, 0).unwrap(), None);
    folder.write("seg/0/000000.png", encode(&mask, 4, 6, ExtendedColorType::L8));
    assert!(plain.foreground(0, 0).is_err() && plain.foreground(0, 1).is_err());
    assert_told(&check_capture(&folder.0, &settings), &["seg/0/000000.png: is 4 x 6"]);
}

fn npz(name: &str, content: &[u8]) -> Vec<u8> {
    zip(&[(name.to_owned(), content.to_owned())])
}

fn npy(header: &str, values: &[f64]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes().into_iter().chain(header.bytes()));
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

#[test]
fn initial_points_are_read_and_their_faults_told() {
    let folder = Folder::new("dynamic-points");
    write(&folder, 1);
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 7), }\n";
    let mut values = [1.0, 2.0, 3.0, 0.5, 0.0, 1.0, 1.0, -4.0, 5.5, 6.0, 1.0, 0.25, 2.0, 0.0];
    let whole = npz("data.npy", &npy(header, &values));
    folder.write("init_pt_cld.npz", &whole);
    let expected = [([1.0, 2.0, 3.0], [128, 0, 255]), ([-4.0, 5.5, 6.0], [255, 64, 255])];
    assert_eq!(folder.open().points, expected.map(|(position, color)| Point { position, color }));
    for n in 0..whole.len() {
        folder.write("init_pt_cld.npz", &whole[..n]);
        assert_told(&folder.check(), &["init_pt_cld.npz"]);
    }
    for at in 0..whole.len() {
        let mut changed = whole.clone();
        changed[at] ^= 0xff;
        folder.write("init_pt_cld.npz", changed);
        super::told(&folder.check());
    }
    for (from, to, says) in [
        ("(2, 7)", "(7, 2)", "has 2 columns"),
        ("(2, 7)", "(2, 9)", "has the shape [2, 9] and 14 values"),
        ("(2, 7)", "(14,)", "has the shape [14]"),
        ("(2, 7)", "(18446744073709551615, 7)", "has the shape"),
        ("<f8", "<i8", "is not of little-endian f16, f32 or f64"),
        ("False", "True", "is not in C order"),
    ] {
        folder.write("init_pt_cld.npz", npz("data.npy", &npy(&header.replace(from, to), &values)));
        assert_told(&folder.check(), &[says]);
    }
    folder.write("init_pt_cld.npz", npz("other.npy", &npy(header, &values)));
    assert_told(&folder.check(), &["is not in the archive"]);
    values[8] = f64::NAN;
    folder.write("init_pt_cld.npz", npz("data.npy", &npy(header, &values)));
    assert_told(&folder.check(), &["row 1"]);
}

#[test]
fn every_contradiction_of_the_lists_is_told() {
    let folder = Folder::new("dynamic-faults");
    write(&folder, 2);
    let cases: [Case<Value>; 10] = [
        (|m| m["k"].as_array_mut().unwrap().truncate(1), "lists 1 frames in k, 2 in w2c"),
        (|m| m["fn"][1].as_array_mut().unwrap().truncate(1), "lists 2 cameras in k, 2 in w2c, 1 in fn"),
        (|m| m["fn"][1][0] = json!("../../secret.png"), "ims/secret.png: is missing"),
        (|m| m["k"][0][0][0][1] = json!(0.1), "no pinhole without skew"),
        (|m| m["k"][1][0][0][0] = json!(7.0), "changes its intrinsics in time"),
        (|m| m["cam_id"][1][1] = json!(0), "is listed twice in this frame"),
        (|m| m["cam_id"][0][0] = json!(1), "is both a training and a test camera"),
        (|m| m["w2c"][0][0][0][0] = json!(2.0), "has no rotation"),
        (|m| m["w2c"][0][0][3][0] = json!(0.5), "as the last row of w2c, not [0, 0, 0, 1]"),
        (|m| m["w"] = json!(8), "is 6 x 4, its camera"),
    ];
    for (change, says) in cases {
        let mut meta = meta(2, &[0, 2]);
        change(&mut meta);
        folder.write("train_meta.json", meta.to_string());
        assert_told(&folder.check(), &[says]);
    }
    let text = meta(2, &[0, 2]).to_string();
    folder.write("train_meta.json", text.replacen("5.0", "NaN", 1));
    assert_told(&folder.check(), &["train_meta.json, line 1, column"]);
    for n in (0..text.len()).step_by(7) {
        folder.write("train_meta.json", &text[..n]);
        assert_told(&folder.check(), &["is no meta file"]);
    }
}
