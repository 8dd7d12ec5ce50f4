//! `transforms.json` of nerfstudio and instant-ngp, and D-NeRF's split into `transforms_train.json` and
//! `transforms_test.json`. Poses map camera to world, the camera x right, y up, z backward (OpenGL).

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::builder::{CaptureBuilder, MAX_FRAMES};
use super::camera::{Camera, Shot};
use super::decoder::MAX_SIDE;
use super::header::read_size;
use super::names::{flat, is_image, relative, with_image_extension};
use super::report::Faults;
use super::settings::CaptureSettings;
use crate::error::{self, Error};
use crate::files::read_bytes;
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose};
use glam::{DMat3, DVec3};

const REMEDY: &str = "correct the file, or export the capture again";
/// Two times closer than this are one.
const TIME_TOLERANCE: f64 = 1e-6;
/// How far a time may lie from the grid of frames, in frames.
const GRID_TOLERANCE: f64 = 0.05;
/// Most frames between the two closest times: irregular times have a fine common grid too, but not one of a clip.
const MAX_DIVISION: f64 = 8.0;

/// Intrinsics; each may stand in the file, in a frame, or nowhere.
#[derive(Clone, Default, serde::Deserialize)]
#[serde(default)]
struct GivenLens {
    camera_model: Option<String>,
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    /// What instant-ngp says instead of a model.
    is_fisheye: Option<bool>,
}

#[derive(serde::Deserialize)]
struct Document {
    #[serde(flatten)]
    lens: GivenLens,
    frames: Vec<Frame>,
    test_filenames: Option<Vec<String>>,
    ply_file_path: Option<String>,
}

#[derive(serde::Deserialize)]
struct Frame {
    #[serde(flatten)]
    lens: GivenLens,
    file_path: String,
    mask_path: Option<String>,
    transform_matrix: Vec<[f64; 4]>,
    time: Option<f64>,
}

/// One image.
struct Entry {
    camera: Camera,
    distortion: Distortion,
    name: PathBuf,
    shot: Shot,
    time: Option<f64>,
}

pub(super) fn read(path: &Path, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let (train, test) = (path.join("transforms_train.json"), path.join("transforms_test.json"));
    let split = train.is_file();
    let calibration = if split { train } else { path.join("transforms.json") };
    let mut builder = CaptureBuilder {
        fps: settings.fps,
        n_frames: 1,
        calibration: calibration.clone(),
        ..CaptureBuilder::default()
    };
    let mut entries = read_file(path, &calibration, settings, &mut builder.notes, faults);
    let mut has_test = entries.iter().any(|entry| entry.camera.is_test);
    if split && test.is_file() {
        let tests = read_file(path, &test, settings, &mut builder.notes, faults);
        has_test = true;
        entries.extend(tests.into_iter().map(|mut entry| {
            entry.camera.is_test = true;
            entry
        }));
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    let mut images = HashSet::new();
    for entry in entries.iter().filter(|entry| !images.insert(&entry.shot.image)) {
        faults.add(&calibration, format!("`{}`", entry.name.display()), "is listed twice", REMEDY);
    }
    if !has_test && settings.test_every > 0 {
        entries.iter_mut().step_by(settings.test_every).for_each(|entry| entry.camera.is_test = true);
    }
    match frames_of(&entries) {
        Ok((frames, n_frames)) => {
            entries.iter_mut().zip(frames).for_each(|(entry, frame)| entry.shot.frame = frame);
            builder.n_frames = n_frames;
        }
        Err(reason) => faults.add(&calibration, "field `time`", reason, "give every frame a time on one grid, or none"),
    }
    group(entries, &mut builder);
    builder
}

fn read_file(
    path: &Path,
    file: &Path,
    settings: &CaptureSettings,
    notes: &mut Vec<String>,
    faults: &mut Faults,
) -> Vec<Entry> {
    let Some(document) = faults.take(parse(file)) else { return Vec::new() };
    if document.frames.is_empty() {
        faults.add(file, "field `frames`", "holds no frame", "add at least one");
    }
    if let Some(name) = &document.ply_file_path {
        notes.push(format!("the points of `{}` are not read", name.escape_debug()));
    }
    let mut places = Vec::new();
    for (index, frame) in document.frames.iter().enumerate() {
        let place = format!("frame {index}");
        match frame.paths(path) {
            Ok(paths) => places.push((place, frame, paths)),
            Err(reason) => faults.add(file, place, reason, REMEDY),
        }
    }
    // Where the file gives no size, its images share one.
    let size = || places.iter().find_map(|(_, _, paths)| read_size(&paths.image).ok());
    let size = if document.lens.w.is_some() && document.lens.h.is_some() { None } else { size() };
    let mut entries = Vec::new();
    for (place, frame, paths) in places {
        let lens = frame.lens.or(&document.lens, size);
        let pose = world_to_camera(&frame.transform_matrix);
        match lens.resolved().and_then(|lens| Ok((lens, pose?))) {
            Ok((lens, pose)) => {
                let tested = document.test_filenames.as_ref().is_some_and(|names| names.contains(&frame.file_path));
                entries.push(frame.entry(lens, pose, paths, tested));
            }
            // Without any image the size is unknown; that they are missing says it better.
            Err(Unfit { needs_size: true, .. }) if size.is_none() => {
                if !settings.skip_missing {
                    let missing = read_size(&paths.image).err();
                    missing.into_iter().for_each(|fault| faults.push(fault));
                }
            }
            Err(Unfit { reason, remedy, .. }) => faults.add(file, place, reason, remedy),
        }
    }
    entries
}

fn parse(file: &Path) -> error::Result<Document> {
    serde_json::from_slice(&read_bytes(file)?).map_err(|fault| {
        let place = format!("line {}, column {}", fault.line(), fault.column());
        Error::data(file, place, format!("is no transforms.json: {fault}"), REMEDY)
    })
}

/// Where a frame's files are.
struct Paths {
    name: PathBuf,
    image: PathBuf,
    mask: Option<PathBuf>,
}

impl Frame {
    fn paths(&self, folder: &Path) -> Result<Paths, String> {
        let name = relative(&self.file_path)?;
        let image = folder.join(&name);
        let image = if is_image(&image) { image } else { with_image_extension(&image) };
        let mask = self.mask_path.as_deref().map(relative).transpose()?.map(|mask| folder.join(mask));
        Ok(Paths { name, image, mask })
    }

    fn entry(&self, lens: Lens, world_to_camera: Pose, paths: Paths, is_test: bool) -> Entry {
        let Lens { intrinsics, distortion } = lens;
        let Paths { name, image, mask } = paths;
        let camera =
            Camera { name: flat(&name), intrinsics, world_to_camera, is_test, is_photo: false, shots: Vec::new() };
        Entry { camera, distortion, name, shot: Shot { image, mask, ..Shot::default() }, time: self.time }
    }
}

/// Why a frame has no camera.
struct Unfit {
    reason: String,
    remedy: &'static str,
    needs_size: bool,
}

fn unfit(reason: String) -> Unfit {
    Unfit { reason, remedy: REMEDY, needs_size: false }
}

impl GivenLens {
    /// What stands here, else in `file`, else what follows from the size of the images.
    fn or(&self, file: &GivenLens, size: Option<(u32, u32)>) -> GivenLens {
        let (w, h) = size.unzip();
        GivenLens {
            camera_model: self.camera_model.clone().or_else(|| file.camera_model.clone()),
            w: self.w.or(file.w).or(w.map(f64::from)),
            h: self.h.or(file.h).or(h.map(f64::from)),
            fl_x: self.fl_x.or(file.fl_x),
            fl_y: self.fl_y.or(file.fl_y),
            cx: self.cx.or(file.cx),
            cy: self.cy.or(file.cy),
            camera_angle_x: self.camera_angle_x.or(file.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(file.camera_angle_y),
            k1: self.k1.or(file.k1),
            k2: self.k2.or(file.k2),
            k3: self.k3.or(file.k3),
            k4: self.k4.or(file.k4),
            p1: self.p1.or(file.p1),
            p2: self.p2.or(file.p2),
            is_fisheye: self.is_fisheye.or(file.is_fisheye),
        }
    }

    /// The numbers without gaps.
    fn resolved(&self) -> Result<Lens, Unfit> {
        let [k1, k2, k3, k4, p1, p2] =
            [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].map(Option::unwrap_or_default);
        let usual = if self.is_fisheye == Some(true) { "OPENCV_FISHEYE" } else { "OPENCV" };
        let distortion = match self.camera_model.as_deref().unwrap_or(usual) {
            "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" if k4 == 0.0 => {
                Distortion::brown([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2])
            }
            "OPENCV_FISHEYE" => Distortion::Fisheye([k1, k2, k3, k4]),
            "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" => Distortion::Fisheye([k1, k2, 0.0, 0.0]),
            model => {
                let reason =
                    format!("has the model {} with k4 = {k4}, which is not undistorted here", model.escape_debug());
                return Err(unfit(reason));
            }
        };
        let (Some(w), Some(h)) = (self.w, self.h) else {
            return Err(Unfit { needs_size: true, ..unfit("gives no w and h".to_owned()) });
        };
        let is_side = |side: f64| side.fract() == 0.0 && (1.0..=f64::from(MAX_SIDE)).contains(&side);
        if !(is_side(w) && is_side(h)) {
            return Err(unfit(format!("has {w} x {h} pixels, whole numbers of 1 to {MAX_SIDE} are allowed")));
        }
        let by_angle = |side: f64, angle: f64| side / (2.0 * (angle / 2.0).tan());
        let Some(fx) = self.fl_x.or_else(|| Some(by_angle(w, self.camera_angle_x?))) else {
            return Err(unfit("gives neither fl_x nor camera_angle_x".to_owned()));
        };
        let fy = self.fl_y.or_else(|| Some(by_angle(h, self.camera_angle_y?))).unwrap_or(fx);
        let (cx, cy) = (self.cx.unwrap_or(w / 2.0), self.cy.unwrap_or(h / 2.0));
        let intrinsics = Intrinsics { width: w as u32, height: h as u32, fx, fy, cx, cy };
        Ok(Lens { intrinsics, distortion })
    }
}

/// Inverts a rotation and translation after turning y and z around.
fn world_to_camera(rows: &[[f64; 4]]) -> Result<Pose, Unfit> {
    if !(rows.len() == 3 || rows.len() == 4 && rows[3] == [0.0, 0.0, 0.0, 1.0]) {
        let reason = "has a transform_matrix that is not 3 or 4 rows of 4 with [0, 0, 0, 1] at the end";
        return Err(unfit(reason.to_owned()));
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
    let rotation = DMat3::from_cols(column(0), -column(1), -column(2)).transpose();
    Ok(Pose::at(column(3), rotation))
}

/// Each image's frame and the number of frames. The times must lie on a grid whose step is their greatest common
/// divisor; the first is frame 0, whatever the unit.
fn frames_of(entries: &[Entry]) -> Result<(Vec<u32>, u32), String> {
    let times: Vec<f64> = entries.iter().filter_map(|entry| entry.time).collect();
    if times.is_empty() {
        return Ok((vec![0; entries.len()], 1));
    }
    if times.len() != entries.len() {
        return Err(format!("{} of {} frames have one", times.len(), entries.len()));
    }
    if let Some(time) = times.iter().find(|time| !time.is_finite()) {
        return Err(format!("is {time}"));
    }
    let mut sorted = times.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, span) = (sorted[0], sorted[sorted.len() - 1] - sorted[0]);
    let tolerance = TIME_TOLERANCE * span.max(f64::MIN_POSITIVE);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > tolerance);
    let smallest_gap = gaps.clone().fold(f64::INFINITY, f64::min);
    // Rounded times leave remainders that a smaller step would only follow, hence the bound.
    let step = gaps.fold(0.0_f64, |step, gap| {
        let (mut a, mut b) = (step.max(gap), step.min(gap));
        let smallest = GRID_TOLERANCE * if b > 0.0 { b } else { a };
        while b > smallest {
            (a, b) = (b, (a % b).min(b - a % b));
        }
        a
    });
    if step == 0.0 {
        return Ok((vec![0; entries.len()], 1));
    }
    let n_frames = (span / step).round() + 1.0;
    let grid = times.iter().map(|time| (time - first) / step);
    let too_fine = step * MAX_DIVISION < smallest_gap || n_frames > f64::from(MAX_FRAMES);
    if too_fine || grid.clone().any(|f| (f - f.round()).abs() > GRID_TOLERANCE) {
        return Err(format!("the {} times lie on no common grid of frames", times.len()));
    }
    Ok((grid.map(|f| f.round() as u32).collect(), n_frames as u32))
}

/// Images of one place, lens and part at different frames are one camera.
fn group(entries: Vec<Entry>, builder: &mut CaptureBuilder) {
    let cameras = &mut builder.cameras;
    let mut known: HashMap<(Vec<u64>, bool), usize> = HashMap::new();
    for Entry { camera, distortion, shot, .. } in entries {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
        let (pose, lens) = (camera.world_to_camera.rows(), [fx, fy, cx, cy, width.into(), height.into()]);
        let numbers = pose.as_flattened().iter().chain(&lens);
        let key = (numbers.map(|v| v.to_bits()).collect(), camera.is_test);
        let at = known.get(&key).copied();
        match at.filter(|&at| cameras[at].shots.iter().all(|other| other.frame != shot.frame)) {
            Some(at) => cameras[at].shots.push(shot),
            None => {
                known.insert(key, cameras.len());
                builder.distorted.insert(camera.name.clone(), distortion);
                cameras.push(Camera { shots: vec![shot], ..camera });
            }
        }
    }
}
