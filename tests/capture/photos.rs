//! Photographs of what rests, inside the folder of a clip.

use super::{Folder, told};
use crate::common::prelude::*;
use ivv::internals::synth::Options;

/// A clip of four cameras, one of them for testing, and three photographs of its room.
pub fn clip(name: &str) -> Folder {
    let folder = Folder::new(name);
    let tiny = Preset::Tiny.options(3);
    let (cameras, test_cameras, frames, photos) = (4, 1, 4, Some(3));
    let options = Options { cameras, test_cameras, frames, photos, samples: 1, points: 60, ..tiny };
    write_capture(&folder.0, &options, 2, &mut |_, _| {}).unwrap();
    folder
}

#[test]
fn photographs_are_cameras_of_another_time() {
    let folder = clip("photos");
    let report = folder.check();
    assert_eq!((told(&report).as_str(), report.n_cameras, report.n_photos, report.n_images), ("", 4, 3, 19));
    let capture = folder.open();
    let photos: Vec<usize> = (0..capture.cameras.len()).filter(|i| capture.cameras[*i].is_photo).collect();
    assert_eq!(photos, [4, 5, 6]);
    assert_eq!(capture.training_frames().len(), 15);
    assert!(photos.iter().all(|photo| !capture.cameras[*photo].is_test && capture.cameras[*photo].shots.len() == 1));
    // Nothing that moves lives so long, and the picture is its own.
    let view = capture.view(4, 0).unwrap();
    assert!(view.time > 1e3, "{}", view.time);
    assert_eq!(capture.view(0, 2).unwrap().time, 0.5);
    assert_eq!(capture.picture(4, 0).unwrap().width, 64);
    // Their points are no points of the clip, their places no part of how large it is.
    let alone = {
        let manifest = Manifest { photos: false, ..Manifest::read(&folder.0).unwrap() };
        let other = clip("photos-unused");
        manifest.write(&other.0).unwrap();
        assert!(other.check().notes.iter().any(|note| note.contains("photos/ is not used")));
        other.open()
    };
    assert!(!capture.photo_points.is_empty() && alone.photo_points.is_empty() && alone.cameras.len() == 4);
    assert_eq!(capture.points, alone.points);
    assert_eq!(capture.extent().center, alone.extent().center);
    assert_eq!((capture.lens_views().len(), alone.lens_views().len()), (3, 3));
    // Any part of the clip has them, unless somebody leaves them out.
    let part = CaptureSettings { frames: Frames { from: 2, ..Frames::default() }, ..CaptureSettings::default() };
    let part = Capture::open_with(&folder.0, &part).unwrap();
    assert_eq!((part.n_frames, part.training_frames().len()), (2, 9));
    let without = part.without_photos();
    assert_eq!((without.cameras.len(), without.training_frames().len()), (7, 6));
}

#[test]
fn photographs_are_of_one_moment_and_have_none_themselves() {
    let folder = clip("photos-faults");
    let photos = folder.0.join("photos");
    let says = |change: &dyn Fn(&mut Manifest), expected: &str| {
        let before = Manifest::read(&photos).unwrap();
        let mut manifest = before.clone();
        change(&mut manifest);
        manifest.write(&photos).unwrap();
        let told = told(&check_capture(&folder.0, &CaptureSettings::default()));
        assert!(told.contains(expected), "{expected}: {told}");
        before.write(&photos).unwrap();
    };
    says(&|manifest| manifest.frames = 2, "has 2 frames; photographs are a capture of one frame");
    says(&|manifest| manifest.photos = true, "has photos itself");
    std::fs::remove_file(photos.join("images/photo01/00000.png")).unwrap();
    assert!(told(&folder.check()).contains("photo01"));
    std::fs::remove_dir_all(&photos).unwrap();
    assert!(told(&folder.check()).contains("set photos = false"));
}
