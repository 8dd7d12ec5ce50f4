//! Runs that are looked at: rendered from their own cameras, and before they have ended.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::{command, json};
use ivv::internals::sound::rig::Rig;
use ivv::internals::train::spread;

/// Trains so shortly in `tiny.folder/run` that little is learnt; the near plane cuts away much of what is there.
fn short_run(tiny: &Tiny) -> std::path::PathBuf {
    let run = tiny.folder.join("run");
    let train = ["train", text(&tiny.folder), "-o", text(&run), "--steps", "12", "--sh-degree", "0", "--near", "2.9"];
    works(&train);
    run
}

fn difference(a: &Path, b: &Path) -> f64 {
    let [a, b] = [a, b].map(|file| image::open(file).unwrap().to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: f64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.as_raw().len() as f64
}

fn pictures(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

fn name(capture: &Capture, camera: usize, frame: u32) -> String {
    capture.view(camera, frame).unwrap().name
}

#[test]
fn a_run_is_rendered_from_its_own_cameras_as_it_was_scored() {
    let tiny = Tiny::new("look");
    let run = short_run(&tiny);
    let scale = Run::read(&run).unwrap().world.scale;
    assert!((scale - 1.0).abs() > 0.05, "the frame of training is another: {scale}");
    let [all, far, raw] = ["all", "far", "raw"].map(|name| tiny.folder.join(name));
    works(&["render", text(&run), "-o", text(&all)]);
    let images: usize = tiny.capture.cameras.iter().map(|camera| camera.shots.len()).sum();
    assert_eq!(pictures(&all).len(), images);

    let (camera, frame) = *tiny.capture.test_frames().last().unwrap();
    let test = tiny.capture.cameras[camera].name.clone();
    let frames = format!("{frame}:");
    let some = ["render", text(&run), "--camera", &test, "--frames", &frames, "-o", text(&far)];
    works(&[&some[..], &["--near", "0.01"]].concat());
    // The number of the frame of training means another depth in the scene's.
    let unscaled = ["render", text(&run), "--camera", &test, "--frames", &frames, "-o", text(&raw), "--near", "2.9"];
    works(&unscaled);
    let file = format!("{}.png", name(&tiny.capture, camera, frame));
    assert_eq!(pictures(&far), std::slice::from_ref(&file), "one camera from its last frame on");
    let scored = run.join("renders").join(&test).join(format!("{frame:05}.png"));
    let [same, without, unscaled] = [&all, &far, &raw].map(|folder| difference(&folder.join(&file), &scored));
    let told = format!("{same} levels by itself, {without} without its near plane, {unscaled} with one not scaled");
    assert!(same < 0.05 && without > 1.0 && unscaled > 0.1, "{told}");

    // The capture has moved.
    let elsewhere = tiny.folder.with_extension("elsewhere");
    let moved = elsewhere.join("run");
    std::fs::rename(&tiny.folder, &elsewhere).unwrap();
    let told = fails(&["render", text(&moved), "-o", text(&far)], 3);
    assert!(told.contains("no such folder") && told.contains("--capture"), "{told}");
    let again = elsewhere.join("again");
    let render = ["render", text(&moved), "--camera", &test, "-o", text(&again), "--capture", text(&elsewhere)];
    works(&render);
    let render = ["render", text(&moved), "--camera", "nobody", "-o", "x", "--capture", text(&elsewhere)];
    let told = fails(&render, 2);
    assert!(told.contains("nobody") && told.contains(&test), "{told}");
    let kept = difference(&again.join(&file), &elsewhere.join("all").join(&file));
    std::fs::remove_dir_all(&elsewhere).unwrap();
    assert_eq!(kept, 0.0);
}

#[test]
fn a_run_that_has_not_ended_is_looked_at_by_its_newest_checkpoint() {
    let tiny = Tiny::new("unfinished");
    let run = short_run(&tiny);
    let (scene, exported) = (run.join("scene.ply"), tiny.folder.join("exported.ply"));
    let ended = std::fs::read(&scene).unwrap();
    let scores = json(&run.join("eval.json"));
    ["scene.ply", "train.json", "eval.json"].iter().for_each(|file| std::fs::remove_file(run.join(file)).unwrap());

    let told = tells(&["export", text(&run), "-o", text(&exported)]);
    assert!(told.contains("has not ended") && told.contains("step 12 of 12"), "{told}");
    // The last checkpoint holds the scene that the run ended with.
    assert_same("the checkpoint", &std::fs::read(&exported).unwrap(), &ended);

    let inspected: Value = serde_json::from_str(&works(&["inspect", text(&run), "--json"])).unwrap();
    assert_eq!((&inspected["checkpoint_step"], &inspected["n"]), (&Value::from(12), &scores["gaussians"]));

    let told: Value = serde_json::from_str(&works(&["eval", text(&run), "--json"])).unwrap();
    assert_eq!((&told["psnr"], &told["step"]), (&scores["psnr"], &Value::from(12)));
    assert_eq!(json(&run.join("eval/step-00000012/eval.json")), told);
    assert!(!run.join("eval.json").exists(), "the run's own scores are those of its end");

    let (camera, frame) = tiny.capture.test_frames()[0];
    let out = tiny.folder.join("out");
    works(&["render", text(&run), "--camera", &tiny.capture.cameras[camera].name, "-o", text(&out)]);
    let scored = run.join("renders").join(&tiny.capture.cameras[camera].name).join(format!("{frame:05}.png"));
    let same = difference(&out.join(format!("{}.png", name(&tiny.capture, camera, frame))), &scored);
    assert!(same < 0.05, "{same} levels");

    std::fs::remove_dir_all(run.join("checkpoints")).unwrap();
    let told = fails(&["inspect", text(&run)], 3);
    assert!(told.contains("no checkpoint yet") && told.contains("--resume"), "{told}");
    let told = fails(&["inspect", text(&tiny.folder)], 3);
    assert!(told.contains("run.json") && told.contains("meta.json"), "{told}");
}

#[test]
fn the_cameras_of_a_capture_are_written_and_read_as_its_views() {
    let tiny = Tiny::new("cameras");
    let file = tiny.folder.join("out.json");
    let (capture, output) = (text(&tiny.folder), text(&file));
    let views = |cameras: &[usize], frames: std::ops::Range<u32>| -> Vec<View> {
        let of =
            |camera: &usize| frames.clone().map(|frame| tiny.capture.view(*camera, frame).unwrap()).collect::<Vec<_>>();
        cameras.iter().flat_map(of).collect()
    };
    let all: Vec<usize> = (0..tiny.capture.cameras.len()).collect();
    assert!(all.len() > 2 && tiny.capture.n_frames == 4);
    works(&["inspect", capture, "--cameras", output]);
    assert_eq!(read_views(&file).unwrap(), views(&all, 0..4));
    let [first, last] = [0, all.len() - 1].map(|camera| tiny.capture.cameras[camera].name.as_str());
    let some = ["inspect", capture, "--cameras", output, "--camera", last, "--camera", first];
    for (frames, range) in [("1:3", 1..3), (":2", 0..2), ("3:", 3..4), ("2", 2..3), ("2:99", 2..4)] {
        works(&[&some[..], &["--frames", frames]].concat());
        assert_eq!(read_views(&file).unwrap(), views(&[0, all.len() - 1], range), "{frames}");
    }
    for frames in ["3:1", "a:", "1:1", "-1:2", ""] {
        let frames = format!("--frames={frames}");
        assert!(fails(&[&some[..], &[&frames]].concat(), 2).contains("A:B"), "{frames}");
    }
    assert!(fails(&[&some[..], &["--frames", "4:"]].concat(), 2).contains("frames 0 to 3"));
    assert!(fails(&["inspect", capture, "--cameras", output, "--camera", "none"], 2).contains(first));
}

#[test]
fn a_capture_is_read_for_its_views_as_for_its_training() {
    let tiny = Tiny::new("read");
    let (capture, file) = (text(&tiny.folder), tiny.folder.join("out.json"));
    works(&["inspect", capture, "--cameras", text(&file), "--max-frames", "2", "--frames", "1:", "--test-every", "3"]);
    let views: Vec<View> = (0..tiny.capture.cameras.len()).map(|c| tiny.capture.view(c, 1).unwrap()).collect();
    let names = |views: &[View]| views.iter().map(|view| view.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&read_views(&file).unwrap()), names(&views), "frame 1 of two");
    let settings = CaptureSettings { frames: Frames::first(2), ..CaptureSettings::default() };
    assert_eq!(Rig::open_with(&tiny.folder, &settings).unwrap().n_frames, 2);

    // Of three images one is missing, and they are a half of the calibration's 6 x 4.
    let folder = crate::capture::Folder::new("views");
    crate::capture::model::write(&folder, &crate::capture::model::sample());
    for name in ["a.png", "c d.png"] {
        folder.write(&format!("pictures_2/{name}"), crate::capture::png(3, 2, 90));
    }
    let (scene, out) = (folder.0.join("scene.ply"), folder.0.join("out"));
    ivv::internals::formats::write_ply(&scene, &ivv::internals::scene::demo().0).unwrap();
    let options = ["--images", "pictures", "--downscale", "2", "--skip-missing"];
    works(&[&["inspect", text(&folder.0), "--cameras", text(&file)], &options[..]].concat());
    let sizes: Vec<_> =
        read_views(&file).unwrap().iter().map(|view| (view.intrinsics.width, view.intrinsics.height)).collect();
    assert_eq!(sizes, [(3, 2), (3, 2)]);
    for of in ["--capture", "--cameras"] {
        works(&[&["render", text(&scene), of, text(&folder.0), "-o", text(&out)], &options[..]].concat());
        let sizes =
            pictures(&out).iter().map(|name| image::image_dimensions(out.join(name)).unwrap()).collect::<Vec<_>>();
        assert_eq!(sizes, [(3, 2), (3, 2)], "{of}");
        std::fs::remove_dir_all(&out).unwrap();
    }
    assert!(fails(&["inspect", text(&folder.0), "--cameras", text(&file)], 3).contains("images"), "needs the options");

    // A cameras file is not read as a capture, and a run is read as for its training.
    let told = fails(&["render", text(&scene), "--cameras", text(&file), "-o", text(&out), "--rescale"], 2);
    assert!(told.contains("is a cameras file; leave them out"), "{told}");
    let run = short_run(&tiny);
    works(&[
        "inspect",
        text(&run),
        "--cameras",
        text(&file),
        "--test-cameras",
        &Run::read(&run).unwrap().test_cameras.join(","),
    ]);
    let told = fails(&["inspect", text(&run), "--cameras", text(&file), "--max-frames", "2"], 2);
    assert!(told.contains("run.json has those of the run"), "{told}");
}

#[test]
fn captures_and_transforms_are_cameras_of_a_scene() {
    let tiny = Tiny::new("rendered");
    let (splats, _) = ivv::internals::scene::demo();
    let (scene, at) = (tiny.folder.join("scene.ply"), |name: &str| tiny.folder.join(name));
    ivv::internals::formats::write_ply(&scene, &splats).unwrap();
    let camera = tiny.capture.cameras[0].name.as_str();
    let some = ["render", text(&scene), "--camera", camera, "--frames", "1:3"];
    works(&[&some[..], &["--capture", text(&tiny.folder), "-o", text(&at("a"))]].concat());
    works(&[&some[..], &["--cameras", text(&tiny.folder), "-o", text(&at("b"))]].concat());
    let file = at("cameras.json");
    let views: Vec<View> = (1..3).map(|frame| tiny.capture.view(0, frame).unwrap()).collect();
    write_views(&file, &views).unwrap();
    works(&["render", text(&scene), "--cameras", text(&file), "-o", text(&at("c"))]);
    let names: Vec<String> = views.iter().map(|view| format!("{}.png", view.name)).collect();
    for folder in ["a", "b", "c"] {
        assert_eq!(pictures(&at(folder)), names);
        names.iter().for_each(|name| assert_eq!(difference(&at("a").join(name), &at(folder).join(name)), 0.0));
    }
    assert!(fails(&[&some[..], &["--cameras", text(&file), "-o", "x"]].concat(), 2).contains("--frames"));
    assert!(fails(&["render", text(&scene), "-o", "x"], 2).contains("--capture"));

    // OpenGL's axes: y and z of the camera turn around.
    let view = &views[0];
    let pose = glam::DMat4::from_cols_array_2d(&view.pose.rows()).transpose().inverse();
    let turned = pose * glam::DMat4::from_scale(glam::DVec3::new(1.0, -1.0, -1.0));
    let rows: Vec<[f64; 4]> = (0..4).map(|row| turned.row(row).to_array()).collect();
    let folder = at("transforms");
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(&tiny.capture.cameras[0].shot(1).unwrap().image, folder.join("one.png")).unwrap();
    let transforms = serde_json::json!({
        "w": view.intrinsics.width, "h": view.intrinsics.height, "fl_x": view.intrinsics.fx, "fl_y": view.intrinsics.fy, "cx": view.intrinsics.cx, "cy": view.intrinsics.cy,
        "frames": [{ "file_path": "one.png", "transform_matrix": rows }],
    });
    std::fs::write(folder.join("transforms.json"), transforms.to_string()).unwrap();
    let cameras = folder.join("transforms.json");
    let time = view.time.to_string();
    works(&["render", text(&scene), "--cameras", text(&cameras), "--time", &time, "-o", text(&at("d"))]);
    let [one] = &pictures(&at("d"))[..] else { panic!("one picture") };
    assert!(difference(&at("d").join(one), &at("a").join(&names[0])) < 0.05);
}

#[test]
fn stills_are_shown_at_the_time_that_is_asked_for_within_the_clip() {
    let tiny = Tiny::new("time");
    let (splats, _) = ivv::internals::scene::demo();
    let (scene, at) = (tiny.folder.join("scene.ply"), |name: &str| tiny.folder.join(name));
    ivv::internals::formats::write_ply(&scene, &splats).unwrap();
    let capture = text(&tiny.folder);
    let still = ["render", text(&scene), "--capture", capture, "-o"];
    works(&[&still[..], &[text(&at("half")), "--time", "0.5"]].concat());
    assert_eq!(pictures(&at("half")).len(), tiny.capture.cameras.len(), "cameras that rest are rendered once");
    works(&[&still[..], &[text(&at("frame")), "--frames", "2"]].concat());
    let [first, second] = [0, 2].map(|frame| format!("{}.png", name(&tiny.capture, 0, frame)));
    assert_eq!(
        difference(&at("half").join(&first), &at("frame").join(&second)),
        0.0,
        "frame 2 of 4 is at half the time"
    );
    for time in ["5", "-1", "nan", "1.0001"] {
        let told = fails(&[&still[..], &[text(&at("x")), "--time", time]].concat(), 2);
        assert!(told.contains("0 (the clip's start) to 1"), "{told}");
        let told = fails(&["export", text(&scene), "-o", text(&at("x.ply")), "--time", time], 2);
        assert!(told.contains("0 (the clip's start) to 1") && !at("x.ply").exists(), "{told}");
    }
    let late = at("late.json");
    write_views(&late, &[View { time: 1.5, ..tiny.capture.view(0, 0).unwrap() }]).unwrap();
    let told = fails(&["render", text(&scene), "--cameras", text(&late), "-o", text(&at("x"))], 3);
    assert!(told.contains("late.json") && told.contains("found 1.5"), "{told}");
    works(&["render", text(&scene), "--cameras", text(&late), "-o", text(&at("x")), "--time", "1"]);
}

#[test]
fn a_run_under_way_shows_test_views_and_its_report() {
    let tiny = Tiny::new("progress");
    let run = tiny.folder.join("run");
    let train = ["train", text(&tiny.folder), "-o", text(&run), "--steps", "100000", "--sh-degree", "0", "--quiet"];
    let often = ["--eval-at", "3", "--eval-every", "0", "--eval-images", "5", "--checkpoint-every", "2"];
    let mut child = command(&[&train[..], &often].concat()).spawn().unwrap();
    // They are written at once, each as a whole.
    let (report, strip) = (run.join("report.html"), run.join("renders/progress/00000003.png"));
    let begun = std::time::Instant::now();
    while !(report.is_file() && strip.is_file())
        && child.try_wait().unwrap().is_none()
        && begun.elapsed().as_secs() < 240
    {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let page = std::fs::read_to_string(&report).unwrap();
    assert!(
        page.contains("run, step 3 of 100000") && page.matches("<img").count() >= 9,
        "three views, three pictures each"
    );

    let strip = image::open(strip).unwrap().to_rgb8();
    let shown = spread(&spread(&tiny.capture.test_frames(), 5), 3);
    let (mut left, mut error) = (0, 0.0);
    for (camera, frame) in shown {
        let truth = image::open(&tiny.capture.cameras[camera].shot(frame).unwrap().image).unwrap().to_rgb8();
        let (width, height) = truth.dimensions();
        assert_eq!(strip.height(), 2 * height);
        for (x, y, pixel) in truth.enumerate_pixels() {
            assert_eq!(strip.get_pixel(left + x, y), pixel, "the truth is above");
            let rendered = strip.get_pixel(left + x, height + y);
            error += (0..3).map(|c| f64::from(rendered[c].abs_diff(pixel[c]))).sum::<f64>() / 3.0;
        }
        left += width;
        assert!(left <= strip.width());
    }
    assert_eq!(left, strip.width());
    let error = error / f64::from(left * strip.height() / 2);
    assert!(error > 1.0 && error < 100.0, "the rendering is below: {error} levels");

    let told = tells(&["inspect", text(&run)]);
    assert!(told.contains("of 100000"), "{told}");
    works(&["train", text(&tiny.folder), "-o", text(&run), "--steps", "1", "--sh-degree", "0", "--overwrite"]);
    assert!(!run.join("renders/progress").exists(), "pictures of the run before are gone");
}

#[test]
fn a_file_with_views_of_its_own_is_rendered_from_them() {
    let tiny = Tiny::new("own-views");
    let name = |file: &str| tiny.folder.join(file).to_str().unwrap().to_owned();
    let [scene, cameras] = ["scene.ply", "cameras.json"].map(|name| format!("assets/demo/{name}"));
    works(&["export", &scene, "-o", &name("a.4dgs"), "--seconds", "1", "--cameras", &cameras]);
    works(&["render", &name("a.4dgs"), "-o", &name("own")]);
    works(&["render", &name("a.4dgs"), "-o", &name("given"), "--cameras", &cameras]);
    let pictures = |folder: &str| {
        let all = read_views(Path::new(&cameras)).unwrap();
        all.iter()
            .map(|view| std::fs::read(tiny.folder.join(folder).join(format!("{}.png", view.name))).unwrap())
            .collect::<Vec<_>>()
    };
    assert_eq!(pictures("own"), pictures("given"));
    assert!(fails(&["render", &scene, "-o", &name("none")], 2).contains("a scene without cameras"));
}
