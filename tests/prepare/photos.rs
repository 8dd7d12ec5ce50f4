//! `ivv prepare --static`: photographs of the place of a clip.

use super::{COLMAP, done, ivv_prepare, program, run, settings, video};
use crate::capture::model::{Model, write_to};
use crate::capture::photos::clip;
use crate::capture::{assert_told, encode, png};
use crate::common::prelude::*;
use ivv::internals::prepare::prepare;
use ivv::internals::scene::capture::Alpha;

/// A model of these images, each a camera of its own, in a folder.
fn model(folder: &Folder, name: &str, images: &[&'static str]) {
    let turn = [1.0, 0.0, 0.0, 0.0];
    let of = |(k, image): (usize, &&'static str)| {
        let id = k as u32 + 1;
        (id, turn, [k as f64, 0.0, 0.0], id, *image, vec![])
    };
    let images: Vec<_> = images.iter().enumerate().map(of).collect();
    let camera = |(id, .., name, _): &(u32, [f64; 4], [f64; 3], u32, &str, Vec<_>)| {
        let (width, height) = if name.starts_with("photos/") { (32_u32, 24_u32) } else { (64, 48) };
        let params = vec![f64::from(width), f64::from(width) / 2.0, f64::from(height) / 2.0, -0.02];
        (*id, 2, "SIMPLE_RADIAL", u64::from(width), u64::from(height), params)
    };
    let model = Model { cameras: images.iter().map(camera).collect(), images, points: vec![] };
    write_to(folder, name, &model);
}

#[test]
fn videos_and_photographs_are_placed_together_and_become_one_capture() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-static");
    let cameras = ["left.jpg", "middle.jpg", "right.jpg"];
    for name in ["left", "middle", "right"] {
        video(&folder.0.join(format!("source/{name}.mp4")), 3);
    }
    for (index, name) in ["a", "b"].iter().enumerate() {
        folder.write(&format!("walk/{name}.png"), png(32, 24, 90 * index as u8));
    }
    model(&folder, "model", &["left.jpg", "middle.jpg", "right.jpg", "photos/a.png", "photos/b.png"]);
    model(&folder, "of-cameras", &cameras);
    model(&folder, "of-photos", &["photos/a.png", "photos/b.png"]);
    program(&folder, "colmap", COLMAP);
    let walk = folder.path("walk");
    let options = ["--static", &walk, "--triangulate", "none", "--frames", "2"];
    let output = ivv_prepare(&folder, &options);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    assert!(told.contains("COLMAP places 5 pictures, matching 10 pairs"), "{told}");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("placed 3 of 3 pictures") && said.contains("2 of 2 photographs of the place"), "{said}");
    let read = |name: &str| std::fs::read_to_string(folder.0.join(name)).unwrap();
    let calls = read("calls");
    // Cameras of a rig differ; photographs of one size are of one camera.
    let singles: Vec<bool> = calls.lines().take(2).map(|call| call.contains("single_camera 1")).collect();
    assert_eq!(singles, [false, true], "{calls}");
    assert_eq!(read("listed"), "left.jpg\nmiddle.jpg\nright.jpg\nphotos/a.png\nphotos/b.png\n");
    assert_eq!(read("deleted"), "photos/a.png\nphotos/b.png\nleft.jpg\nmiddle.jpg\nright.jpg\n");
    let capture = Capture::open(folder.0.join("out")).unwrap();
    let of =
        |is_photo: bool| capture.cameras.iter().filter(|c| c.is_photo == is_photo).map(|c| c.shots.len()).collect();
    let (clip, photos): (Vec<usize>, Vec<usize>) = (of(false), of(true));
    assert_eq!((clip, photos, capture.n_frames), (vec![2, 2, 2], vec![1, 1], 2));
    // The picture is the photograph's, without its distortion.
    let [r, ..] = capture.picture(4, 0).unwrap().pixels[0].to_le_bytes();
    assert!((90..120).contains(&r), "{r}");
    // A second run asks COLMAP for nothing.
    assert!(ivv_prepare(&folder, &options).status.success());
    assert_eq!(read("calls"), calls);
}

#[test]
fn photographs_of_a_capture_stay_with_it() {
    let (folder, clip) = (Folder::new("prepare-static-capture"), clip("prepare-static-source"));
    let half = PrepareSettings { source: clip.0.clone(), scale: 0.5, ..settings(&folder) };
    let capture = {
        done(&half);
        Capture::open(&half.output).unwrap()
    };
    let whole = Capture::open(&clip.0).unwrap();
    assert_eq!((capture.cameras.len(), capture.photo_points.len()), (whole.cameras.len(), whole.photo_points.len()));
    let (photo, of_whole) = (&capture.cameras[5], &whole.cameras[5]);
    assert!(photo.is_photo && photo.world_to_camera == of_whole.world_to_camera);
    assert_eq!(2 * photo.intrinsics.width, of_whole.intrinsics.width);
    // Given from elsewhere, in the same world.
    let manifest = clip.0.join("capture.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text.replace("photos = true\n", "")).unwrap();
    let photos = Some(clip.0.join("photos"));
    let given = PrepareSettings { source: clip.0.clone(), output: folder.0.join("given"), photos, ..settings(&folder) };
    done(&given);
    assert_eq!(Capture::open(&given.output).unwrap().cameras.len(), 7);
    let without = PrepareSettings { photos: None, output: folder.0.join("without"), ..given };
    done(&without);
    assert_eq!(Capture::open(&without.output).unwrap().cameras.len(), 4);
}

#[test]
fn photographs_are_checked_before_anything_is_made_and_read_as_is_asked() {
    let (folder, clip) = (Folder::new("prepare-static-read"), clip("prepare-static-read-source"));
    model(&folder, "walk/sparse/0", &["a.png", "b.png", "c.png"]);
    let half: Vec<u8> = (0..64 * 48).flat_map(|i| [200, 100, 50, if i % 64 < 32 { 255 } else { 0 }]).collect();
    folder.write("walk/images/a.png", encode(&half, 64, 48, ExtendedColorType::Rgba8));
    folder.write("walk/images/b.png", png(32, 48, 0));
    let photos = Some(folder.0.join("walk"));
    let given = PrepareSettings { source: clip.0.clone(), photos, ..settings(&folder) };
    let (prepared, pieces) = run(&given).unwrap();
    let says = ["is calibrated for 64 x 48, its pictures are 32 x 48", "c.png: is missing"];
    assert_told(&prepared.report, &says);
    assert!(pieces.is_empty() && !given.output.exists(), "{pieces:?}");
    let capture =
        CaptureSettings { skip_missing: true, rescale: true, alpha: Alpha::Mask, ..CaptureSettings::default() };
    let asked = PrepareSettings { capture, ..given };
    done(&asked);
    let capture = Capture::open(&asked.output).unwrap();
    assert_eq!(capture.cameras.iter().filter(|camera| camera.is_photo).count(), 2);
    assert!(asked.output.join("photos/foreground/a/00000.png").is_file());
}

#[test]
fn photographs_that_do_not_suit_the_source_are_told() {
    let (folder, clip) = (Folder::new("prepare-static-faults"), clip("prepare-static-faults-source"));
    for name in ["a", "b", "c"] {
        folder.write(&format!("walk/{name}.png"), png(32, 24, 0));
    }
    folder.write("videos/left.mp4", "");
    let walk = folder.0.join("walk");
    let says = |source: &Path, photos: &Path, expected: &str| {
        let (source, photos) = (source.to_owned(), Some(photos.to_owned()));
        let told = prepare(&PrepareSettings { source, photos, ..settings(&folder) }, &|_| {}).unwrap_err().to_string();
        assert!(told.contains(expected) && !folder.0.join("out").exists(), "{expected}: {told}");
    };
    says(&clip.0, &walk, "has no cameras, and the source has some");
    says(&walk, &walk, "this source is photographs itself");
    says(&folder.0.join("videos"), &clip.0.join("photos"), "is no folder of photographs without cameras");
    says(&folder.0.join("videos"), &folder.0.join("nowhere"), "is no folder of photographs");
}
