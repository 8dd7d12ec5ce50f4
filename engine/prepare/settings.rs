//! Settings of a preparation, and its progress.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::scene::capture::{CaptureSettings, Frames, RATES};

const JPEG_QUALITY: u8 = 95;

/// The format of images that are made here; images that need no change are taken over as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum ImageFormat {
    Png,
    /// JPEG of quality 95: a quarter of the bytes or less.
    Jpeg,
}

impl ImageFormat {
    pub(super) fn extension(self) -> &'static str {
        match self {
            ImageFormat::Png => "png",
            ImageFormat::Jpeg => "jpg",
        }
    }

    pub(super) fn write(self, path: &Path, pixels: &[u8], size: (u32, u32), kind: ExtendedColorType) -> Result<()> {
        let (width, height) = size;
        write_atomic(path, |to| {
            let written = match self {
                ImageFormat::Png => PngEncoder::new(to).write_image(pixels, width, height, kind),
                ImageFormat::Jpeg => {
                    JpegEncoder::new_with_quality(to, JPEG_QUALITY).write_image(pixels, width, height, kind)
                }
            };
            written.map_err(std::io::Error::other)
        })
    }
}

/// Of which frames points are triangulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum Triangulate {
    /// Of none; points that the source has are kept, of single frames too.
    None,
    Reference,
    /// Of every n-th, beginning with the first; the other frames get a file without points.
    Every(u32),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShiftBy {
    #[default]
    Given,
    Timecode,
    Sound,
}

/// Stages, each of which needs all of those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    Cameras,
    Images,
    Points,
    Flow,
}

/// A share of the pieces of a stage: several machines with one file system do one each, at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Its number, from 0.
    pub part: u32,
    /// How many there are, at least 1.
    pub of: u32,
}

impl Share {
    pub const ALL: Share = Share { part: 0, of: 1 };

    pub(super) fn has(self, piece: usize) -> bool {
        piece % self.of.max(1) as usize == self.part as usize
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct PrepareSettings {
    /// Folder of the recordings and their calibration.
    pub source: PathBuf,
    pub output: PathBuf,
    /// Where videos and image sequences are, when not beside the calibration.
    pub footage: Option<PathBuf>,
    pub frames: Frames,
    /// By camera, frames of the clip (before any are left out) by which it begins later in the footage, or earlier where negative; parts
    /// of frames choose the nearest picture. The source's points of single frames are dropped then.
    pub shifts: BTreeMap<String, f64>,
    pub shift_by: ShiftBy,
    /// Frames per second of the clip, which videos are paired by. `None`: the lowest of theirs.
    pub fps: Option<f64>,
    /// The cameras of a folder of videos move, as one: every n-th frame and the last are placed, and poses between are interpolated.
    pub moving: Option<u32>,
    /// Size of the images relative to the source's, in (0, 1].
    pub scale: f64,
    pub format: ImageFormat,
    /// `None`: every frame, unless the source has points.
    pub triangulate: Option<Triangulate>,
    /// Photographs of the static scene: without cameras where the source has none, else a capture in the source's world.
    pub photos: Option<PathBuf>,
    /// A folder of masks, bright where pixels count: one for each frame in a folder of each camera's name, or for each photograph.
    pub masks: Option<PathBuf>,
    /// Estimates optical flow with OpenCV's DIS.
    pub flow: bool,
    /// Settings of a source that is a capture; of every source its test cameras, and the rate of image sequences. Its `frames` are not used.
    pub capture: CaptureSettings,
    /// Replaces what other settings made, and files of a capture that was not made here.
    pub force: bool,
    /// Threads, and the most programs that run at once.
    pub threads: usize,
}

impl PrepareSettings {
    pub fn new(source: &Path, output: &Path) -> Self {
        PrepareSettings {
            source: source.to_owned(),
            output: output.to_owned(),
            footage: None,
            frames: Frames::default(),
            shifts: BTreeMap::new(),
            shift_by: ShiftBy::Given,
            fps: None,
            moving: None,
            scale: 1.0,
            format: ImageFormat::Png,
            triangulate: None,
            photos: None,
            masks: None,
            flow: false,
            capture: CaptureSettings::default(),
            force: false,
            threads: crate::parallel::threads(),
        }
    }

    pub(super) fn shift(&self, camera: &str) -> f64 {
        self.shifts.get(camera).copied().unwrap_or(0.0)
    }

    /// As [`PrepareSettings::shift`], of footage whose frames are known by their numbers.
    pub(super) fn whole_shift(&self, camera: &str) -> i32 {
        self.shift(camera).round() as i32
    }

    /// The shifts for the journal, where a whole number is one.
    pub(super) fn shifts_noted(&self) -> Value {
        let noted = |frames: &f64| if frames.fract() == 0.0 { json!(*frames as i64) } else { json!(frames) };
        Value::Object(self.shifts.iter().map(|(name, frames)| (name.clone(), noted(frames))).collect())
    }

    pub(super) fn check(&self) -> Result<()> {
        let bad = |option: &str, reason: String, remedy: &str| Err(Error::data(&self.output, option, reason, remedy));
        if !(self.scale > 0.0 && self.scale <= 1.0) {
            return bad("--scale", format!("is {}", self.scale), "give a number above 0, at most 1");
        }
        let fps = self.fps.unwrap_or(self.capture.fps);
        if !RATES.contains(&fps) {
            let reason = format!("is {fps}, {} to {} are allowed", RATES.start(), RATES.end());
            return bad("--fps", reason, "give the rate at which the pictures were taken");
        }
        let zero = [
            ("--frames", self.frames.every == 0 || self.frames.to == Some(0)),
            ("--moving", self.moving == Some(0)),
            ("--triangulate", self.triangulate == Some(Triangulate::Every(0))),
        ];
        if let Some((option, _)) = zero.iter().find(|(_, zero)| *zero) {
            return bad(option, "is 0".to_owned(), "give at least 1");
        }
        match self.inside() {
            Some(what) => bad("", format!("is {what} or holds it"), "choose another folder with -o"),
            None => Ok(()),
        }
    }

    /// An input that lies in the output, where it would be removed or overwritten.
    fn inside(&self) -> Option<&'static str> {
        let absolute = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).unwrap_or_default();
        let output = absolute(&self.output);
        let places = [
            ("the source", Some(self.source.clone())),
            ("the folder of --static", self.photos.clone()),
            ("the folder of --masks", self.masks.clone()),
            ("the folder of --footage", self.footage.clone()),
            // Of a plain COLMAP project both name a folder in the source.
            ("the folder of --footage", self.footage.as_ref().map(|footage| self.source.join(footage))),
            ("the folder of --images", Some(self.source.join(&self.capture.images))),
        ];
        let is_inside = |place: &Option<PathBuf>| place.as_ref().is_some_and(|it| absolute(it).starts_with(&output));
        places.iter().find(|(_, place)| is_inside(place)).map(|(what, _)| *what)
    }
}

/// Hears of progress, from any thread.
pub type OnProgress<'a> = &'a (dyn Fn(Progress) + Sync);

/// Something that is done, or where `total` is 0 what is to be expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    pub stage: &'static str,
    /// Pieces of the stage that are done, those of earlier runs included.
    pub done: usize,
    pub total: usize,
    pub piece: &'a str,
}
