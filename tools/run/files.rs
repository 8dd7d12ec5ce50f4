//! Folders, JSON files and scenes of the verbs.

use ivv::internals::files::{read_file, write_atomic};
use ivv::internals::formats::{Own, write_ply_with};
use ivv::internals::scene::{Similarity, Splats};
use ivv::internals::train::{Config, Run};
use std::path::Path;

pub fn is_run(path: &Path) -> bool {
    Run::file(path).is_file()
}

pub fn make_folder(folder: &Path) -> ivv::Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| ivv::Error::data(folder, "", format!("cannot be made: {e}"), "choose another folder with -o"))
}

pub fn write_json(file: &Path, value: &impl serde::Serialize) -> ivv::Result<()> {
    write_atomic(file, |to| Ok(serde_json::to_writer_pretty(to, value)?))
}

pub fn read_json<T: serde::de::DeserializeOwned>(file: &Path, remedy: &str) -> ivv::Result<T> {
    let fault = |reason: String| ivv::Error::data(file, "", reason, remedy);
    let text = read_file(file).map_err(|e| fault(format!("cannot be read: {e}")))?;
    serde_json::from_slice(&text).map_err(|e| fault(e.to_string()))
}

/// Parses the value of an option that JSON has under the same name.
pub fn word<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, serde_json::Error> {
    serde_json::from_value(text.into())
}

pub fn config_of(folder: &Path) -> ivv::Result<Config> {
    read_json(&folder.join("config.json"), "give the folder of a run of `ivv train`")
}

/// `train.json` of the run in `folder`, or null: a run that was copied without it still has scores.
pub fn totals(folder: &Path) -> serde_json::Value {
    read_json(&folder.join("train.json"), "").unwrap_or_default()
}

/// Writes the Gaussians of a run in the capture's frame. `world` maps that to the frame of training; `own` has rendering
/// constants.
pub fn write_scene(path: &Path, splats: &Splats, world: &Similarity, own: &Own) -> ivv::Result<()> {
    if !world.is_exact_in_f32() {
        tracing::warn!(
            "{}: the capture lies so far from its origin that single precision rounds positions there visibly; the \
             checkpoints and the renders are exact. Move the capture to its origin to get an exact file",
            path.display()
        );
    }
    write_ply_with(path, splats, own)
}
