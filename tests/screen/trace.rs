//! `--trace`: spans of a command in Chrome's trace format.

use super::{Folder, ivv};
use crate::common::prelude::*;
#[cfg(unix)]
use crate::common::running::Running;

/// The spans of a trace: each as the names from the outermost one of its thread to itself, with its arguments.
fn spans(file: &Path) -> Vec<(Vec<String>, Value)> {
    let text = std::fs::read(file).unwrap();
    let entries: Vec<Value> = serde_json::from_slice(&text).unwrap();
    let mut open: BTreeMap<u64, Vec<String>> = BTreeMap::new();
    let (mut found, mut last) = (Vec::new(), BTreeMap::new());
    for entry in &entries {
        let (thread, name) = (entry["tid"].as_u64().unwrap(), entry["name"].as_str().unwrap());
        let open = open.entry(thread).or_default();
        match entry["ph"].as_str().unwrap() {
            "B" => {
                open.push(name.to_owned());
                found.push((open.clone(), entry["args"].clone()));
            }
            "E" => assert_eq!(open.pop().as_deref(), Some(name), "a span ends inside another"),
            _ => continue,
        }
        let at = entry["ts"].as_f64().unwrap();
        assert!(at >= last.insert(thread, at).unwrap_or(0.0), "time goes on in a thread");
    }
    assert!(open.values().all(Vec::is_empty), "{open:?} have not ended");
    found
}

fn paths(spans: &[(Vec<String>, Value)]) -> BTreeSet<String> {
    spans.iter().map(|(path, _)| path.join("/")).collect()
}

const SHORT: [&str; 6] = ["--max-gaussians", "800", "--eval-every", "3", "--checkpoint-every", "4"];

#[test]
fn a_traced_training_has_its_phases_its_steps_and_where_it_waits() {
    let folder = Folder::new("trace");
    let (capture, run, file) = (folder.capture(), folder.path("run"), folder.path("trace.json"));
    std::fs::write(&file, "what was there before, longer than what comes, or not").unwrap();
    let train = ["train", &capture, "-o", &run, "--steps", "6", "-q", "--set", "offsets=false", "--trace", &file];
    let output = ivv(&[&train[..], &SHORT].concat()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let spans = spans(Path::new(&file));
    let found = paths(&spans);
    for path in [
        "ivv/initialise",
        "ivv/upload scene/submit",
        "ivv/step/upload",
        "ivv/step/record/forward",
        "ivv/step/record/loss",
        "ivv/step/record/backward",
        "ivv/step/record/optimiser",
        "ivv/step/submit",
        "ivv/step/wait",
        "ivv/wait",
        "ivv/evaluate/frame/submit",
        "ivv/evaluate/frame/wait",
        "ivv/checkpoint",
        // On a thread of its own.
        "write checkpoint",
        "ivv/write report",
        "decode",
    ] {
        assert!(found.contains(path), "no {path}: {found:#?}");
    }
    let steps = spans.iter().filter(|(path, _)| path.join("/") == "ivv/step").map(|(_, args)| args["step"].clone());
    assert_eq!(steps.collect::<Vec<_>>(), (1..=6).map(|n: u64| n.to_string()).collect::<Vec<_>>());
    assert!(found.iter().all(|path| !path.ends_with("/pass")), "passes are told of at --log-level trace alone");
    let waits: BTreeSet<&str> = spans.iter().filter_map(|(_, args)| args["what"].as_str()).collect();
    assert_eq!(waits, ["device", "image"].into());
}

#[test]
fn at_level_trace_every_pass_is_there_and_without_trace_there_is_no_file() {
    let folder = Folder::new("passes");
    let (capture, run, file) = (folder.capture(), folder.path("run"), folder.path("trace.json"));
    let train = ["train", &capture, "-o", &run, "--steps", "1", "--max-gaussians", "400", "--eval-images", "0"];
    let before = || std::fs::read_dir(&folder.0).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let entries: BTreeSet<std::ffi::OsString> = before();
    let plain = ivv(&train).current_dir(&folder.0).output().unwrap();
    assert!(plain.status.success(), "{}", String::from_utf8_lossy(&plain.stderr));
    let (mut now, mut expected): (BTreeSet<std::ffi::OsString>, _) = (before(), entries);
    expected.insert("run".into());
    now.remove(std::ffi::OsStr::new(".cache"));
    assert_eq!(now, expected);
    let traced = [&train[..], &["--overwrite", "--log-level", "trace", "--trace", &file]].concat();
    assert!(ivv(&traced).stderr(Stdio::null()).status().unwrap().success());
    let spans = spans(Path::new(&file));
    assert!(paths(&spans).contains("ivv/step/submit/pass"));
    let labels: BTreeSet<&str> = spans.iter().filter_map(|(_, args)| args["label"].as_str()).collect();
    assert!(labels.contains("report/loss_sum_report") && labels.len() > 20, "{labels:?}");
}

#[test]
fn a_trace_is_whole_when_the_command_fails_or_cannot_write_it() {
    let folder = Folder::new("failed-trace");
    let (none, file) = (folder.path("none"), folder.path("trace.json"));
    let output = ivv(&["check", &none, "--trace", &file]).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(paths(&spans(Path::new(&file))), ["ivv".to_owned()].into());
    let nowhere = folder.path("no/trace.json");
    let output = ivv(&["train", "--list-settings", "--trace", &nowhere]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(3) && told.contains(&nowhere) && output.stdout.is_empty(), "{told}");
    if Path::new("/dev/full").exists() {
        let output = ivv(&["train", "--list-settings", "--trace", "/dev/full"]).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(3) && told.contains("/dev/full") && !told.contains("panicked"), "{told}");
        assert!(!output.stdout.is_empty(), "the results are told all the same");
    }
}

/// Runs a training with a trace, sends it `signal` once steps are under way, and gives its trace.
#[cfg(unix)]
fn stopped(name: &str, signal: rustix::process::Signal, code: Option<i32>) -> Vec<Value> {
    let folder = Folder::new(name);
    let (capture, run, file) = (folder.capture(), folder.path("run"), folder.path("trace.json"));
    let train = ["train", &capture, "-o", &run, "--steps", "100000", "-q", "--trace", &file];
    let mut command = ivv(&[&train[..], &SHORT[..2], &["--checkpoint-every", "5"]].concat());
    let mut training = Running::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
    training.wait_for_checkpoint(&folder.0.join("run/checkpoints"), 5);
    training.signal(signal);
    assert_eq!(training.code(), code);
    if code.is_some() {
        let found = paths(&spans(Path::new(&file)));
        assert!(found.contains("ivv/step/wait") && found.contains("write checkpoint"), "{found:?}");
    }
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[test]
#[cfg(unix)]
fn ctrl_c_completes_the_trace_and_a_kill_leaves_one_that_can_be_read() {
    use rustix::process::Signal;
    assert!(stopped("trace-interrupt", Signal::INT, Some(130)).len() > 20);
    assert!(stopped("trace-kill", Signal::KILL, None).len() > 20);
}
