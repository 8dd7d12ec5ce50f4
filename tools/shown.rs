//! What a verb is given to look at: a scene file, the folder of a run, or that of a run that has not ended.

use crate::screen::say;
use ivv::Error;
use ivv::scene::{Clock, FourDgs, Splats, read_scene};
use ivv::train::{Checkpoint, Run};
use std::path::{Path, PathBuf};

/// A scene and where it is from.
pub struct Shown {
    /// The file that was read.
    pub file: PathBuf,
    /// In the capture's own frame.
    pub splats: Splats,
    /// The step that it is of, where the run has not ended.
    pub unfinished: Option<u64>,
}

/// Whether `path` is the folder of a run.
pub fn is_run(path: &Path) -> bool {
    Run::file(path).is_file()
}

/// The clock of the scene file `path`, where it has one.
///
/// # Errors
/// Those of the file.
pub fn clock(path: &Path) -> ivv::Result<Option<Clock>> {
    if FourDgs::is(path) { FourDgs::read(path).map(|file| Some(file.clock())) } else { Ok(None) }
}

/// As [`open`], for one normalised time if there is one: a `.4dgs` can hold what only one moment of it can be shown of.
pub fn open_at(path: &Path, time: Option<f64>) -> ivv::Result<Shown> {
    match time {
        Some(time) if FourDgs::is(path) => {
            let file = FourDgs::read(path)?;
            let splats = file.splats().or_else(|_| file.at(time))?;
            Ok(Shown { splats, file: path.to_owned(), unfinished: None })
        }
        _ => open(path),
    }
}

/// Reads the scene of `path`; of a run without scene.ply its newest checkpoint, and says of which step that is.
///
/// # Errors
/// Those of the files; [`Error::Data`] when a folder is neither a run's nor a scene, or a run has no checkpoint either.
pub fn open(path: &Path) -> ivv::Result<Shown> {
    let scene = path.join("scene.ply");
    if scene.is_file() {
        return Ok(Shown { splats: read_scene(&scene)?, file: scene, unfinished: None });
    }
    if is_run(path) {
        return newest(path);
    }
    if path.is_dir() && !path.join("meta.json").is_file() {
        let reason = "expected a run (run.json) or a SOG scene (meta.json), found neither";
        return Err(Error::data(path, "", reason, "give the folder of a run of `ivv train`, or a scene file"));
    }
    Ok(Shown { splats: read_scene(path)?, file: path.to_owned(), unfinished: None })
}

/// The newest checkpoint of the run in `folder`.
fn newest(folder: &Path) -> ivv::Result<Shown> {
    let checkpoints = folder.join("checkpoints");
    let Some(checkpoint) = Checkpoint::newest(&checkpoints)? else {
        let remedy = "wait for the first checkpoint, or continue the run with `ivv train --resume -o RUN`";
        return Err(Error::data(folder, "", "the run has no scene.ply and no checkpoint yet", remedy));
    };
    let Checkpoint { step, total, .. } = checkpoint;
    say!("{}: the run has not ended; this is its newest checkpoint, of step {step} of {total}", folder.display());
    let file = Checkpoint::file(&checkpoints, step);
    Ok(Shown { splats: checkpoint.splats(), file, unfinished: Some(step) })
}
