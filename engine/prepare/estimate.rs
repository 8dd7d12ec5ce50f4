//! An estimate of a preparation, from a few frames that are prepared for that and thrown away.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use super::settings::{OnProgress, PrepareSettings, Triangulate};
use super::{Preparation, make, triangulate};
use crate::error::{Error, Result};
use crate::scene::capture::Frames;

/// Frames that are prepared, from the middle of the clip.
const SAMPLED: u32 = 4;
const STAGES: [(&str, &[&str]); 3] = [
    ("images", &["images", "masks", "foreground", "covisible", "depth", "audio", "keypoints"]),
    ("points", &["points", "sparse"]),
    ("flow", &["flow"]),
];

#[derive(Clone, Debug, serde::Serialize)]
pub struct Estimate {
    pub cameras: usize,
    pub frames: u32,
    /// Frames that were prepared to find out.
    pub sampled: u32,
    pub threads: usize,
    pub stages: Vec<StageEstimate>,
}

#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct StageEstimate {
    pub stage: &'static str,
    pub sampled_seconds: f64,
    pub seconds: f64,
    pub bytes: u64,
}

struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // A folder that cannot be removed does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Prepares some frames of a source that has cameras in a folder beside the output, which is removed, and estimates all from them.
pub fn estimate(settings: &PrepareSettings, progress: OnProgress) -> Result<Estimate> {
    settings.check()?;
    let Preparation { source, images, settings, .. } = Preparation::faultless(settings)?;
    let (n, every) = (images.n_frames(), settings.frames.every);
    let sampled = SAMPLED.min(n);
    let from = settings.frames.from + (n - sampled) / 2 * every;
    let scratch = Scratch(scratch_folder(&settings.output)?);
    let sample = PrepareSettings {
        frames: Frames { from, to: Some(from + sampled * every), every },
        output: scratch.0.clone(),
        photos: None,
        force: true,
        ..settings.clone()
    };
    // When each stage was last heard of.
    let heard: Mutex<HashMap<&'static str, Instant>> = Mutex::default();
    let mut before = Instant::now();
    let prepared = make(Preparation::new(&sample)?, None, Vec::new(), &|update| {
        heard.lock().unwrap_or_else(PoisonError::into_inner).insert(update.stage, Instant::now());
        progress(update);
    })?;
    if let Some(fault) = prepared.report.faults.into_iter().next() {
        return Err(fault.into());
    }
    let heard = heard.into_inner().unwrap_or_else(PoisonError::into_inner);
    let mut stages = Vec::new();
    for (stage, parts) in STAGES {
        let Some(end) = heard.get(stage) else { continue };
        let sampled_seconds = end.duration_since(before).as_secs_f64();
        before = *end;
        let times = match (stage, triangulate::asked(&source, &settings).0) {
            ("points", Triangulate::Reference) => 1.0,
            ("points", Triangulate::Every(every)) => f64::from(n.div_ceil(every)) / f64::from(sampled.div_ceil(every)),
            ("flow", _) => f64::from(n - 1) / f64::from((sampled - 1).max(1)),
            _ => f64::from(n) / f64::from(sampled),
        };
        let bytes: u64 = parts.iter().map(|part| size(&scratch.0.join(part))).sum();
        stages.push(StageEstimate {
            stage,
            sampled_seconds,
            seconds: times * sampled_seconds,
            bytes: (times * bytes as f64) as u64,
        });
    }
    Ok(Estimate { cameras: images.cameras.len(), frames: n, sampled, threads: settings.threads, stages })
}

/// A folder on the disk of `output` that nobody else uses.
fn scratch_folder(output: &Path) -> Result<PathBuf> {
    let Some(name) = output.file_name() else {
        return Err(Error::data(output, "", "this names no folder", "choose another folder with -o"));
    };
    let hidden = format!(".{}.plan-{}", name.to_string_lossy(), std::process::id());
    Ok(output.with_file_name(hidden))
}

fn size(path: &Path) -> u64 {
    match fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| size(&entry.path())).sum(),
        Err(_) => fs::metadata(path).map_or(0, |data| data.len()),
    }
}
