//! `ivv compare`: runs side by side, and a history of them.

use super::Tiny;
use super::run::{fails, json, works};
use ivv::study::{RunResult, RunTable};

#[test]
fn runs_are_compared_and_a_history_grows() {
    let tiny = Tiny::new("compare");
    let [run, other, out] = ["run", "other", "out"].map(|name| tiny.folder.join(name).to_str().unwrap().to_owned());
    let history = tiny.folder.join("history.json");
    let capture = tiny.folder.to_str().unwrap();
    let train = ["train", capture, "--steps", "4", "--sh-degree", "0", "--eval-every", "0"];
    works(&[&train[..], &["-o", &run]].concat());
    works(&[&train[..], &["-o", &other, "--seed", "7"]].concat());
    let compare = ["compare", &run, &other, "-o", &out, "--history", history.to_str().unwrap()];
    let table = works(&compare);
    assert!(table.contains("`sh_degree=0` | 4 | 7 42 |"), "{table}");
    works(&compare);

    let folder = tiny.folder.join("out");
    let told = json(&folder.join("compare.json"));
    let mean = ["run", "other"].map(|name| json(&tiny.folder.join(name).join("eval.json"))["psnr"].as_f64().unwrap());
    let [mean, least, most] = [mean[0].midpoint(mean[1]), mean[0].min(mean[1]), mean[0].max(mean[1])];
    assert_eq!(told["groups"][0]["scores"]["psnr"], serde_json::json!([mean, least, most]));
    assert!(std::fs::read_to_string(folder.join("compare.svg")).unwrap().contains("<circle"));
    assert_eq!(std::fs::read_to_string(folder.join("compare.md")).unwrap().trim_end(), table.trim_end());
    assert_eq!(json(&history).as_array().unwrap().len(), 2, "one measurement each time");
    let drawn = std::fs::read_to_string(tiny.folder.join("history.svg")).unwrap();
    // PSNR, SSIM, seconds and, where the system tells, those of the processors; two points each.
    assert!([6, 8].contains(&drawn.matches("<circle").count()), "{drawn}");
    let seconds = told["runs"][0]["cpu_seconds"].as_f64();
    assert!(!cfg!(target_os = "linux") || seconds.is_some_and(|seconds| seconds > 0.0), "{seconds:?}");

    // Runs of other images, devices and sources have rows of their own.
    let found = RunResult::read(&tiny.folder.join("run")).unwrap();
    let others = [
        RunResult { images: "others".to_owned(), ..found.clone() },
        RunResult { device: "another".to_owned(), ..found.clone() },
        RunResult { driver: "another".to_owned(), ..found.clone() },
        RunResult { revision: Some("another".to_owned()), ..found.clone() },
    ];
    others.into_iter().for_each(|other| assert_eq!(RunTable::new(&[found.clone(), other]).0.len(), 2));

    // A run that has not ended, and a file that is no history, which stays as it is.
    std::fs::remove_file(tiny.folder.join("other/eval.json")).unwrap();
    let told = fails(&compare, 3);
    assert!(told.contains("eval.json") && told.contains("--resume"), "{told}");
    std::fs::write(&history, "{}").unwrap();
    let told = fails(&["compare", &run, "--history", history.to_str().unwrap()], 3);
    assert!(told.contains("history.json") && told.contains("--history"), "{told}");
    assert_eq!(std::fs::read_to_string(&history).unwrap(), "{}");
}
