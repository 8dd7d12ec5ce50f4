//! `prepare.json`: from what the files of each stage were made.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde_json::{Value, json};

use super::settings::PrepareSettings;
use crate::error::{Error, Result};
use crate::files::{cannot_list, make_folder, read_file, remove_temporaries, write_atomic};
use crate::scene::capture::JOURNAL;

/// The parts of a capture that each stage makes. All depend on the first two, which come in this order.
const STAGES: [(&str, &[&str]); 5] = [
    ("reconstruction", &["reconstruction", "photos"]),
    ("images", &["images", "masks", "foreground", "covisible", "depth", "flow", "truth.json"]),
    ("points", &["sparse", "points"]),
    ("flow", &["flow"]),
    (SOUND, &["audio", "keypoints"]),
];
/// Files beside the pictures: one that comes later is taken over too.
pub(super) const SOUND: &str = "sound";
const MANIFEST: &str = "capture.toml";
const LOCK: &str = ".prepare.lock";

#[derive(Default, serde::Serialize, serde::Deserialize)]
struct Record {
    made_by: String,
    made_from: BTreeMap<String, Value>,
}

pub(super) struct Journal {
    output: PathBuf,
    force: bool,
}

impl Journal {
    pub fn open(settings: &PrepareSettings) -> Result<Journal> {
        make_folder(&settings.output)?;
        let journal = Journal { output: settings.output.clone(), force: settings.force };
        let _lock = journal.lock()?;
        journal.read()?;
        Ok(journal)
    }

    /// Other programs may prepare a share of the same capture: one at a time looks at the journal and changes it.
    fn lock(&self) -> Result<File> {
        let path = self.output.join(LOCK);
        let fault = |fault: std::io::Error| {
            Error::data(&path, "", format!("cannot be locked: {fault}"), "choose another folder with -o")
        };
        let file = File::options().create(true).truncate(false).write(true).open(&path).map_err(fault)?;
        file.lock().map_err(fault)?;
        Ok(file)
    }

    /// The journal's record; an empty one in an empty folder.
    fn read(&self) -> Result<Record> {
        let (output, path) = (&self.output, self.output.join(JOURNAL));
        match read_file(&path) {
            Ok(bytes) => serde_json::from_slice(&bytes).map_err(|fault| {
                let reason = format!("is no journal of `ivv prepare`: {fault}");
                Error::data(&path, "", reason, "remove the file and give --force, or choose another folder with -o")
            }),
            Err(fault) if fault.kind() == ErrorKind::NotFound => {
                if !self.force && !is_empty(output)? {
                    let reason = format!("is not empty and was not made by `ivv prepare` (it has no {JOURNAL})");
                    let remedy = "choose another folder with -o, or give --force to replace a capture there";
                    return Err(Error::data(output, "", reason, remedy));
                }
                Ok(Record { made_by: "ivv prepare".to_owned(), ..Record::default() })
            }
            Err(fault) => {
                let reason = format!("cannot be read: {fault}");
                Err(Error::data(&path, "", reason, "check its permissions"))
            }
        }
    }

    /// Begins or continues a stage. Where its files were made from something else, they are removed, with the images all that was made
    /// from them; that needs `force`, as does removing unknown files.
    pub fn begin(&self, stage: &'static str, made_from: Value) -> Result<()> {
        self.begin_beside(stage, made_from, &[])
    }

    /// As [`Journal::begin`], but the folders `kept`, which came along with the images, stay.
    pub fn begin_beside(&self, stage: &'static str, made_from: Value, kept: &[PathBuf]) -> Result<()> {
        let _lock = self.lock()?;
        let mut record = self.read()?;
        let before = record.made_from.get(stage);
        if before.is_some_and(|before| agree(before, &made_from)) {
            remove_temporaries(&self.output, 2)?;
            return if before == Some(&made_from) { Ok(()) } else { self.note(record, stage, made_from) };
        }
        let at = STAGES.iter().position(|(name, _)| *name == stage).unwrap_or(0);
        let n = if at < 2 { STAGES.len() - at } else { 1 };
        let anew = &STAGES[at..at + n];
        let parts = anew.iter().flat_map(|(_, parts)| *parts).map(|part| self.output.join(part));
        let old: Vec<PathBuf> = parts.flat_map(|part| without(part, kept)).filter(|path| path.exists()).collect();
        if let Some(path) = old.first().filter(|_| !self.force) {
            let reason = match record.made_from.get(stage) {
                Some(before) => format!("was made with other settings: {}", difference(before, &made_from)),
                None => "is there already".to_owned(),
            };
            let remedy = "give --force to make it again, or choose another folder with -o";
            return Err(Error::data(path, "", reason, remedy));
        }
        // A part of two stages is there once.
        for path in std::iter::once(self.output.join(MANIFEST)).chain(old).filter(|path| path.exists()) {
            let removed = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
            removed.map_err(|fault| {
                Error::data(&path, "", format!("cannot be removed: {fault}"), "check its permissions")
            })?;
        }
        for (name, _) in anew {
            record.made_from.remove(*name);
        }
        self.note(record, stage, made_from)
    }

    fn note(&self, mut record: Record, stage: &str, made_from: Value) -> Result<()> {
        record.made_from.insert(stage.to_owned(), made_from);
        let text = serde_json::to_vec_pretty(&record).map_err(std::io::Error::other);
        write_atomic(&self.output.join(JOURNAL), |to| to.write_all(&text?))
    }
}

/// True if files made from `before` can stay: it is the same, or a list of files that has grown.
fn agree(before: &Value, now: &Value) -> bool {
    match (before, now) {
        (Value::Array(before), Value::Array(now)) => before.iter().all(|file| now.contains(file)),
        _ => before == now,
    }
}

/// The paths of a part to remove: all of it, or those beside some of `kept`.
fn without(part: PathBuf, kept: &[PathBuf]) -> Vec<PathBuf> {
    if !kept.iter().any(|path| path.starts_with(&part)) {
        return vec![part];
    }
    let entries = fs::read_dir(part).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|path| !kept.contains(path)).collect()
}

fn difference(before: &Value, now: &Value) -> String {
    let (Value::Object(old), Value::Object(new)) = (before, now) else { return "its files have changed".to_owned() };
    let is_list = |value: &Value| value.is_array() || value.is_object();
    let mut differ: Vec<_> = new.iter().filter(|(name, value)| old.get(*name) != Some(*value)).collect();
    // A setting tells more than the lists that follow from it.
    differ.sort_by_key(|(_, value)| is_list(value));
    differ.first().map_or_else(
        || "the source has changed".to_owned(),
        |(name, value)| match old.get(name.as_str()) {
            Some(was) if !is_list(was) && !is_list(value) => format!("{name} was {was} and is {value}"),
            _ => format!("{name} have changed"),
        },
    )
}

/// Files from which a stage is made, as the journal knows them: name, length and the second of the last change.
pub(super) fn stamps<P: AsRef<Path>>(files: impl IntoIterator<Item = P>) -> Value {
    files.into_iter().map(|file| stamp(file.as_ref())).collect()
}

fn stamp(file: &Path) -> Value {
    let data = fs::metadata(file).ok();
    let time = data.as_ref().and_then(|data| data.modified().ok());
    let seconds = time.and_then(|time| time.duration_since(UNIX_EPOCH).ok()).map(|age| age.as_secs());
    // Not every name of a file is text, which JSON must be.
    json!([file.to_string_lossy(), data.map(|data| data.len()), seconds])
}

fn is_empty(path: &Path) -> Result<bool> {
    let mut entries = fs::read_dir(path).map_err(|fault| cannot_list(path, &fault))?.flatten();
    Ok(entries.all(|entry| entry.file_name() == LOCK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_files_beside_the_pictures_there_may_be_more_but_each_is_as_it_was() {
        let [one, two] = [json!([["a.wav", 1, 2]]), json!([["a.wav", 1, 2], ["b.wav", 1, 2]])];
        assert!(agree(&one, &two) && !agree(&two, &one) && !agree(&one, &json!([["a.wav", 1, 3]])));
        let of = |pictures: &Value| json!({ "pictures": pictures, "frames": 3 });
        assert!(agree(&of(&one), &of(&one)) && !agree(&of(&one), &of(&two)) && !agree(&of(&two), &of(&one)));
    }
}
