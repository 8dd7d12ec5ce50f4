use std::path::Path;

use super::format::{WriteOptions, Writer, Written};
use super::own::list;
use super::scene::{Clip, Scene};
use crate::error::{Error, Result};

pub(super) fn write(path: &Path, scene: &Scene, options: &WriteOptions, writers: &'static [Writer]) -> Result<Written> {
    let writer = options.format.or_else(|| by_ending(path, writers)).ok_or_else(|| {
        let known: Vec<&str> = writers.iter().filter_map(|writer| writer.ending).collect();
        Error::data(path, "", "unsupported scene format", format!("use {}, or give a format", known.join(", ")))
    })?;
    let splats = options.moment(&scene.splats);
    let mut notes = (writer.write)(path, &splats, &scene.clip, options)?;
    notes.extend(lost(writer, &scene.clip));
    let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    Ok(Written { bytes, ..Written::of(&splats, |i| writer.keeps.non_finite || splats.is_finite(i), notes) })
}

pub(super) fn by_ending(path: &Path, writers: &'static [Writer]) -> Option<&'static Writer> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let is_its = |writer: &&Writer| writer.ending.is_some_and(|ending| name.ends_with(ending));
    // `.ftgs.ply` is a `.ply` too.
    writers.iter().filter(is_its).max_by_key(|writer| writer.ending.map_or(0, str::len))
}

fn lost(writer: &Writer, clip: &Clip) -> Vec<String> {
    let unusual = clip.unusual();
    let mut lost = Vec::new();
    if !writer.keeps.constants && !unusual.is_empty() {
        lost.push(format!("the format {} has no place for {}; viewers use theirs", writer.name, list(&unusual)));
    }
    if !writer.keeps.sounds && !clip.sounds.is_empty() {
        lost.push(format!("the format {} has no place for sound", writer.name));
    }
    lost
}
