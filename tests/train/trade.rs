//! `ivv trade` as a command: what settings cost and buy.

use super::Tiny;
use super::run::{fails, json, works};
use std::path::Path;

#[test]
fn a_trade_runs_all_settings_in_turn_and_finds_a_cut_of_nothing_to_be_exact() {
    let tiny = Tiny::new("trade");
    let (capture, output) = (tiny.folder.to_str().unwrap(), tiny.folder.join("trade"));
    let mut arguments = vec!["trade", capture, "-o", output.to_str().unwrap(), "--steps", "20", "--seeds", "3"];
    // The constants leave out as much.
    arguments.extend(["--presets", "exact", "--knob", "frame.alpha_cut=0.001", "--knob", "frame.depth_bits=16"]);
    arguments.extend(["--knob", "required.reviews=1", "--without", "balanced"]);
    let told = works(&arguments);
    let found = json(&output.join("trade.json"));
    let names: Vec<&str> = found["arms"].as_array().unwrap().iter().map(|arm| arm["name"].as_str().unwrap()).collect();
    assert_eq!(names[..4], ["exact", "frame.alpha_cut=0.001", "frame.depth_bits=16", "required.reviews=1"]);
    assert!(names.contains(&"balanced without resolution"));
    assert_eq!(found["comparisons"][1]["verdict"], "same_bits");
    // A review takes something from every scene of so few steps.
    assert_ne!(found["runs"][0][0]["scene_hash"], found["runs"][0][3]["scene_hash"]);
    for run in found["runs"][0].as_array().unwrap() {
        let blocks = run["block_seconds"].as_array().unwrap();
        assert!(blocks.len() == 2 && blocks.iter().all(|seconds| seconds.as_f64().unwrap() > 0.0));
        assert!(run["psnr"].as_f64().unwrap() > 5.0 && run["worst_psnr"].as_f64() < run["psnr"].as_f64());
        assert!(
            run["flicker"].is_number() && run["flow_error"].is_number() && run["device_bytes"].as_u64() > Some(10_000)
        );
    }
    let errors = found["kernel_errors"].as_array().unwrap();
    assert!(errors[0]["psnr"].as_f64().unwrap() > 80.0 && errors.len() >= 3, "{errors:?}");
    let table = std::fs::read_to_string(output.join("trade.md")).unwrap();
    assert!(told.contains(&table) && table.contains("| frame.alpha_cut=0.001 | ") && table.contains("same bits"));
    let seed = output.join("seed-3.json");
    let before = std::fs::metadata(&seed).unwrap().modified().unwrap();
    works(&arguments);
    assert_eq!(std::fs::metadata(&seed).unwrap().modified().unwrap(), before, "a run was made again");
    let to = ["trade", capture, "-o", output.to_str().unwrap(), "--only-presets"];
    let told = fails(&["trade", capture, "-o", output.to_str().unwrap(), "--knob", "batch=2"], 2);
    assert!(told.contains("batch=2: changes batch, steps, epochs or seed"), "{told}");
    let metric = ["trade", capture, "-o", output.to_str().unwrap(), "--knob", "loss.depth_space=metric"];
    assert!(fails(&metric, 2).contains("loss.depth_space=metric: takes depth or flow otherwise"));
    let flow =
        [&["trade", capture, "-o", output.to_str().unwrap()][..], &["--set", "loss.flow=0", "--knob", "loss.flow=1"]];
    assert!(fails(&flow.concat(), 2).contains("loss.flow=1: takes depth or flow otherwise"));
    assert!(fails(&[&to[..], &["--seeds", "3,3"]].concat(), 2).contains("names 3 twice"));
    assert!(fails(&["trade", capture, "-o", "x", "--knob", "frame.depth=16"], 2).contains("frame.depth=16"));
}

#[test]
fn a_capture_that_was_made_again_is_measured_again() {
    let tiny = Tiny::new("trade-again");
    let (capture, output) = (tiny.folder.join("made"), tiny.folder.join("trade"));
    let [capture, to] = [&capture, &output].map(|path| path.to_str().unwrap());
    let synth = ["synth", "-o", capture, "--preset", "tiny", "--frames", "2"];
    let trade = ["trade", capture, "-o", to, "--steps", "10", "--seeds", "3", "--presets", "exact", "--only-presets"];
    let times = || {
        works(&trade);
        std::fs::metadata(output.join("seed-3.json")).unwrap().modified().unwrap()
    };
    works(&synth);
    let first = times();
    assert_eq!(times(), first, "a run was made again");
    // The same frames of the same cameras, half as large.
    works(&[&synth[..], &["--size", "32x24"]].concat());
    assert_ne!(times(), first, "the times of another capture");
}

#[test]
fn a_trade_trains_and_scores_as_a_run_does() {
    let tiny = Tiny::new("trade-run");
    let (capture, trade) = (tiny.folder.to_str().unwrap(), tiny.folder.join("trade"));
    // Random Gaussians are before the lenses too, where a run shows none.
    let same = ["--steps", "20", "--set", "init=random", "--set", "init_points=3000"];
    let path = |folder: &Path| folder.to_str().unwrap().to_owned();
    let seeds = ["--seeds", "3", "--presets", "balanced", "--only-presets"];
    works(&[&["trade", capture, "-o", &path(&trade)][..], &seeds, &same].concat());
    let trade = json(&trade.join("trade.json"));
    // The second begins on images of half the size.
    for (arm, preset) in ["exact", "balanced"].iter().enumerate() {
        assert_eq!(trade["arms"][arm]["name"], *preset);
        let run = tiny.folder.join(preset);
        let train = ["train", capture, "-o", &path(&run), "--preset", preset, "--seed", "3", "--eval-every", "0"];
        works(&[&train[..], &same].concat());
        let run = json(&run.join("eval.json"));
        let [alone, in_turn] = [&run["psnr"], &trade["runs"][0][arm]["psnr"]].map(|psnr| psnr.as_f64().unwrap());
        assert!((alone - in_turn).abs() < 1e-3, "{preset}: {alone} {in_turn}");
    }
}
