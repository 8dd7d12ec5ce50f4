//! Runs in the folder of another run.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::json;

/// All files below `folder` with their bytes, but for the lock.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else if path.file_name().unwrap() != ".lock" {
            all.insert(path.clone(), std::fs::read(path).unwrap());
        }
    }
    all
}

#[test]
fn a_run_is_replaced_with_all_that_was_written_for_it_once_the_new_one_can_begin() {
    let tiny = Tiny::of_frames("overwrite", 2);
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let train = ["train", capture, "-o", run.to_str().unwrap(), "--steps", "4", "--sh-degree", "0"];
    works(&[&train[..], &["--eval-every", "2", "--eval-images", "1"]].concat());
    let other = tiny.folder.join("other.ply");
    std::fs::copy(run.join("scene.ply"), &other).unwrap();
    works(&["eval", run.to_str().unwrap(), "--scene", other.to_str().unwrap()]);
    let cameras = |is_test: bool| tiny.capture.cameras.iter().filter(move |camera| camera.is_test == is_test);
    let (old, new) = (cameras(true).next().unwrap().name.clone(), cameras(false).next().unwrap().name.clone());
    let at = |names: &[&str]| names.iter().fold(run.clone(), |path, name| path.join(name));
    let stale = [
        at(&["renders", &old, "00001.png"]),
        at(&["renders", "progress", "00000002.png"]),
        at(&["eval", "other.ply", "eval.json"]),
        at(&["eval", "other.ply", "report.html"]),
        at(&["eval", "other.ply", "renders", &old, "00000.png"]),
    ];
    stale.iter().for_each(|file| assert!(file.is_file(), "{}", file.display()));
    // Somebody's own.
    let own = [at(&["notes.txt"]), at(&["renders", &old, "mine.png"]), at(&["eval", "notes.txt"])];
    own.iter().for_each(|file| std::fs::write(file, "mine").unwrap());
    let before = files(&run);

    // Settings and captures that are wrong are found before anything is lost.
    let weights = tiny.folder.join("none.safetensors");
    let lpips = format!("loss.lpips_weights={}", weights.display());
    for (wrong, told) in [
        (vec!["--set", "loss.lpips=0.1", "--set", &lpips], "none.safetensors"),
        (vec!["--test-cameras", "nobody"], "nobody"),
    ] {
        let found = fails(&[&train[..], &["--overwrite"], &wrong].concat(), 3);
        assert!(found.contains(told), "{found}");
        assert!(files(&run) == before, "{told}: the run is as it was");
    }

    works(&[&train[..], &["--overwrite", "--eval-every", "0", "--test-cameras", &new]].concat());
    assert_eq!(json(&run.join("run.json"))["test_cameras"], serde_json::json!([new]));
    stale.iter().for_each(|file| assert!(!file.exists(), "{}", file.display()));
    assert!(!at(&["eval", "other.ply"]).exists() && !at(&["renders", "progress"]).exists(), "folders of nothing go");
    own.iter().for_each(|file| assert_eq!(std::fs::read_to_string(file).unwrap(), "mine", "{}", file.display()));
    assert!(at(&["renders", &new, "00001.png"]).is_file());
    // Neither does a new run begin beside results without a scene.
    std::fs::remove_file(run.join("scene.ply")).unwrap();
    std::fs::remove_dir_all(run.join("checkpoints")).unwrap();
    assert!(fails(&train, 3).contains("already holds a run"));
}
