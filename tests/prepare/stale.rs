//! What has changed in the source is told, and made again with `--force`; flow that comes along stays as it is.

use super::sources::IDENTITY;
use super::{COLMAP, calls, done, ivv_prepare, open, program, run, settings, video};
use crate::capture::model::{Model, write_to};
use crate::capture::png;
use crate::common::prelude::*;
use ivv::internals::scene::prior::{write_depth, write_flow, write_flow_halves};
use std::time::SystemTime;

const N: usize = 64 * 48;

/// In the place of Python with OpenCV: it gives the camera that it is called for the flow of `flow.npy`, where a frame has none.
const PYTHON: &str = r#"#!/bin/sh
[ "$1" = - ] || exit 0
cat >/dev/null
here=$(dirname "$0")/..
echo "$6" >>"$here/calls"
mkdir -p "$2/flow/$6"
for frame in 00000 00001; do
    ls "$2/flow/$6/$frame".* >/dev/null 2>&1 || cp "$here/flow.npy" "$2/flow/$6/$frame.npy"
done
"#;

/// Prepares with the programs of the folder; what is told where that fails.
fn prepare(folder: &Folder, options: &[&str]) -> Result<(), String> {
    let output = ivv_prepare(folder, &[&["--triangulate", "none"], options].concat());
    let told = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    output.status.success().then_some(()).ok_or(told)
}

/// A model of images of one lens, with a point, in a folder.
fn model(folder: &Folder, name: &str, images: &[&'static str], x: f64) {
    let camera = |id: u32| (id, 1, "PINHOLE", 64, 48, vec![50.0, 50.0, 32.0, 24.0]);
    let image = |(id, name): (u32, &&'static str)| (id, IDENTITY, [f64::from(id), 0.0, 0.0], id, *name, vec![]);
    let ids = 1..=images.len() as u32;
    let model = Model {
        cameras: ids.clone().map(camera).collect(),
        images: ids.zip(images).map(image).collect(),
        points: vec![(5, [x, 0.5, 4.0], [9, 8, 7], 0.1, vec![(1, 0), (2, 0)])],
    };
    write_to(folder, name, &model);
}

/// A capture folder of two cameras and three frames with depth; those of `with_flow` have flow.
fn capture(test: &str, with_flow: &[&str]) -> Folder {
    let folder = Folder::new(test);
    model(&folder, "source/sparse/0", &["a/00000.png", "b/00000.png"], 0.5);
    for name in ["a", "b"] {
        for frame in 0..3_u8 {
            folder.write(&format!("source/images/{name}/{frame:05}.png"), png(64, 48, frame));
            let depth = folder.write(&format!("source/depth/{name}/{frame:05}.npy"), "");
            write_depth(&depth, &[2.0; N], 64, 48).unwrap();
        }
    }
    for name in with_flow {
        for frame in 0..2 {
            let flow = folder.write(&format!("source/flow/{name}/{frame:05}.flo"), "");
            write_flow(&flow, &[[1.0, 0.0]; N], 64, 48).unwrap();
        }
    }
    let manifest = Manifest { fps: 30.0, frames: 3, depth: true, flow: !with_flow.is_empty(), ..Manifest::default() };
    manifest.write(&folder.0.join("source")).unwrap();
    folder
}

fn write_point(path: &Path, x: f64) {
    let point = SeenPoint { position: [x, 0.5, 4.0], rgb: [9, 8, 7], camera_ids: vec![1, 2] };
    write_points(path, &[point]).unwrap();
}

/// The journal counts seconds: so a file is changed later than it was made, as it would be.
fn date(path: &Path) {
    let file = File::options().write(true).open(path).unwrap();
    file.set_modified(SystemTime::now() + Duration::from_secs(60)).unwrap();
}

/// Prepares again what was made from something else. That is told, and needs force once.
fn made_again(settings: &PrepareSettings, what: &str) -> Capture {
    let told = run(settings).unwrap_err().to_string();
    let says = format!("was made with other settings: {what} have changed");
    assert!(told.contains(&says) && told.contains("--force"), "{told}");
    done(&PrepareSettings { force: true, ..settings.clone() });
    open(settings)
}

#[test]
fn what_comes_along_from_a_capture_is_as_new_as_there() {
    let folder = capture("prepare-stale-along", &["a"]);
    let source = |name: &str| folder.0.join("source").join(name);
    for frame in 0..3 {
        write_point(&folder.write(&format!("source/points/{frame:05}.ply"), ""), 0.5);
    }
    Manifest { points: true, ..Manifest::read(&source("")).unwrap() }.write(&source("")).unwrap();
    folder.write("source/audio/room.wav", "RIFF....WAVE");
    folder.write("source/keypoints/a.json", "[]");
    let settings = PrepareSettings { triangulate: None, ..settings(&folder) };
    done(&settings);

    write_point(&source("points/00000.ply"), 7.0);
    date(&source("points/00000.ply"));
    let capture = made_again(&settings, "source points");
    assert_eq!(capture.points_of(0).unwrap()[0].position, [7.0, 0.5, 4.0]);
    assert_eq!((capture.points[0].position[0], capture.points_of(1).unwrap()[0].position[0]), (7.0, 0.5));

    write_depth(&source("depth/b/00001.npy"), &[5.0; N], 64, 48).unwrap();
    date(&source("depth/b/00001.npy"));
    let capture = made_again(&settings, "priors");
    let depth = read_depth(capture.cameras[1].shots[1].depth.as_ref().unwrap(), 64, 48).unwrap();
    assert!(depth == [5.0; N]);

    write_flow(&source("flow/a/00000.flo"), &[[3.0, 0.0]; N], 64, 48).unwrap();
    date(&source("flow/a/00000.flo"));
    let capture = made_again(&settings, "priors");
    let flow = read_flow(capture.cameras[0].shots[0].flow.as_ref().unwrap(), 64, 48).unwrap();
    assert!(flow == [[3.0, 0.0]; N]);

    let read = |name: &str| std::fs::read_to_string(settings.output.join(name)).unwrap();
    date(&folder.write("source/audio/room.wav", "RIFF,,,,WAVE"));
    made_again(&settings, "its files");
    assert_eq!(read("audio/room.wav"), "RIFF,,,,WAVE");
    folder.write("source/keypoints/a.json", r#"[{"frame_id": 1, "instances": []}]"#);
    made_again(&settings, "its files");
    assert!(read("keypoints/a.json").contains("frame_id"));
    // What is new beside the pictures comes along without more ado.
    folder.write("source/keypoints/b.json", "[]");
    done(&settings);
    assert_eq!(read("keypoints/b.json"), "[]");
}

/// Points that are not of single frames are compared themselves: each format has them elsewhere.
#[test]
fn points_of_a_model_are_as_new_as_there() {
    let folder = capture("prepare-stale-model", &[]);
    let settings = PrepareSettings { triangulate: None, ..settings(&folder) };
    assert_eq!(open(&settings).points[0].position, [0.5, 0.5, 4.0]);
    model(&folder, "source/sparse/0", &["a/00000.png", "b/00000.png"], 3.0);
    assert_eq!(made_again(&settings, "source points").points[0].position, [3.0, 0.5, 4.0]);
}

#[test]
fn flow_that_comes_along_is_not_estimated() {
    let folder = capture("prepare-stale-flow", &["a", "b"]);
    for (name, scale, ending) in [("whole", 1.0, "flo"), ("half", 0.5, "npy")] {
        let output = folder.0.join(name);
        let settings = PrepareSettings { flow: true, scale, output, ..settings(&folder) };
        let flow = || std::fs::read(settings.output.join(format!("flow/b/00001.{ending}"))).unwrap();
        done(&settings);
        let before = flow();
        done(&PrepareSettings { force: true, ..settings.clone() });
        done(&settings);
        assert!(flow() == before, "{name}");
    }
}

#[test]
fn flow_is_estimated_beside_that_which_comes_along() {
    let folder = capture("prepare-stale-beside", &["a"]);
    program(&folder, "python3", PYTHON);
    write_flow_halves(&folder.write("flow.npy", ""), &[[2.0, 0.0]; N], 64, 48).unwrap();
    let read = |name: &str| std::fs::read(folder.0.join(name)).unwrap();
    let is_whole = || {
        let is_same = |from: &str, to: &str| read(from) == read(&format!("out/flow/{to}"));
        is_same("source/flow/a/00001.flo", "a/00001.flo") && is_same("flow.npy", "b/00001.npy")
    };
    prepare(&folder, &["--flow", "dis"]).unwrap();
    assert!(is_whole());
    prepare(&folder, &["--flow", "dis", "--force"]).unwrap();
    assert!(is_whole() && calls(&folder) == "b\n");
    // As an earlier version that estimated it otherwise.
    let journal = String::from_utf8(read("out/prepare.json")).unwrap();
    folder.write("out/prepare.json", journal.replace("full resolution", "half resolution"));
    let told = prepare(&folder, &["--flow", "dis"]).unwrap_err();
    assert!(told.contains("flow/b: was made with other settings: method was"), "{told}");
    prepare(&folder, &["--flow", "dis", "--force"]).unwrap();
    assert!(is_whole() && calls(&folder) == "b\nb\n");
}

#[test]
fn flow_that_comes_along_in_part_is_completed() {
    let folder = capture("prepare-stale-part", &["b"]);
    program(&folder, "python3", PYTHON);
    for (name, x) in [("flow.npy", 2.0), ("source/flow/a/00000.npy", 1.0)] {
        write_flow_halves(&folder.write(name, ""), &[[x, 0.0]; N], 64, 48).unwrap();
    }
    // No folder holds flow of two kinds.
    let (last, away) = (folder.0.join("source/flow/b/00001.flo"), folder.0.join("away"));
    std::fs::rename(&last, &away).unwrap();
    let told = prepare(&folder, &["--flow", "dis"]).unwrap_err();
    assert!(told.contains("flow/b/00000.flo: is flow of some frames") && !folder.0.join("out").exists(), "{told}");
    std::fs::rename(&away, &last).unwrap();
    let read = |name: &str| std::fs::read(folder.0.join(name)).unwrap();
    for options in [&["--flow", "dis"][..], &["--flow", "dis"], &["--flow", "dis", "--force"]] {
        prepare(&folder, options).unwrap();
        assert!(read("out/flow/a/00000.npy") == read("source/flow/a/00000.npy"), "{options:?}");
        assert!(read("out/flow/a/00001.npy") == read("flow.npy"), "{options:?}");
        assert_eq!(calls(&folder), "a\n", "{options:?}");
    }
}

/// Asserts that the pictures are placed again once `what` has changed: for the `n`-th time.
fn placed_again(folder: &Folder, options: &[&str], what: &str, n: usize) {
    let told = prepare(folder, options).unwrap_err();
    assert!(told.contains(&format!("was made with other settings: {what} have changed")), "{told}");
    let n_placed = || calls(folder).lines().filter(|call| call.starts_with("mapper")).count();
    assert_eq!(n_placed(), n - 1);
    prepare(folder, &[options, &["--force"]].concat()).unwrap();
    prepare(folder, options).unwrap();
    assert_eq!(n_placed(), n);
}

#[test]
fn photos_that_have_changed_are_placed_again() {
    let folder = Folder::new("prepare-stale-photos");
    program(&folder, "colmap", COLMAP);
    ["a", "b", "c"].iter().for_each(|name| drop(folder.write(&format!("source/{name}.png"), png(64, 48, 0))));
    model(&folder, "model", &["a.png", "b.png", "c.png"], 0.5);
    prepare(&folder, &[]).unwrap();
    folder.write("source/d.png", png(64, 48, 9));
    placed_again(&folder, &[], "pictures", 2);
    date(&folder.write("source/a.png", png(64, 48, 40)));
    placed_again(&folder, &[], "pictures", 3);
}

#[test]
fn videos_and_photographs_that_have_changed_are_placed_again() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-stale-videos");
    program(&folder, "colmap", COLMAP);
    let (cameras, photos) = (["left.jpg", "middle.jpg", "right.jpg"], ["photos/a.png", "photos/b.png"]);
    ["left", "middle", "right"].iter().for_each(|name| video(&folder.0.join(format!("source/{name}.mp4")), 3));
    ["a", "b"].iter().for_each(|name| drop(folder.write(&format!("walk/{name}.png"), png(64, 48, 0))));
    model(&folder, "model", &[&cameras[..], &photos].concat(), 0.5);
    model(&folder, "of-cameras", &cameras, 0.5);
    model(&folder, "of-photos", &photos, 0.5);
    let walk = folder.0.join("walk").display().to_string();
    let options = ["--frames", "2", "--static", &walk];
    prepare(&folder, &options).unwrap();
    folder.write("walk/c.png", png(64, 48, 9));
    placed_again(&folder, &options, "photos", 2);
    video(&folder.0.join("source/left.mp4"), 4);
    placed_again(&folder, &options, "pictures", 3);
}
