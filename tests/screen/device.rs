//! The device that a verb works on: the width of its subgroups, the bits of its depth keys, and where its pipelines are kept.

use super::{Folder, ivv};
use crate::common::prelude::*;
use crate::common::program::done;

/// The pipelines in a folder of caches, in the order of their names.
fn pipelines(cache: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(PathBuf::from(cache).join("ivv")).into_iter().flatten();
    let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    files.sort();
    files
}

/// The demo's scene, and a view of 16 x 16 pixels of it.
fn small(folder: &Folder) -> (String, String) {
    let (splats, views) = ivv::internals::scene::demo();
    let mut view = views[0].clone();
    (view.intrinsics.width, view.intrinsics.height) = (16, 16);
    ivv::internals::formats::write_ply(&folder.file("scene.ply"), &splats).unwrap();
    ivv::internals::scene::write_views(&folder.file("cameras.json"), &[view]).unwrap();
    (folder.path("scene.ply"), folder.path("cameras.json"))
}

#[test]
fn a_width_that_the_device_does_not_take_is_refused() {
    let folder = Folder::new("width");
    let arguments = ["train", &folder.capture(), "-o", &folder.path("run"), "--subgroup-size", "5"];
    let output = ivv(&arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("subgroups of 5 lanes were asked for; expected "), "{told}");
    assert!(!folder.0.join("run/config.json").exists(), "nothing is begun");
}

#[test]
fn depth_keys_that_do_not_reach_far_from_the_near_plane_are_warned_of() {
    let folder = Folder::new("keys");
    let ((scene, cameras), out) = (small(&folder), folder.path("out"));
    let told = |more: &[&str]| {
        let render = ["render", &scene, "--cameras", &cameras, "-o", &out];
        let output = ivv(&[&render, more].concat()).output().unwrap();
        assert!(output.status.success(), "{more:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let warned = told(&["--near", "1e-9", "--depth-bits", "24"]);
    assert!(warned.contains("WARN") && warned.contains("depth keys of 24 bits do not reach far"), "{warned}");
    for right in [&["--near", "1e-9"][..], &["--near", "1e-9", "--depth-bits", "32"], &["--depth-bits", "24"]] {
        let told = told(right);
        assert!(!told.contains("WARN"), "{right:?}: {told}");
    }
}

#[test]
fn pipelines_are_kept_in_a_file_of_their_device_and_a_damaged_one_is_made_anew() {
    let folder = Folder::new("pipelines");
    let (scene, cameras) = small(&folder);
    let cache = folder.path("cache");
    let render = |to: &str| {
        let arguments = ["render", &scene, "--cameras", &cameras, "-o", &folder.path(to)];
        done(ivv(&arguments).env("XDG_CACHE_HOME", &cache));
    };
    render("first");
    let files = pipelines(&cache);
    let [file] = &files[..] else { panic!("{files:?}") };
    let name = file.file_name().unwrap().to_str().unwrap();
    let digits = name.strip_prefix("pipelines-").and_then(|rest| rest.strip_suffix(".bin"));
    assert!(digits.is_some_and(|digits| digits.len() == 32 && u128::from_str_radix(digits, 16).is_ok()), "{name}");
    std::fs::write(file, b"no pipelines").unwrap();
    render("second");
    assert_eq!(pipelines(&cache), files);
    assert_ne!(std::fs::read(file).unwrap(), b"no pipelines", "it was made anew");
}
