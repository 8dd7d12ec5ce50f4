//! Test scores that fall while a run goes on.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::train::{Fall, Kind, Log, Strategy};
use serde_json::json;

/// The steps of `scores` at which `Fall` warns, in a run of 30,000 steps.
fn warned(scores: &[(u64, f64)], config: &Config) -> Vec<u64> {
    let told = (1..=scores.len()).filter_map(|n| Fall::of(&scores[..n], config, 30_000));
    told.map(|fall| fall.step).collect()
}

fn at(scores: &[(f64, f64)]) -> Vec<(u64, f64)> {
    scores.iter().map(|(thousands, psnr)| ((1000.0 * thousands) as u64, *psnr)).collect()
}

fn never_reset() -> Config {
    Config { density: Density { reset_every: 0, ..Density::default() }, ..exact() }
}

#[test]
fn a_fall_is_told_once_until_the_scores_recover() {
    let config = never_reset();
    let fall = Fall::of(&at(&[(1.0, 20.0), (2.0, 25.0), (3.0, 24.4)]), &config, 30_000);
    assert_eq!(fall, Some(Fall { step: 3000, psnr: 24.4, best_step: 2000, best_psnr: 25.0 }));
    // What is near the best is none: runs that go well move by a few tenths.
    assert_eq!(warned(&at(&[(1.0, 20.0), (2.0, 25.0), (3.0, 24.6), (4.0, 24.55)]), &config), [0; 0]);
    // Once in a fall, and again in the next.
    let course =
        [(1.0, 25.0), (2.0, 24.0), (3.0, 23.0), (4.0, 24.0), (5.0, 24.8), (6.0, 24.0), (7.0, 26.0), (8.0, 25.4)];
    assert_eq!(warned(&at(&course), &config), [2000, 6000, 8000]);
    // A slow fall counts from the best, not from the score before.
    assert_eq!(warned(&at(&[(1.0, 25.0), (2.0, 24.7), (3.0, 24.4), (4.0, 24.1)]), &config), [3000]);
    assert_eq!(warned(&[], &config), [0; 0]);
    assert_eq!(warned(&at(&[(1.0, f64::NAN), (2.0, 3.0)]), &config), [0; 0]);
}

#[test]
fn the_dip_after_a_reset_of_the_opacities_is_expected() {
    // Resets after every 3,000 steps, the last one before half of the run.
    let config = Config {
        density: Density { strategy: Strategy::Adc, reset_every: 3000, stop: 0.5, ..Density::default() },
        ..exact()
    };
    assert_eq!(warned(&at(&[(2.9, 25.0), (3.0, 15.0), (3.5, 20.0), (4.0, 24.0)]), &config), [0; 0]);
    assert_eq!(warned(&at(&[(2.9, 25.0), (3.0, 15.0), (4.5, 24.0)]), &config), [4500], "it should have recovered");
    assert_eq!(warned(&at(&[(2.0, 25.0), (2.9, 24.0)]), &config), [2900], "before the first reset");
    assert_eq!(warned(&at(&[(14.0, 25.0), (15.0, 24.0)]), &config), [15_000], "half of the run is over");
    // A dip that is expected is no recovery from a fall before it.
    assert_eq!(warned(&at(&[(1.0, 25.0), (2.0, 24.0), (3.0, 20.0), (5.0, 24.0)]), &config), [2000]);
    let mcmc = Config { density: Density { strategy: Strategy::Mcmc, ..config.density.clone() }, ..config.clone() };
    assert_eq!(warned(&at(&[(2.9, 25.0), (3.0, 15.0)]), &mcmc), [3000], "it never resets");
}

#[test]
fn only_scores_of_the_same_images_are_compared() {
    let mut log = Log::open(Path::new("nowhere"), 0);
    let mut push = |step: u64, psnr: f64, view: &str| {
        log.push(Kind::Evaluation, &json!({ "step": step, "psnr": psnr, "views": [{ "view": view }] })).unwrap();
        Fall::of_log(&log, &never_reset(), 100).map(|fall| fall.best_step)
    };
    assert_eq!([push(10, 30.0, "easy"), push(20, 20.0, "hard"), push(30, 19.0, "hard")], [None, None, Some(20)]);
}

#[test]
fn a_run_whose_test_scores_fall_warns_on_the_screen_in_the_log_and_in_the_report() {
    let tiny = Tiny::of_frames("fall", 2);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let train = ["train", capture, "-o", run.to_str().unwrap(), "--steps", "50", "--eval-every", "10", "-q"];
    // Colours that jump about ever more wildly.
    let rates = r#"lr.sh={"start":2e-2,"end":100}"#;
    let told = tells(&[&train[..], &["--eval-images", "2", "--set", rates]].concat());
    let text = std::fs::read_to_string(run.join("train.jsonl")).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let fall = lines.iter().find(|line| line["kind"] == "fall").expect("a line of the log");
    let [psnr, best] = ["psnr", "best_psnr"].map(|key| fall[key].as_f64().unwrap());
    assert!(psnr < best - 0.5, "{fall}");
    let warning = format!(
        "the PSNR of the test images fell: {best:.2} dB after step {}, {psnr:.2} dB after step {}",
        fall["best_step"], fall["step"]
    );
    assert_eq!(told.matches(&format!("warning: {warning}")).count(), 1, "{told}");
    assert!(told.contains("train with fewer steps (--steps)"), "{told}");
    assert!(std::fs::read_to_string(run.join("report.html")).unwrap().contains(&warning));
    assert_eq!(json(&run.join("train.json"))["steps"], 50);
}
