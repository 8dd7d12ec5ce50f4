//! The project's own capture folder (SPEC 8).

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::{
    Camera, CaptureBuilder, CaptureSettings, Faults, FramePoints, Frames, MAX_FRAMES, Named, Posed, Shot, camera_place,
    check_names, read_model, read_true_offsets, with_image_extension,
};
use crate::error::{self, Error};
use crate::files::{cannot_read, read_text, write_atomic};
use crate::scene::Pose;
use crate::scene::prior::{DEPTH_EXTENSIONS, FLOW_EXTENSIONS};
use crate::scene::undistort::Lens;

const FILE: &str = "capture.toml";
pub(crate) const PHOTOS: &str = "photos";
/// The first file that `ivv prepare` writes into a capture folder; the manifest is the last.
pub(crate) const JOURNAL: &str = "prepare.json";
/// Missing images of a camera that are listed at most, whatever number a file gives.
const MAX_MISSING: u32 = 1000;

#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    pub fps: f64,
    /// Frames of the clip. Every camera has an image of each that is not in [`Manifest::absent`].
    pub frames: u32,
    /// The frame of the static points (SPEC 5).
    #[serde(default)]
    pub reference_frame: u32,
    #[serde(default)]
    pub test_cameras: Vec<String>,
    /// `masks/<camera>/<frame:05>.png` exist, for all frames of every camera that has such a folder.
    #[serde(default)]
    pub masks: bool,
    /// `foreground/`, likewise: moving things are bright.
    #[serde(default)]
    pub foreground: bool,
    /// `covisible/` of test cameras, likewise: what training cameras see too is bright.
    #[serde(default)]
    pub covisible: bool,
    /// `points/<frame:05>.ply` exist.
    #[serde(default)]
    pub points: bool,
    #[serde(default)]
    pub flow: bool,
    #[serde(default)]
    pub depth: bool,
    #[serde(default)]
    pub audio: bool,
    /// `photos/` is a capture folder of one frame in the same world: the static scene at another time.
    #[serde(default)]
    pub photos: bool,
    /// By camera, the frames of which it has no image.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub absent: BTreeMap<String, BTreeSet<u32>>,
}

impl Manifest {
    pub fn read(capture: &Path) -> error::Result<Manifest> {
        let path = capture.join(FILE);
        let text = read_text(&path).map_err(|fault| match fault.kind() {
            ErrorKind::InvalidData => Error::data(&path, "", "is not UTF-8", "write it as TOML"),
            _ => cannot_read(&path, &fault),
        })?;
        toml::from_str(&text).map_err(|fault| {
            let start = fault.span().map_or(0, |span| span.start);
            let line = text.as_bytes().iter().take(start).filter(|byte| **byte == b'\n').count() + 1;
            let remedy = "give fps, frames and, where they apply, reference_frame, test_cameras, masks, foreground, \
                          covisible, points, flow, depth, audio, photos and absent";
            Error::data(&path, format!("line {line}"), fault.message().to_owned(), remedy)
        })
    }

    pub fn write(&self, capture: &Path) -> error::Result<()> {
        let text = toml::to_string(self).map_err(std::io::Error::other);
        write_atomic(&capture.join(FILE), |to| to.write_all(text?.as_bytes()))
    }
}

/// True if `ivv prepare` began the capture in this folder and has not finished it.
pub(crate) fn is_unfinished(path: &Path) -> bool {
    path.join(JOURNAL).is_file() && !path.join(FILE).exists()
}

pub(super) fn unfinished(named: &Named, _: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let remedy = "run the same `ivv prepare` command again to continue it";
    faults.add(&named.folder, "", "is a capture that `ivv prepare` has not finished", remedy);
    CaptureBuilder::default()
}

pub(super) fn read(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let manifest = faults.take(Manifest::read(path));
    let model = read_model(&path.join("sparse/0"), faults);
    let Some(manifest) = manifest else { return CaptureBuilder::default() };
    // The builder refuses a longer clip, whose missing frames need no fault each.
    let n_frames = if manifest.frames <= MAX_FRAMES { settings.frames.end(manifest.frames) } else { 0 };
    let mut builder = CaptureBuilder {
        fps: manifest.fps,
        n_frames: manifest.frames,
        reference_frame: manifest.reference_frame,
        points: model.points,
        notes: model.notes,
        n_sounds: if manifest.audio { n_files(&path.join("audio")) as usize } else { 0 },
        calibration: path.join(FILE),
        ..CaptureBuilder::default()
    };
    let ids = model.images.iter().filter_map(|posed| Some((posed.camera_id, camera_name(&posed.name)?))).collect();
    let mut reader = FolderReader { path, model: &model.file, n_frames, builder: &mut builder, faults };
    reader.cameras(model.images, &manifest.absent);
    reader.check_folders(&manifest);
    reader.find_masks(&manifest);
    if manifest.flow {
        reader.find_priors("flow", FLOW_EXTENSIONS, |shot| &mut shot.flow);
    }
    if manifest.depth {
        reader.find_priors("depth", DEPTH_EXTENSIONS, |shot| &mut shot.depth);
    }
    if manifest.points {
        reader.find_points(ids, settings.frames);
    }
    let names: Vec<&str> = builder.cameras.iter().map(|camera| camera.name.as_str()).collect();
    check_names("test cameras", &manifest.test_cameras, &names, &builder.calibration, faults);
    check_names("absent", manifest.absent.keys(), &names, &builder.calibration, faults);
    builder.true_offsets = read_true_offsets(path, &names, faults);
    if manifest.photos {
        builder.photos = photos(&path.join(PHOTOS), faults).map(Box::new);
    }
    for camera in &mut builder.cameras {
        camera.is_test = manifest.test_cameras.contains(&camera.name);
    }
    builder
}

fn photos(folder: &Path, faults: &mut Faults) -> Option<CaptureBuilder> {
    // Photographs have no photographs: a folder that held itself would have no end.
    let manifest = faults.take(Manifest::read(folder))?;
    if manifest.frames != 1 || manifest.photos {
        let found =
            if manifest.photos { "has photos itself".to_owned() } else { format!("has {} frames", manifest.frames) };
        let remedy = "make it with `ivv prepare PHOTOS`, or give it to `ivv prepare --static`";
        faults.add(&folder.join(FILE), "", format!("{found}; photographs are a capture of one frame"), remedy);
        return None;
    }
    let named = Named { folder: folder.to_owned(), ..Named::default() };
    let mut builder = read(&named, &CaptureSettings::default(), faults);
    builder.cameras.iter_mut().for_each(|camera| (camera.is_photo, camera.is_test) = (true, false));
    Some(builder)
}

/// The camera of an image named `<camera>.<ext>` or `<camera>/<frame>.<ext>`.
fn camera_name(image: &Path) -> Option<String> {
    let parts: Vec<_> = image.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    match parts.as_slice() {
        [_] => Some(image.with_extension("").to_string_lossy().into_owned()),
        [camera, _] => Some(camera.clone()),
        _ => None,
    }
}

fn n_files(folder: &Path) -> u32 {
    std::fs::read_dir(folder).map_or(0, |files| u32::try_from(files.count()).unwrap_or(u32::MAX))
}

struct FolderReader<'a> {
    path: &'a Path,
    /// The file of the model's images.
    model: &'a Path,
    /// Up to the last that is used.
    n_frames: u32,
    builder: &'a mut CaptureBuilder,
    faults: &'a mut Faults,
}

impl FolderReader<'_> {
    /// The cameras of the model's images: `<camera>.<ext>`, or `<camera>/<frame>.<ext>` of a camera that moves.
    fn cameras(&mut self, images: Vec<Posed>, absent: &BTreeMap<String, BTreeSet<u32>>) {
        let mut by_name: BTreeMap<String, Vec<Posed>> = BTreeMap::new();
        for posed in images {
            let Some(name) = camera_name(&posed.name) else {
                let (place, remedy) = (posed.name.display(), "name images <camera>.<ext> or <camera>/<frame>.<ext>");
                self.faults.add(self.model, format!("image `{place}`"), "is nested too deep", remedy);
                continue;
            };
            by_name.entry(name).or_default().push(posed);
        }
        for (name, posed) in by_name {
            let Some((Lens { intrinsics, distortion }, moving)) = self.check_poses(&name, &posed) else { continue };
            let folder = self.path.join("images").join(&name);
            let n_files = n_files(&folder);
            let absent = absent.get(&name);
            let n_absent = absent.map_or(0, BTreeSet::len) as u32;
            let n_listed = self.n_frames.min(n_files.saturating_add(n_absent).saturating_add(MAX_MISSING));
            if n_listed < self.n_frames {
                let reason = format!("has {n_files} files, the clip has {} frames", self.n_frames);
                self.faults.add(&folder, "", reason, format!("add the images, or correct `frames` in {FILE}"));
            }
            let there = (0..n_listed).filter(|frame| absent.is_none_or(|absent| !absent.contains(frame)));
            let shot = |frame: u32| Shot {
                frame,
                image: with_image_extension(&folder.join(format!("{frame:05}"))),
                world_to_camera: moving.get(&frame).copied(),
                ..Shot::default()
            };
            let (shots, world_to_camera) = (there.map(shot).collect(), posed[0].pose);
            self.builder.distorted.insert(name.clone(), distortion);
            self.builder.cameras.push(Camera { name, intrinsics, world_to_camera, shots, ..Camera::default() });
        }
        if self.builder.cameras.is_empty() && self.faults.n() == 0 {
            let remedy = "write one for each camera, named <camera>/<frame>.png";
            self.faults.add(self.model, "", "holds no image", remedy);
        }
    }

    /// A camera's lens, and the poses of a moving camera by frame.
    fn check_poses(&mut self, name: &str, posed: &[Posed]) -> Option<(Lens, BTreeMap<u32, Pose>)> {
        let place = camera_place(name);
        let mut fault = |reason: String, remedy: &str| self.faults.add(self.model, &place, reason, remedy);
        let lens = posed.first()?.lens;
        if posed.iter().any(|posed| posed.lens != lens) {
            fault("changes its intrinsics".to_owned(), "make it a camera for each of them");
            return None;
        }
        let mut poses = BTreeMap::new();
        if posed.len() == 1 {
            return Some((lens, poses));
        }
        for posed in posed {
            match posed.name.file_stem().and_then(|stem| stem.to_str()?.parse().ok()) {
                Some(frame) if frame < self.n_frames => {
                    if poses.insert(frame, posed.pose).is_some() {
                        fault(format!("has two poses at frame {frame}"), "keep one");
                    }
                }
                // A frame behind the last that is used.
                Some(_) => {}
                None => {
                    let reason = format!("has several images and one named `{}`", posed.name.display());
                    fault(reason, "name the images of a moving camera <camera>/<frame>.<ext>");
                }
            }
        }
        let mut absent = (0..self.n_frames).filter(|frame| !poses.contains_key(frame));
        let n = absent.clone().count();
        if let Some(first) = absent.next() {
            let reason = format!("moves and has no pose at {n} frames, the first is {first}");
            fault(reason, "add the poses, or keep one image of a camera that stands still");
        }
        Some((lens, poses))
    }

    fn check_folders(&mut self, manifest: &Manifest) {
        for (name, declared) in [
            ("masks", manifest.masks),
            ("foreground", manifest.foreground),
            ("covisible", manifest.covisible),
            ("points", manifest.points),
            ("flow", manifest.flow),
            ("depth", manifest.depth),
            ("audio", manifest.audio),
            (PHOTOS, manifest.photos),
        ] {
            let exists = self.path.join(name).is_dir();
            if declared && !exists {
                let remedy = format!("add the folder or set {name} = false in {FILE}");
                self.faults.add(&self.path.join(name), "", "is missing", remedy);
            } else if exists && !declared {
                self.builder.notes.push(format!("{name}/ is not used: {FILE} does not declare it"));
            }
        }
    }

    fn find_masks(&mut self, manifest: &Manifest) {
        for camera in &mut self.builder.cameras {
            // A camera that has a folder of masks has one for every frame.
            let folder = |name: &str, declared: bool| {
                Some(self.path.join(name).join(&camera.name)).filter(|folder| declared && folder.is_dir())
            };
            let masks = folder("masks", manifest.masks);
            let foreground = folder("foreground", manifest.foreground);
            let covisible = folder("covisible", manifest.covisible);
            for shot in &mut camera.shots {
                let file = |folder: &Option<PathBuf>| Some(folder.as_ref()?.join(format!("{:05}.png", shot.frame)));
                (shot.mask, shot.foreground, shot.covisible) = (file(&masks), file(&foreground), file(&covisible));
            }
        }
    }

    /// Finds the priors `<folder>/<camera>/<frame:05>.<extension>`. A camera may have no folder, and a folder may lack frames.
    fn find_priors(&mut self, folder: &str, extensions: [&str; 4], of: fn(&mut Shot) -> &mut Option<PathBuf>) {
        let priors = self.path.join(folder);
        if !priors.is_dir() {
            return;
        }
        let mut n_folders = 0;
        for camera in &mut self.builder.cameras {
            let folder = priors.join(&camera.name);
            let Ok(files) = std::fs::read_dir(&folder) else { continue };
            n_folders += 1;
            let names: HashSet<OsString> = files.flatten().map(|file| file.file_name()).collect();
            let is_of = |name: &OsString, extension: &str| Path::new(name).extension().is_some_and(|e| e == extension);
            let present = |extension: &&str| names.iter().any(|name| is_of(name, extension));
            let present: Vec<&str> = extensions.into_iter().filter(present).collect();
            let &[extension] = present.as_slice() else {
                let (reason, remedy) = match present.as_slice() {
                    [] => ("holds no file of a known kind", format!("give one of {}", extensions.join(", "))),
                    several => ("holds files of several kinds", format!("keep one of {}", several.join(", "))),
                };
                self.faults.add(&folder, "", reason, remedy);
                continue;
            };
            let mut n_found = 0;
            for shot in &mut camera.shots {
                let name = format!("{:05}.{extension}", shot.frame);
                if names.contains(OsStr::new(&name)) {
                    *of(shot) = Some(folder.join(name));
                    n_found += 1;
                }
            }
            if n_found == 0 {
                let remedy = format!("name the files by their frames, 00000.{extension} the first");
                self.faults.add(&folder, "", "holds no file of any frame of the clip", remedy);
            }
        }
        if n_folders == 0 {
            let remedy = format!("give each camera a folder there, or remove the declaration from {FILE}");
            self.faults.add(&priors, "", "holds no folder of any camera", remedy);
        }
    }

    /// Finds the points of the frames. `ids` are the cameras by CAMERA_ID of the model.
    fn find_points(&mut self, ids: Vec<(u32, String)>, used: Frames) {
        let folder = self.path.join("points");
        if !folder.is_dir() {
            return;
        }
        let mut cameras = HashMap::new();
        for (id, name) in ids {
            let known = cameras.entry(id).or_insert_with(|| name.clone());
            if *known != name {
                let reason = format!("is that of `{}` and `{}`", known.escape_debug(), name.escape_debug());
                let remedy = "give each camera its own id, by which points/ tells who saw a point";
                self.faults.add(self.model, format!("camera {id}"), reason, remedy);
            }
        }
        let points = FramePoints { folder, cameras, frames: Frames::default() };
        // In a clip of millions of frames whose files are not there, the missing ones are counted without a search.
        let n_listed = self.n_frames.min(n_files(&points.folder).saturating_add(MAX_MISSING));
        let (there, absent): (Vec<u32>, Vec<u32>) = used.of(n_listed).partition(|frame| points.has(*frame));
        if let Some(first) = absent.first() {
            let reason = match used.of(self.n_frames).len() - there.len() - 1 {
                0 => "is missing".to_owned(),
                more => format!("is missing, as are those of {more} more frames"),
            };
            let remedy = format!("triangulate every frame, or set points = false in {FILE}");
            self.faults.add(&points.path(*first), "", reason, remedy);
        }
        for frame in there {
            self.faults.take(points.check(frame));
        }
        self.builder.frame_points = Some(points);
    }
}
