//! Run folders through the command line: trained, scored again from what they hold, exported.

use super::Tiny;
use super::report::{assert_self_contained, assert_well_formed, plot};
use crate::common::prelude::*;
use crate::common::program::json;

fn lines(folder: &Path, kind: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("train.jsonl")).unwrap();
    let all = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    all.filter(|line| line["kind"] == kind).collect()
}

fn scores(evaluation: &Value) -> Vec<(String, [f64; 4])> {
    let of = |view: &Value| ["psnr", "psnr_aligned", "ssim", "l1"].map(|key| view[key].as_f64().unwrap());
    let views = evaluation["views"].as_array().unwrap();
    views.iter().map(|view| (view["view"].as_str().unwrap().to_owned(), of(view))).collect()
}

#[test]
fn a_run_is_scored_again_from_its_folder_alone() {
    let tiny = Tiny::new("run");
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let path = run.to_str().unwrap();
    let train = ["train", capture, "-o", path, "--steps", "50", "--sh-degree", "1", "--eval-every", "20"];
    works(&[&train[..], &["--eval-at", "35,50", "--eval-images", "3", "--log-every", "5"]].concat());

    let trained = json(&run.join("eval.json"));
    let test = tiny.capture.test_frames();
    let names: Vec<String> = test.iter().map(|&(c, f)| tiny.capture.view(c, f).unwrap().name).collect();
    assert!(names.len() > 3);
    let views = scores(&trained);
    assert_eq!(views.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>(), names);
    let mean = views.iter().map(|(_, s)| s[0]).sum::<f64>() / views.len() as f64;
    assert!(views.iter().all(|(_, [psnr, aligned, ssim, l1])| aligned > psnr && *ssim < 1.0 && *l1 > 0.0));
    assert!((trained["psnr"].as_f64().unwrap() - mean).abs() < 1e-9 && mean > 5.0);
    assert_eq!((&trained["rounded_to_8_bits"], &trained["step"]), (&Value::Bool(false), &Value::from(50)));
    let scene = read_ply(&run.join("scene.ply")).unwrap();
    // Bands that are 0 are not counted.
    let bytes = trained["bytes"].as_u64().unwrap();
    assert_eq!(bytes, scene.clone().by_degree().summary().parameter_bytes);
    assert!((76..=112).contains(&(bytes / scene.len() as u64)), "{bytes} bytes of {} Gaussians", scene.len());
    assert_eq!(trained["gaussians"], scene.len());

    // The curve: always the same three images, the last of them out of all.
    let curve = lines(&run, "evaluation");
    assert_eq!(curve.iter().map(|line| line["step"].as_u64().unwrap()).collect::<Vec<_>>(), [20, 35, 40, 50]);
    let curve_views: Vec<Vec<String>> =
        curve.iter().map(|line| scores(line).into_iter().map(|(name, _)| name).collect()).collect();
    assert!(curve_views.iter().all(|views| views.len() == 3 && *views == curve_views[0]));
    let of_all = |name: &String| views.iter().find(|(other, _)| other == name).unwrap().1[0];
    let last = curve_views[0].iter().map(of_all).sum::<f64>() / 3.0;
    assert!((curve[3]["psnr"].as_f64().unwrap() - last).abs() < 1e-9);
    let best = curve.iter().max_by(|a, b| a["psnr"].as_f64().unwrap().total_cmp(&b["psnr"].as_f64().unwrap())).unwrap();
    let best = format!("best-{:08}-{:.4}dB.ckpt", best["step"].as_u64().unwrap(), best["psnr"].as_f64().unwrap());
    assert!(run.join("checkpoints").join(&best).is_file(), "{best}");
    assert_eq!(std::fs::read_dir(run.join("checkpoints")).unwrap().count(), 4, "the last three and the best");

    check_totals(&run);
    check_report(&run, &names);

    // Another scene goes elsewhere; the run's own scores stay.
    let snapshot = tiny.folder.join("at.ply");
    works(&["export", path, "-o", snapshot.to_str().unwrap(), "--time", "0.5"]);
    works(&["eval", path, "--scene", snapshot.to_str().unwrap()]);
    let other = json(&run.join("eval/at.ply/eval.json"));
    assert!(other["psnr"].as_f64().unwrap() > 5.0 && scores(&other) != views);
    assert_eq!(other["step"], 0, "no run says how many steps it took");
    let driver = json(&run.join("train.json"))["device"]["driver"].as_str().unwrap().to_owned();
    let tells = |report: &str| std::fs::read_to_string(run.join(report)).unwrap().contains(&driver);
    assert!(tells("report.html") && !tells("eval/at.ply/report.html"), "the training is in the run's own report alone");
    // One of the same name in another format has scores of its own.
    works(&["export", path, "-o", tiny.folder.join("at.splat").to_str().unwrap(), "--time", "0.5"]);
    works(&["eval", path, "--scene", tiny.folder.join("at.splat").to_str().unwrap()]);
    assert_ne!(json(&run.join("eval/at.splat/eval.json"))["psnr"], other["psnr"]);
    assert_eq!(json(&run.join("eval/at.ply/eval.json")), other);
    works(&["eval", path, "--scene", &format!("{path}/checkpoints/..")]);
    assert!(run.join("eval").join(run.file_name().unwrap()).join("eval.json").is_file());
    assert_eq!(json(&run.join("eval.json")), trained);

    // The folder alone: moved, its results removed, the capture where it was.
    let moved = std::env::temp_dir().join(format!("ivv-train-moved-{}", std::process::id()));
    std::fs::rename(&run, &moved).unwrap();
    ["eval.json", "report.html"].iter().for_each(|file| std::fs::remove_file(moved.join(file)).unwrap());
    std::fs::remove_dir_all(moved.join("renders")).unwrap();
    let told: Value = serde_json::from_str(&works(&["eval", moved.to_str().unwrap(), "--json"])).unwrap();
    assert_eq!(scores(&told), views, "the same numbers to the last digit");
    assert_eq!(json(&moved.join("eval.json")), told);
    for &(camera, frame) in &test {
        let render = moved.join("renders").join(&tiny.capture.cameras[camera].name).join(format!("{frame:05}.png"));
        let size = image::image_dimensions(render).unwrap();
        assert_eq!(
            size,
            (tiny.capture.cameras[camera].intrinsics.width, tiny.capture.cameras[camera].intrinsics.height)
        );
    }
    check_report(&moved, &names);
    capture_that_moved(&tiny, &moved);
    std::fs::remove_dir_all(&moved).unwrap();
}

fn capture_that_moved(tiny: &Tiny, run: &Path) {
    let (path, elsewhere) = (run.to_str().unwrap(), tiny.folder.with_extension("elsewhere"));
    std::fs::rename(&tiny.folder, &elsewhere).unwrap();
    let told = fails(&["eval", path], 3);
    assert!(told.contains("no such folder") && told.contains("--capture"), "{told}");
    let table = works(&["eval", path, "--capture", elsewhere.to_str().unwrap()]);
    assert!(table.contains("mean") && table.contains("frames per second") && table.contains("SH degree 1"), "{table}");
    // One image fewer is another capture.
    let (camera, frame) = tiny.capture.training_frames()[0];
    let manifest = elsewhere.join("capture.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text.replace("frames = 4", "frames = 3")).unwrap();
    let told = fails(&["eval", path, "--capture", elsewhere.to_str().unwrap()], 3);
    assert!(told.contains("run's held"), "{told} ({camera}, {frame})");
    std::fs::rename(&elsewhere, &tiny.folder).unwrap();
}

fn check_totals(run: &Path) {
    let totals = json(&run.join("train.json"));
    assert_eq!((&totals["steps"], &totals["capture"]["held"]["frames"]), (&Value::from(50), &Value::from(4)));
    assert!(totals["device"]["driver"].is_string() && totals["peak_bytes"].as_u64().unwrap() > 10_000);
    assert!(totals["seconds_per_step"].as_f64().unwrap() > 0.0);
    let steps = lines(run, "step");
    assert!(steps.len() >= 10 && steps.iter().all(|line| line["loss"].is_number() && line["seconds"].is_number()));
    let profiled: Vec<u64> = lines(run, "profile").iter().map(|line| line["step"].as_u64().unwrap()).collect();
    if totals["device"]["timestamp_ns"].as_f64() == Some(0.0) {
        crate::common::notes::skip("the device has no timestamps");
        return;
    }
    assert_eq!(profiled, [5, 15, 25, 35, 45]);
    let passes = totals["profile"]["passes"].as_array().unwrap();
    let sum: f64 = passes.iter().map(|pass| pass["ms"].as_f64().unwrap()).sum();
    assert!((totals["profile"]["ms"].as_f64().unwrap() - sum).abs() < 1e-6 * sum && sum > 0.0);
    for section in
        ["cull", "project", "depth sort", "tile sort", "blend", "loss", "blend bwd", "project bwd adam", "adam"]
    {
        let has = |pass: &Value| pass["label"].as_str().unwrap().starts_with(&format!("{section}/"));
        assert!(passes.iter().any(has), "{section}");
    }
    assert!(totals["bytes_by_buffer"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum::<u64>() > 10_000);
}

fn check_report(run: &Path, views: &[String]) {
    let html = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert_well_formed(&html);
    assert_self_contained(&html);
    assert!(views.iter().all(|view| html.contains(&format!("<td>{view}</td>"))), "every view has a row");
    assert_eq!(html.matches("data:image/png").count(), 3 * views.len().min(8));
    assert_eq!(plot(&html, "plot-psnr").matches("<circle").count(), lines(run, "evaluation").len());
    assert!(["worst", "median", "best"].iter().all(|why| html.contains(&format!("the {why}"))));
}

/// Debian 12's lavapipe kept 2.5 MB of every step for good, until no push constant alone decided a branch (unfolded.glsl).
#[test]
fn memory_does_not_grow_with_the_steps() {
    let tiny = Tiny::new("memory");
    let peak = |steps: &str| {
        let run = tiny.folder.join(steps);
        let path = run.to_str().unwrap();
        let train = ["train", tiny.folder.to_str().unwrap(), "-o", path, "--steps", steps, "--max-gaussians", "1500"];
        works(&[&train[..], &["--eval-every", "0"]].concat());
        json(&run.join("train.json"))["host_peak_bytes"].as_f64()
    };
    let (Some(few), Some(many)) = (peak("20"), peak("80")) else {
        return crate::common::notes::skip("this system does not tell how much memory a process held");
    };
    assert!(few > 1e7 && many < few + 4e7, "{few} bytes after 20 steps, {many} after 80");
}

#[test]
fn a_folder_with_a_run_is_not_trained_over_unless_asked_and_an_ended_run_resumes_to_itself() {
    let tiny = Tiny::new("again");
    let run = tiny.folder.join("run");
    let train = ["train", tiny.folder.to_str().unwrap(), "-o", run.to_str().unwrap(), "--steps", "12"];
    works(&[&train[..], &["--sh-degree", "0", "--eval-every", "0"]].concat());
    let (scene, evaluations) = (std::fs::read(run.join("scene.ply")).unwrap(), lines(&run, "evaluation"));
    assert_eq!(evaluations.len(), 1, "the end is always scored");
    let told = fails(&train, 3);
    assert!(told.contains("--resume") && told.contains("--overwrite"), "{told}");
    works(&[&train[..], &["--resume"]].concat());
    assert_eq!(std::fs::read(run.join("scene.ply")).unwrap(), scene);
    assert_eq!(lines(&run, "evaluation").len(), 1);
    let config = json(&run.join("config.json"));
    assert_eq!(config["sh_degree"], 0, "as the checkpoint says");
    works(&[&train[..], &["--overwrite", "--sh-degree", "1"]].concat());
    assert_ne!(std::fs::read(run.join("scene.ply")).unwrap(), scene);
}

#[test]
fn a_run_and_a_scene_are_exported_in_every_format() {
    let tiny = Tiny::new("export");
    let file = |name: &str| tiny.folder.join(name).to_str().unwrap().to_owned();
    let (splats, _) = ivv::internals::scene::demo();
    let run = tiny.folder.join("run");
    std::fs::create_dir(&run).unwrap();
    std::fs::write(run.join("run.json"), "{}").unwrap();
    ivv::internals::formats::write_ply(&run.join("scene.ply"), &splats).unwrap();
    works(&["export", run.to_str().unwrap(), "-o", &file("whole.ply")]);
    assert_eq!(std::fs::read(file("whole.ply")).unwrap(), std::fs::read(run.join("scene.ply")).unwrap());
    let still = splats.at(0.25, 0.5);
    assert!(!still.is_empty() && still.len() < splats.len());
    for (name, arguments) in [("a.ply", &[][..]), ("a.spz", &[]), ("a.splat", &[]), ("a.bin", &["--format", "spz"])] {
        let scene = run.join("scene.ply");
        let whole = ["export", scene.to_str().unwrap(), "-o", &file(name), "--time", "0.25", "--min-opacity", "0.5"];
        let told = works(&[&whole[..], arguments].concat());
        assert!(told.contains(&format!("{} of {}", still.len(), splats.len())), "{told}");
        let read = read_scene(Path::new(&file(name))).unwrap();
        assert_eq!((read.len(), read.n_static), (still.len(), still.len()), "{name}");
    }
    assert_eq!(read_ply(Path::new(&file("a.ply"))).unwrap(), still);
    for name in ["a.glb", "a.html"] {
        let scene = run.join("scene.ply");
        works(&["export", scene.to_str().unwrap(), "-o", &file(name), "--time", "0.25", "--min-opacity", "0.5"]);
        assert!(std::fs::metadata(file(name)).unwrap().len() > 50_000, "{name}");
    }
    for name in ["a.4dgs", "a.ftgs.ply"] {
        let scene = run.join("scene.ply");
        let told = works(&["export", scene.to_str().unwrap(), "-o", &file(name), "--seconds", "2"]);
        assert!(told.contains(&format!("{0} of {0}", splats.len())), "{told}");
        let read = read_scene(Path::new(&file(name))).unwrap();
        assert_eq!((read.len(), read.n_static), (splats.len(), splats.n_static), "{name}");
    }
    let told = works(&["inspect", &file("a.4dgs"), "--json"]);
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!((&told["fourdgs"]["gaussianCount"], &told["fourdgs"]["durationSec"]), (&"5269".into(), &2.0.into()));
    assert_eq!(told["n"], 5269);
    let told = fails(&["export", run.to_str().unwrap(), "-o", &file("b.spz")], 3);
    assert!(told.contains("dynamic") && told.contains("--time"), "{told}");
    assert!(fails(&["export", run.to_str().unwrap(), "-o", &file("b.obj")], 3).contains("--format"));
}

#[test]
fn a_preset_goes_before_the_file_and_the_file_before_single_settings_and_the_run_keeps_its_name() {
    let tiny = Tiny::new("preset");
    let file = |name: &str| tiny.folder.join(name).to_str().unwrap().to_owned();
    std::fs::write(file("own.json"), r#"{"loss": {"depth": 0.5}, "adam": "lazy"}"#).unwrap();
    let capture = tiny.folder.to_str().unwrap();
    let train = ["train", capture, "-o", &file("run"), "--steps", "6", "--sh-degree", "0", "--eval-every", "0"];
    let settings = ["--preset", "fast", "--config", &file("own.json"), "--set", "adam=dense"];
    works(&[&train[..], &settings].concat());
    let config = json(&tiny.folder.join("run/config.json"));
    let told = [&config["loss"]["ssim_stride"], &config["loss"]["depth"], &config["adam"], &config["preset"]["name"]];
    assert_eq!(told, [&Value::from(2), &Value::from(0.5), &Value::from("dense"), &Value::from("fast")]);
    assert_eq!(json(&tiny.folder.join("run/train.json"))["preset"], config["preset"]);
    assert_eq!(config["preset"]["hash"].as_str().unwrap().len(), 16);
    let elsewhere = ["train", capture, "-o", &file("other")];
    assert!(fails(&[&elsewhere[..], &["--preset", "quick"]].concat(), 3).contains("balanced"));
    std::fs::write(file("bad.json"), r#"{"about": "", "settings": {"frame": {"depth_bit": 16}}}"#).unwrap();
    assert!(fails(&[&elsewhere[..], &["--preset", &file("bad.json")]].concat(), 3).contains("depth_bit"));
    assert!(fails(&[&elsewhere[..], &["--set", "frame.depth_bits=20"]].concat(), 2).contains("depth_bits"));
    // --epochs goes before the steps of a file, such as an earlier run's.
    let earlier = file("run/config.json");
    let plan = [&elsewhere[..], &["--config", &earlier, "--epochs", "1", "--plan", "--json"]].concat();
    let plan: Value = serde_json::from_str(&works(&plan)).unwrap();
    assert_eq!((&plan["steps"], config["steps"].as_u64()), (&plan["training_images"], Some(6)));
}

/// A capture that `check` accepts with some options is trained, scored and gone on with as it was checked.
#[test]
fn the_options_of_a_capture_are_those_of_its_run() {
    let model = crate::capture::model::sample();
    let folder = crate::capture::Folder::new("run-options");
    crate::capture::model::write(&folder, &model);
    for (index, name) in ["a.png", "b.png"].iter().enumerate() {
        folder.write(&format!("images_2/{name}"), crate::capture::png(3, 2, 40 * index as u8));
    }
    let at = |path: &Path| path.to_str().unwrap().to_owned();
    let (capture, output) = (at(&folder.0), at(&folder.0.join("run")));
    let options = ["--downscale", "2", "--skip-missing", "--test-cameras", "b"];
    works(&[&["check", &capture], options.as_slice()].concat());
    let train = ["train", &capture, "-o", &output, "--steps", "2", "--set", "init=random", "--set", "init_points=20"];
    works(&[&train, options.as_slice()].concat());
    let run = json(&folder.0.join("run/run.json"));
    assert_eq!(run["capture_settings"]["downscale"], 2);
    assert_eq!(run["capture_settings"]["skip_missing"], true);
    assert_eq!(run["test_cameras"], serde_json::json!(["b"]));
    works(&["eval", &output]);
}

#[test]
fn the_first_gaussians_alone_are_those_of_the_run_that_is_asked_for() {
    let tiny = Tiny::new("first-alone");
    let (capture, file) = (tiny.folder.to_str().unwrap(), tiny.folder.join("first.ply"));
    let only = ["train", capture, "--only-init", file.to_str().unwrap(), "--json"];
    let told: Value = serde_json::from_str(&works(&[&only[..], &["--max-gaussians", "300"]].concat())).unwrap();
    let config = Config { max_gaussians: 300, ..exact() };
    let training = tiny.capture.clone().transformed(&tiny.capture.normalisation());
    let initial = initialise(&training, &config, &mut |_, _| {}).unwrap().splats;
    let written = read_ply(&file).unwrap();
    assert_eq!((written.len(), written.n_static), (initial.len(), initial.n_static));
    assert_eq!((&told["gaussians"], &told["dynamic_gaussians"]), (&initial.len().into(), &initial.motion.len().into()));
    assert!((1..=300).contains(&written.len()) && written.sh_degree == 0);
    let concatenated: Value = serde_json::from_str(&works(&[&only[..], &["--set", "init=concat"]].concat())).unwrap();
    assert!(concatenated["from"] == "concat" && concatenated["gaussians"].as_u64() > told["gaussians"].as_u64());
}
