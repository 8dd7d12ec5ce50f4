//! Captures made by others.

use super::{Folder, assert_told, dynamic};
use crate::common::prelude::*;
use ivv::internals::scene::capture::FrameCache;

#[test]
fn the_fox_has_its_published_test_views() {
    let Some(path) = shared("data/fox_quarter") else { return };
    let capture = Capture::open(&path).unwrap();
    assert_eq!((capture.cameras.len(), capture.points.len(), capture.n_frames), (50, 5139, 1));
    let names =
        |frames: Vec<(usize, u32)>| frames.iter().map(|f| capture.cameras[f.0].name.clone()).collect::<Vec<_>>();
    assert_eq!(names(capture.test_frames()), ["0001", "0012", "0027", "0042", "0073", "0089", "0110"]);
    assert_eq!(capture.training_frames().len(), 43);
    // The points project into the images that they were made from.
    let view = capture.view(0, 0).unwrap();
    assert_eq!((view.intrinsics.width, view.intrinsics.height), (266, 474));
    let row = |k: usize, p: [f64; 3]| -> f64 {
        (0..3).map(|c| view.pose.rows()[k][c] * p[c]).sum::<f64>() + view.pose.translation[k]
    };
    let inside = capture.points.iter().filter(|point| {
        let [x, y, z] = [0, 1, 2].map(|k| row(k, point.position));
        let (u, v) = (view.intrinsics.fx * x / z + view.intrinsics.cx, view.intrinsics.fy * y / z + view.intrinsics.cy);
        z > 0.0 && (0.0..266.0).contains(&u) && (0.0..474.0).contains(&v)
    });
    assert!(inside.count() > 1000);
    let extent = capture.extent();
    assert!(extent.radius > 1.0 && extent.radius < 20.0, "{extent:?}");
}

#[test]
fn the_basketball_clip_streams_within_its_budget() {
    let Some(path) = shared("data/panoptic_basketball_dev") else { return };
    let capture = Capture::open(&path).unwrap();
    assert_eq!((capture.cameras.len(), capture.n_frames), (31, 20));
    let test: Vec<_> = capture.cameras.iter().filter(|camera| camera.is_test).map(|camera| &camera.name).collect();
    assert_eq!(test, ["0", "10", "15", "30"]);
    assert_eq!((capture.training_frames().len(), capture.test_frames().len()), (540, 80));
    let order: Vec<_> = capture.training_frames().into_iter().step_by(40).cycle().take(28).collect();
    let budget = 4 << 20;
    let mut cache = FrameCache::new(&capture, order.clone(), &PriorPlan::default(), budget, 2).unwrap();
    for _ in &order {
        let picture = cache.next_picture().unwrap().unwrap();
        assert_eq!((picture.width, picture.height), (640, 360));
        assert!(picture.pixels.iter().any(|pixel| *pixel != picture.pixels[0]));
    }
    let stats = cache.stats();
    assert!(stats.peak_bytes <= budget && stats.n_decoded >= 14, "{stats:?}");
    let settings = CaptureSettings { foreground_masks: true, ..CaptureSettings::default() };
    let masked = check_capture(&path, &settings);
    assert_eq!((masked.n_faults, masked.n_masks), (0, 540));
}

#[test]
fn missing_images_of_the_mutant_are_all_reported_or_left_out() {
    let Some(path) = shared("data/dnerf_mutant") else { return };
    let report = check_capture(&path, &CaptureSettings::default());
    assert_told(&report, &["train/r_001.png: is missing", "test/r_019.png: is missing"]);
    assert_eq!((report.n_faults, report.n_frames), (136, 150));
    let settings = CaptureSettings { skip_missing: true, background: [1.0; 3], ..CaptureSettings::default() };
    let capture = Capture::open_with(&path, &settings).unwrap();
    assert_eq!((capture.training_frames().len(), capture.test_frames().len()), (30, 4));
    assert_eq!(capture.training_frames()[1].1, 5);
    // Its corners are transparent, its middle is not white.
    let pixels = capture.picture(capture.training_frames()[0].0, 0).unwrap().pixels;
    assert_eq!((pixels.len(), pixels[0]), (640_000, 0xffff_ffff));
    assert!(pixels.iter().any(|pixel| *pixel != 0xffff_ffff));
}

#[test]
fn images_of_one_other_size_are_taken_with_one_note() {
    let Some(path) = shared("data/n3v_flame_steak_frame0") else { return };
    // They are the only pictures of these names.
    let notes = check_capture(&path, &CaptureSettings::default()).notes;
    assert!(notes[0].contains("(images/cam00.png): 21; taken from derived_images_4/cam00.png"), "{notes:?}");
    let mut settings = CaptureSettings { images: "derived_images_4".into(), ..CaptureSettings::default() };
    let report = check_capture(&path, &settings);
    assert_eq!(
        report.notes,
        ["images of 1/4 of the calibration's size in all cameras: the calibration is scaled to them"]
    );
    for rescale in [false, true] {
        settings.rescale = rescale;
        let scaled = Capture::open_with(&path, &settings).unwrap();
        let camera = &scaled.cameras[0];
        assert_eq!((scaled.cameras.len(), scaled.points.len()), (21, 7298));
        assert_eq!((camera.intrinsics.width, camera.intrinsics.height), (672, 504));
        // COLMAP put the principal point at the centre; it stays there although 2690 is no multiple of 672.
        assert!(
            (camera.intrinsics.cx - 336.0).abs() < 1e-9 && (camera.intrinsics.cy - 252.0).abs() < 1e-9,
            "{camera:?}"
        );
    }
}

#[test]
fn a_distorted_model_asks_for_prepare_and_its_undistorted_copy_opens() {
    let Some(path) = shared("data/colmap_simple_radial_7img") else { return };
    let report = check_capture(&path, &CaptureSettings::default());
    assert_eq!(report.n_faults, 1);
    assert_told(&report, &["7 lenses distort (SIMPLE_RADIAL)", "`ivv prepare"]);
    let dense = Capture::open(path.join("dense")).unwrap();
    assert_eq!((dense.cameras.len(), dense.points.len()), (7, 699));
    let sizes: std::collections::HashSet<_> =
        dense.cameras.iter().map(|c| (c.intrinsics.width, c.intrinsics.height)).collect();
    assert!(sizes.len() > 1);
    let picture = dense.picture(3, 0).unwrap();
    assert_eq!(picture.pixels.len() as u32, dense.cameras[3].intrinsics.width * dense.cameras[3].intrinsics.height);
}

#[test]
fn a_jpeg_cut_anywhere_is_a_fault_and_never_a_picture() {
    let Some(path) = shared("data/panoptic_basketball_dev/ims/5/000000.jpg") else { return };
    let whole = std::fs::read(path).unwrap();
    let folder = Folder::new("jpeg");
    dynamic::write_sized(&folder, 640, 360, &whole);
    let capture = folder.open();
    assert_eq!(capture.picture(0, 0).unwrap().pixels.len(), 640 * 360);
    // Telephones append a video, to which half an image is half an image.
    let pixels = capture.picture(0, 0).unwrap().pixels;
    folder.write("ims/0/000000.jpg", [&whole[..], &[7; 5000]].concat());
    assert_same("pixels", &folder.open().picture(0, 0).unwrap().pixels, &pixels);
    folder.write("ims/0/000000.jpg", [&whole[..whole.len() / 2], &[7; 5000]].concat());
    assert!(super::told(&folder.check()).contains("is cut off"));
    for n in (0..whole.len() - 64).step_by(307) {
        folder.write("ims/0/000000.jpg", &whole[..n]);
        let error = capture.picture(0, 0).err().unwrap_or_else(|| panic!("cut at {n} of {}", whole.len()));
        assert_eq!(error.exit_code(), 3);
        super::told(&folder.check());
    }
}
