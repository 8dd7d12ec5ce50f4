//! Fits of depth priors that an earlier run found: a long clip has terabytes of priors.

use super::line::Outcome;
use crate::files::{read_file, write_atomic};
use crate::scene::View;
use crate::scene::capture::Capture;
use crate::stage::DepthSpace;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::UNIX_EPOCH;

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Kept {
    /// See [`DepthCache::key`].
    key: String,
    fit: Outcome,
}

/// `depth/fits.json` of a capture. Where it cannot be read or written, fits are found anew.
pub(super) struct DepthCache {
    capture: PathBuf,
    /// By file, relative to the capture.
    before: BTreeMap<String, Kept>,
    found: Mutex<BTreeMap<String, Kept>>,
}

impl DepthCache {
    pub fn open(capture: &Capture) -> Self {
        let file = Self::file(&capture.path);
        let before = read_file(&file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        DepthCache { capture: capture.path.clone(), before, found: Mutex::default() }
    }

    fn file(capture: &Path) -> PathBuf {
        capture.join("depth/fits.json")
    }

    /// All that the fit of a prior depends on; none without the file.
    pub fn key(path: &Path, view: &View, space: DepthSpace, points: &[[f64; 3]]) -> Option<String> {
        let of_file = std::fs::metadata(path).ok()?;
        let changed = of_file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        let mut hash = Sha256::new();
        hash.update(of_file.len().to_le_bytes());
        hash.update(changed.as_nanos().to_le_bytes());
        hash.update([u8::from(space == DepthSpace::Inverse)]);
        let lens = view.intrinsics;
        hash.update([lens.width, lens.height].map(u32::to_le_bytes).as_flattened());
        let numbers = [lens.fx, lens.fy, lens.cx, lens.cy];
        let rows = view.pose.rows();
        for number in numbers.iter().chain(rows.as_flattened()).chain(points.as_flattened()) {
            hash.update(number.to_le_bytes());
        }
        Some(format!("{:x}", hash.finalize()))
    }

    pub fn get(&self, path: &Path, key: &str) -> Option<Outcome> {
        self.before.get(&self.name(path)?).filter(|kept| kept.key == key).map(|kept| kept.fit)
    }

    pub fn note(&self, path: &Path, key: String, fit: Outcome) {
        if let Some(name) = self.name(path) {
            self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(name, Kept { key, fit });
        }
    }

    fn name(&self, path: &Path) -> Option<String> {
        path.strip_prefix(&self.capture).ok().and_then(Path::to_str).map(str::to_owned)
    }

    pub fn close(self) {
        let found = self.found.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut all = self.before;
        let file = Self::file(&self.capture);
        if found.is_empty() {
            return;
        }
        all.extend(found);
        if let Err(fault) = write_atomic(&file, |to| Ok(serde_json::to_writer(to, &all)?)) {
            tracing::debug!("the fits of depth priors are not kept: {fault}");
        }
    }
}
