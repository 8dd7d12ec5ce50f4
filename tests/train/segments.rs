//! A clip in segments: planned, trained job by job, joined, and scored as one scene.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;
#[cfg(unix)]
use crate::common::running::Running;
use ivv::internals::scene::ALWAYS;

/// That the means of the frames at seams, and of the others, are those of the views.
fn assert_scored_at_seams(scores: &Value, seam: std::ops::RangeInclusive<u64>) {
    let both = &scores["mean_at_seams_and_elsewhere"];
    for (index, at_seam) in [(0, true), (1, false)] {
        let views = scores["views"].as_array().unwrap().iter();
        let of = views.filter(|view| seam.contains(&view["frame"].as_u64().unwrap()) == at_seam);
        let psnr: Vec<f64> = of.map(|view| view["psnr"].as_f64().unwrap()).collect();
        let (told, expected) = (both[index]["psnr"].as_f64().unwrap(), psnr.iter().sum::<f64>() / psnr.len() as f64);
        assert!((told - expected).abs() < 1e-9, "{told} {expected}");
    }
}

/// That a scene of frames 0 to 4 and 3 to 7 of eight has Gaussians as they are where a segment is full, and as they fade, of `n`
/// that were trained.
fn assert_faded(joined: &Splats, n: usize) {
    let ends: Vec<f32> = joined.span.iter().flatten().copied().filter(|end| end.is_finite()).collect();
    let [going, coming, gone, full] = [2.0 / 8.0, 2.5 / 8.0, 4.5 / 8.0, 5.0 / 8.0];
    assert!(ends.iter().all(|end| [going, coming, gone, full].contains(end)) && ends.contains(&going), "{ends:?}");
    let now = joined.motion.len();
    assert!((n / 2..=2 * n).contains(&now) && !joined.span.contains(&ALWAYS), "{n} became {now}");
}

#[test]
fn a_clip_in_segments_is_joined_to_one_scene_and_jobs_are_done_once() {
    let tiny = Tiny::of_frames("segments", 8);
    let plan = tiny.folder.join("plan");
    let planned = ["segments", "plan", text(&tiny.folder), "-o", text(&plan), "--frames", "5", "--overlap", "2"];
    let settings = ["--steps", "24", "--sh-degree", "1", "--set", "init_static_tau=0", "--set", "init_points=200"];
    let told = works(&[&planned[..], &settings[..]].concat());
    assert!(told.contains("segment 0: frames 0 to 4") && told.contains("segment 1: frames 3 to 7"), "{told}");
    // The same plan again is no fault, another one is.
    works(&[&planned[..], &settings[..]].concat());
    assert!(fails(&[&planned[..], &["--steps", "25"]].concat(), 3).contains("holds another plan or a run"));

    fn jobs<'a>(plan: &'a str, only: &[&'a str]) -> Vec<&'a str> {
        [&["segments", "run", plan][..], only, &["--", "--eval-every", "0"]].concat()
    }
    // What no segment could be trained with is told before the first run is.
    let other = tiny.folder.join("other");
    let drawn = ["segments", "plan", text(&tiny.folder), "-o", text(&other), "--set", "density.strategy=mcmc"];
    assert!(fails(&drawn, 2).contains("density.strategy=mcmc") && !other.exists());
    let script = std::process::Command::new("bash").arg("-n").arg(plan.join("slurm.sh")).status().unwrap();
    assert!(script.success() && plan.join("Snakefile").is_file());
    let run = |only| jobs(text(&plan), only);
    assert!(fails(&["segments", "join", text(&plan)], 3).contains("expected a run that has ended"));
    assert!(fails(&run(&["--only", "2"]), 2).contains("a segment from 0 to 1"));
    assert!(fails(&run(&["--only", "1"]), 2).contains("the training into"), "what rests comes first");
    let told = works(&[&["--json"][..], &run(&["--only", "base"])].concat());
    assert_eq!(serde_json::from_str::<Value>(&told).unwrap()["path"], text(&plan.join("base")));
    works(&run(&["--only", "0001"]));
    // A job that was killed goes on: as if before its end.
    let segment = plan.join("segment-0001");
    for name in ["scene.ply", "train.json"] {
        std::fs::remove_file(segment.join(name)).unwrap();
    }
    let newest = segment.join("checkpoints/00000024.ckpt");
    assert!(newest.is_file());
    std::fs::remove_file(newest).unwrap();
    works(&run(&[]));
    let told = tells(&run(&[]));
    assert!(told.matches(": is done").count() == 3, "{told}");

    let joined = read_ply(&plan.join("scene.ply")).unwrap();
    let scene = |folder: &str| read_ply(&plan.join(folder).join("scene.ply")).unwrap();
    let (base, first, second) = (scene("base"), scene("segment-0000"), scene("segment-0001"));
    assert_eq!(joined.n_static, base.n_static);
    assert_faded(&joined, first.motion.len() + second.motion.len());
    // A whole run's verbs take it: scores of all frames, and a clip for players.
    works(&["eval", text(&plan)]);
    let scores = json(&plan.join("eval.json"));
    // Frames 3 to 5: those of both segments, and the one behind, up to which the first disappears.
    assert_scored_at_seams(&scores, 3..=5);
    let views = scores["views"].as_array().unwrap();
    assert!(views.len() >= 8 && views.iter().all(|view| view["psnr"].as_f64().unwrap() > 8.0));
    // Where only one segment is there, the picture is that of the segment alone.
    let mut n_alone = 0;
    for (folder, first, alone) in [("segment-0000", 0, 0..3), ("segment-0001", 3, 5..8)] {
        let own = json(&plan.join(folder).join("eval.json"));
        for view in own["views"].as_array().unwrap() {
            let frame = view["frame"].as_u64().unwrap() + first;
            if alone.contains(&frame) {
                let same = |of: &&Value| of["camera"] == view["camera"] && of["frame"] == frame;
                let joined = views.iter().find(same).unwrap()["psnr"].as_f64().unwrap();
                let own = view["psnr"].as_f64().unwrap();
                assert!((joined - own).abs() < 0.01, "frame {frame}: {joined} joined, {own} alone");
                n_alone += 1;
            }
        }
    }
    assert!(n_alone >= 6);
    let told = works(&["--json", "segments", "join", text(&plan)]);
    assert_eq!(serde_json::from_str::<Value>(&told).unwrap()["segments"], 2);
    // A run's folder is no place for a plan.
    let into = ["segments", "plan", text(&tiny.folder), "-o", text(&segment)];
    assert!(fails(&into, 3).contains("holds another plan or a run"));
    let clip = tiny.folder.join("scene.4dgs");
    works(&["export", text(&plan), "-o", text(&clip), "--clamp-colors"]);
    let read = ivv::internals::formats::read_scene(&clip).unwrap();
    assert_eq!(read.len(), joined.len());
    assert!(!read.span.is_empty());
}

#[cfg(unix)]
#[test]
fn segments_that_are_asked_to_end_pass_it_on_and_begin_nothing_more() {
    let tiny = Tiny::of_frames("segments-stop", 8);
    let plan = tiny.folder.join("plan");
    let planned = ["segments", "plan", text(&tiny.folder), "-o", text(&plan), "--frames", "5", "--overlap", "2"];
    works(&[&planned[..], &["--steps", "100000", "--set", "init_points=200"]].concat());
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.args(["segments", "run", text(&plan), "--", "--eval-every", "0", "--checkpoint-every", "3"]);
    command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
    let mut running = Running::start(&mut command);
    running.wait_for_checkpoint(&plan.join("base/checkpoints"), 3);
    running.signal(rustix::process::Signal::TERM);
    assert_eq!(running.code(), Some(130));
    // The training has ended too: it holds its folder no more.
    drop(ivv::internals::train::RunLock::take(&plan.join("base")).unwrap());
    assert!(!plan.join("segment-0000").exists());
}

#[test]
fn a_plan_is_scored_with_what_its_jobs_were_trained_with() {
    let tiny = Tiny::of_frames("segments-white", 8);
    for camera in &tiny.capture.cameras {
        for shot in &camera.shots {
            // Transparent in the upper half.
            let mut picture = image::open(&shot.image).unwrap().to_rgba8();
            let upper = picture.height() / 2;
            picture.enumerate_pixels_mut().filter(|(_, y, _)| *y < upper).for_each(|(.., pixel)| pixel.0[3] = 0);
            picture.save(&shot.image).unwrap();
        }
    }
    let plan = tiny.folder.join("plan");
    let (file, views) = (tiny.folder.join("viewpoints.json"), [tiny.capture.view(0, 0).unwrap()]);
    ivv::internals::scene::write_views(&file, &views).unwrap();
    let planned = ["segments", "plan", text(&tiny.folder), "-o", text(&plan), "--frames", "5", "--overlap", "2"];
    let settings = ["--steps", "12", "--set", "init_points=100", "--set", "background=[1,1,1]"];
    works(&[&planned[..], &settings[..]].concat());
    let run = ["segments", "run", text(&plan)];
    let options = ["--", "--eval-every", "0", "--blur", "0.2", "--viewpoints", text(&file)];
    works(&[&run[..], &["--only", "base"], &options].concat());
    // A run that goes on has its viewpoints.
    std::fs::remove_file(plan.join("base/train.json")).unwrap();
    works(&[&run[..], &options].concat());
    let of = |folder: &str| json(&plan.join(folder).join("run.json"));
    let [whole, base, segment] = ["", "base", "segment-0000"].map(of);
    assert_eq!(whole["constants"], base["constants"]);
    assert_eq!(whole["capture_settings"]["background"], segment["capture_settings"]["background"]);
    assert_eq!(whole["capture_settings"]["background"], serde_json::json!([1.0, 1.0, 1.0]));
    // As if what rests had been trained in a frame of another unit, as on a rig that moves: the near plane is where it was.
    let file = plan.join("base/run.json");
    let mut other = base.clone();
    for (part, name) in [("world", "scale"), ("constants", "near")] {
        other[part][name] = serde_json::json!(2.0 * base[part][name].as_f64().unwrap());
    }
    std::fs::write(&file, other.to_string()).unwrap();
    works(&["segments", "join", text(&plan)]);
    assert_eq!(of("")["constants"], base["constants"]);
    std::fs::write(&file, base.to_string()).unwrap();
    // Frames that one segment alone shows have its scores.
    works(&["eval", text(&plan)]);
    let scores = |folder: &str| json(&plan.join(folder).join("eval.json"))["views"].as_array().unwrap().clone();
    let (joined, own) = (scores(""), scores("segment-0000"));
    let at = |views: &[Value], camera: &Value, frame: u64| {
        let same = |view: &&Value| view["camera"] == *camera && view["frame"] == frame;
        views.iter().find(same).unwrap()["psnr"].as_f64().unwrap()
    };
    let camera = &own[0]["camera"];
    let [joined, own] = [at(&joined, camera, 0), at(&own, camera, 0)];
    assert!((joined - own).abs() < 0.01, "{joined} joined, {own} alone");
    works(&[&planned[..], &settings[..]].concat());
    assert_eq!(json(&plan.join("run.json"))["constants"], base["constants"], "the same plan again takes nothing back");
}

#[test]
fn segments_are_as_long_as_memory_allows() {
    let tiny = Tiny::of_frames("segments-memory", 8);
    let fitted = |memory: u64, to: &str| {
        let (to, memory) = (tiny.folder.join(to), memory.to_string());
        let asked =
            ["--json", "segments", "plan", text(&tiny.folder), "-o", text(&to), "--overlap", "2", "--memory", &memory];
        let out = ivv(&[&asked[..], &["--max-gaussians", "5000"]].concat());
        (out.status.success(), String::from_utf8_lossy(&out.stdout).into_owned(), to)
    };
    let (is_fitted, told, _) = fitted(0, "none");
    let least: u64 = told.split("at least ").nth(1).unwrap().split(':').next().unwrap().parse().unwrap();
    let of_frame: u64 = told.split("of a frame ").nth(1).unwrap().split(';').next().unwrap().parse().unwrap();
    assert!(!is_fitted && of_frame > 0, "{told}");
    assert!(!fitted(least - 1, "none").0);
    for (more, length) in [(0, 4), (of_frame, 5), (of_frame * 3, 7), (of_frame * 100, 8)] {
        let (is_fitted, told, to) = fitted(least + more, &format!("of-{length}"));
        assert!(is_fitted, "{told}");
        let cut = ivv::internals::train::Segments::read(&to).unwrap();
        assert!(cut.segments.iter().all(|[from, to]| to - from <= length));
        assert_eq!(cut.segments.len() > 1, length < 8);
        assert_eq!(cut.cache_bytes, Some(u64::from(length) * of_frame));
    }
}
