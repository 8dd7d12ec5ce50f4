//! Captures: what several cameras saw (SPEC 8), from the formats that others write and from the project's own folder.
//!
//! Opening a capture reads calibrations and the headers of images, never pixels; [`FrameCache`] streams those.

mod cache;
mod colmap;
mod colmap_bin;
mod colmap_text;
mod draft;
mod dynamic;
mod folder;
pub(super) mod header;
mod names;
mod npz;
pub(super) mod picture;
mod points;
mod priors;
mod report;
mod transforms;
mod truth;

pub use cache::{CacheStats, FrameCache};
pub use folder::Manifest;
pub(crate) use folder::{JOURNAL, is_unfinished};
pub use picture::Picture;
pub use points::FramePoint;
pub use priors::{PriorPlan, prior_word};
pub use report::{Fault, Report};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) use colmap::{Posed, images_folder, model_folder, read_images, tracks};
pub use draft::camera_center;
pub(crate) use draft::{Draft, RATES, check_names};
pub(crate) use header::{has_alpha, read_size};
pub(crate) use names::{is_image, relative};
pub(crate) use npz::read_npy;
pub(crate) use picture::{alpha_of, decode_image};
pub(crate) use points::FramePoints;
pub(crate) use report::Faults;
pub(crate) use truth::write_true_offsets;

use self::priors::PriorSource;
use crate::error::{Error, Result};
use crate::scene::{Similarity, View};

/// [`Extent::radius`] in the frame that training computes in: the geometric middle of SPEC 1's 1 to 10. Rates and limits
/// in scene units, as those of velocities and the near plane, mean the same in every capture.
pub const TRAINING_RADIUS: f64 = 3.0;

/// What the alpha channel of images is. Either way the background shows through where it is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alpha {
    /// No more than that.
    #[default]
    Background,
    /// The foreground mask too, of images that have no other: what is at least half opaque.
    Mask,
}

/// How a capture is read. The default suits every format.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    /// Names of the test cameras; `None` takes those that the format declares.
    pub test_cameras: Option<Vec<String>>,
    /// Plain COLMAP and `transforms.json` declare no test images: every n-th of the sorted names is one; 0 for none.
    pub test_every: usize,
    /// Colour behind images that have an alpha channel, and of the views; in [0, 1].
    pub background: [f32; 3],
    /// Uses only the first frames of the clip.
    pub max_frames: Option<u32>,
    /// Frames per second of a capture that does not say.
    pub fps: f64,
    /// Leaves out images whose file is absent, with a note, where each is a fault otherwise.
    pub skip_missing: bool,
    /// Takes the foreground masks of Dynamic3DGaussians (`seg/`) as masks too. Off: they label what moves, not what is
    /// valid, and a training that ignores what they leave out has no background.
    pub foreground_masks: bool,
    /// Folder of the images of a plain COLMAP project, relative to the capture. Where it is absent the largest of `images_2`,
    /// `images_4` and `images_8` is taken, with a note.
    pub images: PathBuf,
    /// Takes the folder of images of 1/N of the size, `images_N`, instead.
    pub downscale: Option<u32>,
    /// Scales a camera's intrinsics, along each axis, to the size of its images where it differs from the calibration.
    /// Otherwise they are scaled, with a note, when the images of all cameras differ by one common factor, within rounding;
    /// any other difference is a fault.
    pub rescale: bool,
    /// What the alpha channel of images is.
    pub alpha: Alpha,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        CaptureSettings {
            test_cameras: None,
            test_every: 8,
            background: [0.0; 3],
            max_frames: None,
            fps: 30.0,
            skip_missing: false,
            foreground_masks: false,
            images: PathBuf::from("images"),
            downscale: None,
            rescale: false,
            alpha: Alpha::default(),
        }
    }
}

/// The rows of a 4 x 4 matrix from world to camera (x right, y down, z forward).
pub type Pose = [[f64; 4]; 4];

/// One image of a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shot {
    /// Frame of the clip.
    pub frame: u32,
    /// PNG or JPEG.
    pub image: PathBuf,
    /// PNG of the camera's size; pixels of value 0 are to be ignored.
    pub mask: Option<PathBuf>,
    /// PNG of the camera's size; pixels of at least 128 show what moves. Only the first Gaussians are made from it. The image
    /// itself where its alpha channel is meant ([`Alpha::Mask`]).
    pub foreground: Option<PathBuf>,
    /// PNG of the camera's size, of a test camera; pixels of at least 128 show what a training camera sees too (co-visibility,
    /// Gao et al. 2022). Only scores are made from it.
    pub covisible: Option<PathBuf>,
    /// Optical flow to the next frame, for [`read_flow`](crate::scene::prior::read_flow).
    pub flow: Option<PathBuf>,
    /// Monocular depth, for [`read_depth`](crate::scene::prior::read_depth).
    pub depth: Option<PathBuf>,
    /// The pose at this frame when the camera moves.
    pub world_to_camera: Option<Pose>,
}

impl Shot {
    /// The image and what is of its size.
    pub fn pictures(&self) -> impl Iterator<Item = &PathBuf> {
        [Some(&self.image), self.mask.as_ref(), self.foreground.as_ref(), self.covisible.as_ref()].into_iter().flatten()
    }
}

/// A pinhole camera and its images.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Unique; fit as a file name.
    pub name: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Focal length in x, pixels.
    pub fx: f64,
    /// Focal length in y, pixels.
    pub fy: f64,
    /// Principal point in x, pixels; pixel (0, 0) has its centre at (0.5, 0.5).
    pub cx: f64,
    /// Principal point in y, pixels.
    pub cy: f64,
    /// The pose of every shot that has none of its own.
    pub world_to_camera: Pose,
    /// Kept for testing: no image of it is trained on.
    pub is_test: bool,
    /// By frame; a frame may be absent (every camera of a monocular clip has one).
    pub shots: Vec<Shot>,
}

impl Camera {
    /// The shot of a frame.
    pub fn shot(&self, frame: u32) -> Option<&Shot> {
        self.shots.binary_search_by_key(&frame, |shot| shot.frame).ok().map(|index| &self.shots[index])
    }

    /// The pose at a frame; of a moving camera without a shot there, that of its nearest earlier shot.
    pub fn pose(&self, frame: u32) -> &Pose {
        let index = self.shots.partition_point(|shot| shot.frame <= frame);
        let shot = index.checked_sub(1).and_then(|index| self.shots.get(index));
        shot.and_then(|shot| shot.world_to_camera.as_ref()).unwrap_or(&self.world_to_camera)
    }
}

/// A point of a sparse reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World, scene units.
    pub position: [f64; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Different images that saw it; 0 when the format does not say.
    pub n_views: u32,
}

/// Where the cameras are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Mean of the training cameras' centres, world.
    pub center: [f64; 3],
    /// 1.1 times the largest distance of a training camera from `center`, scene units (3DGS's scene extent). Where the points are
    /// more than three times as far from there in the median, it goes over to that median distance, which it is from four times
    /// on: around a small rig that looks outward the scene is as large as it is far. When the cameras coincide: that distance
    /// too, or 1 when there are no points.
    pub radius: f64,
}

/// A capture that has been read and has no fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// The folder.
    pub path: PathBuf,
    /// Frames per second.
    pub fps: f64,
    /// Frames of the clip; 1 for a static scene.
    pub n_frames: u32,
    /// The frame of the static points (SPEC 5).
    pub reference_frame: u32,
    /// Training and test cameras.
    pub cameras: Vec<Camera>,
    /// Sparse points; may be empty.
    pub points: Vec<Point>,
    /// Colour behind images that have an alpha channel, and of the views.
    pub background: [f32; 3],
    /// By camera, the frames by which its pictures show a later time than their number says, where `truth.json` of the folder
    /// knows (`time_offsets_frames`). Training is not told; what it learns is compared with them.
    pub true_offsets: BTreeMap<String, f64>,
    /// Views that the scene will be seen from beside those of its cameras, where somebody says so; training keeps clear what
    /// lies just before them. Empty unless set.
    pub viewpoints: Vec<View>,
    frame_points: Option<FramePoints>,
    /// How it was read.
    settings: CaptureSettings,
    /// From the world of the files to this one's.
    moved: Similarity,
}

impl Capture {
    /// Opens a capture with the default settings.
    ///
    /// # Errors
    /// As [`Capture::open_with`].
    pub fn open(path: &Path) -> Result<Capture> {
        Capture::open_with(path, &CaptureSettings::default())
    }

    /// Opens the folder of a capture; the format is recognised from its content (see [`check_capture`]).
    ///
    /// # Errors
    /// [`Error::Data`] with the first fault and the number of the others.
    pub fn open_with(path: &Path, settings: &CaptureSettings) -> Result<Capture> {
        let (capture, report) = read(path, settings);
        match report.first_error() {
            Some(error) => Err(error),
            None => Ok(capture),
        }
    }

    /// How it was read.
    pub fn settings(&self) -> &CaptureSettings {
        &self.settings
    }

    /// The view of a camera at a frame: time is `frame / n_frames`, `flow_dt` is `1 / n_frames`. The view is named after
    /// the camera, and the frame when there are several.
    ///
    /// # Errors
    /// [`Error::Data`] when there is no such camera or frame. The frame need not have an image.
    pub fn view(&self, camera: usize, frame: u32) -> Result<View> {
        let Some(seen_by) = self.cameras.get(camera).filter(|_| frame < self.n_frames) else {
            return Err(self.absent(camera, frame));
        };
        Ok(draft::view(seen_by, frame, self.n_frames, seen_by.pose(frame), self.background))
    }

    /// (camera, frame) of every image of the training cameras, by frame and then by camera.
    pub fn training_frames(&self) -> Vec<(usize, u32)> {
        self.frames(false)
    }

    /// (camera, frame) of every image of the test cameras, by frame and then by camera.
    pub fn test_frames(&self) -> Vec<(usize, u32)> {
        self.frames(true)
    }

    /// A view of every pose of every training camera (one of a camera that rests, one for each image of a camera that moves),
    /// and [`Capture::viewpoints`]. None of a test camera: training must not know where it will be tested.
    pub fn lens_views(&self) -> Vec<View> {
        let mut views = self.viewpoints.clone();
        for (index, camera) in self.cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test) {
            let moves = camera.shots.iter().any(|shot| shot.world_to_camera.is_some());
            let shots = camera.shots.iter().take(if moves { usize::MAX } else { 1 });
            views.extend(shots.filter_map(|shot| self.view(index, shot.frame).ok()));
        }
        views
    }

    /// Decodes one image with its mask. [`FrameCache`] does so ahead of time.
    ///
    /// # Errors
    /// [`Error::Data`] when there is no such image, when it does not decode or is of another size than its camera.
    pub fn picture(&self, camera: usize, frame: u32) -> Result<Picture> {
        picture::decode(&self.source(camera, frame, &PriorPlan::default())?)
    }

    /// As [`Capture::picture`], with the priors that `plan` names.
    ///
    /// # Errors
    /// As [`Capture::picture`], for the priors too.
    pub fn picture_with(&self, camera: usize, frame: u32, plan: &PriorPlan) -> Result<Picture> {
        picture::decode(&self.source(camera, frame, plan)?)
    }

    /// Whether each pixel of an image, row by row, shows what moves; `None` when nothing says so.
    ///
    /// # Errors
    /// As [`Capture::picture`].
    pub fn foreground(&self, camera: usize, frame: u32) -> Result<Option<Vec<bool>>> {
        self.bright(camera, frame, |shot| shot.foreground.as_ref())
    }

    /// Whether each pixel of a test image, row by row, shows what a training camera sees too; `None` when nothing says so.
    ///
    /// # Errors
    /// As [`Capture::picture`].
    pub fn covisible(&self, camera: usize, frame: u32) -> Result<Option<Vec<bool>>> {
        self.bright(camera, frame, |shot| shot.covisible.as_ref())
    }

    /// Where a mask of an image is bright.
    fn bright(&self, camera: usize, frame: u32, mask: fn(&Shot) -> Option<&PathBuf>) -> Result<Option<Vec<bool>>> {
        let source = self.source(camera, frame, &PriorPlan::default())?;
        let shot = self.cameras[camera].shot(frame);
        shot.and_then(mask).map(|path| picture::bright(path, &source)).transpose()
    }

    /// Whether the capture has points of every frame.
    pub fn has_frame_points(&self) -> bool {
        self.frame_points.is_some()
    }

    /// The points that were triangulated from the images of a frame, in this capture's world.
    ///
    /// # Errors
    /// [`Error::Data`] when the capture has no such points or no such frame, or when the file is damaged.
    pub fn points_of(&self, frame: u32) -> Result<Vec<FramePoint>> {
        let Some(points) = self.frame_points.as_ref().filter(|_| frame < self.n_frames) else {
            let reason = format!("has no points of frame {frame}");
            let remedy = "triangulate every frame: `ivv prepare` does, or ask for a frame of the clip";
            return Err(Error::data(&self.path, "", reason, remedy));
        };
        let index = |name: &str| self.cameras.iter().position(|camera| camera.name == name);
        let mut points = points.read(frame, index)?;
        points.iter_mut().for_each(|point| point.position = self.moved.point(point.position));
        Ok(points)
    }

    /// Where the training cameras are; of all cameras when every one is a test camera.
    pub fn extent(&self) -> Extent {
        draft::extent(&self.cameras, &self.points)
    }

    /// The shift and scale to the frame that training computes in (SPEC 1): the origin at [`Extent::center`], and
    /// [`Extent::radius`] [`TRAINING_RADIUS`].
    pub fn normalisation(&self) -> Similarity {
        let Extent { center, radius } = self.extent();
        Similarity { origin: center, scale: TRAINING_RADIUS / radius }
    }

    /// The capture in another frame: its cameras and points move, its pictures stay the same.
    pub fn transformed(mut self, to: &Similarity) -> Capture {
        for camera in &mut self.cameras {
            camera.world_to_camera = to.pose(&camera.world_to_camera);
            let poses = camera.shots.iter_mut().filter_map(|shot| shot.world_to_camera.as_mut());
            poses.for_each(|pose| *pose = to.pose(pose));
        }
        self.viewpoints.iter_mut().for_each(|view| view.world_to_camera = to.pose(&view.world_to_camera));
        self.points.iter_mut().for_each(|point| point.position = to.point(point.position));
        self.moved = self.moved.then(to);
        self
    }

    fn frames(&self, is_test: bool) -> Vec<(usize, u32)> {
        let cameras = self.cameras.iter().enumerate().filter(|(_, camera)| camera.is_test == is_test);
        let mut frames: Vec<_> =
            cameras.flat_map(|(index, camera)| camera.shots.iter().map(move |shot| (index, shot.frame))).collect();
        frames.sort_unstable_by_key(|&(camera, frame)| (frame, camera));
        frames
    }

    fn source(&self, camera: usize, frame: u32, plan: &PriorPlan) -> Result<picture::Source> {
        let found = self.cameras.get(camera).and_then(|camera| camera.shot(frame).map(|shot| (camera, shot)));
        let depth_map = plan.depth.get(&(camera, frame));
        let (camera, shot) = found.ok_or_else(|| self.absent(camera, frame))?;
        Ok(picture::Source {
            priors: PriorSource {
                flow: shot.flow.clone().filter(|_| plan.flow),
                depth: shot.depth.clone().zip(depth_map.copied()),
            },
            image: shot.image.clone(),
            mask: shot.mask.clone(),
            width: camera.width,
            height: camera.height,
            background: self.background,
        })
    }

    fn absent(&self, camera: usize, frame: u32) -> Error {
        let reason = format!("is not in the capture of {} cameras and {} frames", self.cameras.len(), self.n_frames);
        let remedy = "ask for one of its training or test frames";
        Error::data(&self.path, format!("camera {camera}, frame {frame}"), reason, remedy)
    }
}

/// Reads a capture as [`Capture::open_with`] does and reports all of its faults at once.
///
/// A folder with `capture.toml` is the project's own (SPEC 8); with `train_meta.json`, Dynamic3DGaussians'; with
/// `transforms.json` or `transforms_train.json`, nerfstudio's, instant-ngp's or D-NeRF's; with `cameras.bin` or
/// `cameras.txt` in `sparse/0`, `sparse` or itself, COLMAP's.
pub fn check_capture(path: &Path, settings: &CaptureSettings) -> Report {
    read(path, settings).1
}

type Recogniser = fn(&Path) -> bool;
type Reader = fn(&Path, &CaptureSettings, &mut Faults) -> Draft;

/// Every format: its name, how a folder is recognised, how it is read. The first that fits is taken.
const FORMATS: [(&str, Recogniser, Reader); 5] = [
    ("ivv capture folder", |path| path.join("capture.toml").is_file(), folder::read),
    ("ivv capture folder", folder::is_unfinished, folder::unfinished),
    ("Dynamic3DGaussians", |path| path.join("train_meta.json").is_file(), dynamic::read),
    (
        "transforms.json",
        |path| ["transforms.json", "transforms_train.json"].iter().any(|name| path.join(name).is_file()),
        transforms::read,
    ),
    ("COLMAP", |path| colmap::model_folder(path).is_some(), colmap::read_capture),
];

/// Whether a folder is in one of the [`FORMATS`].
pub(crate) fn is_capture(path: &Path) -> bool {
    FORMATS.into_iter().any(|(_, is, _)| is(path))
}

/// What the files of a folder in one of the [`FORMATS`] say, lenses that distort included, before it is compared with the
/// images; `None` when the folder is in none of them.
pub(crate) fn describe(path: &Path, settings: &CaptureSettings, faults: &mut Faults) -> Option<(&'static str, Draft)> {
    let (name, _, read) = FORMATS.into_iter().find(|(_, is, _)| is(path))?;
    Some((name, read(path, settings, faults)))
}

fn read(path: &Path, settings: &CaptureSettings) -> (Capture, Report) {
    let mut faults = Faults::default();
    let (format, draft) = describe(path, settings, &mut faults).unwrap_or_else(|| {
        let reason = if path.is_dir() { "not a recognised capture" } else { "no such folder" };
        let remedy = "give a folder with capture.toml, train_meta.json, transforms.json or a COLMAP model in sparse/0; \
                      `ivv prepare` makes one from other formats";
        faults.add(path, "", reason, remedy);
        ("", Draft::default())
    });
    if settings.downscale.is_some() && !["", "COLMAP"].contains(&format) {
        let remedy = "leave it out; `ivv prepare --scale` makes smaller pictures of any capture";
        faults.add(
            path,
            "--downscale",
            "is for a plain COLMAP project, which has images_2, images_4 and so on",
            remedy,
        );
    }
    let mut report = Report::new(path, format);
    let capture = draft.finish(path, settings, &mut faults, &mut report);
    report.set_faults(faults);
    (capture, report)
}
