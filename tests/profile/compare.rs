//! Two profiles side by side.

use crate::common::prelude::*;
use crate::common::program::json as read_json;
use ivv::internals::profile::{Change, Comparison, Recorded};
use serde_json::json;

/// The profile that the project ships; it is older than the counts of samples by pass.
fn shipped() -> Value {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/profile/profile.json");
    read_json(&file)
}

fn line(label: &str, samples: u64, median_ms: f64, p95_ms: f64) -> Value {
    json!({ "label": label, "samples": samples, "median_ms": median_ms, "p95_ms": p95_ms, "later": [1] })
}

fn written(folder: &Folder, name: &str, profile: &Value) -> PathBuf {
    let inside = folder.file(name);
    std::fs::create_dir_all(&inside).unwrap();
    std::fs::write(inside.join("profile.json"), profile.to_string()).unwrap();
    inside
}

fn compared(folder: &Folder, a: &Value, b: &Value) -> Comparison {
    let (a, b) = (written(folder, "a", a), written(folder, "b", b));
    Comparison::new((&a, &Recorded::read(&a).unwrap()), (&b, &Recorded::read(&b).unwrap()))
}

/// Runs the command on devices that are not there: it needs none.
fn command(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.arg("profile").args(arguments).env("VK_ICD_FILENAMES", "/nowhere.json");
    command.env("VK_DRIVER_FILES", "/nowhere.json").output().unwrap()
}

#[test]
fn passes_are_marked_where_they_changed_by_more_than_they_scatter() {
    let folder = Folder::new("compare");
    let (mut a, mut b) = (shipped(), shipped());
    // Of 100 samples whose 95th percentile lies 10 % above, a median's standard error is 0.76 %.
    a["lines"] = json!([
        line("slower", 100, 10.0, 11.0),
        line("faster", 100, 4.0, 4.4),
        line("within", 100, 2.0, 2.2),
        line("tiny", 100, 1.0, 1.0),
        line("seldom", 4, 1.0, 1.0),
        line("gone", 100, 3.0, 3.3),
        line("nothing", 100, 0.0, 0.0),
    ]);
    b["lines"] = json!([
        line("within", 100, 2.06, 2.27),
        line("slower", 100, 10.5, 11.0),
        line("new", 100, 0.25, 0.3),
        line("faster", 100, 3.0, 3.3),
        line("tiny", 100, 1.01, 1.01),
        line("seldom", 4, 1.3, 1.3),
        line("nothing", 100, 0.0, 0.0),
    ]);
    let found = compared(&folder, &a, &b);
    let of = |label: &str| found.passes.iter().find(|pass| pass.label == label).unwrap();
    let changes = [
        ("slower", Change::Slower),
        ("faster", Change::Faster),
        ("within", Change::Same),
        ("tiny", Change::Same),
        ("seldom", Change::TooFew),
        ("gone", Change::Gone),
        ("new", Change::New),
        ("nothing", Change::Same),
    ];
    for (label, change) in changes {
        assert_eq!(of(label).change, Some(change), "{label}");
    }
    let order: Vec<&str> = found.passes.iter().map(|pass| pass.label.as_str()).collect();
    assert_eq!(order, ["gone", "faster", "slower", "seldom", "new", "within", "tiny", "nothing"]);
    assert_eq!((of("gone").change_ms, of("new").change_ms), (-3.0, 0.25));
    assert_eq!((of("faster").ratio, of("gone").ratio, of("nothing").ratio), (Some(0.75), None, None));
    // Wider scatter: the same change is within it.
    a["lines"][0] = line("slower", 100, 10.0, 14.0);
    assert_eq!(compared(&folder, &a, &b).passes[2].change, Some(Change::Same));
    assert!(found.is_comparable && found.differences.is_empty(), "{:?}", found.differences);
}

#[test]
fn what_differs_beside_the_times_is_said_first_and_spoils_the_ratios_or_not() {
    let folder = Folder::new("compare-other");
    let (a, mut b) = (shipped(), shipped());
    b["shaders"] = "0123456789abcdef".into();
    b["counters"]["evaluated"] = json!(1e6);
    let of_kernels = compared(&folder, &a, &b);
    assert!(of_kernels.is_comparable, "{:?}", of_kernels.differences);
    let names: Vec<&str> = of_kernels.differences.iter().map(|other| other.what).collect();
    assert_eq!(names, ["kernels (hash)", "pixel-splats evaluated"]);
    assert!(!of_kernels.terminal().contains("do not show"));

    b["subject"] = "another\u{1b}[31m".into();
    b["device"]["driver"] = "Mesa 99".into();
    b["counters"]["gaussians"] = json!(30000.0);
    b["peaks"]["bytes"] = json!(1e9);
    let other = compared(&folder, &a, &b);
    assert!(!other.is_comparable);
    let told = other.terminal();
    let warning = "do not show what a change of the kernels did: A and B differ in driver, subject, Gaussians.";
    let (at, passes) = (told.find(warning).unwrap(), told.find("Medians of the passes").unwrap());
    assert!(at < passes && told.contains("Mesa 99") && told.contains("measured GB/s"), "{told}");
    assert!(told.contains("(B / A)") && !told.contains('\u{1b}'), "{told}");
}

#[test]
fn the_command_compares_without_a_device_and_refuses_what_is_no_profile() {
    let folder = Folder::new("compare-command");
    let (mut after, shaders) = (shipped(), "0123456789abcdef");
    after["shaders"] = shaders.into();
    let (a, b) = (written(&folder, "a", &shipped()), written(&folder, "b", &after));
    let file = a.join("profile.json");
    let [a, b, file] = [&a, &b, &file].map(|path| path.to_str().unwrap());
    let output = command(&["--compare", file, b]);
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(told.contains("all passes") && told.contains("host's clock") && told.contains(shaders), "{told}");
    let json: Value = serde_json::from_slice(&command(&["--compare", a, b, "--json"]).stdout).unwrap();
    assert_eq!(json["passes"].as_array().unwrap().len(), after["lines"].as_array().unwrap().len());
    assert_eq!((&json["is_comparable"], &json["total"]["ratio"]), (&true.into(), &json!(1.0)));
    assert_eq!(json["total"]["verdict"], "same");

    let mut twice = shipped();
    twice["lines"][1]["label"] = twice["lines"][0]["label"].clone();
    let mut negative = shipped();
    negative["lines"][0]["median_ms"] = json!(-1.0);
    let faults = [
        ("none", json!([]), "expected a profile: "),
        ("twice", twice, "expected each pass once"),
        ("negative", negative, "expected a time of 0 or more"),
    ];
    for (name, profile, reason) in faults {
        let bad = written(&folder, name, &profile);
        let output = command(&["--compare", a, bad.to_str().unwrap()]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{told}");
        assert!(told.contains(reason) && told.contains("give a profile.json of `ivv profile`"), "{told}");
    }
    let output = command(&["--compare", a, "/nowhere"]);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(command(&["--compare", a]).status.code(), Some(2), "one profile alone is not compared");
}
