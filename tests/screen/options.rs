//! What is said of options that are refused.

use super::{Folder, ivv};

#[test]
fn an_option_out_of_range_is_told_with_what_was_expected_and_what_was_found() {
    let folder = Folder::new("options");
    let [scene, cameras] =
        ["scene.ply", "cameras.json"].map(|name| format!("{}/assets/demo/{name}", env!("CARGO_MANIFEST_DIR")));
    let (capture, out, ply) = (folder.capture(), folder.path("out"), folder.path("out.ply"));
    let render = ["render", &scene, "--cameras", &cameras, "-o", &out];
    let sound = ["sound", "render", "scene.json", "--path", "path.csv", "-o", "out.wav"];
    let cases = [
        ([&render[..], &["--alpha-min", "2"]].concat(), "--alpha-min: expected a number above 0 and below 1, found 2"),
        ([&render[..], &["--blur", "0"]].concat(), "--blur: expected a positive number, found 0"),
        (
            vec!["export", &scene, "-o", &ply, "--time", "0.5", "--min-opacity", "2"],
            "--min-opacity: expected a number from 0 to 1, found 2",
        ),
        (vec!["train", &capture, "-o", &out, "--only-init", &ply], "--only-init"),
        (vec!["train", &capture, "-o", &out, "--list-settings"], "--list-settings"),
        (vec!["train", &capture], "--output"),
        (
            vec!["sound", "localize", &capture, "-o", &out, "--metres-per-unit", "0"],
            "--metres-per-unit: expected a positive number, found 0",
        ),
        ([&sound[..], &["--lufs", "1"]].concat(), "--lufs: expected a number from -70 to 0, found 1"),
        (vec!["inspect", &capture, "--cameras", &out, "--capture", &capture], "which is none; leave it out"),
        (vec!["inspect", &scene, "--test-every", "4"], "--cameras"),
    ];
    for (arguments, expected) in cases {
        let output = ivv(&arguments).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(expected), "{arguments:?}: {told}");
    }
}
