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
/// Flow and depth of the source, which earlier versions did not note.
pub(super) const PRIORS: &str = "priors";
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
        // Earlier versions had no such stage.
        if before.map_or(stage == SOUND, |before| agree(before, &made_from)) {
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

/// True if files made from `before` can stay. A list of files may have grown, and earlier versions noted less: see [`was_noted`] and
/// [`PRIORS`].
fn agree(before: &Value, now: &Value) -> bool {
    match (before, now) {
        (Value::Array(before), Value::Array(now)) => before.iter().all(|file| now.contains(file)),
        (Value::Object(before), Value::Object(now)) => {
            let same = |(name, value): (&String, &Value)| {
                now.get(name).is_some_and(|now| now == value || was_noted(value, now))
            };
            let is_known = |name: &String| name == PRIORS || before.contains_key(name);
            now.keys().all(is_known) && before.iter().all(same)
        }
        _ => before == now,
    }
}

/// True if an earlier version noted `before` in place of the list `now`: the files' name, or the number that is the list's first.
fn was_noted(before: &Value, now: &Value) -> bool {
    match before {
        Value::String(_) => now.is_array(),
        Value::Number(_) => now.get(0) == Some(before),
        _ => false,
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

/// A value that differs, with its name.
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
    fn what_an_earlier_version_noted_agrees_and_what_has_changed_does_not() {
        let before = json!({ "pictures": "photos", "frames": 3, "source points": 7 });
        let now = json!({ "pictures": [["a.png", 1, 2]], "frames": 3, "source points": [7, "digest"] });
        assert!(agree(&before, &now) && agree(&now, &now));
        // Points that were not there before are a change, and so are those that are there no more.
        let of_points = |points: Value| json!({ "source points": points });
        let [none, some] = [json!(0), json!([7, "digest"])].map(of_points);
        assert!(!agree(&none, &some) && !agree(&some, &none) && !agree(&of_points(json!(8)), &some));
        assert!(agree(&of_points(json!("points")), &of_points(json!([["00000.ply", 1, 2]]))));
        let other = |name: &str, value: Value| {
            let mut other = now.clone();
            other[name] = value;
            other
        };
        assert!(!agree(&before, &other("frames", json!(4))) && !agree(&before, &other("moving", json!(4))));
        assert!(!agree(&now, &other("pictures", json!([["a.png", 1, 3]]))));
        assert!(!agree(&now, &other("pictures", json!([["a.png", 1, 2], ["b.png", 1, 2]]))));
        // Flow and depth are compared as soon as they are noted.
        let [without, with] = [json!([]), json!([["a.flo", 1, 2]])].map(|priors| other(PRIORS, priors));
        assert!(agree(&before, &with) && agree(&now, &with));
        assert!(!agree(&without, &with) && !agree(&with, &without) && !agree(&with, &now));
        // Of files beside the pictures there may be more, but each is as it was.
        let [one, two] = [json!([["a.wav", 1, 2]]), json!([["a.wav", 1, 2], ["b.wav", 1, 2]])];
        assert!(agree(&one, &two) && !agree(&two, &one) && !agree(&one, &json!([["a.wav", 1, 3]])));
    }
}
