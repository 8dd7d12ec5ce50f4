//! `transforms.json`.

use super::{Case, Folder, assert_told, encode, png};
use crate::common::prelude::*;
use serde_json::json;

/// A camera at (x, 0, 5) that looks along -z of the world with y up, as OpenGL has it.
fn frame(name: &str, x: f64) -> Value {
    let rows = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]];
    json!({ "file_path": name, "transform_matrix": rows })
}

pub fn document(n: usize) -> Value {
    let frames: Vec<_> = (0..n).map(|i| frame(&format!("./images/{i:04}.png"), i as f64)).collect();
    json!({ "w": 6.0, "h": 4.0, "fl_x": 5.0, "fl_y": 5.5, "cx": 3.25, "cy": 2.0, "k1": 0.0, "frames": frames })
}

pub fn write(folder: &Folder, n: usize, document: &Value) {
    folder.write("transforms.json", document.to_string());
    (0..n).for_each(|i| drop(folder.write(&format!("images/{i:04}.png"), png(6, 4, i as u8))));
}

#[test]
fn poses_are_turned_and_every_eighth_image_is_a_test() {
    let folder = Folder::new("transforms");
    write(&folder, 10, &document(10));
    let capture = folder.open();
    assert_eq!((capture.cameras.len(), capture.n_frames), (10, 1));
    assert_eq!(capture.test_frames(), [(0, 0), (8, 0)]);
    let view = capture.view(3, 0).unwrap();
    assert_eq!((view.name.as_str(), view.intrinsics.width, view.intrinsics.height), ("images_0003", 6, 4));
    assert_eq!([view.intrinsics.fx, view.intrinsics.fy, view.intrinsics.cx, view.intrinsics.cy], [5.0, 5.5, 3.25, 2.0]);
    // The world's origin is 5 in front of the camera and 3 to its left; y turns around.
    let expected = [[1.0, 0.0, 0.0, -3.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 5.0], [0.0, 0.0, 0.0, 1.0]];
    assert_eq!(view.pose.rows(), expected);
}

#[test]
fn intrinsics_come_from_angles_frames_and_images() {
    let folder = Folder::new("transforms-lens");
    let mut document =
        json!({ "camera_angle_x": 1.0, "frames": [frame("images/0000", 0.0), frame("images/0001", 1.0)] });
    document["frames"][1]["fl_x"] = json!(9.0);
    document["frames"][1]["cy"] = json!(1.5);
    write(&folder, 2, &document);
    let capture = folder.open();
    let (first, second) = (capture.view(0, 0).unwrap(), capture.view(1, 0).unwrap());
    let focal = 3.0 / 0.5_f64.tan();
    assert!((first.intrinsics.fx - focal).abs() < 1e-12 && first.intrinsics.fx == first.intrinsics.fy);
    assert_eq!(
        (first.intrinsics.width, first.intrinsics.height, first.intrinsics.cx, first.intrinsics.cy),
        (6, 4, 3.0, 2.0)
    );
    assert_eq!(
        (second.intrinsics.fx, second.intrinsics.fy, second.intrinsics.cx, second.intrinsics.cy),
        (9.0, 9.0, 3.0, 1.5)
    );
}

#[test]
fn times_become_frames_and_a_camera_that_stays_is_one_camera() {
    let folder = Folder::new("transforms-time");
    let mut train = document(5);
    // Five of seven frames, as D-NeRF counts them: the last is at 1.
    for (index, f) in [0.0, 1.0, 3.0, 4.0, 6.0].iter().enumerate() {
        train["frames"][index]["time"] = json!(f / 6.0);
    }
    train["frames"][4]["transform_matrix"] = train["frames"][1]["transform_matrix"].clone();
    let mut test = json!({ "w": 6, "h": 4, "fl_x": 5.0, "frames": [frame("test/r_5", 2.0)] });
    test["frames"][0]["time"] = json!(5.0 / 6.0);
    write(&folder, 5, &train);
    std::fs::rename(folder.0.join("transforms.json"), folder.0.join("transforms_train.json")).unwrap();
    folder.write("transforms_test.json", test.to_string());
    folder.write("test/r_5.png", png(6, 4, 0));
    let capture = folder.open();
    assert_eq!((capture.n_frames, capture.cameras.len()), (7, 5));
    assert_eq!(capture.training_frames(), [(0, 0), (1, 1), (2, 3), (3, 4), (1, 6)]);
    assert_eq!(capture.test_frames(), [(4, 5)]);
    let view = capture.view(1, 6).unwrap();
    assert_eq!((view.name.as_str(), view.time, view.flow_dt), ("images_0001_00006", 6.0 / 7.0, 1.0 / 7.0));
    train["frames"][2]["time"] = json!(0.41);
    folder.write("transforms_train.json", train.to_string());
    assert_told(&folder.check(), &["lie on no common grid"]);
    train["frames"][2].as_object_mut().unwrap().remove("time");
    folder.write("transforms_train.json", train.to_string());
    assert_told(&folder.check(), &["5 of 6 frames have one"]);
}

#[test]
fn transparent_images_lie_over_the_background() {
    let folder = Folder::new("transforms-alpha");
    write(&folder, 2, &document(2));
    let pixels: Vec<u8> = (0..24).flat_map(|i| [200, 100, 0, [0, 51, 255][i % 3]]).collect();
    folder.write("images/0001.png", encode(&pixels, 6, 4, ExtendedColorType::Rgba8));
    let settings = CaptureSettings { background: [1.0, 0.0, 0.5], ..CaptureSettings::default() };
    let capture = Capture::open_with(&folder.0, &settings).unwrap();
    assert_eq!(capture.view(1, 0).unwrap().background, [1.0, 0.0, 0.5]);
    let pixels = capture.picture(1, 0).unwrap().pixels;
    let bytes: Vec<_> = pixels[..3].iter().map(|pixel| pixel.to_le_bytes()).collect();
    assert_eq!(bytes, [[255, 0, 128, 255], [244, 20, 102, 255], [200, 100, 0, 255]]);
}

#[test]
fn every_fault_of_a_transforms_file_is_told() {
    let folder = Folder::new("transforms-faults");
    let cases: [Case<Value>; 15] = [
        (|d| d["k1"] = json!(0.01), "`ivv prepare "),
        (|d| d["camera_model"] = json!("OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
        (|d| d["w"] = json!(6.5), "has 6.5 x 4 pixels"),
        (|d| d["h"] = json!(1e30), "whole numbers of 1 to 65536"),
        (|d| d["w"] = json!(7), "is 6 x 4, its camera is calibrated for 7 x 4"),
        (|d| drop(d.as_object_mut().unwrap().remove("fl_x")), "neither fl_x nor camera_angle_x"),
        (|d| d["fl_x"] = json!(-1.0), "has fx = -1.0 pixels"),
        (|d| d["frames"] = json!([]), "holds no frame"),
        (|d| d["frames"][1]["file_path"] = json!(".."), "is empty"),
        (|d| d["frames"][1]["mask_path"] = json!("a\u{1}"), "a control character"),
        (|d| d["frames"][1]["file_path"] = json!("images/0000.png"), "is listed twice"),
        (|d| d["frames"][1]["file_path"] = json!("images/9"), "images/9.png: is missing"),
        (|d| d["frames"][1]["transform_matrix"][0][0] = json!(1.5), "has no rotation"),
        (|d| d["frames"][1]["transform_matrix"][3][3] = json!(2.0), "is not 3 or 4 rows"),
        (|d| d["frames"][1]["transform_matrix"][0][3] = json!(1e12), "has a position beyond"),
    ];
    for (change, says) in cases {
        let mut changed = document(3);
        change(&mut changed);
        write(&folder, 3, &changed);
        assert_told(&folder.check(), &[says]);
    }
    let text = document(3).to_string();
    for n in 0..text.len() {
        folder.write("transforms.json", &text[..n]);
        assert_told(&folder.check(), &["is no transforms.json"]);
    }
}
