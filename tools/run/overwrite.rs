//! `ivv train --overwrite`: removes all that `ivv` wrote for the run in the folder, and nothing else.

use ivv::Error;
use ivv::internals::train::{Checkpoint, Run};
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

const RESULTS: [&str; 7] =
    ["scene.ply", "train.json", "train.jsonl", "offsets.json", "cameras.json", "eval.json", "report.html"];
/// Results of `ivv eval` in a folder of its own.
const SCORES: [&str; 2] = ["eval.json", "report.html"];
/// Least digits of a frame or a step in the name of a picture.
const DIGITS: usize = 5;

pub fn contains_run(folder: &Path) -> ivv::Result<bool> {
    let has_checkpoints = Checkpoint::any_in(&folder.join("checkpoints"))?;
    Ok(has_checkpoints || RESULTS.iter().any(|name| folder.join(name).exists()))
}

/// Removes the run in `folder`: checkpoints, results, renders, and what `ivv eval` wrote. Settings stay, since `new` replaces them.
pub fn remove_run(folder: &Path, new: &Run) -> ivv::Result<()> {
    // If run.json is lost, the renders of cameras that the new run does not test stay.
    let mut cameras = Run::read(folder).map_or(Vec::new(), |old| old.test_cameras);
    cameras.extend(new.test_cameras.iter().cloned());
    Checkpoint::remove_all(&folder.join("checkpoints"))?;
    RESULTS.iter().try_for_each(|name| remove(&folder.join(name)))?;
    remove_renders(folder, &cameras)?;
    let evaluations = folder.join("eval");
    for evaluation in entries(&evaluations)?.iter().filter(|entry| entry.is_dir()) {
        SCORES.iter().try_for_each(|name| remove(&evaluation.join(name)))?;
        remove_renders(evaluation, &cameras)?;
        remove_if_empty(evaluation);
    }
    remove_if_empty(&evaluations);
    Ok(())
}

/// Removes the pictures of `cameras`, and those of evaluations during the run, from `renders` in `folder`.
fn remove_renders(folder: &Path, cameras: &[String]) -> ivv::Result<()> {
    let renders = folder.join("renders");
    // Names come from a file and must not lead out of the folder.
    let is_within = |name: &&str| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    for name in cameras.iter().map(String::as_str).filter(is_within).chain(["progress"]) {
        let pictures = renders.join(name);
        for file in entries(&pictures)?.iter().filter(|file| is_numbered(file)) {
            remove(file)?;
        }
        pictures.ancestors().take_while(|part| *part != folder).for_each(remove_if_empty);
    }
    Ok(())
}

fn is_numbered(file: &Path) -> bool {
    let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let is_number = stem.len() >= DIGITS && stem.bytes().all(|byte| byte.is_ascii_digit());
    is_number && file.extension().is_some_and(|ending| ending == "png")
}

fn entries(folder: &Path) -> ivv::Result<Vec<PathBuf>> {
    let cannot = |e| Error::data(folder, "", format!("cannot be listed: {e}"), "check its permissions");
    match std::fs::read_dir(folder) {
        Err(e) if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&e.kind()) => Ok(Vec::new()),
        found => found.map_err(cannot)?.map(|entry| Ok(entry.map_err(cannot)?.path())).collect(),
    }
}

fn remove(file: &Path) -> ivv::Result<()> {
    match std::fs::remove_file(file) {
        Err(e) if e.kind() != ErrorKind::NotFound => {
            Err(Error::data(file, "", format!("cannot be removed: {e}"), "check its permissions"))
        }
        _ => Ok(()),
    }
}

fn remove_if_empty(folder: &Path) {
    let _ = std::fs::remove_dir(folder);
}
