//! Output that cannot be written ends no work, and never with a panic.

use super::{Folder, ivv};
use crate::common::prelude::*;
use crate::common::running::Running;
use std::io::{BufRead, BufReader, Read};

fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

/// A device that is always full; none where the system has none.
fn full() -> Option<Stdio> {
    File::options().write(true).open("/dev/full").ok().map(Stdio::from)
}

/// The code that a command ends with, and what it told on standard error.
fn ended(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_listing_whose_reader_goes_ends_quietly() {
    for arguments in [&["devices"][..], &["devices", "--json"], &["--help"], &["--version"], &["train", "--help"]] {
        let (code, told) = ended(&ivv(arguments).stdout(closed_pipe()).stderr(Stdio::piped()).output().unwrap());
        assert_eq!((code, told.as_str()), (Some(0), ""), "{arguments:?}");
    }
    let folder = Folder::new("listing");
    let (code, told) = ended(&ivv(&["check", &folder.path("none")]).stdout(closed_pipe()).output().unwrap());
    assert!(code == Some(3) && !told.contains("panicked"), "what is wrong is still told: {code:?} {told}");
}

#[test]
fn results_that_find_no_room_are_an_error() {
    if full().is_none() {
        return crate::common::notes::skip("this system has no /dev/full");
    }
    let folder = Folder::new("full");
    let capture = folder.capture();
    let cases =
        [&["devices"][..], &["devices", "--json"], &["--json", "check", &capture], &["check", &capture], &["--help"]];
    for arguments in cases {
        let full = full().expect("it was there");
        let (code, told) = ended(&ivv(arguments).stdout(full).stderr(Stdio::piped()).output().unwrap());
        assert_eq!(code, Some(3), "{arguments:?}: {told}");
        assert!(told.starts_with("ivv: standard output: cannot be written") && told.lines().count() == 1, "{told}");
    }
}

#[test]
fn warnings_and_faults_that_find_no_room_change_nothing() {
    let folder = Folder::new("warnings");
    let (mut splats, views) = ivv::internals::scene::demo();
    splats.position[0][0] = f32::NAN;
    ivv::internals::formats::write_ply(&folder.0.join("scene.ply"), &splats).unwrap();
    ivv::internals::scene::write_views(&folder.0.join("cameras.json"), &views[..1]).unwrap();
    let (scene, cameras, out) = (folder.path("scene.ply"), folder.path("cameras.json"), folder.path("out"));
    let render = ["render", &scene, "--cameras", &cameras, "-o", &out, "--log-level", "trace"];
    let none = folder.path("none");
    for lost in [Some(closed_pipe()), full()].into_iter().flatten() {
        assert_eq!(ivv(&render).stderr(lost).status().unwrap().code(), Some(0));
    }
    for (arguments, code) in [(&["check", &none][..], 3), (&["no-such-verb"], 2), (&[], 2)] {
        assert_eq!(ivv(arguments).stderr(closed_pipe()).output().unwrap().status.code(), Some(code), "{arguments:?}");
    }
}

/// A training whose standard error is read up to its first line.
fn train_without_reader(folder: &Folder, more: &[&str]) -> Running {
    let (capture, run) = (folder.capture(), folder.path("run"));
    let train = ["train", &capture, "-o", &run, "--max-gaussians", "800", "--eval-every", "0", "--log-level", "trace"];
    let mut training = Running::start(ivv(&[&train, more].concat()).stdout(Stdio::null()).stderr(Stdio::piped()));
    let mut reader = BufReader::new(training.0.stderr.take().unwrap());
    reader.read_line(&mut String::new()).unwrap();
    training
}

#[test]
fn a_training_outlives_the_reader_of_its_messages() {
    let folder = Folder::new("reader");
    let mut training = train_without_reader(&folder, &["--steps", "12"]);
    assert_eq!(training.code(), Some(0));
    assert!(folder.0.join("run/scene.ply").is_file() && folder.0.join("run/report.html").is_file());
}

#[test]
#[cfg(unix)]
fn ctrl_c_leaves_a_checkpoint_where_nobody_reads_the_messages() {
    let folder = Folder::new("interrupt");
    let mut training = train_without_reader(&folder, &["--steps", "100000", "--checkpoint-every", "5"]);
    // Steps are under way once there is a checkpoint.
    training.wait_for_checkpoint(&folder.0.join("run/checkpoints"), 5);
    training.signal(rustix::process::Signal::INT);
    assert_eq!(training.code(), Some(130));
}

#[test]
#[cfg(unix)]
fn a_signal_leaves_a_checkpoint_where_the_pipe_of_messages_is_full() {
    let folder = Folder::new("full-pipe");
    let (capture, run) = (folder.capture(), folder.path("run"));
    let train = ["train", &capture, "-o", &run, "--max-gaussians", "300", "--eval-every", "0", "--log-level", "trace"];
    let more = ["--steps", "1000000", "--checkpoint-every", "1000000"];
    // Its reader holds the pipe open and reads nothing; a trace fills it in the first steps.
    let (reader, writer) = std::io::pipe().unwrap();
    let mut training = Running::start(ivv(&[&train[..], &more].concat()).stdout(Stdio::null()).stderr(writer));
    let checkpoints = folder.0.join("run/checkpoints");
    training.wait_for_checkpoint(&checkpoints, 0);
    // The writer waits by now, or a trace of some hundred steps would have ended.
    std::thread::sleep(std::time::Duration::from_secs(3));
    training.signal(rustix::process::Signal::TERM);
    assert_eq!(training.code(), Some(130));
    let step = ivv::internals::train::Checkpoint::newest_step(&checkpoints).unwrap().unwrap();
    assert!(step > 0, "no step was taken while nobody read");
    // What a reader finds that comes late: the lines that were there first.
    let mut told = String::new();
    BufReader::new(reader).read_line(&mut told).unwrap();
    assert!(!told.is_empty());
}

#[test]
fn with_json_a_fault_is_json_too() {
    let folder = Folder::new("json");
    let (none, run) = (folder.path("none"), folder.path("run"));
    let cases = [
        (&["train", &none, "-o", &run, "--json"][..], "data", 3),
        (&["prepare", &none, "-o", &run, "--json"], "data", 3),
        (&["--json", "check", &none], "data", 3),
        (&["inspect", &none, "--json"], "data", 3),
        (&["train", "--json"], "usage", 2),
        (&["train", &none, "-o", &run, "--set", "growth", "--json"], "usage", 2),
        (&["devices", "--device", "no such device", "--json"], "no_device", 4),
    ];
    for (arguments, kind, code) in cases {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_ivv"));
        let output = child.args(arguments).output().unwrap();
        let (ended, told) = ended(&output);
        assert_eq!(ended, Some(code), "{arguments:?}: {told}");
        let value: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}"));
        let error = &value["error"];
        assert_eq!((&error["kind"], &error["exit_code"]), (&Value::from(kind), &Value::from(code)), "{arguments:?}");
        let message = error["message"].as_str().unwrap();
        assert!(!message.is_empty() && told.contains(message), "{message} / {told}");
    }
}

#[test]
fn files_with_the_same_fault_are_told_of_together() {
    let folder = Folder::new("faults");
    let capture = folder.capture();
    let told = |capture: &str| {
        let output = ivv(&["check", capture]).output().unwrap();
        assert_eq!(output.status.code(), Some(3));
        String::from_utf8(output.stdout).unwrap()
    };
    for frame in 0..2 {
        for camera in ["cam00", "cam01", "cam02"] {
            std::fs::remove_file(folder.0.join(format!("capture/images/{camera}/{frame:05}.png"))).unwrap();
        }
    }
    let faults = told(&capture);
    let faults: Vec<&str> = faults.lines().filter(|line| line.starts_with("fault:")).collect();
    assert!(faults.len() == 1 && faults[0].contains("6 times: "), "{faults:#?}");
    assert!(faults[0].contains("images/cam00/00000.png") && faults[0].ends_with(", ..."), "{faults:#?}");
    // Nothing is counted in what is not there.
    let nothing = told(&folder.path("none"));
    assert!(nothing.contains("no such folder") && !nothing.contains("cameras:"), "{nothing}");
}

#[test]
fn logs_have_colours_on_terminals_alone_and_quiet_leaves_warnings() {
    let folder = Folder::new("quiet");
    let (capture, run) = (folder.capture(), folder.path("run"));
    let train =
        ["train", &capture, "-o", &run, "--steps", "3", "--set", "offsets=false", "--eval-every", "0", "--overwrite"];
    let told = |more: &[&str]| ended(&ivv(&[&train, more].concat()).output().unwrap());
    let (code, plain) = told(&["--log-level", "debug"]);
    assert_eq!(code, Some(0), "{plain}");
    assert!(plain.contains("device: ") && !plain.contains('\x1b'), "{plain}");
    let (code, quiet) = told(&["--quiet"]);
    assert_eq!((code, quiet.as_str()), (Some(0), ""));
    // A checkpoint that cannot be read is warned of all the same.
    std::fs::write(folder.0.join("run/checkpoints/00000099.ckpt"), "no checkpoint").unwrap();
    let resume = ["train", &capture, "-o", &run, "--resume", "-q"];
    let (code, warned) = ended(&ivv(&resume).output().unwrap());
    assert_eq!(code, Some(0), "{warned}");
    assert!(warned.contains("WARN") && warned.contains("00000099.ckpt") && !warned.contains('\x1b'), "{warned}");
}

#[test]
fn views_that_are_soon_rendered_have_no_line_each() {
    let folder = Folder::new("views");
    let (splats, views) = ivv::internals::scene::demo();
    let mut view = views[0].clone();
    (view.intrinsics.width, view.intrinsics.height) = (16, 16);
    let views: Vec<_> =
        (0..30).map(|i| ivv::internals::scene::View { name: format!("v{i}"), ..view.clone() }).collect();
    ivv::internals::formats::write_ply(&folder.0.join("scene.ply"), &splats).unwrap();
    ivv::internals::scene::write_views(&folder.0.join("cameras.json"), &views).unwrap();
    let (scene, cameras, out) = (folder.path("scene.ply"), folder.path("cameras.json"), folder.path("out"));
    let render = ["render", &scene, "--cameras", &cameras, "-o", &out];
    let mut child = ivv(&render).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = String::new();
    child.stderr.take().unwrap().read_to_string(&mut told).unwrap();
    assert!(child.wait().unwrap().success() && folder.0.join("out/v29.png").is_file(), "{told}");
    assert!(told.lines().count() < 15, "{told}");
}
