//! What a run says of a capture that is not what it was, and of test images that it trains on.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;

fn show(folder: &Path, [from, to]: [&str; 2]) {
    for entry in std::fs::read_dir(folder.join("images").join(from)).unwrap() {
        let file = entry.unwrap().path();
        std::fs::copy(&file, folder.join("images").join(to).join(file.file_name().unwrap())).unwrap();
    }
}

#[test]
fn another_calibration_and_other_pictures_are_told_before_a_run_is_scored_or_goes_on() {
    let tiny = Tiny::of_frames("changed", 2);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let path = run.to_str().unwrap();
    let train = ["train", capture, "-o", path, "--steps", "4", "--sh-degree", "0", "--eval-every", "0"];
    assert!(!tells(&train).contains("warning"));
    let quiet = |told: String| assert!(!told.contains("warning"), "{told}");
    quiet(tells(&["eval", path]));
    quiet(tells(&["train", "--resume", "-o", path, "--steps", "5"]));
    // Runs of before there were fingerprints are read as they were.
    let file = run.join("run.json");
    let new = json(&file);
    let mut old = new.clone();
    assert!(old.as_object_mut().unwrap().remove("fingerprints").is_some());
    std::fs::write(&file, old.to_string()).unwrap();
    quiet(tells(&["eval", path]));
    std::fs::write(&file, new.to_string()).unwrap();
    // The calibration of every camera, as a new reconstruction has it.
    let model = tiny.folder.join("sparse/0/images.txt");
    let text = std::fs::read_to_string(&model).unwrap();
    let moved = text.lines().map(|line| {
        let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        if words.len() == 10 && words[0] != "#" {
            words[5] = (words[5].parse::<f64>().unwrap() + 0.3).to_string();
        }
        words.join(" ") + "\n"
    });
    std::fs::write(&model, moved.collect::<String>()).unwrap();
    let n = tiny.capture.cameras.len();
    let warned = tells(&["eval", path]);
    assert!(warned.contains(&format!("the calibration of {n} cameras")) && warned.contains("cam00"), "{warned}");
    assert!(!warned.contains("picture"), "{warned}");
    std::fs::write(&model, text).unwrap();
    // Pictures of one camera by those of another.
    show(&tiny.folder, ["cam02", "cam03"]);
    let warned = tells(&["train", "--resume", "-o", path, "--steps", "6"]);
    assert!(warned.contains("2 pictures changed (cam03: 2)") && !warned.contains("calibration"), "{warned}");
    assert!(warned.contains("warning"), "{warned}");
}

#[test]
fn test_images_that_are_training_images_are_counted() {
    let tiny = Tiny::of_frames("shared-pictures", 2);
    let tests: Vec<&str> = tiny.capture.cameras.iter().filter(|c| c.is_test).map(|c| c.name.as_str()).collect();
    let other = tiny.capture.cameras.iter().find(|camera| !camera.is_test).unwrap();
    show(&tiny.folder, [&other.name, tests[0]]);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let path = run.to_str().unwrap();
    let warned = tells(&["train", capture, "-o", path, "--steps", "2", "--sh-degree", "0", "--eval-every", "0"]);
    assert!(warned.contains("2 test images are images of another camera"), "{warned}");
    assert!(tells(&["eval", path]).contains("2 test images are images of another camera"));
}

#[test]
fn weights_of_lpips_are_opened_before_the_first_step_if_they_are_for_scores_alone() {
    let tiny = Tiny::of_frames("lpips-missing", 2);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let (path, weights) = (run.to_str().unwrap(), tiny.folder.join("narrow.safetensors"));
    let setting = format!("loss.lpips_weights={}", weights.display());
    let train = ["train", capture, "-o", path, "--steps", "4", "--sh-degree", "0", "--eval-every", "0", "--overwrite"];
    let lpips = ["--set", "loss.lpips=0", "--set", &setting];
    let missing = fails(&[&train[..], &lpips].concat(), 3);
    assert!(missing.contains("narrow.safetensors") && !run.join("checkpoints").exists(), "{missing}");
    fails(&["train", capture, "-o", path, "--plan", "--set", &setting], 3);
    ivv_conformance::fixtures::lpips::save(
        &weights,
        &ivv_conformance::fixtures::lpips::narrow(1, ivv::internals::stage::Trunk::SqueezeNet),
    )
    .unwrap();
    let plan = |crop: &str| -> Value {
        let arguments = ["train", capture, "-o", path, "--json", "--plan", "--set", &setting, "--set", crop];
        serde_json::from_str(&works(&arguments)).unwrap()
    };
    let bytes = |crop: &str| plan(crop)["device_bytes"].as_u64().unwrap();
    assert!(bytes("loss.lpips_crop=0") > bytes("loss.lpips_crop=20"), "the plan has its features");
    works(&[&train[..], &lpips].concat());
    let eval = json(&run.join("eval.json"));
    assert!(eval["lpips"].as_f64().unwrap() > 0.0 && eval["lpips_unscaled"].as_f64().unwrap() > 0.0);
    assert!(eval["metrics"]["lpips_unscaled"].as_str().unwrap().contains("[0, 1]"));
    std::fs::remove_file(&weights).unwrap();
    let steps = json(&run.join("train.json"))["steps"].clone();
    assert!(fails(&["train", "--resume", "-o", path, "--steps", "9"], 3).contains("narrow.safetensors"));
    assert_eq!(json(&run.join("train.json"))["steps"], steps);
    assert!(!run.join("checkpoints/00000009.ckpt").exists());
}

#[test]
fn more_steps_than_lazy_adam_has_room_for_are_refused_before_anything_is_written() {
    let tiny = Tiny::of_frames("lazy", 2);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let train = ["train", capture, "-o", run.to_str().unwrap(), "--steps", "400000000", "--set", "adam=lazy"];
    let refused = fails(&train, 5);
    assert!(refused.contains("adam=dense") && refused.contains("steps at most"), "{refused}");
    assert!(!run.join("run.json").exists());
}
