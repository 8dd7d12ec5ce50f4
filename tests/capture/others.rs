//! Photographs with the poses of LLFF and of OpenSfM, and calibrations that are named because they are not read.

use super::model::{sample, write};
use super::{Folder, assert_told, png, told};
use crate::common::npy_rows;
use crate::common::prelude::*;
use ivv::internals::scene::capture::Report;
use serde_json::json;

fn noted(report: &Report, says: &str) {
    assert!(report.notes.iter().any(|note| note.contains(says)), "no note says {says:?}: {:?}", report.notes);
}

/// Rows of cameras at these places of the x axis, which look along -z with y up; images of 6 x 4 pixels, focal length 5.
fn poses(places: &[f64]) -> Vec<u8> {
    // Down, right, back, centre, (height, width, focal length), by row.
    let row = |x: f64| {
        [[0.0, 1.0, 0.0, x, 4.0], [-1.0, 0.0, 0.0, 0.0, 6.0], [0.0, 0.0, 1.0, 5.0, 5.0]]
            .concat()
            .into_iter()
            .chain([1.0, 9.0])
    };
    let values: Vec<f64> = places.iter().flat_map(|x| row(*x)).collect();
    npy_rows(places.len(), &values)
}

#[test]
fn photographs_of_llff_are_read_in_every_size() {
    let folder = Folder::new("llff");
    folder.write("poses_bounds.npy", poses(&[0.0, 1.0, 2.0]));
    for (at, size) in [("images", (6, 4)), ("images_2", (3, 2))] {
        (0..3).for_each(|i| drop(folder.write(&format!("{at}/IMG_{i}.png"), png(size.0, size.1, i))));
    }
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.format.as_str(), report.n_cameras), ("", "LLFF", 3));
    let capture = folder.open();
    let camera = &capture.cameras[2];
    assert_eq!((camera.name.as_str(), camera.intrinsics.fx, camera.intrinsics.cx), ("IMG_2", 5.0, 3.0));
    let expected = [[1.0, 0.0, 0.0, -2.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 5.0], [0.0, 0.0, 0.0, 1.0]];
    assert_eq!(camera.world_to_camera.rows(), expected);
    let half = CaptureSettings { downscale: Some(2), ..CaptureSettings::default() };
    let capture = Capture::open_with(&folder.0, &half).unwrap();
    assert_eq!((capture.cameras[0].intrinsics.fx, capture.cameras[0].intrinsics.width), (2.5, 3));
    fs::remove_dir_all(folder.0.join("images")).unwrap();
    noted(&folder.check(), "there is no folder images: images_2 is taken");
    fs::remove_file(folder.0.join("images_2/IMG_1.png")).unwrap();
    assert_told(&folder.check(), &["describes 3 images, there are 2 in images_2"]);
    // The model of COLMAP that they were made from says more.
    write(&folder, &sample());
    assert_eq!(folder.check().format, "COLMAP");
}

#[test]
fn images_of_llff_are_in_the_order_of_their_numbers_or_of_their_text_and_it_is_told() {
    // Cameras in a row, by their numbers.
    let by_number: Vec<f64> = (0..12).map(f64::from).collect();
    let mut by_text = by_number.clone();
    by_text.sort_by_key(|n| n.to_string());
    for (rows, says) in [(&by_number, "in that of their numbers"), (&by_text, "in that of their text")] {
        let folder = Folder::new("llff-order");
        folder.write("poses_bounds.npy", poses(rows));
        (0..12).for_each(|i| drop(folder.write(&format!("images/cam_{i}.png"), png(6, 4, i))));
        let report = folder.check();
        assert_eq!(told(&report), "");
        noted(&report, says);
        for camera in &folder.open().cameras {
            let number: f64 = camera.name.strip_prefix("cam_").unwrap().parse().unwrap();
            assert_eq!(camera.world_to_camera.center().x, number, "{}: {says}", camera.name);
        }
    }
}

#[test]
fn reconstructions_of_opensfm_are_read() {
    let folder = Folder::new("opensfm");
    let lens = json!({ "projection_type": "brown", "width": 6, "height": 4, "focal_x": 1.0, "focal_y": 1.5, "c_x": 0.1, "c_y": -0.05 });
    let shot = |x: f64, turn: f64| json!({ "rotation": [turn, 0.0, 0.0], "translation": [x, 0.5, 4.0], "camera": "c" });
    let quarter = std::f64::consts::FRAC_PI_2;
    let part = json!({
        "cameras": { "c": lens },
        "shots": { "a.jpg": shot(1.0, 0.0), "b.jpg": shot(2.0, quarter) },
        "points": { "1": { "color": [255.0, 0.0, 7.0], "coordinates": [0.25, 1.0, -2.0] } },
    });
    let small = json!({ "cameras": { "c": lens }, "shots": { "z.jpg": shot(0.0, 0.0) }, "points": {} });
    folder.write("reconstruction.json", json!([small, part]).to_string());
    folder.write("images/a.jpg", png(6, 4, 0));
    folder.write("images/b.jpg", png(6, 4, 1));
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.format.as_str(), report.n_cameras), ("", "OpenSfM", 2));
    noted(&report, "2 parts, of 1, 2 images: the largest is taken");
    let capture = folder.open();
    let lens = capture.cameras[1].intrinsics;
    let found = [lens.fx, lens.fy, lens.cx, lens.cy];
    assert!(found.iter().zip([6.0, 9.0, 3.6, 1.7]).all(|(v, w)| (v - w).abs() < 1e-12), "{found:?}");
    let rows = capture.cameras[1].world_to_camera.rows();
    let expected = [[1.0, 0.0, 0.0, 2.0], [0.0, 0.0, -1.0, 0.5], [0.0, 1.0, 0.0, 4.0], [0.0, 0.0, 0.0, 1.0]];
    assert!(rows.as_flattened().iter().zip(expected.as_flattened()).all(|(v, w)| (v - w).abs() < 1e-12), "{rows:?}");
    assert_eq!((capture.points[0].position, capture.points[0].color), ([0.25, 1.0, -2.0], [255, 0, 7]));
    let mut bad = part.clone();
    bad["cameras"]["c"]["projection_type"] = json!("spherical");
    folder.write("reconstruction.json", json!([bad]).to_string());
    assert_told(&folder.check(), &["has a spherical lens"]);
    folder.write("reconstruction.json", "[{}]");
    assert_told(&folder.check(), &["is no reconstruction of OpenSfM"]);
}

#[test]
fn calibrations_that_are_not_read_are_named() {
    let folder = Folder::new("foreign");
    folder.write("cameras.csv", "#name,x,y,alt,heading,pitch,roll,f,px,py\na.jpg,0,0,0,1,2,3,35,0,0\n");
    folder.write(
        "cameras.xml",
        "<?xml version=\"1.0\"?><document version=\"2.0.0\"><chunk label=\"1\"></chunk></document>",
    );
    folder.write("table.csv", "a,b\n1,2\n");
    let report = check_capture(&folder.0, &CaptureSettings::default());
    noted(&report, "the poses of RealityScan in cameras.csv are not read");
    noted(&report, "the poses of Metashape in cameras.xml are not read");
    assert_eq!(report.notes.len(), 2, "{:?}", report.notes);
}
