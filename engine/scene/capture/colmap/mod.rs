//! COLMAP's sparse model, and a plain COLMAP project as a static capture.

mod bin;
mod raw;
mod text;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use self::raw::{DAMAGED, RawCamera, RawImage, RawPoint};
use crate::scene::capture::builder::CaptureBuilder;
use crate::scene::capture::camera::{Camera, MAX_COORDINATE, Point, Shot};
use crate::scene::capture::decoder::MAX_SIDE;
use crate::scene::capture::names::{flat, relative};
use crate::scene::capture::report::Faults;
use crate::scene::capture::settings::CaptureSettings;
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose};
use glam::{DVec3, DVec4};

/// Largest deviation of a quaternion's length from 1; COLMAP writes all digits.
const QUATERNION_TOLERANCE: f64 = 1e-3;

/// An image of the model: where it is, and what took it.
pub(crate) struct Posed {
    /// Relative, without `..`.
    pub name: PathBuf,
    pub camera_id: u32,
    pub pose: Pose,
    pub lens: Lens,
}

/// A sparse model.
#[derive(Default)]
pub(crate) struct Model {
    pub images: Vec<Posed>,
    pub points: Vec<Point>,
    /// The file of the images.
    pub file: PathBuf,
}

/// The folder of a COLMAP model in a project: `sparse/0`, `sparse` or the project itself.
pub(crate) fn model_folder(path: &Path) -> Option<PathBuf> {
    let folders = [path.join("sparse/0"), path.join("sparse"), path.to_owned()];
    folders.into_iter().find(|folder| ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file()))
}

/// Reads a model; `points3D` may be absent. What is faulty is left out.
pub(super) fn read_model(folder: &Path, faults: &mut Faults) -> Model {
    read(folder, true, faults)
}

/// Reads a model without its points.
pub(crate) fn read_images(folder: &Path, faults: &mut Faults) -> Model {
    read(folder, false, faults)
}

fn read(folder: &Path, with_points: bool, faults: &mut Faults) -> Model {
    let binary = folder.join("cameras.bin").is_file();
    let file = |stem: &str| folder.join(format!("{stem}.{}", if binary { "bin" } else { "txt" }));
    let (cameras, images, points) = (file("cameras"), file("images"), file("points3D"));
    let raw = if binary { bin::cameras(&cameras, faults) } else { text::cameras(&cameras, faults) };
    let known = check_cameras(&cameras, raw, faults);
    let raw = if binary { bin::images(&images, faults) } else { text::images(&images, faults) };
    let ids: HashSet<u32> = raw.iter().map(|image| image.id).collect();
    let mut model = Model { images: check_images(&images, raw, &known, faults), points: Vec::new(), file: images };
    if with_points && points.is_file() {
        let mut checked = CheckedPoints::new(&points, &ids);
        if binary {
            bin::points(&points, faults, |point, faults| checked.add(point, faults));
        } else {
            text::points(&points, faults, |point, faults| checked.add(point, faults));
        }
        model.points = checked.points;
    }
    model
}

/// The cameras by id; `None` for one that is known and faulty.
fn check_cameras(file: &Path, raw: Vec<RawCamera>, faults: &mut Faults) -> HashMap<u32, Option<Lens>> {
    let mut known = HashMap::new();
    for camera in raw {
        let place = format!("{}, camera {}", camera.place, camera.id);
        if known.contains_key(&camera.id) {
            faults.add(file, place, "has the id of an earlier camera", DAMAGED);
            continue;
        }
        let lens = match camera.lens() {
            Ok(lens) => Some(lens),
            Err((reason, remedy)) => {
                faults.add(file, place, reason, remedy);
                None
            }
        };
        known.insert(camera.id, lens);
    }
    known
}

impl RawCamera {
    fn lens(&self) -> Result<Lens, (String, &'static str)> {
        let side = |side: u64| u32::try_from(side).ok().filter(|side| (1..=MAX_SIDE).contains(side));
        let (Some(width), Some(height)) = (side(self.width), side(self.height)) else {
            let reason = format!("has {} x {} pixels, 1 to {MAX_SIDE} each is allowed", self.width, self.height);
            return Err((reason, "give the size of the images"));
        };
        let brown =
            |k1, k2, k3, rest: [f64; 3], p: [f64; 2]| Distortion::brown([k1, k2, k3, rest[0], rest[1], rest[2]], p);
        let (none, zeros) = (Distortion::None, [0.0; 3]);
        let (fx, fy, cx, cy, distortion) = match (self.kind.name, self.params.as_slice()) {
            ("SIMPLE_PINHOLE", &[f, cx, cy]) => (f, f, cx, cy, none),
            ("PINHOLE", &[fx, fy, cx, cy]) => (fx, fy, cx, cy, none),
            ("SIMPLE_RADIAL", &[f, cx, cy, k]) => (f, f, cx, cy, brown(k, 0.0, 0.0, zeros, [0.0; 2])),
            ("RADIAL", &[f, cx, cy, k1, k2]) => (f, f, cx, cy, brown(k1, k2, 0.0, zeros, [0.0; 2])),
            ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => (fx, fy, cx, cy, brown(k1, k2, 0.0, zeros, [p1, p2])),
            ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, ref rest @ ..]) => {
                let rest = std::array::from_fn(|k| rest.get(k).copied().unwrap_or(0.0));
                (fx, fy, cx, cy, brown(k1, k2, k3, rest, [p1, p2]))
            }
            ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
                (fx, fy, cx, cy, Distortion::Fisheye([k1, k2, k3, k4]))
            }
            ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => (f, f, cx, cy, Distortion::Fisheye([k, 0.0, 0.0, 0.0])),
            ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => (f, f, cx, cy, Distortion::Fisheye([k1, k2, 0.0, 0.0])),
            (name, _) => {
                let remedy = "undistort the images with `colmap image_undistorter`";
                return Err((format!("has the model {name}, which is not undistorted here"), remedy));
            }
        };
        let lens = Lens { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, distortion };
        lens.fault().map_or(Ok(lens), |reason| Err((reason, DAMAGED)))
    }
}

fn check_images(
    file: &Path,
    raw: Vec<RawImage>,
    known: &HashMap<u32, Option<Lens>>,
    faults: &mut Faults,
) -> Vec<Posed> {
    let (mut ids, mut names) = (HashSet::new(), HashSet::new());
    let mut images = Vec::new();
    for image in raw {
        let place = format!("{}, image {}", image.place, image.id);
        let mut fault = |reason: String| faults.add(file, &place, reason, DAMAGED);
        if !ids.insert(image.id) {
            fault("has the id of an earlier image".to_owned());
            continue;
        }
        let (name, pose) = (relative(&image.name), image.pose());
        for reason in [name.as_ref().err(), pose.as_ref().err()].into_iter().flatten() {
            fault(reason.clone());
        }
        let lens = known.get(&image.camera_id);
        if lens.is_none() {
            fault(format!("was taken by camera {}, which is not in the list of cameras", image.camera_id));
        }
        let (Ok(name), Ok(pose), Some(Some(lens))) = (name, pose, lens) else { continue };
        if names.insert(name.clone()) {
            images.push(Posed { name, camera_id: image.camera_id, pose, lens: *lens });
        } else {
            fault(format!("has the name of an earlier image, `{}`", name.display()));
        }
    }
    images
}

impl RawImage {
    fn pose(&self) -> Result<Pose, String> {
        let (length, translation) = (DVec4::from(self.quaternion).length(), DVec3::from(self.translation));
        // Written positively, so that NaN fails.
        let is_near = translation.abs().cmple(DVec3::splat(MAX_COORDINATE)).all();
        if !(length.is_finite() && is_near) {
            let reason = format!("has the pose {:?}, {:?}", self.quaternion, self.translation);
            return Err(reason + ": a number is not finite or too large");
        }
        if (length - 1.0).abs() > QUATERNION_TOLERANCE {
            return Err(format!("has a quaternion of length {length}, not 1"));
        }
        Ok(Pose::of_quaternion(self.quaternion, translation))
    }
}

/// Points as they come; a file of them can be far larger than what is kept.
struct CheckedPoints<'a> {
    file: &'a Path,
    images: &'a HashSet<u32>,
    ids: HashSet<u64>,
    points: Vec<Point>,
}

impl<'a> CheckedPoints<'a> {
    fn new(file: &'a Path, images: &'a HashSet<u32>) -> Self {
        CheckedPoints { file, images, ids: HashSet::new(), points: Vec::new() }
    }

    fn add(&mut self, point: RawPoint, faults: &mut Faults) {
        let place = || format!("{}, point {}", point.place, point.id);
        if !self.ids.insert(point.id) {
            return faults.add(self.file, place(), "has the id of an earlier point", DAMAGED);
        }
        if !point.position.iter().all(|v| v.is_finite() && v.abs() <= MAX_COORDINATE) {
            let reason = format!("is at {:?}, not finite or beyond {MAX_COORDINATE}", point.position);
            return faults.add(self.file, place(), reason, DAMAGED);
        }
        if let Some(id) = point.seen_in.iter().find(|id| !self.images.contains(id)) {
            return faults.add(self.file, place(), format!("was seen in image {id}, which does not exist"), DAMAGED);
        }
        self.points.push(Point { position: point.position, color: point.color });
    }
}

/// The points of a binary model that COLMAP wrote, each with the names of the images that saw it.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) with the first fault.
pub(crate) fn tracks(folder: &Path) -> crate::Result<Vec<(Point, Vec<PathBuf>)>> {
    let mut faults = Faults::default();
    let raw = bin::images(&folder.join("images.bin"), &mut faults);
    let names: HashMap<u32, PathBuf> = raw.into_iter().map(|image| (image.id, PathBuf::from(image.name))).collect();
    let ids = names.keys().copied().collect();
    let mut tracks = Vec::new();
    let file = folder.join("points3D.bin");
    let mut checked = CheckedPoints::new(&file, &ids);
    bin::points(&file, &mut faults, |point, faults| {
        let seen_in = point.seen_in.clone();
        let n_before = checked.points.len();
        checked.add(point, faults);
        if checked.points.len() > n_before {
            let mut seen_in: Vec<PathBuf> = seen_in.iter().filter_map(|id| names.get(id).cloned()).collect();
            seen_in.sort_unstable();
            seen_in.dedup();
            tracks.push(seen_in);
        }
    });
    match faults.first() {
        Some(error) => Err(error),
        None => Ok(checked.points.into_iter().zip(tracks).collect()),
    }
}

/// The folder of a plain COLMAP project's images: the one that is asked for, or where it is absent the largest of its smaller
/// copies.
pub(crate) fn images_folder(path: &Path, settings: &CaptureSettings) -> PathBuf {
    let images = path.join(&settings.images);
    let smaller = |n: u32| {
        let mut name = images.clone().into_os_string();
        name.push(format!("_{n}"));
        PathBuf::from(name)
    };
    match settings.downscale {
        Some(1) => images,
        Some(n) => smaller(n),
        None if images.is_dir() => images,
        None => [2, 4, 8].map(smaller).into_iter().find(|folder| folder.is_dir()).unwrap_or(images),
    }
}

/// A plain COLMAP project as a clip of one frame, every image a camera of its own.
pub(super) fn read_capture(path: &Path, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let mut model = model_folder(path).map_or_else(Model::default, |folder| read_model(&folder, faults));
    if model.images.is_empty() && faults.n() == 0 {
        faults.add(&model.file, "", "holds no image", "run COLMAP's mapper, or export the model again");
    }
    model.images.sort_by(|a, b| a.name.cmp(&b.name));
    let images = images_folder(path, settings);
    let camera = |(index, posed): (usize, &Posed)| Camera {
        is_test: settings.test_every > 0 && index.is_multiple_of(settings.test_every),
        ..posed.camera(flat(&posed.name), &images.join(&posed.name))
    };
    let mut builder = CaptureBuilder {
        fps: settings.fps,
        n_frames: 1,
        cameras: model.images.iter().enumerate().map(camera).collect(),
        points: model.points,
        calibration: model.file,
        ..CaptureBuilder::default()
    };
    let asked = path.join(&settings.images);
    if let Some(n) = settings.downscale.filter(|_| !images.is_dir()) {
        let remedy = format!("make it with pictures of 1/{n} of the size, or choose another --downscale");
        faults.add(&images, "", "is missing", remedy);
        builder.cameras.clear();
    } else if settings.downscale.is_none() && images != asked {
        let [taken, asked] =
            [&images, &asked].map(|path| path.strip_prefix(path.parent().unwrap_or(path)).unwrap_or(path));
        builder.notes.push(format!("there is no folder {}: {} is taken", asked.display(), taken.display()));
    }
    for (camera, posed) in builder.cameras.iter().zip(&model.images) {
        builder.distorted.insert(camera.name.clone(), posed.lens.distortion);
    }
    builder
}

impl Posed {
    /// The camera of one image, at frame 0.
    fn camera(&self, name: String, image: &Path) -> Camera {
        let shot = Shot { frame: 0, image: image.to_owned(), ..Shot::default() };
        let intrinsics = self.lens.intrinsics;
        Camera { name, intrinsics, world_to_camera: self.pose, is_test: false, is_photo: false, shots: vec![shot] }
    }
}
