//! `truth.json` of a capture folder: what is known of a capture and kept from training, for comparison.

use std::collections::BTreeMap;
use std::path::Path;

use super::builder::check_names;
use super::report::Faults;
use crate::error::{Error, Result};
use crate::files::{cannot_read, read_file, write_atomic};

const FILE: &str = "truth.json";

/// The part of the file that is read here; a synthetic capture knows more.
#[derive(serde::Serialize, serde::Deserialize)]
struct Truth {
    #[serde(default)]
    time_offsets_frames: BTreeMap<String, f64>,
}

/// By name, the offsets of the folder's cameras; empty where there is no such file or it tells none.
pub(super) fn read_true_offsets(folder: &Path, cameras: &[&str], faults: &mut Faults) -> BTreeMap<String, f64> {
    let path = folder.join(FILE);
    if !path.exists() {
        return BTreeMap::new();
    }
    let text = read_file(&path).map_err(|fault| cannot_read(&path, &fault));
    let truth = text.and_then(|text| {
        serde_json::from_slice::<Truth>(&text).map_err(|fault| {
            let place = format!("line {}", fault.line());
            let remedy = "give {\"time_offsets_frames\": {\"<camera>\": <frames>, ...}}, or remove the file";
            Error::data(&path, place, format!("is no truth of a capture: {fault}"), remedy)
        })
    });
    let offsets = faults.take(truth).map(|truth| truth.time_offsets_frames).unwrap_or_default();
    check_names("time_offsets_frames", offsets.keys(), cameras, &path, faults);
    offsets
}

/// Writes the file with the offsets; one that says the same already is left as it is.
///
/// # Errors
/// [`Error::Data`] when the file cannot be written.
pub(crate) fn write_true_offsets(folder: &Path, offsets: BTreeMap<String, f64>) -> Result<()> {
    let text = serde_json::to_vec_pretty(&Truth { time_offsets_frames: offsets }).map_err(std::io::Error::other);
    let path = folder.join(FILE);
    if text.as_ref().is_ok_and(|text| read_file(&path).is_ok_and(|before| before == *text)) {
        return Ok(());
    }
    write_atomic(&path, |to| to.write_all(&text?))
}
