//! Where footage lies and in what form: a folder for each camera, chapters of a take, sequences of pictures that ffmpeg reads, masks.

use super::sources::{IDENTITY, sequence};
use super::{done, run, settings, video};
use crate::capture::model::{Model, write_cameras};
use crate::capture::{assert_told, encode, png};
use crate::common::prelude::*;
use ivv::internals::prepare::recognise;

/// A calibration of cameras of 64 x 48 in COLMAP's files, without points.
fn rig(folder: &str, names: &[&'static str]) -> Folder {
    let folder = Folder::new(folder);
    let image = |(id, name): (u32, &&'static str)| (id, IDENTITY, [f64::from(id), 0.0, 1.0], 1, *name, vec![]);
    let cameras = vec![(1, 1, "PINHOLE", 64, 48, vec![60.0, 60.0, 32.0, 24.0])];
    let model = Model { cameras, images: (1..).zip(names).map(image).collect(), points: vec![] };
    write_cameras(&folder, "source", &model);
    folder
}

fn ffmpeg(arguments: &[&str], to: &Path) {
    std::fs::create_dir_all(to.parent().unwrap()).unwrap();
    let mut command = Command::new("ffmpeg");
    assert!(command.args(["-v", "error", "-y"]).args(arguments).arg(to).status().unwrap().success());
}

/// A picture of the test film at a second, in the format that the ending asks for.
fn still(to: &Path, second: &str, options: &[&str]) {
    let film = ["-f", "lavfi", "-i", "testsrc=size=64x48:rate=10", "-ss", second, "-frames:v", "1"];
    ffmpeg(&[&film[..], options].concat(), to);
}

#[test]
fn a_folder_of_each_camera_has_its_clip() {
    needs!("ffmpeg");
    let folder = rig("prepare-folders", &["a.jpg", "b.jpg"]);
    video(&folder.0.join("source/a/GX010123.MP4"), 4);
    // The second camera's take goes on in a further chapter.
    video(&folder.0.join("source/b/GX010007.MP4"), 2);
    let negative = ["-f", "lavfi", "-i", "testsrc=size=64x48:rate=10", "-vf", "negate"];
    let short = ["-frames:v", "3", "-c:v", "mpeg4", "-q:v", "2"];
    ffmpeg(&[negative, short].concat(), &folder.0.join("source/b/GX020007.MP4"));
    let settings = settings(&folder);
    let prepared = done(&settings);
    assert_eq!((prepared.source_format, prepared.report.n_frames), ("COLMAP rig", 4));
    let notes = prepared.notes.join("\n");
    assert!(notes.contains("2 chapters of one take are joined: GX010007.MP4, GX020007.MP4"), "{notes}");
    assert!(notes.contains("4 (`a`) to 5 (`b`)"), "{notes}");
    let capture = Capture::open(&settings.output).unwrap();
    let first = |camera, frame| capture.picture(camera, frame).unwrap().pixels[0].to_le_bytes()[0];
    // What was bright is dark in the second chapter, whose first frame is the third.
    assert!(first(0, 2).abs_diff(first(1, 2)) > 100 && first(0, 1).abs_diff(first(1, 1)) < 8);
    // A second run has nothing to do, and knows when a later chapter has changed.
    assert!(run(&settings).is_ok());

    // Two takes are not one clip.
    std::fs::rename(folder.0.join("source/b/GX020007.MP4"), folder.0.join("source/b/GX010008.MP4")).unwrap();
    let two = PrepareSettings { output: folder.0.join("two"), ..settings };
    assert_told(&run(&two).unwrap().0.report, &["has 2 clips in", "GX010007.MP4, GX010008.MP4", "ffmpeg -f concat"]);
}

#[test]
fn folders_of_clips_without_calibration_are_cameras() {
    let folder = Folder::new("prepare-clips");
    ["a/GX010001.MP4", "a/GX020001.MP4", "b/GX010001.MP4"].iter().for_each(|name| drop(folder.write(name, "")));
    assert_eq!(recognise(&folder.0).unwrap().what, "a folder of videos");
}

#[test]
fn of_two_videos_of_a_camera_one_is_named() {
    needs!("ffmpeg");
    let folder = rig("prepare-twins", &["a.jpg", "b.jpg"]);
    ["a.mp4", "a.mov", "b.mp4"].iter().for_each(|name| video(&folder.0.join("source").join(name), 2));
    let notes = done(&settings(&folder)).notes.join("\n");
    assert!(notes.contains("a.mp4 is taken; a.mov lies beside it"), "{notes}");
}

#[test]
fn sequences_that_ffmpeg_reads_are_converted() {
    needs!("ffmpeg");
    let folder = rig("prepare-sequences", &["png.png", "tif.png", "dpx.png", "exr.png", "webp.png"]);
    let source = folder.0.join("source");
    for (index, second) in ["0", "0.1"].iter().enumerate() {
        let place = |kind: &str| source.join(format!("{kind}/{index:04}.{kind}"));
        still(&place("png"), second, &[]);
        still(&place("tif"), second, &["-pix_fmt", "rgb48le"]);
        still(&place("dpx"), second, &[]);
        still(&place("webp"), second, &["-lossless", "1"]);
        // Linear light, as OpenEXR holds it.
        let linear = "format=gbrpf32le,geq=r='pow(r(X,Y),2.2)':g='pow(g(X,Y),2.2)':b='pow(b(X,Y),2.2)'";
        still(&place("exr"), second, &["-vf", linear]);
    }
    let settings = settings(&folder);
    let prepared = done(&settings);
    let notes = prepared.notes.join("\n");
    assert!(notes.contains("2 .tif") && notes.contains("linear, are encoded as sRGB"), "{notes}");
    let capture = Capture::open(&settings.output).unwrap();
    let index = |name: &str| capture.cameras.iter().position(|camera| camera.name == name).unwrap();
    let pixels = |name: &str, frame| capture.picture(index(name), frame).unwrap().pixels;
    assert_ne!(pixels("png", 0), pixels("png", 1));
    for frame in 0..2 {
        for (kind, most) in [("tif", 1.0), ("dpx", 0.0), ("webp", 0.0), ("exr", 1.0)] {
            let pairs = pixels("png", frame).into_iter().zip(pixels(kind, frame));
            let off = pairs.flat_map(|(a, b)| a.to_le_bytes().into_iter().zip(b.to_le_bytes()));
            let off: Vec<f64> = off.map(|(a, b)| f64::from(a.abs_diff(b))).collect();
            // In the mean: single pixels at edges of the pattern become others on ffmpeg's way to linear light.
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            assert!(mean <= most, "{kind} {frame}: off by {mean} levels");
        }
    }
    // What nobody reads is named.
    std::fs::remove_dir_all(source.join("dpx")).unwrap();
    (0..3).for_each(|k| drop(folder.write(&format!("source/dpx/{k}.psd"), "")));
    let other = PrepareSettings { output: folder.0.join("other"), ..settings };
    assert_told(&run(&other).unwrap().0.report, &["camera `dpx`: has neither a video nor images", "holds 3 .psd"]);
}

#[test]
fn masks_of_a_folder_go_with_videos_and_sequences() {
    needs!("ffmpeg");
    let folder = rig("prepare-masks", &["film.png", "seq.png", "bare.png"]);
    video(&folder.0.join("source/film.mp4"), 4);
    sequence(&folder, "seq", 4);
    sequence(&folder, "bare", 4);
    for frame in 0..4_u8 {
        let mask = encode(&vec![10 * frame + 9; 64 * 48], 64, 48, image::ExtendedColorType::L8);
        folder.write(&format!("masks/film/{frame:04}.png"), &mask);
        folder.write(&format!("masks/seq/{frame:04}.png"), mask);
    }
    let settings =
        PrepareSettings { masks: Some(folder.0.join("masks")), frames: "1:4:2".parse().unwrap(), ..settings(&folder) };
    let prepared = done(&settings);
    assert!(
        prepared.notes.iter().any(|note| note.contains("1 of 3 cameras have no masks: bare")),
        "{:?}",
        prepared.notes
    );
    assert_eq!(prepared.report.n_masks, 4);
    for camera in ["film", "seq"] {
        let value = |frame: u32| {
            let mask = image::open(settings.output.join(format!("masks/{camera}/{frame:05}.png"))).unwrap();
            mask.into_luma8().into_raw()[0]
        };
        assert_eq!((value(0), value(1)), (19, 39), "{camera}");
    }
    assert_eq!(check_capture(&settings.output, &CaptureSettings::default()).n_faults, 0);
    // One is missing; they are of another size; there are none.
    let faulty = |says: &str, output: &str| {
        let settings = PrepareSettings { output: folder.0.join(output), ..settings.clone() };
        assert_told(&run(&settings).unwrap().0.report, &[says]);
    };
    folder.write("masks/film/0001.png", png(32, 24, 0));
    faulty("has masks of 32 x 24, the pictures are 64 x 48", "small");
    std::fs::remove_file(folder.0.join("masks/film/0003.png")).unwrap();
    faulty("has 3 masks, but none of frame 3", "gap");
    std::fs::remove_dir_all(folder.0.join("masks")).unwrap();
    faulty("--masks: no such folder", "none");
    // Masks that nobody asked for are named.
    folder.write("source/masks/film/0000.png", png(64, 48, 0));
    let plain = PrepareSettings { masks: None, output: folder.0.join("plain"), ..settings };
    assert!(done(&plain).notes.iter().any(|note| note.contains("are not used: give --masks")));
}

#[test]
fn a_folder_that_is_no_source_is_told_by_what_it_holds() {
    let folder = Folder::new("prepare-unknown");
    let told = |name: &str| {
        let settings = PrepareSettings::new(&folder.0.join(name), &folder.0.join("out"));
        run(&settings).map(|_| ()).unwrap_err().to_string()
    };
    std::fs::create_dir_all(folder.0.join("empty")).unwrap();
    folder.write("one/a.jpg", "");
    folder.write("text/a.pdf", "");
    folder.write("text/b.pdf", "");
    folder.write("card/DCIM/GX010001.MP4", "");
    ["a.png", "b.png", "c.png"].iter().for_each(|name| drop(folder.write(&format!("days/day1/{name}"), png(6, 4, 0))));
    folder.write("days/day2/a.png", png(6, 4, 0));
    folder.write("days/day2/b.png", png(6, 4, 0));
    for (name, says) in [
        ("typo", "no such folder"),
        ("empty", "is empty"),
        ("one", "holds one picture, which is not enough"),
        ("text", "it holds 2 .pdf"),
        ("card", "card/DCIM/GX010001.MP4 (a video)"),
        ("days", "days/day1 (photos)"),
        ("one/a.jpg", "no folder and no video"),
    ] {
        let told = told(name);
        assert!(told.contains(says), "{name}: {told}");
    }
}
