//! Pictures without cameras: photos, a video, a folder of videos; and what a source is taken for.

use super::sources::{IDENTITY, transforms};
use super::{calls, done, ivv_in, ivv_prepare, program, run, settings, video};
use crate::capture::model::{Model, write_to};
use crate::capture::{assert_told, png, told};
use crate::common::prelude::*;
use ivv::internals::prepare::{forecast, prepare, recognise};

/// A program in the place of COLMAP that writes what it is called with, tells progress as COLMAP does, and has the mapper find
/// the model in `model/`.
pub(super) fn stand_in(folder: &Folder) {
    let script = "#!/bin/sh\nhere=$(dirname \"$0\")/..\necho \"$@\" >>\"$here/calls\"\n\
        case $1 in\nfeature_extractor) echo 'Processed file [1/4]'; echo 'Processed file [4/4]';;\n\
        exhaustive_matcher) echo 'Matching block [1/1, 1/1] in 0.1s';;\n\
        mapper) while [ \"$1\" != --output_path ]; do shift; done\n\
        mkdir -p \"$2/0\" \"$2/1\"; cp \"$here\"/small/* \"$2/0\"; cp \"$here\"/model/* \"$2/1\"\n\
        echo 'Registering image #4 (4)';;\nesac\n";
    program(folder, "colmap", script);
}

/// The models that the stand-in finds: one of three pictures of the four, and a smaller one.
pub(super) fn models(folder: &Folder, names: [&'static str; 3]) {
    let turn = [1.0, 0.0, 0.0, 0.0];
    let images = |n: usize| {
        let image = |k: usize| (k as u32 + 1, turn, [k as f64, 0.0, 0.0], 1, names[k], vec![]);
        (0..n).map(image).collect::<Vec<_>>()
    };
    for (part, n) in [("model", 3), ("small", 2)] {
        let points = vec![(5, [0.5, 0.0, 4.0], [9, 8, 7], 0.1, vec![(1, 0), (2, 0)])];
        let camera = (1, 2, "SIMPLE_RADIAL", 64, 48, vec![60.0, 32.0, 24.0, -0.02]);
        let model = Model { cameras: vec![camera], images: images(n), points };
        write_to(folder, part, &model);
    }
}

fn photos(folder: &Folder) {
    for (index, name) in ["a", "b", "c", "d"].iter().enumerate() {
        folder.write(&format!("source/{name}.png"), png(64, 48, 20 * index as u8));
    }
}

#[test]
fn photos_become_a_capture() {
    let folder = Folder::new("prepare-photos");
    photos(&folder);
    models(&folder, ["a.png", "b.png", "d.png"]);
    stand_in(&folder);
    let out = folder.0.join("out");
    let output = ivv_prepare(&folder, &[]);
    let (said, told) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{told}");
    // How long it will take comes first.
    let first = told.lines().next().unwrap();
    assert!(first.contains("COLMAP places 4 pictures, matching 6 pairs, in about "), "{first}");
    assert!(told.contains("features 4/4") && told.contains("matches 1/1"), "{told}");
    assert!(
        said.contains("COLMAP placed 3 of 4 pictures") && said.contains("left out") && said.contains("c.png"),
        "{said}"
    );
    let calls = calls(&folder);
    let verbs: Vec<&str> = calls.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(verbs, ["feature_extractor", "exhaustive_matcher", "mapper"]);
    assert!(
        calls.lines().take(2).all(|line| line.contains("use_gpu 0")) && calls.contains("single_camera 1"),
        "{calls}"
    );
    let capture = Capture::open(&out).unwrap();
    let names: Vec<_> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "d"]);
    assert_eq!((capture.n_frames, capture.points.len(), capture.cameras[2].world_to_camera.translation.x), (1, 1, 2.0));
    // The distortion is undone, and the picture is the photo's.
    assert_eq!(capture.cameras[0].intrinsics.fx, 60.0);
    let [r, ..] = capture.picture(1, 0).unwrap().pixels[0].to_le_bytes();
    assert!((20..40).contains(&r), "{r}");
    // A second run asks COLMAP for nothing.
    assert!(ivv_prepare(&folder, &[]).status.success());
    assert_eq!(self::calls(&folder), calls);
}

#[test]
fn photos_that_cannot_be_placed_are_told() {
    let folder = Folder::new("prepare-unplaced");
    photos(&folder);
    models(&folder, ["a.png", "b.png", "d.png"]);
    stand_in(&folder);
    for stem in ["cameras", "images", "points3D"] {
        std::fs::rename(folder.0.join(format!("small/{stem}.bin")), folder.0.join(format!("model/{stem}.bin")))
            .unwrap();
    }
    std::fs::write(folder.0.join("small/none"), "").unwrap();
    let output = ivv_prepare(&folder, &[]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(told.contains("COLMAP cannot place") && told.contains("overlap"), "{told}");
}

#[test]
fn videos_of_one_moment_become_a_capture_of_their_frames() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-videos");
    for name in ["left", "middle", "right"] {
        video(&folder.0.join(format!("source/{name}.mp4")), 3);
    }
    models(&folder, ["left.jpg", "middle.jpg", "right.jpg"]);
    stand_in(&folder);
    let out = folder.0.join("out");
    let output = ivv_prepare(&folder, &["--triangulate", "none", "--frames", "2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let calls = calls(&folder);
    assert!(calls.contains("single_camera 0"), "{calls}");
    let capture = Capture::open(&out).unwrap();
    assert_eq!((capture.cameras.len(), capture.n_frames, capture.fps), (3, 2, 10.0));
    // A forecast is made in this process, whose path has no stand-in.
    if has_program("colmap") {
        let forecast = forecast(&PrepareSettings::new(&folder.0.join("source"), &out)).unwrap().unwrap();
        assert_eq!((forecast.what, forecast.pictures, forecast.pairs), ("a folder of videos", 3, 3));
    }
}

#[test]
fn a_video_of_what_stands_still_becomes_a_capture_of_one_moment() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-walk");
    video(&folder.0.join("walk.mp4"), 4);
    models(&folder, ["00000.jpg", "00001.jpg", "00003.jpg"]);
    stand_in(&folder);
    // Names relative to the folder in which the command is given.
    let output = ivv_in(&folder).args(["prepare", "walk.mp4", "-o", "out"]).current_dir(&folder.0).output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(told.starts_with("a video without cameras: COLMAP places 4 pictures, matching 6 pairs"), "{told}");
    let calls = calls(&folder);
    assert!(calls.lines().nth(1).unwrap().starts_with("sequential_matcher"), "{calls}");
    let capture = Capture::open(folder.0.join("out")).unwrap();
    let names: Vec<_> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!((names.as_slice(), capture.n_frames), (["00000", "00001", "00003"].as_slice(), 1));
}

#[test]
fn what_is_no_capture_yet_is_told_by_its_name_and_the_command() {
    let folder = Folder::new("prepare-names");
    folder.write("photos/a.png", png(6, 4, 0));
    folder.write("photos/b.png", png(6, 4, 0));
    // As phones do.
    folder.write("photos/a.mov", "");
    folder.write("n3v/poses_bounds.npy", "");
    folder.write("caliscope/camera_array.toml", "");
    folder.write("p2s/calibration/Calib.toml", "");
    folder.write("videos/a.mp4", "");
    // A still of each video is no photo of a phone.
    ["a.mp4", "a.png", "b.mp4", "b.png"].iter().for_each(|name| drop(folder.write(&format!("stills/{name}"), "")));
    folder.write("one.MOV", "");
    folder.write("capture/capture.toml", "");
    folder.write("capture/a.png", png(6, 4, 0));
    folder.write("capture/b.png", png(6, 4, 0));
    for (name, what) in [
        ("photos", "photos"),
        ("n3v", "a N3V recording"),
        ("caliscope", "a caliscope recording"),
        ("p2s", "a Pose2Sim recording"),
        ("videos", "a folder of videos"),
        ("stills", "a folder of videos"),
        ("one.MOV", "a video"),
    ] {
        let path = folder.0.join(name);
        let known = recognise(&path).unwrap();
        assert_eq!((known.what.as_str(), &known.source), (what, &path));
        for verb in ["check", "train"] {
            let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
            command.arg(verb).arg(&path);
            let run = folder.0.join("run");
            let output = if verb == "train" { command.arg("-o").arg(&run) } else { &mut command }.output().unwrap();
            let told = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap()).concat();
            assert_eq!(output.status.code(), Some(3), "{told}");
            let command = format!("`ivv prepare {} -o CAPTURE`", path.display());
            assert!(told.contains(&format!("found {what}")) && told.contains(&command), "{told}");
            assert!(!run.exists());
        }
    }
    assert_eq!((recognise(&folder.0.join("capture")), recognise(&folder.0.join("nowhere"))), (None, None));
}

fn model(folder: &Folder, to: &str, names: &[&'static str]) {
    let image = |(id, name): (u32, &&'static str)| (id, IDENTITY, [f64::from(id), 0.0, 0.0], 1, *name, vec![]);
    let images = (1..).zip(names).map(image).collect();
    let cameras = vec![(1, 1, "PINHOLE", 64, 48, vec![60.0, 60.0, 32.0, 24.0])];
    write_to(folder, to, &Model { cameras, images, points: vec![] });
}

/// A plain COLMAP project of these images, and of others that were not placed.
fn project(folder: &Folder, placed: &[&'static str], others: &[&'static str]) {
    model(folder, "source/sparse/0", placed);
    for name in placed.iter().chain(others) {
        folder.write(&format!("source/images/{name}"), png(64, 48, 0));
    }
}

#[test]
fn a_film_or_a_folder_of_one_placed_image_makes_no_rig_of_a_project() {
    let live = Folder::new("prepare-live");
    project(&live, &["IMG_6.png", "IMG_7.png", "IMG_8.png"], &[]);
    live.write("source/images/IMG_7.MOV", "");
    assert_eq!(done(&settings(&live)).source_format, "COLMAP");
    // Every photo has its film.
    ["6", "8"].iter().for_each(|number| drop(live.write(&format!("source/images/IMG_{number}.MOV"), "")));
    let all = PrepareSettings { output: live.0.join("all"), ..settings(&live) };
    assert_eq!(done(&all).source_format, "COLMAP");

    let days = Folder::new("prepare-days");
    let placed = ["day1/IMG_1.png", "day1/IMG_2.png", "day1/IMG_3.png", "day2/IMG_4.png"];
    project(&days, &placed, &["day2/IMG_5.png", "day2/IMG_6.png"]);
    let prepared = done(&settings(&days));
    assert_eq!((prepared.source_format, prepared.report.n_images), ("COLMAP", 4));

    // A rig stays one, where a camera has lost its video and where the images of the model are there too.
    let rig = Folder::new("prepare-stills");
    project(&rig, &["left.png", "middle.png", "right.png"], &[]);
    ["left", "right"].iter().for_each(|name| drop(rig.write(&format!("source/{name}.mp4"), "")));
    assert_eq!(recognise(&rig.0.join("source")).unwrap().what, "a COLMAP rig recording");
}

/// Two of five cameras have footage, and stills of all are where a plain project has its images.
#[test]
fn a_rig_most_of_whose_footage_is_missing_is_told() {
    for (name, place) in [("prepare-lost", "source"), ("prepare-lost-elsewhere", "footage")] {
        let folder = Folder::new(name);
        project(&folder, &["cam0.png", "cam1.png", "cam2.png", "cam3.png", "cam4.png"], &[]);
        for image in ["cam0/0.png", "cam0/1.png", "cam1/0.png", "cam1/1.png", "cam_2/0.png", "cam_2/1.png"] {
            folder.write(&format!("{place}/{image}"), png(64, 48, 0));
        }
        let footage = (place == "footage").then(|| folder.0.join(place));
        let (prepared, _) = run(&PrepareSettings { footage, ..settings(&folder) }).unwrap();
        let says = ["2", "3", "4"].map(|k| format!("camera `cam{k}`: has neither a video nor images"));
        assert_told(&prepared.report, &says.each_ref().map(String::as_str));
        assert_eq!((prepared.source_format, prepared.report.n_faults), ("COLMAP rig", 3));
        assert!(prepared.notes.iter().any(|note| note.contains("out of the source")), "{:?}", prepared.notes);
    }
}

#[test]
fn footage_that_was_given_is_not_asked_for() {
    let folder = Folder::new("prepare-asked");
    project(&folder, &["a.png", "b.png"], &[]);
    folder.write("source/images/film.mp4", "");
    let asks = |settings: &PrepareSettings| {
        let prepared = done(settings);
        assert_eq!(prepared.source_format, "COLMAP");
        prepared.notes.iter().any(|note| note.contains("--footage"))
    };
    let plain = settings(&folder);
    let footage = Some(folder.0.join("source/images"));
    let given = PrepareSettings { footage, output: folder.0.join("given"), ..plain.clone() };
    assert!(asks(&plain) && !asks(&given));
}

#[test]
fn smaller_images_are_of_a_plain_colmap_project_alone() {
    let folder = Folder::new("prepare-downscale");
    (0..2).for_each(|i| drop(folder.write(&format!("transforms/images/{i:04}.png"), png(64, 48, i))));
    folder.write("transforms/transforms.json", transforms(2, |_, _| ()));
    model(&folder, "rig", &["left.png", "right.png"]);
    for image in ["rig/left/0.png", "rig/left/1.png", "rig/right/0.png", "rig/right/1.png"] {
        folder.write(image, png(64, 48, 0));
    }
    ["a", "b"].iter().for_each(|name| drop(folder.write(&format!("photos/{name}.png"), png(64, 48, 0))));
    for source in ["transforms", "rig", "photos"].map(|name| folder.0.join(name)) {
        let capture = CaptureSettings { downscale: Some(4), ..CaptureSettings::default() };
        let given = PrepareSettings { source, capture, ..settings(&folder) };
        let told = run(&given).map_or_else(|error| error.to_string(), |(prepared, _)| told(&prepared.report));
        assert!(told.contains("--downscale: is for a plain COLMAP project"), "{}: {told}", given.source.display());
        assert!(!given.output.exists());
    }
}

/// COLMAP itself, on seven photos.
#[test]
#[ignore = "slow: all of COLMAP on seven photographs"]
fn colmap_places_photos() {
    let Some(source) = shared("data/colmap_simple_radial_7img/images") else { return };
    needs!("colmap");
    let folder = Folder::new("prepare-colmap");
    let settings = PrepareSettings { source, scale: 0.25, triangulate: None::<Triangulate>, ..settings(&folder) };
    let prepared = prepare(&settings, &|_| {}).unwrap();
    assert_eq!(crate::capture::told(&prepared.report), "");
    assert_eq!((prepared.source_format, prepared.report.n_cameras), ("photos", 7));
    assert!(prepared.report.n_points > 500, "{:?}", prepared.report);
    assert!(Manifest::read(&settings.output).is_ok());
}
