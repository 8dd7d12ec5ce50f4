//! A capture that has been read.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::picture;
use super::{
    Calibration, Camera, CaptureSettings, Extent, FramePoint, FramePoints, Picture, Point, PriorPlan, PriorSource,
    Shot, extent, has_alpha,
};
use crate::error::{Error, Result};
use crate::scene::{Similarity, View};
use glam::DVec3;

/// [`Extent::radius`] in the frame that training computes in, the geometric middle of SPEC 1's 1 to 10, so that rates and limits in scene
/// units mean the same in every capture.
pub const TRAINING_RADIUS: f64 = 3.0;

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
    /// Sparse points of the photographs.
    pub photo_points: Vec<Point>,
    /// Colour behind images that have an alpha channel, and of the views.
    pub background: [f32; 3],
    /// By camera, the delay of its pictures in frames, where `truth.json` has it (`time_offsets_frames`). Only reports use it.
    pub true_offsets: BTreeMap<String, f64>,
    /// Views besides the cameras' before which training keeps the space clear. Empty unless set.
    pub viewpoints: Vec<View>,
    /// Corrections of poses and times that an earlier run learnt, by name of the camera. Empty unless set.
    pub calibration: BTreeMap<String, Calibration>,
    /// Sentences on everything that the reader dropped, guessed or converted.
    pub notes: Vec<String>,
    pub(super) frame_points: Option<FramePoints>,
    pub(super) settings: CaptureSettings,
    /// From the world of the files to this one.
    pub(super) moved: Similarity,
}

impl Capture {
    /// How it was read.
    pub fn settings(&self) -> &CaptureSettings {
        &self.settings
    }

    /// The view of a camera at a frame: time is `frame / n_frames`, `flow_dt` is `1 / n_frames`. Its name is the camera's, with the frame
    /// when there are several.
    ///
    /// # Errors
    /// [`Error::Data`] when there is no such camera or frame. The frame need not have an image.
    pub fn view(&self, camera: usize, frame: u32) -> Result<View> {
        let Some(seen_by) = self.cameras.get(camera).filter(|_| frame < self.n_frames) else {
            return Err(self.absent(camera, frame));
        };
        let view = seen_by.view(frame, self.n_frames, seen_by.pose(frame), self.background);
        Ok(View { time_offset: self.offset(camera), ..view })
    }

    /// The capture without the images of its photographs. Their cameras stay, so that those of the clip keep their numbers.
    #[must_use]
    #[doc(hidden)]
    pub fn without_photos(mut self) -> Self {
        self.cameras.iter_mut().filter(|camera| camera.is_photo).for_each(|camera| camera.shots.clear());
        self.photo_points.clear();
        self
    }

    #[doc(hidden)]
    pub fn has_photos(&self) -> bool {
        self.cameras.iter().any(|camera| camera.is_photo && !camera.shots.is_empty())
    }

    /// True for a clip of several training cameras: the scene's own times and colours absorb the errors of one alone. A camera of one
    /// image does not count, since a moving one may be listed as a camera for each image.
    #[doc(hidden)]
    pub fn is_rig_clip(&self) -> bool {
        let tells = |camera: &&Camera| camera.films() && camera.shots.len() > 1;
        self.n_frames > 1 && self.cameras.iter().filter(tells).count() > 1
    }

    /// (camera index, frame) of every image of the training cameras, ordered by frame and then by camera.
    pub fn training_frames(&self) -> Vec<(usize, u32)> {
        self.frames(false)
    }

    /// (camera index, frame) of every image of the test cameras, ordered by frame and then by camera.
    pub fn test_frames(&self) -> Vec<(usize, u32)> {
        self.frames(true)
    }

    /// [`Capture::viewpoints`] and a view of every pose of every training camera: not of photographs, from where nobody watches, nor of
    /// test cameras, of which training must not know.
    #[doc(hidden)]
    pub fn lens_views(&self) -> Vec<View> {
        let mut views = self.viewpoints.clone();
        for (index, camera) in self.cameras.iter().enumerate().filter(|(_, camera)| camera.films()) {
            let shots = camera.shots.iter().take(if camera.moves() { usize::MAX } else { 1 });
            views.extend(shots.filter_map(|shot| self.view(index, shot.frame).ok()));
        }
        views
    }

    /// Decodes one image with its mask.
    ///
    /// # Errors
    /// [`Error::Data`] when there is no such image, when it does not decode or is of another size than its camera.
    pub fn picture(&self, camera: usize, frame: u32) -> Result<Picture> {
        self.picture_with(camera, frame, &PriorPlan::default())
    }

    /// As [`Capture::picture`], with the priors that `plan` names.
    #[doc(hidden)]
    pub fn picture_with(&self, camera: usize, frame: u32, plan: &PriorPlan) -> Result<Picture> {
        Ok(picture::decode(&self.source(camera, frame, plan)?)?)
    }

    /// By pixel, row by row, true where the image shows something that moves; `None` where the capture has no such mask.
    ///
    /// # Errors
    /// As [`Capture::picture`].
    pub fn foreground(&self, camera: usize, frame: u32) -> Result<Option<Vec<bool>>> {
        self.bright(camera, frame, |shot| shot.foreground.as_ref())
    }

    /// By pixel, row by row, true where the image is at least half opaque; `None` when it has no alpha channel.
    #[doc(hidden)]
    pub fn opaque(&self, camera: usize, frame: u32) -> Result<Option<Vec<bool>>> {
        self.bright(camera, frame, |shot| Some(&shot.image).filter(|image| has_alpha(image)))
    }

    /// By pixel, row by row, true where a training camera sees the same surface; `None` where the capture has no such mask.
    ///
    /// # Errors
    /// As [`Capture::picture`].
    pub fn covisible(&self, camera: usize, frame: u32) -> Result<Option<Vec<bool>>> {
        self.bright(camera, frame, |shot| shot.covisible.as_ref())
    }

    fn bright(&self, camera: usize, frame: u32, mask: fn(&Shot) -> Option<&PathBuf>) -> Result<Option<Vec<bool>>> {
        let source = self.source(camera, frame, &PriorPlan::default())?;
        let shot = self.cameras[camera].shot(frame);
        shot.and_then(mask).map(|path| picture::bright(path, &source)).transpose()
    }

    /// True if the capture has points of every frame.
    pub fn has_frame_points(&self) -> bool {
        self.frame_points.is_some()
    }

    /// The points that were triangulated from the images of a frame.
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

    /// Where the training cameras are, or all cameras when every one is a test camera.
    pub fn extent(&self) -> Extent {
        extent(&self.cameras, &self.points)
    }

    /// The shift and scale to the frame that training computes in (SPEC 1): the origin at [`Extent::center`], and
    /// [`Extent::radius`] [`TRAINING_RADIUS`].
    pub fn normalisation(&self) -> Similarity {
        let Extent { center, radius } = self.extent();
        Similarity { origin: center, scale: TRAINING_RADIUS / radius }
    }

    /// The capture in another frame of reference: cameras and points change, pictures stay the same.
    pub fn transformed(mut self, to: &Similarity) -> Capture {
        self.cameras.iter_mut().flat_map(Camera::poses_mut).for_each(|pose| *pose = to.pose(pose));
        self.viewpoints.iter_mut().for_each(|view| view.pose = to.pose(&view.pose));
        let points = self.points.iter_mut().chain(&mut self.photo_points);
        points.for_each(|point| point.position = to.point(point.position));
        self.moved = self.moved.then(to);
        self
    }

    /// Corrects the cameras that `by` names. For a capture in its own world.
    #[must_use]
    #[doc(hidden)]
    pub fn calibrated(mut self, by: &BTreeMap<String, Calibration>) -> Self {
        for camera in &mut self.cameras {
            let Some(Calibration { turn, shift, .. }) = by.get(&camera.name) else { continue };
            let (turn, shift) = (DVec3::from(*turn), DVec3::from(*shift));
            // A pose that is right keeps its bits.
            if turn != DVec3::ZERO || shift != DVec3::ZERO {
                camera.poses_mut().for_each(|pose| *pose = pose.corrected(turn, shift));
            }
        }
        self.calibration = by.clone();
        self
    }

    fn offset(&self, camera: usize) -> f64 {
        self.calibration.get(&self.cameras[camera].name).map_or(0.0, |known| known.offset * self.fps)
    }

    fn frames(&self, is_test: bool) -> Vec<(usize, u32)> {
        let cameras = self.cameras.iter().enumerate().filter(|(_, camera)| camera.is_test == is_test);
        let mut frames: Vec<_> =
            cameras.flat_map(|(index, camera)| camera.shots.iter().map(move |shot| (index, shot.frame))).collect();
        frames.sort_unstable_by_key(|&(camera, frame)| (frame, camera));
        frames
    }

    pub(super) fn source(&self, camera: usize, frame: u32, plan: &PriorPlan) -> Result<picture::Source> {
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
            width: camera.intrinsics.width,
            height: camera.intrinsics.height,
            background: self.background,
            reduction: 1,
        })
    }

    fn absent(&self, camera: usize, frame: u32) -> Error {
        let reason = format!("is not in the capture of {} cameras and {} frames", self.cameras.len(), self.n_frames);
        let remedy = "ask for one of its training or test frames";
        Error::data(&self.path, format!("camera {camera}, frame {frame}"), reason, remedy)
    }
}
