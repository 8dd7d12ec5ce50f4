//! Hashes that tell a capture from another, or from itself after a change.

use crate::error::Result;
use crate::parallel::{in_parallel, threads};
use crate::scene::Pose;
use crate::scene::capture::{Camera, Capture, Shot};
use crate::words::count;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of a file that are hashed, at its beginning, in its middle and at its end, beside its length: the length of a
/// compressed picture hardly ever stays. Whole files would take minutes.
const PART: u64 = 4096;
/// Resolution of poses: of a rotation's numbers, and of a translation for each unit of its length.
const STEPS: f64 = 1e7;
const NAMED: usize = 4;

/// By camera, of a capture in its own frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct Fingerprints(pub BTreeMap<String, Fingerprint>);

#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fingerprint {
    /// Of its poses, its lens, the size of its pictures and their frames; 16 hexadecimal digits.
    pub calibration: String,
    /// Of its pictures, with their masks, by frame; 16 digits each, one after the other.
    pub pictures: String,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Cameras that stand elsewhere, or have another lens or other frames.
    pub calibration: Vec<String>,
    pub pictures: Vec<(String, usize)>,
}

impl Fingerprints {
    /// The fingerprints of `capture`, in its own world. A picture that cannot be read has that of an empty file.
    pub fn of(capture: &Capture) -> Result<Self> {
        let shots: Vec<&Shot> = capture.cameras.iter().flat_map(|camera| &camera.shots).collect();
        let pictures = in_parallel(shots.len(), threads(), |at| Ok(of_picture(shots[at])), |_| ())?;
        let mut pictures = pictures.into_iter();
        let of = |camera: &Camera| {
            let pictures = pictures.by_ref().take(camera.shots.len()).collect();
            (camera.name.clone(), Fingerprint { calibration: of_calibration(camera), pictures })
        };
        Ok(Fingerprints(capture.cameras.iter().map(of).collect()))
    }

    pub fn changes(&self, now: &Self) -> Changes {
        let mut changes = Changes::default();
        for (name, before) in &self.0 {
            let now = now.0.get(name).cloned().unwrap_or_default();
            if now.calibration != before.calibration {
                changes.calibration.push(name.clone());
            }
            let n = before.each().zip(now.each()).filter(|(before, now)| before != now).count();
            if n > 0 {
                changes.pictures.push((name.clone(), n));
            }
        }
        changes
    }

    /// Pictures of the cameras that `tests` names that are also pictures of another camera.
    pub fn n_shared(&self, tests: &[String]) -> usize {
        let (tests, others): (Vec<_>, Vec<_>) = self.0.iter().partition(|(name, _)| tests.contains(name));
        let others: BTreeSet<&str> = others.iter().flat_map(|(_, of)| of.each()).collect();
        tests.iter().flat_map(|(_, of)| of.each()).filter(|picture| others.contains(picture)).count()
    }
}

impl Fingerprint {
    fn each(&self) -> impl Iterator<Item = &str> {
        (0..self.pictures.len() / 16).filter_map(|at| self.pictures.get(16 * at..16 * (at + 1)))
    }
}

impl Changes {
    pub fn is_empty(&self) -> bool {
        self.calibration.is_empty() && self.pictures.is_empty()
    }
}

impl fmt::Display for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let some = |names: Vec<String>| {
            let more = if names.len() > NAMED { ", ..." } else { "" };
            format!("{}{more}", names.into_iter().take(NAMED).collect::<Vec<_>>().join(", "))
        };
        let mut parts = Vec::new();
        if !self.calibration.is_empty() {
            let (n, names) = (count(self.calibration.len(), "camera"), some(self.calibration.clone()));
            parts.push(format!("the calibration of {n} is another ({names})"));
        }
        if !self.pictures.is_empty() {
            let n = count(self.pictures.iter().map(|(_, n)| n).sum::<usize>(), "picture");
            let names = some(self.pictures.iter().map(|(name, n)| format!("{name}: {n}")).collect());
            parts.push(format!("{n} changed ({names})"));
        }
        write!(f, "{}", parts.join("; "))
    }
}

fn digits(hash: Sha256) -> String {
    let mut digits = format!("{:x}", hash.finalize());
    digits.truncate(16);
    digits
}

fn of_calibration(camera: &Camera) -> String {
    let mut hash = Sha256::new();
    let lens = &camera.intrinsics;
    hash.update([lens.width, lens.height].map(u32::to_le_bytes).as_flattened());
    let mut numbers = |all: &[f64], unit: f64| {
        all.iter().for_each(|x| hash.update(((x / unit * STEPS).round() as i64).to_le_bytes()));
    };
    // In pixels of a picture.
    numbers(&[lens.fx, lens.fy, lens.cx, lens.cy], f64::from(lens.width.max(lens.height).max(1)));
    let mut pose = |pose: &Pose| {
        numbers(&pose.rotation.to_cols_array(), 1.0);
        let length = pose.translation.length();
        numbers(&pose.translation.to_array(), if length > 0.0 { length.log2().floor().exp2() } else { 1.0 });
    };
    if !camera.moves() {
        pose(&camera.world_to_camera);
    }
    camera.shots.iter().filter_map(|shot| shot.world_to_camera.as_ref()).for_each(&mut pose);
    camera.shots.iter().for_each(|shot| hash.update(shot.frame.to_le_bytes()));
    digits(hash)
}

fn of_picture(shot: &Shot) -> String {
    let mut hash = Sha256::new();
    for file in [Some(&shot.image), shot.mask.as_ref()].into_iter().flatten() {
        // The bytes up to a fault are hashed.
        let _ = add_file(&mut hash, file);
    }
    digits(hash)
}

fn add_file(hash: &mut Sha256, path: &Path) -> std::io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    hash.update(length.to_le_bytes());
    let mut part = Vec::with_capacity(PART as usize);
    let starts = if length <= 3 * PART { vec![0] } else { vec![0, (length - PART) / 2, length - PART] };
    let n = if starts.len() == 1 { length } else { PART };
    for start in starts {
        part.clear();
        file.seek(SeekFrom::Start(start))?;
        file.by_ref().take(n).read_to_end(&mut part)?;
        hash.update(&part);
    }
    Ok(())
}
