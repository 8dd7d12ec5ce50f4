//! Checkpoints: all that a run needs to continue bit for bit, in one file of hashed sections.
//!
//! Magic, length and hash of the header, header (JSON), then the sections: little-endian f32. A folder holds the last
//! three and the best by the PSNR of test views, whose name has its score: `best-00000300-24.9312dB.ckpt`.

use super::{Average, Config};
use crate::error::{Error, Result};
use crate::files::{read_file, write_atomic};
use crate::scene::{Similarity, Splats};
use crate::stage::{GridState, PoseRows};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"IVVCKPT4";
/// Newest checkpoints kept in a folder.
const KEEP: usize = 3;
const REMEDY: &str = "delete it to go on from the one before";

/// A run between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Steps done.
    pub step: u64,
    /// Steps of the whole run.
    pub total: u64,
    /// The run's settings.
    pub config: Config,
    /// From the capture to the frame that training computes in.
    pub world: Similarity,
    /// Added to the positions of `params` in the frame of training.
    pub origin: [f64; 3],
    /// The parameters, positions relative to `origin`.
    pub params: Splats,
    /// First moments of Adam, by parameter.
    pub first: Splats,
    /// Second moments of Adam, by parameter.
    pub second: Splats,
    /// State of every Gaussian, see `Optimiser::state`.
    pub state: Vec<[f32; 4]>,
    /// The learnt parameters of the cameras.
    pub cameras: CameraState,
    /// Events that were due after the step and have not happened, because the run failed there.
    pub due: DueEvents,
    /// The sizes of the buffers of a step.
    pub room: StepCapacity,
    /// The mean of the scenes near the end of the run so far.
    pub average: Average,
}

/// The sizes of the buffers of a step. A run that continues with others may end with other last bits: lazy Adam has
/// moved Gaussians already when a step that did not fit runs again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct StepCapacity {
    /// Pairs of a Gaussian and a tile; 0 where it is not known.
    pub intersections: u32,
    pub rounds: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct DueEvents {
    pub density: bool,
    /// The choice of the cameras that need a colour map.
    pub grids: bool,
    pub review: bool,
    /// The freezing of time offsets that the pictures do not determine.
    pub offsets: bool,
    /// The comparison of the learnt poses with the capture's.
    pub poses: bool,
    /// The scene's share of the average.
    pub average: bool,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraState {
    /// By camera: time offset in frames, its moments, its rounding error so far; empty if no offset is learnt.
    pub clocks: Vec<[f32; 4]>,
    /// By camera, whether its offset is learnt; empty if none is.
    pub learns_offset: Vec<bool>,
    /// By camera, the learnt correction of its pose, in the frame of training, and the row of all; empty if none is.
    pub poses: Vec<PoseRows>,
    /// Bilateral grids of the training cameras with their moments; empty if there are none.
    pub grids: Vec<GridState>,
    pub grid_steps: Vec<u64>,
    /// By camera, whether it has a grid; empty if none has.
    pub has_grid: Vec<bool>,
}

#[derive(serde::Serialize, serde::Deserialize)]
struct Header {
    step: u64,
    total: u64,
    config: Config,
    world: Similarity,
    origin: [f64; 3],
    n_static: usize,
    sh_degree: u32,
    /// Runs of Gaussians of one SH degree: how many, and the degree. None if all have `sh_degree`.
    degrees: Vec<(usize, u8)>,
    learns_offset: Vec<bool>,
    grid_steps: Vec<u64>,
    has_grid: Vec<bool>,
    #[serde(default, rename = "owed")]
    due: DueEvents,
    #[serde(default)]
    room: StepCapacity,
    #[serde(default)]
    averaged: u64,
    sections: Vec<Section>,
}

#[derive(serde::Serialize, serde::Deserialize)]
struct Section {
    name: String,
    len: usize,
    hash: u64,
}

pub(super) fn arrays(splats: &Splats) -> [(&'static str, &[f32]); 6] {
    [
        ("position", splats.position.as_flattened()),
        ("rotation", splats.rotation.as_flattened()),
        ("scale", splats.scale.as_flattened()),
        ("opacity", &splats.opacity),
        ("sh", splats.sh.as_flattened()),
        ("motion", bytemuck::cast_slice(&splats.motion)),
    ]
}

/// `splats` with positions from the world's origin, which were relative to `origin`.
pub(super) fn placed(mut splats: Splats, origin: [f64; 3]) -> Splats {
    for position in &mut splats.position {
        *position = std::array::from_fn(|k| (f64::from(position[k]) + origin[k]) as f32);
    }
    splats
}

/// FNV-1a over 32-bit words.
fn hash(words: impl Iterator<Item = u32>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |h, word| (h ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3))
}

impl Checkpoint {
    /// Most bytes of the file of a checkpoint of `n` Gaussians, `n_dynamic` of them dynamic, but for some thousands and
    /// for grids: parameters, both moments, the average and the state.
    #[doc(hidden)]
    pub fn bytes(n: u64, n_dynamic: u64, sh_degree: u32) -> u64 {
        let side = u64::from(sh_degree) + 1;
        4 * (4 * ((11 + 3 * side * side) * n + 5 * n_dynamic) + 4 * n)
    }

    /// Checkpoints that a folder holds at most: the newest three, and the best.
    #[doc(hidden)]
    pub const MOST_KEPT: usize = KEEP + 1;

    /// The file of `step` in `folder`.
    pub fn file(folder: &Path, step: u64) -> PathBuf {
        folder.join(format!("{step:08}.ckpt"))
    }

    fn sections(&self) -> Vec<(String, &[f32])> {
        let mut all = Vec::new();
        let sets = [("params", &self.params), ("first", &self.first), ("second", &self.second)];
        for (set, splats) in sets.into_iter().chain(self.average.scene().map(|mean| ("average", mean))) {
            all.extend(arrays(splats).map(|(name, values)| (format!("{set}.{name}"), values)));
        }
        all.push(("state".to_owned(), self.state.as_flattened()));
        all.push(("clocks".to_owned(), self.cameras.clocks.as_flattened()));
        all.push(("poses".to_owned(), self.cameras.poses.as_flattened().as_flattened()));
        for (index, GridState { grid, first, second }) in self.cameras.grids.iter().enumerate() {
            all.extend(
                [("values", grid), ("first", first), ("second", second)]
                    .map(|(part, values)| (format!("grid{index}.{part}"), values.as_slice())),
            );
        }
        all
    }

    /// Writes the checkpoint into `folder` and removes all but the newest three and the best there; none on a fault.
    ///
    /// # Errors
    /// [`Error::Data`] naming the file that cannot be written; older checkpoints are then untouched.
    #[tracing::instrument(level = "info", name = "write checkpoint", skip_all)]
    pub fn write(&self, folder: &Path) -> Result<()> {
        let file = Self::file(folder, self.step);
        std::fs::create_dir_all(folder).map_err(|e| {
            Error::data(folder, "", format!("cannot be made: {e}"), "free space or choose another folder")
        })?;
        let sections = self.sections();
        let section = |(name, values): &(String, &[f32])| Section {
            name: name.clone(),
            len: values.len(),
            hash: hash(values.iter().map(|x| x.to_bits())),
        };
        let header = Header {
            step: self.step,
            total: self.total,
            config: self.config.clone(),
            world: self.world,
            origin: self.origin,
            n_static: self.params.n_static,
            sh_degree: self.params.sh_degree,
            degrees: self.params.degree.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0])).collect(),
            learns_offset: self.cameras.learns_offset.clone(),
            grid_steps: self.cameras.grid_steps.clone(),
            has_grid: self.cameras.has_grid.clone(),
            due: self.due,
            room: self.room,
            averaged: self.average.n,
            sections: sections.iter().map(section).collect(),
        };
        write_atomic(&file, |to| {
            let header = serde_json::to_vec(&header)?;
            to.write_all(MAGIC)?;
            to.write_all(&(header.len() as u64).to_le_bytes())?;
            to.write_all(&hash(header.iter().map(|b| u32::from(*b))).to_le_bytes())?;
            to.write_all(&header)?;
            for (_, values) in &sections {
                for part in values.chunks(1 << 16) {
                    to.write_all(&part.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())?;
                }
            }
            Ok(())
        })?;
        let mut all = list(folder)?;
        all.retain(|kept| kept.psnr.is_none());
        all.iter().rev().skip(KEEP).for_each(|old| remove(&old.file));
        Ok(())
    }

    /// True if `folder` holds a checkpoint, readable or not.
    #[doc(hidden)]
    pub fn any_in(folder: &Path) -> Result<bool> {
        Ok(!list(folder)?.is_empty())
    }

    /// The step of the newest checkpoint of `folder`, readable or not.
    #[doc(hidden)]
    pub fn newest_step(folder: &Path) -> Result<Option<u64>> {
        Ok(list(folder)?.iter().rev().find(|kept| kept.psnr.is_none()).map(|kept| kept.step))
    }

    #[doc(hidden)]
    pub fn remove_all(folder: &Path) -> Result<()> {
        list(folder)?.into_iter().try_for_each(|kept| {
            let fault = |e| Error::data(&kept.file, "", format!("cannot be removed: {e}"), "check its permissions");
            std::fs::remove_file(&kept.file).map_err(fault)
        })
    }

    #[doc(hidden)]
    pub fn best(folder: &Path) -> Result<Option<(u64, f64)>> {
        let scored = list(folder)?.into_iter().filter_map(|kept| Some((kept.step, kept.psnr?)));
        Ok(scored.max_by(|a, b| a.1.total_cmp(&b.1)))
    }

    /// Keeps the checkpoint of `step` in `folder` as the best one if its `psnr`, the mean of the test views, is.
    #[doc(hidden)]
    pub fn keep_best(folder: &Path, step: u64, psnr: f64) -> Result<()> {
        // The name has the rounded score: the best one itself, scored again, is not better than it was.
        let told = format!("{psnr:.4}");
        let is_better = |(_, best): (u64, f64)| told.parse().is_ok_and(|psnr: f64| psnr > best);
        if !psnr.is_finite() || !Self::best(folder)?.is_none_or(is_better) {
            return Ok(());
        }
        let file = Self::file(folder, step);
        let best = folder.join(format!("best-{step:08}-{told}dB.ckpt"));
        // A hard link costs no space; a copy serves if the file system has none.
        let linked = std::fs::hard_link(&file, &best);
        if linked.is_err() {
            let bytes = read_file(&file)
                .map_err(|e| Error::data(&file, "", format!("cannot be read: {e}"), "check the folder"))?;
            write_atomic(&best, |to| to.write_all(&bytes))?;
        }
        list(folder)?.iter().filter(|kept| kept.psnr.is_some() && kept.file != best).for_each(|old| remove(&old.file));
        Ok(())
    }

    /// Reads a checkpoint and verifies every hash; the fault names the section that is cut, changed or missing.
    ///
    /// # Errors
    /// [`Error::Data`] naming the section that is cut, changed or missing.
    pub fn read(file: &Path) -> Result<Self> {
        let fault = |place: &str, reason: String| Error::data(file, place, reason, REMEDY);
        let bytes = read_file(file).map_err(|e| fault("", format!("cannot be read: {e}")))?;
        let (header, mut values) = verified(file, &bytes)?;
        let n_degrees = header.degrees.iter().try_fold(0usize, |sum, (n, _)| sum.checked_add(*n));
        if n_degrees.is_none_or(|n| n > bytes.len()) {
            return Err(fault("header", "has more SH degrees than the file can have Gaussians".to_owned()));
        }
        let degree: Vec<u8> = header.degrees.iter().flat_map(|(n, degree)| std::iter::repeat_n(*degree, *n)).collect();
        let mut take = |name: &str| values.remove(name).ok_or_else(|| fault(name, "is missing".to_owned()));
        let mut set = |set: &str| -> Result<Splats> {
            let mut array = |name: &str| take(&format!("{set}.{name}"));
            let splats = Splats {
                n_static: header.n_static,
                position: array("position")?.as_chunks().0.to_vec(),
                rotation: array("rotation")?.as_chunks().0.to_vec(),
                scale: array("scale")?.as_chunks().0.to_vec(),
                opacity: array("opacity")?,
                sh: array("sh")?.as_chunks().0.to_vec(),
                motion: bytemuck::allocation::pod_collect_to_vec(&array("motion")?),
                degree: degree.clone(),
                ..Splats::new(header.sh_degree.min(3))
            };
            let source_row = (0..splats.len() as u32).collect();
            let splats = Splats { source_row, ..splats };
            splats.check().map_err(|reason| fault(set, reason))?;
            Ok(splats)
        };
        let (params, first, second) = (set("params")?, set("first")?, set("second")?);
        let average = match header.averaged {
            0 => Average::default(),
            n => Average { n, mean: set("average")? },
        };
        let state = take("state")?.as_chunks().0.to_vec();
        let n_average = average.scene().map_or(params.len(), Splats::len);
        if [first.len(), second.len(), state.len(), n_average] != [params.len(); 4] {
            return Err(fault("sections", "are of different numbers of Gaussians".to_owned()));
        }
        let clocks: Vec<[f32; 4]> = take("clocks")?.as_chunks().0.to_vec();
        // Checkpoints from before poses were learnt have none.
        let poses = take("poses").unwrap_or_default().as_chunks().0.as_chunks().0.to_vec();
        let Header { step, total, config, world, origin, learns_offset, grid_steps, has_grid, due, room, .. } = header;
        let mut grids = Vec::new();
        for index in 0..grid_steps.len() {
            let mut part = |part: &str| take(&format!("grid{index}.{part}"));
            let grid = GridState { grid: part("values")?, first: part("first")?, second: part("second")? };
            if !grid.is_sound() {
                return Err(fault(&format!("grid{index}"), "is no bilateral grid".to_owned()));
            }
            grids.push(grid);
        }
        if clocks.len() != learns_offset.len() {
            return Err(fault("sections", "are of different numbers of cameras".to_owned()));
        }
        let cameras = CameraState { clocks, learns_offset, poses, grids, grid_steps, has_grid };
        Ok(Checkpoint { step, total, config, world, origin, params, first, second, state, cameras, due, room, average })
    }

    /// The Gaussians in the capture's own world; at the end of the run their average. Under lazy Adam those that were out
    /// of view lately lag: only [`super::Trainer::splats`] catches up with their steps.
    pub fn splats(&self) -> Splats {
        if let (Some(mean), true) = (self.average.scene(), self.step == self.total) {
            return self.world.inverse().splats(mean);
        }
        self.world.inverse().splats(&placed(self.params.clone(), self.origin))
    }

    /// The newest checkpoint of `folder` that can be read, with a warning for each newer one; the newest one's fault if
    /// none can be read.
    ///
    /// # Errors
    /// The newest one's fault, when none can be read; [`Error::Data`] when the folder is there and cannot be listed.
    pub fn newest(folder: &Path) -> Result<Option<Self>> {
        let mut newest_fault = None;
        for Kept { file, .. } in list(folder)?.into_iter().rev() {
            match Self::read(&file) {
                Ok(checkpoint) => return Ok(Some(checkpoint)),
                Err(fault) => {
                    tracing::warn!("{fault}");
                    newest_fault.get_or_insert(fault);
                }
            }
        }
        newest_fault.map_or(Ok(None), Err)
    }
}

/// The header of the checkpoint `file`, and the numbers of its sections by name, all as their hashes say.
fn verified(file: &Path, bytes: &[u8]) -> Result<(Header, BTreeMap<String, Vec<f32>>)> {
    let fault = |place: &str, reason: String| Error::data(file, place, reason, REMEDY);
    let Some((head, rest)) = bytes.split_at_checked(24).filter(|(head, _)| head.starts_with(MAGIC)) else {
        return Err(fault("", "is no checkpoint of this version".to_owned()));
    };
    let number = |at: usize| head[at..at + 8].iter().rev().fold(0u64, |n, byte| n << 8 | u64::from(*byte));
    // A header may be long, since it grows with the cameras; its hash shows if it is one.
    let length = usize::try_from(number(8)).ok();
    let Some((header, mut rest)) = length.and_then(|n| rest.split_at_checked(n)) else {
        return Err(fault("header", "is cut".to_owned()));
    };
    if hash(header.iter().map(|b| u32::from(*b))) != number(16) {
        return Err(fault("header", "its hash differs".to_owned()));
    }
    let header: Header = serde_json::from_slice(header).map_err(|e| fault("header", e.to_string()))?;
    let mut values = BTreeMap::new();
    for section in &header.sections {
        let cut = section.len.checked_mul(4).and_then(|n| rest.split_at_checked(n));
        let Some((data, tail)) = cut else { return Err(fault(&section.name, "is cut".to_owned())) };
        let data: Vec<f32> = data.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        if hash(data.iter().map(|x| x.to_bits())) != section.hash {
            return Err(fault(&section.name, "its hash differs".to_owned()));
        }
        values.insert(section.name.clone(), data);
        rest = tail;
    }
    Ok((header, values))
}

struct Kept {
    step: u64,
    /// PSNR, of a best one.
    psnr: Option<f64>,
    file: PathBuf,
}

/// The checkpoints of `folder`, oldest first; of one step, the best one first.
fn list(folder: &Path) -> Result<Vec<Kept>> {
    let fault = |e| Error::data(folder, "", format!("cannot be listed: {e}"), "check its permissions");
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(fault)?.collect::<std::io::Result<Vec<_>>>().map_err(fault)?,
    };
    let mut all: Vec<Kept> = entries
        .into_iter()
        .filter_map(|entry| {
            let file = entry.path();
            let stem = file.file_name()?.to_str()?.strip_suffix(".ckpt")?;
            let (step, psnr) = match stem.strip_prefix("best-") {
                Some(best) => {
                    let (step, psnr) = best.split_once('-')?;
                    (step, Some(psnr.strip_suffix("dB")?.parse().ok()?))
                }
                None => (stem, None),
            };
            Some(Kept { step: step.parse().ok()?, psnr, file })
        })
        .collect();
    all.sort_by_key(|kept| (kept.step, kept.psnr.is_none()));
    Ok(all)
}

fn remove(old: &Path) {
    if let Err(e) = std::fs::remove_file(old) {
        tracing::warn!("{}: cannot be removed: {e}", old.display());
    }
}
