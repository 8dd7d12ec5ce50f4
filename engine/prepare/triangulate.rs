//! Points of each frame, triangulated by COLMAP from the known poses; and `sparse/0`.

use std::collections::{BTreeSet, HashMap};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::colmap::{Colmap, Matched, OFF, ON};
use super::images::{Camera, Images, take_over};
use super::journal::{Journal, stamps};
use super::model::{self, ModelCamera};
use super::program::COLMAP;
use super::settings::{OnProgress, PrepareSettings, Progress, Share, Triangulate};
use super::source::Source;
use super::video::Selection;
use crate::error::{Error, Result};
use crate::files::{make_folder, read_file, read_text};
use crate::parallel::in_parallel;
use crate::scene::capture::{FramePoints, tracks};
use crate::scene::undistort::Lens;
use crate::scene::{Pose, SeenPoint, write_points};

/// The frame of `sparse/0/points3D.txt`.
const REFERENCE: u32 = 0;
const MATCHED: Matched = Matched { all: 40, neighbours: 20 };
/// Frames whose features one process of COLMAP finds, lens by lens: its start takes as long as those of a small picture.
const FRAMES_AT_ONCE: usize = 8;
/// Programs at once that compute on the GPU: each has its own memory there.
const PROGRAMS_ON_GPU: usize = 4;

/// Triangulates what is not triangulated yet and returns the number of points of each triangulated frame.
#[tracing::instrument(level = "info", name = "points", skip_all)]
pub(super) fn make(
    images: &Images,
    source: &Source,
    settings: &PrepareSettings,
    share: Share,
    journal: &Journal,
    progress: OnProgress,
) -> Result<Vec<(u32, usize)>> {
    let (what, keeps) = asked(source, settings);
    let carried = source.frame_points.as_ref().filter(|_| keeps && what == Triangulate::None);
    let of_source = match carried {
        Some(points) => stamps((0..images.n_frames()).map(|frame| points.path(source_frame(images, frame)))),
        None => digest(source, what),
    };
    let posed: Vec<_> = images.cameras.iter().map(|c| json!([c.name, c.is_test, c.poses])).collect();
    journal.begin("points", json!({ "triangulate": what, "cameras": posed, "source points": of_source }))?;
    let stage =
        Triangulation { images, work: images.output.join(".colmap"), threads: settings.threads, on_gpu: on_gpu() };
    let (model, points) = (images.output.join("sparse/0"), images.output.join("points"));
    let file = |frame: u32| points.join(format!("{frame:05}.ply"));
    let every = if let Triangulate::Every(every) = what { Some(every) } else { carried.map(|_| 1) };
    let Some(every) = every else {
        if share.part > 0 {
            return Ok(Vec::new());
        }
        if !model.join("points3D.txt").is_file() {
            let found = match what {
                Triangulate::None => stage.of_source(source),
                _ => stage.frames(source, &[REFERENCE])?.swap_remove(0),
            };
            // Who saw the points of a static scene is known.
            if images.n_frames() == 1 && found.iter().any(|point| !point.camera_ids.is_empty()) {
                make_folder(&points)?;
                write_points(&file(REFERENCE), &found)?;
            }
            stage.write_model(&model, &found)?;
            progress(Progress { stage: "points", done: 1, total: 1, piece: "the reference frame" });
        }
        let rows = read_text(&model.join("points3D.txt")).unwrap_or_default();
        let n = rows.lines().filter(|line| !line.starts_with('#')).count();
        stage.clear()?;
        return Ok(Vec::from_iter((n > 0).then_some((REFERENCE, n))));
    };
    make_folder(&points)?;
    let frames: Vec<u32> = (0..images.n_frames()).filter(|frame| share.has(*frame as usize)).collect();
    // The reference frame comes first: its points are in the model, too.
    let is_done = |frame: u32| file(frame).is_file() && (frame != REFERENCE || model.join("points3D.txt").is_file());
    let left: Vec<u32> = frames.iter().copied().filter(|frame| !is_done(*frame)).collect();
    let done = AtomicUsize::new(frames.len() - left.len());
    let keep = |frame: u32, found: &[SeenPoint]| {
        write_points(&file(frame), found)?;
        if frame == REFERENCE {
            stage.write_model(&model, found)?;
        }
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let piece = format!("frame {frame}: {} points", found.len());
        progress(Progress { stage: "points", done, total: frames.len(), piece: &piece });
        Ok(())
    };
    let (has_points, without): (Vec<u32>, Vec<u32>) = left.iter().partition(|frame| frame.is_multiple_of(every));
    without.into_iter().try_for_each(|frame| keep(frame, &[]))?;
    if let Some(points) = carried {
        let one = |index: usize| keep(has_points[index], &stage.carried(points, has_points[index])?);
        in_parallel(has_points.len(), settings.threads, one, |_| {})?;
    } else {
        let together: Vec<&[u32]> = has_points.chunks(stage.at_once(has_points.len())).collect();
        let some = |index: usize| {
            let found = stage.frames(source, together[index])?;
            together[index].iter().zip(&found).try_for_each(|(frame, found)| keep(*frame, found))
        };
        in_parallel(together.len(), stage.programs(), some, |_| {})?;
    }
    if share != Share::ALL {
        return Ok(Vec::new());
    }
    stage.clear()?;
    frames.into_iter().step_by(every as usize).map(|frame| Ok((frame, n_points(&file(frame))?))).collect()
}

fn source_frame(images: &Images, frame: u32) -> u32 {
    let Selection { start, every, .. } = images.select;
    start + frame * every
}

/// The source's points of no single frame, for the journal: a digest, or their number where none is taken.
fn digest(source: &Source, what: Triangulate) -> Value {
    if what != Triangulate::None || source.points.is_empty() {
        return json!(source.points.len());
    }
    let mut hash = Sha256::new();
    for (point, seen_by) in &source.points {
        hash.update(point.position.map(f64::to_le_bytes).as_flattened());
        hash.update(point.color);
        seen_by.iter().for_each(|name| hash.update(format!("{name}\n")));
    }
    json!([source.points.len(), format!("{:x}", hash.finalize())])
}

/// The frames whose points are triangulated, and whether the source's are kept.
pub(super) fn asked(source: &Source, settings: &PrepareSettings) -> (Triangulate, bool) {
    let has_points = source.frame_points.is_some() || !source.points.is_empty();
    // A camera that is shifted shows other times than those of the points.
    let keeps = has_points && settings.shifts.is_empty();
    (settings.triangulate.unwrap_or(if keeps { Triangulate::None } else { Triangulate::Every(1) }), keeps)
}

/// Of how many of `n` frames points are triangulated.
pub(super) fn of_frames(what: Triangulate, n: usize) -> usize {
    match what {
        Triangulate::None => 0,
        Triangulate::Reference => 1,
        Triangulate::Every(every) => n.div_ceil(every.max(1) as usize),
    }
}

pub(super) fn n_pairs(cameras: usize) -> usize {
    MATCHED.count(cameras)
}

/// Refuses what COLMAP cannot triangulate, unless all points are there from an earlier run.
pub(super) fn require(images: &Images, source: &Source, settings: &PrepareSettings) -> Result<()> {
    let points = |frame: u32| images.output.join(format!("points/{frame:05}.ply")).is_file();
    let has_points = match asked(source, settings).0 {
        Triangulate::None => return Ok(()),
        Triangulate::Reference => true,
        Triangulate::Every(_) => (0..images.n_frames()).all(points),
    };
    if !settings.force && has_points && images.output.join("sparse/0/points3D.txt").is_file() {
        return Ok(());
    }
    if images.cameras.iter().filter(|camera| !camera.is_test).count() < 2 {
        let reason = "has one training camera; points need two that see the same";
        return Err(Error::data(&source.calibration, "", reason, "give --triangulate none"));
    }
    COLMAP.require(&settings.source)
}

fn n_points(path: &Path) -> Result<usize> {
    let fault = || Error::data(path, "", "is no file of points", "remove it and prepare again");
    let bytes = read_file(path).map_err(|_| fault())?;
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(512)]);
    let n = header.lines().find_map(|line| line.strip_prefix("element vertex ")?.parse().ok());
    n.ok_or_else(fault)
}

struct Triangulation<'a> {
    images: &'a Images,
    /// Everything that COLMAP needs and nobody else.
    work: PathBuf,
    threads: usize,
    /// True if COLMAP finds and matches features on a GPU.
    on_gpu: bool,
}

impl Triangulation<'_> {
    fn id(index: usize) -> u32 {
        index as u32 + 1
    }

    fn of_source(&self, source: &Source) -> Vec<SeenPoint> {
        let names = self.images.cameras.iter().map(|camera| camera.name.as_str());
        let ids: HashMap<&str, u32> = names.zip(1..).collect();
        let points = source.points.iter().map(|(point, by)| {
            let ids: BTreeSet<u32> = by.iter().filter_map(|name| ids.get(name.as_str()).copied()).collect();
            SeenPoint { position: point.position, rgb: point.color, camera_ids: ids.into_iter().collect() }
        });
        points.collect()
    }

    fn carried(&self, points: &FramePoints, frame: u32) -> Result<Vec<SeenPoint>> {
        let index = |name: &str| self.images.cameras.iter().position(|camera| camera.name == name);
        let points = points.read(source_frame(self.images, frame), index)?.into_iter();
        let seen = |by: Vec<usize>| by.into_iter().map(Self::id).collect();
        Ok(points.map(|p| SeenPoint { position: p.position, rgb: p.color, camera_ids: seen(p.seen_by) }).collect())
    }

    /// The model of all cameras, in the names of the finished images, with the points of the reference frame.
    fn write_model(&self, folder: &Path, points: &[SeenPoint]) -> Result<()> {
        let model = |(index, camera): (usize, &Camera)| {
            let frames = (0_u32..).zip(&camera.poses);
            let images = frames.map(|(frame, pose)| (self.images.image_name(camera, frame), *pose)).collect();
            ModelCamera { id: Self::id(index), lens: camera.pinhole, images }
        };
        let cameras: Vec<ModelCamera> = self.images.cameras.iter().enumerate().map(model).collect();
        model::write(folder, &cameras, points)
    }

    fn programs(&self) -> usize {
        if self.on_gpu { self.threads.min(PROGRAMS_ON_GPU) } else { self.threads }
    }

    /// How many of `n` frames are given to one program: all cores have some.
    fn at_once(&self, n: usize) -> usize {
        n.div_ceil(self.programs().max(1)).clamp(1, FRAMES_AT_ONCE)
    }

    /// The name by which COLMAP knows an image: one without spaces, which neither its lists of pairs nor its models of text can hold.
    fn name(&self, camera: usize, frame: u32) -> String {
        let own = PathBuf::from(self.images.image_name(&self.images.cameras[camera], frame));
        format!("{camera:03}/{}", own.file_name().unwrap_or_default().to_string_lossy())
    }

    fn frames(&self, source: &Source, frames: &[u32]) -> Result<Vec<Vec<SeenPoint>>> {
        let all = self.images.cameras.iter().enumerate();
        let cameras: Vec<(usize, &Camera)> = all.filter(|(_, camera)| !camera.is_test).collect();
        let work = self.work.join(format!("{:05}", frames[0]));
        let _ = fs::remove_dir_all(&work);
        make_folder(&work)?;
        // Cameras that have pictures of some of the frames, with those.
        let models = |frames: &[u32]| -> Vec<ModelCamera> {
            let image = |(index, camera): &(usize, &Camera), frame: u32| {
                (self.name(*index, frame), *camera.poses.get(frame as usize).unwrap_or(&camera.poses[0]))
            };
            let model = |camera: &(usize, &Camera)| {
                let frames = frames.iter().filter(|frame| camera.1.has(**frame));
                let images = frames.map(|frame| image(camera, *frame)).collect();
                ModelCamera { id: Self::id(camera.0), lens: camera.1.pinhole, images }
            };
            cameras.iter().map(model).filter(|model| !model.images.is_empty()).collect()
        };
        let folder = work.join("images");
        for (index, camera) in &cameras {
            make_folder(&folder.join(format!("{index:03}")))?;
            for frame in frames.iter().filter(|frame| camera.has(**frame)) {
                let from = self.images.output.join("images").join(self.images.image_name(camera, *frame));
                let to = folder.join(self.name(*index, *frame));
                // No copy where the file system can do without.
                fs::hard_link(&from, &to).or_else(|_| take_over(&from, &to))?;
            }
        }
        let colmap = Colmap {
            about: &source.calibration,
            folder,
            database: work.join("database.db"),
            threads: (self.threads / self.images.n_frames() as usize).max(1).to_string(),
            on_gpu: if self.on_gpu { ON } else { OFF },
        };
        let of_frames: Vec<Vec<ModelCamera>> = frames.iter().map(|frame| models(&[*frame])).collect();
        // Nothing is matched where cameras have lost their frames.
        if of_frames.iter().any(|models| models.len() > 1) {
            colmap.extract(&by_lens(&models(frames)), &work, &[])?;
            match_features(&colmap, &of_frames, &work)?;
        }
        let found = frames.iter().zip(&of_frames).map(|(frame, models)| match models.len() {
            0 | 1 => Ok(Vec::new()),
            _ => self.triangulated(&colmap, models, &work.join(frame.to_string())),
        });
        let found = found.collect();
        // The whole folder is removed at the end.
        let _ = fs::remove_dir_all(&work);
        found
    }

    /// The points of one frame, whose features are matched, seen by the cameras of `models`; the work is done in `folder`.
    fn triangulated(&self, colmap: &Colmap, models: &[ModelCamera], folder: &Path) -> Result<Vec<SeenPoint>> {
        let (input, found) = (folder.join("model"), folder.join("found"));
        make_folder(&found)?;
        model::write(&input, models, &[])?;
        // The poses are known, so that two views of a point are enough.
        if !colmap.triangulate(&input, &found, &[("--Mapper.tri_ignore_two_view_tracks", OsStr::new(OFF))])? {
            return Ok(Vec::new());
        }
        let ids: HashMap<&str, u32> = models.iter().map(|model| (model.images[0].0.as_str(), model.id)).collect();
        let points = tracks(&found)?.into_iter().map(|(point, by)| {
            let ids: BTreeSet<u32> = by.iter().filter_map(|name| ids.get(name.to_str()?).copied()).collect();
            SeenPoint { position: point.position, rgb: point.color, camera_ids: ids.into_iter().collect() }
        });
        Ok(points.collect())
    }

    fn clear(&self) -> Result<()> {
        if !self.work.exists() {
            return Ok(());
        }
        fs::remove_dir_all(&self.work)
            .map_err(|fault| Error::data(&self.work, "", format!("cannot be removed: {fault}"), "remove it by hand"))
    }
}

fn match_features(colmap: &Colmap, of_frames: &[Vec<ModelCamera>], work: &Path) -> Result<()> {
    // Matches along the epipolar lines that the first ones give: nearly twice as many points where views are few.
    let guided = [("--SiftMatching.guided_matching", OsStr::new(ON))];
    if let [models] = of_frames
        && models.len() <= MATCHED.all
    {
        return colmap.run("exhaustive_matcher", &[&colmap.matching()[..], &guided].concat());
    }
    let mut text = String::new();
    for models in of_frames {
        let (names, poses): (Vec<&str>, Vec<Pose>) =
            models.iter().map(|model| (model.images[0].0.as_str(), model.images[0].1)).unzip();
        for (a, b) in MATCHED.pairs(&poses) {
            text += &format!("{} {}\n", names[a], names[b]);
        }
    }
    colmap.match_pairs(&text, work, &guided)
}

fn by_lens(models: &[ModelCamera]) -> Vec<(Lens, Vec<&str>)> {
    let mut groups: Vec<(Lens, Vec<&str>)> = Vec::new();
    for model in models {
        let own = model.images.iter().map(|(name, _)| name.as_str());
        match groups.iter_mut().find(|(lens, _)| *lens == model.lens) {
            Some((_, names)) => names.extend(own),
            None => groups.push((model.lens, own.collect())),
        }
    }
    groups
}

/// True if COLMAP can find and match features on a GPU: it was built with CUDA, and the machine has a GPU of NVIDIA.
fn on_gpu() -> bool {
    let has_gpu = || fs::read_dir("/proc/driver/nvidia/gpus").is_ok_and(|mut gpus| gpus.next().is_some());
    // The other builds say "without CUDA".
    let is_with_cuda = |said: Vec<u8>| String::from_utf8_lossy(&said).contains("with CUDA");
    has_gpu() && COLMAP.run(["help"], Path::new("COLMAP")).is_ok_and(is_with_cuda)
}
