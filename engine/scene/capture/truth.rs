//! `truth.json` of a capture folder: what is known of a capture and kept from training, for comparison.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Faults, check_names};
use crate::error::Result;
use crate::files::{read_file, read_json, write_atomic};

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
    let remedy = "give {\"time_offsets_frames\": {\"<camera>\": <frames>, ...}}, or remove the file";
    let truth = faults.take(read_json::<Truth>(&path, "truth of a capture", remedy));
    let offsets = truth.map(|truth| truth.time_offsets_frames).unwrap_or_default();
    check_names("time_offsets_frames", offsets.keys(), cameras, &path, faults);
    offsets
}

/// Writes the file with the offsets; one that says the same already is left as it is.
pub(crate) fn write_true_offsets(folder: &Path, offsets: BTreeMap<String, f64>) -> Result<()> {
    let text = serde_json::to_vec_pretty(&Truth { time_offsets_frames: offsets }).map_err(std::io::Error::other);
    let path = folder.join(FILE);
    if text.as_ref().is_ok_and(|text| read_file(&path).is_ok_and(|before| before == *text)) {
        return Ok(());
    }
    write_atomic(&path, |to| to.write_all(&text?))
}
