//! `prepare.json`: from what the files of each stage were made.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::settings::PrepareSettings;
use crate::error::{Error, Result};
use crate::files::{read_file, remove_temporaries, write_atomic};
use crate::scene::capture::JOURNAL;

/// The parts of a capture that each stage makes. All depend on the first two, which come in this order.
const STAGES: [(&str, &[&str]); 4] = [
    ("reconstruction", &["reconstruction", "photos"]),
    ("images", &["images", "masks", "foreground", "covisible", "depth", "flow", "audio", "keypoints", "truth.json"]),
    ("points", &["sparse", "points"]),
    ("flow", &["flow"]),
];
const MANIFEST: &str = "capture.toml";
const LOCK: &str = ".prepare.lock";

#[derive(Default, serde::Serialize, serde::Deserialize)]
struct Record {
    made_by: String,
    /// By stage.
    made_from: BTreeMap<String, Value>,
}

pub(super) struct Journal {
    output: PathBuf,
    force: bool,
}

impl Journal {
    /// Opens the journal of the output, which is made when it is absent.
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

    /// What the journal holds; nothing yet in a folder that is empty.
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

    /// Begins a stage or continues it. When its files were made from something else they are removed first, and with the
    /// images all that was made from them; that needs `force`, as does removing files of which nothing is known.
    pub fn begin(&self, stage: &'static str, made_from: Value) -> Result<()> {
        let _lock = self.lock()?;
        let mut record = self.read()?;
        if record.made_from.get(stage) == Some(&made_from) {
            remove_temporaries(&self.output, 2)?;
            return Ok(());
        }
        let at = STAGES.iter().position(|(name, _)| *name == stage).unwrap_or(0);
        let n = if at < 2 { STAGES.len() - at } else { 1 };
        let anew = &STAGES[at..at + n];
        let parts = anew.iter().flat_map(|(_, parts)| *parts);
        let old: Vec<PathBuf> = parts.map(|part| self.output.join(part)).filter(|path| path.exists()).collect();
        if let Some(path) = old.first().filter(|_| !self.force) {
            let reason = match record.made_from.get(stage) {
                Some(before) => format!("was made with other settings: {}", difference(before, &made_from)),
                None => "is there already".to_owned(),
            };
            let remedy = "give --force to make it again, or choose another folder with -o";
            return Err(Error::data(path, "", reason, remedy));
        }
        for path in std::iter::once(self.output.join(MANIFEST)).filter(|path| path.exists()).chain(old) {
            let removed = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
            removed.map_err(|fault| {
                Error::data(&path, "", format!("cannot be removed: {fault}"), "check its permissions")
            })?;
        }
        for (name, _) in anew {
            record.made_from.remove(*name);
        }
        record.made_from.insert(stage.to_owned(), made_from);
        let text = serde_json::to_vec_pretty(&record).map_err(std::io::Error::other);
        write_atomic(&self.output.join(JOURNAL), |to| to.write_all(&text?))
    }
}

/// A value that differs, with its name.
fn difference(before: &Value, now: &Value) -> String {
    let (Value::Object(old), Value::Object(new)) = (before, now) else { return "the source has changed".to_owned() };
    let is_list = |value: &Value| value.is_array() || value.is_object();
    let mut differ: Vec<_> = new.iter().filter(|(name, value)| old.get(*name) != Some(*value)).collect();
    // A setting tells more than the lists that follow from it.
    differ.sort_by_key(|(_, value)| is_list(value));
    differ.first().map_or_else(
        || "the source has changed".to_owned(),
        |(name, value)| match old.get(name.as_str()) {
            Some(was) if !is_list(was) => format!("{name} was {was} and is {value}"),
            _ => format!("{name} have changed"),
        },
    )
}

/// A folder, made when it is absent.
pub(super) fn make_folder(path: &Path) -> Result<()> {
    let remedy = "choose another folder with -o";
    fs::create_dir_all(path).map_err(|fault| Error::data(path, "", format!("cannot be made: {fault}"), remedy))
}

fn is_empty(path: &Path) -> Result<bool> {
    let mut entries = fs::read_dir(path).map_err(|fault| cannot_list(path, &fault))?.flatten();
    Ok(entries.all(|entry| entry.file_name() == LOCK))
}

pub(super) fn cannot_list(path: &Path, fault: &std::io::Error) -> Error {
    Error::data(path, "", format!("cannot be listed: {fault}"), "check the path and its permissions")
}
