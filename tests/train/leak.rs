//! Nothing of a test camera reaches training: a capture without them, their files deleted, trains to the same bits.

use super::Tiny;
use crate::common::folder::copy;
use crate::common::prelude::*;
use crate::common::program::json;

/// Removes the pair of lines of every image of the cameras `left_out`, and their own in cameras.txt.
fn strike(sparse: &Path, left_out: &[&str]) {
    let (images, cameras) = (sparse.join("images.txt"), sparse.join("cameras.txt"));
    let text = fs::read_to_string(&images).unwrap();
    let (head, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let (mut kept, mut struck) = (head, Vec::new());
    for pair in rows.chunks(2) {
        let words: Vec<&str> = pair[0].split(' ').collect();
        if left_out.contains(&words[9].split('/').next().unwrap()) {
            struck.push(words[8]);
        } else {
            kept.extend(pair);
        }
    }
    assert_eq!(struck.len(), left_out.len());
    fs::write(&images, kept.join("\n") + "\n").unwrap();
    let text = fs::read_to_string(&cameras).unwrap();
    let is_kept = |line: &&str| !struck.contains(&line.split(' ').next().unwrap());
    fs::write(&cameras, text.lines().filter(is_kept).collect::<Vec<_>>().join("\n") + "\n").unwrap();
}

#[test]
fn a_capture_without_its_test_cameras_trains_to_the_same_bits() {
    let tiny = Tiny::new("leak");
    let tests: Vec<&str> = tiny.capture.cameras.iter().filter(|c| c.is_test).map(|c| c.name.as_str()).collect();
    assert!(tests.len() > 1);
    let bare = tiny.folder.with_file_name(format!("ivv-train-leak-bare-{}", std::process::id()));
    // None of their files, nor of their lines in the calibration.
    let not_theirs = ["truth", "truth.json", "synth.json"];
    copy(&tiny.folder, &bare, &|name| {
        tests.iter().any(|test| name.split('.').next() == Some(*test)) || not_theirs.contains(&name)
    });
    strike(&bare.join("sparse/0"), &tests);
    let toml = fs::read_to_string(bare.join("capture.toml")).unwrap();
    let line = |line: &str| if line.starts_with("test_cameras") { "test_cameras = []" } else { line }.to_owned();
    fs::write(bare.join("capture.toml"), toml.lines().map(line).collect::<Vec<_>>().join("\n")).unwrap();

    let trained = |capture: &Path, number: usize| {
        let run = tiny.folder.with_file_name(format!("ivv-train-leak-run-{}-{number}", std::process::id()));
        // Gaussians grow and go, clocks, grids and reviews among it.
        let train =
            ["train", text(capture), "-o", text(&run), "--steps", "40", "--sh-degree", "1", "--eval-every", "0"];
        let settings = ["--set", "init=flow", "--set", "init_points=400", "--set", "required.reviews=2"];
        works(&[&train[..], &settings].concat());
        let scene = fs::read(run.join("scene.ply")).unwrap();
        let mut offsets = json(&run.join("offsets.json"));
        // The bare capture does not know it.
        offsets.as_array_mut().unwrap().iter_mut().for_each(|row| {
            row.as_object_mut().unwrap().remove("truth");
        });
        fs::remove_dir_all(run).unwrap();
        (scene, offsets)
    };
    let (with, without) = (trained(&tiny.folder, 0), trained(&bare, 1));
    assert!(with.0.len() > 5_000, "{} bytes", with.0.len());
    assert_same("the Gaussians know of the test cameras", &with.0, &without.0);
    assert_eq!(with.1, without.1, "clocks");
    // Runs that begin otherwise are trained in the same way.
    for init in ["concat", "points", "hull", "frustum", "random"] {
        let [with, without] = [&tiny.folder, &bare].map(|capture| {
            let (file, init) = (capture.with_extension("first.ply"), format!("init={init}"));
            let settings = ["--set", &init, "--set", "init_points=400"];
            works(&[&["train", text(capture), "--only-init", text(&file)][..], &settings].concat());
            let first = fs::read(&file).unwrap();
            fs::remove_file(file).unwrap();
            first
        });
        assert!(with.len() > 5_000, "{init}: {} bytes", with.len());
        assert_same(format_args!("init={init}: the Gaussians know of the test cameras"), &with, &without);
    }
    fs::remove_dir_all(bare).unwrap();
}
