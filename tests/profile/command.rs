//! `ivv profile` as a command.

use super::Folder;
use crate::common::prelude::*;
use crate::common::random;

#[test]
fn a_scene_is_profiled_into_tables_a_page_and_a_trace_and_its_kernels_are_dumped() {
    let Some(_) = timed() else { return };
    let folder = Folder::new("command");
    let (scene, cameras, out) = (folder.file("s.ply"), folder.file("c.json"), folder.file("out"));
    ivv::internals::formats::write_ply(&scene, &random::scene(5, 300, 1)).unwrap();
    ivv::internals::scene::write_views(&cameras, &[random::view()]).unwrap();
    let [scene, cameras, path] = [&scene, &cameras, &out].map(|path| path.to_str().unwrap());
    let of_scene = ["profile", scene, "--cameras", cameras, "-o", path];
    let told = works(&[&of_scene[..], &["--samples", "3", "--warm-up", "1"]].concat());
    assert!(told.contains("What the device can do") && told.contains("blend/blend_fwd_color"), "{told}");
    let json = |name: &str| serde_json::from_slice::<Value>(&std::fs::read(out.join(name)).unwrap()).unwrap();
    let profile = json("profile.json");
    assert_eq!((&profile["samples"], &profile["sample"]), (&Value::from(3), &Value::from("view")));
    assert_eq!(profile["shaders"], ivv::internals::gpu::shaders_hash());
    for key in ["bytes", "rows", "flops", "exp2", "shuffles", "atomics", "dispatch_ns"] {
        assert!(profile["peaks"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    let lines = profile["lines"].as_array().unwrap();
    let share: f64 = lines.iter().map(|line| line["share"].as_f64().unwrap()).sum();
    assert!(lines.len() > 20 && (share - 1.0).abs() < 1e-9, "{} lines of {share}", lines.len());
    for line in lines {
        let [limit, p95, median] = ["limit_ms", "p95_ms", "median_ms"].map(|key| line[key].as_f64().unwrap());
        assert!(limit > 0.0 && p95 >= median, "{line}");
    }
    let ratio = &profile["overhead"]["ratio"];
    assert!(ratio["low"].as_f64() <= ratio["high"].as_f64() && ratio["median"].as_f64().unwrap() > 0.0);
    // A span of the host for each view, one of the device for each of its passes, two names.
    let passes: f64 = lines.iter().map(|line| line["dispatches"].as_f64().unwrap()).sum();
    assert_eq!(json("trace.json")["traceEvents"].as_array().unwrap().len() as f64, 2.0 + 3.0 + 3.0 * passes);
    for (name, holds) in [("profile.html", "id=\"roofline\""), ("roofline.svg", "</svg>"), ("profile.md", "| pass |")] {
        let text = std::fs::read_to_string(out.join(name)).unwrap();
        assert!(text.contains(holds) && !text.contains("NaN") && !text.contains("inf"), "{name}");
    }

    let kernel = lines.iter().find_map(|line| line["label"].as_str()?.strip_prefix("blend/")).unwrap();
    works(&[&of_scene[..], &["--dump", kernel]].concat());
    let file = out.join(format!("{kernel}.dispatch"));
    let replayed = works(&["profile", "--replay", file.to_str().unwrap(), "-n", "3", "--json"]);
    let replayed: Value = serde_json::from_str(&replayed).unwrap();
    assert_eq!((&replayed[0]["kernel"], &replayed[0]["from_dumped"]["words"]), (&kernel.into(), &0.into()));

    let told: Value = serde_json::from_str(&works(&[&of_scene[..], &["--dump", kernel, "--json"]].concat())).unwrap();
    assert_eq!(told["path"], file.to_str().unwrap());
    // Two profiles of a scene cannot differ by a setting of a training.
    let set = ivv(&[&of_scene[..], &["--set", "adam=lazy"]].concat());
    assert!(set.status.code() == Some(2) && String::from_utf8_lossy(&set.stderr).contains("without the settings"));

    let wrong = ivv(&[&of_scene[..], &["--dump", "no_kernel"]].concat());
    assert!(!wrong.status.success() && String::from_utf8_lossy(&wrong.stderr).contains("no_kernel"));
    // A kernel of training, which no view runs, and a misspelt one.
    for (name, told) in [
        (
            "blend_fwd_train_p8",
            "no pass here runs the kernel blend_fwd_train_p8; others of blend/blend_fwd.comp are blend_fwd_p4, ",
        ),
        ("blend_fwd_colour_p8", "there is no such kernel; did you mean blend_fwd_color_p8"),
    ] {
        let wrong = ivv(&[&of_scene[..], &["--dump", name]].concat());
        let fault = String::from_utf8_lossy(&wrong.stderr);
        assert!(!wrong.status.success() && fault.contains(told), "{fault}");
    }
}

#[test]
fn kernels_are_listed_by_shader() {
    let text = works(&["profile", "--list"]);
    assert!(text.lines().any(|line| line.contains(" blend_fwd_train_color_p4, blend_fwd_train_color_p8")), "{text}");
    let shaders: Value = serde_json::from_str(&works(&["profile", "--list", "--json"])).unwrap();
    let kernels = shaders.as_array().unwrap().iter().flat_map(|shader| shader["kernels"].as_array().unwrap());
    assert_eq!(kernels.count(), ivv::internals::gpu::table::KERNELS.len());
}

#[test]
fn a_kernel_is_disassembled_and_its_instructions_are_counted() {
    let text = works(&["profile", "--disassemble", "gather"]);
    assert!(text.contains("OpEntryPoint GLCompute") && text.contains("Load"), "{text}");
    let counts: Value = serde_json::from_str(&works(&["profile", "--disassemble", "gather", "--json"])).unwrap();
    assert!(counts["EntryPoint"] == 1 && counts["Load"].as_u64().unwrap() > 3, "{counts}");
}
