//! `ivv bench`: a study on captures, finished runs side by side, and a history of them.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::study::{Bench, RunResult};

/// Two arms, one of them with a preset, and one seed.
const STUDY: &str = r#"{
    "title": "Colours", "question": "Do higher bands pay?",
    "arms": [{"key": "plain", "name": "constant colours"},
             {"key": "bands.v1", "preset": "balanced", "settings": {"sh_degree": 1}, "paper": {"psnr": "30.1"}}],
    "scores": ["psnr", "ssim", "lpips", "seconds", "scene_bytes"], "seeds": [3], "steps": 4
}"#;

#[test]
fn a_study_trains_each_arm_once_on_each_capture_and_tabulates_what_came_of_it() {
    let tiny = Tiny::new("bench");
    let first = tiny.folder.to_str().unwrap();
    let [other, output, study] = ["other", "out", "own.json"].map(|name| tiny.folder.join(name));
    let [second, to, own] = [&other, &output, &study].map(|path| path.to_str().unwrap());
    std::fs::write(&study, STUDY).unwrap();
    let bench = ["bench", own, first, "-o", to, "--set", "sh_degree=0", "--set", "max_gaussians=300"];
    let text = works(&bench);
    assert_eq!(std::fs::read_to_string(output.join("bench.md")).unwrap().trim_end(), text.trim_end());
    for part in ["| constant colours | ", " (30.1) | ", "Against `plain`", "sh_degree=0", "Do higher bands pay?"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!text.contains("All captures"), "one capture shows nothing of others: {text}");
    let name = tiny.folder.file_name().unwrap().to_str().unwrap();
    let runs = output.join("runs").join(name);
    let found = json(&output.join("bench.json"));
    for (index, (key, degree)) in [("plain", 0), ("bands.v1", 1)].into_iter().enumerate() {
        let [eval, train, config] =
            ["eval", "train", "config"].map(|file| json(&runs.join(format!("{key}-4-3/{file}.json"))));
        let run = found["runs"].as_array().unwrap().iter().find(|run| run["arm"] == key).unwrap();
        assert_eq!(run["scores"]["psnr"], eval["psnr"]);
        assert_eq!(run["scores"]["scene_bytes"].as_f64(), eval["bytes"].as_f64());
        assert_eq!(run["scores"]["seconds"], train["seconds_stepping"]);
        assert_eq!((&config["sh_degree"], &config["steps"]), (&degree.into(), &4.into()));
        assert_eq!(found["results"][index]["scores"]["psnr"]["mean"], eval["psnr"]);
    }
    assert!(std::fs::read_to_string(output.join("bench.svg")).unwrap().contains("constant colours, 4 steps"));

    // A second call repeats nothing, and trains on a further capture, two runs at a time.
    let times = || {
        let files = ["plain-4-3", "bands.v1-4-3"].map(|run| runs.join(run).join("eval.json"));
        files.map(|file| std::fs::metadata(file).unwrap().modified().unwrap())
    };
    let before = times();
    works(&bench);
    assert_eq!(times(), before, "a run was made again");
    works(&["synth", "-o", second, "--preset", "tiny", "--frames", "2"]);
    let both = [&bench[..3], &[second], &bench[3..], &["--jobs", "2"]].concat();
    let text = works(&both);
    assert_eq!(times(), before, "a run was made again");
    assert!(text.contains("## All captures: PSNR, dB against `plain`") && text.contains("## other"), "{text}");
    let row = text.lines().rfind(|line| line.starts_with("| bands.v1 |")).unwrap();
    assert!(row.ends_with("| not shown |") || row.ends_with("| harms |"), "one seed shows nothing: {row}");
    // A run without scores is made again, and so is that of a capture that was made again.
    std::fs::remove_file(runs.join("plain-4-3/eval.json")).unwrap();
    works(&bench);
    assert!(times()[0] > before[0] && times()[1] == before[1]);
    let score = output.join("runs/other/plain-4-3/eval.json");
    let before = std::fs::metadata(&score).unwrap().modified().unwrap();
    works(&["synth", "-o", second, "--preset", "tiny", "--frames", "2", "--size", "32x24"]);
    works(&both);
    assert_ne!(std::fs::metadata(&score).unwrap().modified().unwrap(), before, "the scores of another capture");
}

#[test]
fn a_study_that_cannot_be_is_refused_before_a_run_begins() {
    let tiny = Tiny::new("bench-refused");
    let (capture, output) = (tiny.folder.to_str().unwrap(), tiny.folder.join("out"));
    let (to, file) = (output.to_str().unwrap(), tiny.folder.join("own.json"));
    let own = file.to_str().unwrap();
    for (from, with, reason) in [
        ("\"seeds\"", "\"colour\": 1, \"seeds\"", "unknown field `colour`"),
        ("sh_degree", "sh_degre", "sh_degre"),
        ("\"psnr\", \"ssim\"", "\"beauty\"", "beauty"),
    ] {
        std::fs::write(&file, STUDY.replace(from, with)).unwrap();
        let fault = fails(&["bench", own, capture, "-o", to], 3);
        assert!(fault.contains("own.json") && fault.contains(reason), "{fault}");
    }
    std::fs::write(&file, STUDY).unwrap();
    for (more, code, reason) in [
        (&["--seeds", "1,2,1"][..], 2, "1 is named twice"),
        (&["--set", "frame.depth=16"], 2, "frame.depth"),
        (&["--set", "loss.lpips_weights=/no/such"], 2, "no such file"),
        (&["--history", "x.json"], 2, "--runs"),
        (&["--jobs", "0"], 2, "--jobs"),
        (&[capture], 2, "two captures are called"),
    ] {
        let fault = fails(&[&["bench", own, capture, "-o", to], more].concat(), code);
        assert!(fault.contains(reason), "{more:?}: {fault}");
    }
    assert!(fails(&["bench", "colour", capture, "-o", to], 3).contains("supervision"));
    assert!(fails(&["bench", "perceptual", capture, "-o", to], 2).contains("loss.lpips_weights"));
    assert!(!Path::new(to).exists(), "nothing was begun");
}

#[test]
fn runs_are_compared_and_a_history_grows() {
    let tiny = Tiny::new("bench-runs");
    let [run, other, out] = ["run", "other", "out"].map(|name| tiny.folder.join(name).to_str().unwrap().to_owned());
    let history = tiny.folder.join("history.json");
    let capture = tiny.folder.to_str().unwrap();
    let train = ["train", capture, "--steps", "4", "--sh-degree", "0", "--eval-every", "0"];
    works(&[&train[..], &["-o", &run]].concat());
    works(&[&train[..], &["-o", &other, "--seed", "7"]].concat());
    let compare = ["bench", "--runs", &run, &other, "-o", &out, "--history", history.to_str().unwrap()];
    let table = works(&compare);
    assert!(table.contains("seeds: 7, 42; steps: 4") && table.contains("| sh_degree=0 |"), "{table}");
    works(&compare);

    let folder = tiny.folder.join("out");
    let found = json(&folder.join("bench.json"));
    let psnr = ["run", "other"].map(|name| json(&tiny.folder.join(name).join("eval.json"))["psnr"].as_f64().unwrap());
    let mean = found["results"][0]["scores"]["psnr"]["mean"].as_f64().unwrap();
    assert!((mean - psnr[0].midpoint(psnr[1])).abs() < 1e-9);
    assert!(std::fs::read_to_string(folder.join("bench.svg")).unwrap().contains("<circle"));
    assert_eq!(std::fs::read_to_string(folder.join("bench.md")).unwrap().trim_end(), table.trim_end());
    assert_eq!(json(&history).as_array().unwrap().len(), 2, "one measurement each time");
    let drawn = std::fs::read_to_string(tiny.folder.join("history.svg")).unwrap();
    // PSNR, SSIM, seconds and, where the system tells, those of the processors; two points each.
    assert!([6, 8].contains(&drawn.matches("<circle").count()), "{drawn}");
    let seconds = json(&history)[0]["runs"][0]["cpu_seconds"].as_f64();
    assert!(!cfg!(target_os = "linux") || seconds.is_some_and(|seconds| seconds > 0.0), "{seconds:?}");

    // Runs of other images are on another capture, even of the same name.
    let path = tiny.folder.join("run");
    let result = RunResult::read(&path).unwrap();
    let others = RunResult { images: "others".to_owned(), ..result.clone() };
    let bench = Bench::of_runs(&[(path.as_path(), result), (path.as_path(), others)], String::new()).unwrap();
    assert_ne!(bench.runs[0].capture, bench.runs[1].capture);

    // A run that has not ended, and a file that is no history, which stays as it is.
    std::fs::remove_file(tiny.folder.join("other/eval.json")).unwrap();
    let fault = fails(&compare, 3);
    assert!(fault.contains("eval.json") && fault.contains("--resume"), "{fault}");
    std::fs::write(&history, "{}").unwrap();
    let fault = fails(&["bench", "--runs", &run, "--history", history.to_str().unwrap()], 3);
    assert!(fault.contains("history.json") && fault.contains("--history"), "{fault}");
    assert_eq!(std::fs::read_to_string(&history).unwrap(), "{}");
}
