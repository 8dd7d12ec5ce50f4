//! From what others recorded to the project's capture folder (SPEC 8): video decoded, lenses undistorted, points
//! triangulated frame by frame, optical flow estimated.
//!
//! Every stage goes on where an earlier, interrupted run stopped: each file is written whole and renamed, and `prepare.json`
//! in the folder says from what the files of a stage were made. `capture.toml` comes last.

mod clocks;
mod fit;
mod flow;
mod images;
mod journal;
mod model;
mod program;
mod reconstruct;
mod sound;
mod source;
mod triangulate;
mod video;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use self::images::Images;
use self::journal::Journal;
use self::program::{FFMPEG, FFPROBE};
pub use self::reconstruct::Forecast;
use self::source::{Footage, Source};
use crate::error::{Error, Result};
use crate::scene::capture::{CaptureSettings, Faults, Manifest, RATES, Report, check_capture, write_true_offsets};

/// The format of images that are made here; images that need no change are taken over as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum ImageFormat {
    /// Lossless.
    Png,
    /// JPEG of quality 95: a quarter of the bytes or less.
    Jpeg,
}

impl ImageFormat {
    fn extension(self) -> &'static str {
        match self {
            ImageFormat::Png => "png",
            ImageFormat::Jpeg => "jpg",
        }
    }
}

/// Of which frames points are triangulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum Triangulate {
    /// Of none; points that the source has are kept, of single frames too.
    None,
    /// Of the reference frame.
    Reference,
    /// Of every n-th, beginning with the first; the other frames get a file without points.
    Every(u32),
}

/// What is prepared, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct PrepareSettings {
    /// Folder of the recordings and their calibration.
    pub source: PathBuf,
    /// Folder of the capture.
    pub output: PathBuf,
    /// Where videos and image sequences are, when not beside the calibration.
    pub footage: Option<PathBuf>,
    /// First frame of the source that is taken.
    pub start: u32,
    /// Most frames that are taken.
    pub frames: Option<u32>,
    /// Every n-th frame is taken.
    pub every: u32,
    /// By name, frames of the source by which the clip begins later in a camera's footage, or earlier where negative: for
    /// cameras that did not begin to record at one time. The source's points of single frames lie at other times then, and are
    /// not kept.
    pub shifts: BTreeMap<String, i32>,
    /// Size of the images relative to the source's, in (0, 1].
    pub scale: f64,
    /// Format of images that are made.
    pub format: ImageFormat,
    /// `None`: every frame, unless the source has points.
    pub triangulate: Option<Triangulate>,
    /// Estimates optical flow with OpenCV's DIS.
    pub flow: bool,
    /// How a source is read that is a capture; of every source the test cameras (those that it declares where there are
    /// none) and the frames per second of image sequences, which do not say. `max_frames` is [`PrepareSettings::frames`]
    /// here.
    pub capture: CaptureSettings,
    /// Replaces what other settings made, and files of a capture that was not made here.
    pub force: bool,
    /// Threads, and the most programs that run at once.
    pub threads: usize,
}

impl PrepareSettings {
    /// The settings that suit every source.
    pub fn new(source: &Path, output: &Path) -> Self {
        PrepareSettings {
            source: source.to_owned(),
            output: output.to_owned(),
            footage: None,
            start: 0,
            frames: None,
            every: 1,
            shifts: BTreeMap::new(),
            scale: 1.0,
            format: ImageFormat::Png,
            triangulate: None,
            flow: false,
            capture: CaptureSettings::default(),
            force: false,
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        }
    }

    /// See [`PrepareSettings::shifts`].
    fn shift(&self, camera: &str) -> i32 {
        self.shifts.get(camera).copied().unwrap_or(0)
    }

    fn check(&self) -> Result<()> {
        let bad = |option: &str, reason: String, remedy: &str| Err(Error::data(&self.output, option, reason, remedy));
        if !(self.scale > 0.0 && self.scale <= 1.0) {
            return bad("--scale", format!("is {}", self.scale), "give a number above 0, at most 1");
        }
        let fps = self.capture.fps;
        if !RATES.contains(&fps) {
            let reason = format!("is {fps}, {} to {} are allowed", RATES.start(), RATES.end());
            return bad("--fps", reason, "give the rate at which the pictures were taken");
        }
        let zero = [
            ("--every", self.every == 0),
            ("--frames", self.frames == Some(0)),
            ("--triangulate", self.triangulate == Some(Triangulate::Every(0))),
        ];
        if let Some((option, _)) = zero.iter().find(|(_, zero)| *zero) {
            return bad(option, "is 0".to_owned(), "give at least 1");
        }
        let absolute = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).unwrap_or_default();
        if absolute(&self.source).starts_with(absolute(&self.output)) {
            return bad("", "is the source or holds it".to_owned(), "choose another folder with -o");
        }
        Ok(())
    }
}

/// Something that is done; told from any thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// The stage.
    pub stage: &'static str,
    /// Pieces of the stage that are done, those of earlier runs included.
    pub done: usize,
    /// Pieces of the stage.
    pub total: usize,
    /// The piece that is done now.
    pub piece: &'a str,
}

/// What a folder or file holds of which [`prepare`] makes a capture, and which is none itself: an English phrase such as
/// `a Pose2Sim recording`; nothing where it is a capture or unknown.
pub fn recognise(path: &Path) -> Option<String> {
    source::recognise(path)
}

/// What COLMAP will have to do before pictures without cameras can be prepared, and how long about that takes; nothing where
/// the source has cameras.
///
/// # Errors
/// [`Error::Data`] when COLMAP or ffmpeg is needed and missing, or a video cannot be read.
pub fn forecast(settings: &PrepareSettings) -> Result<Option<Forecast>> {
    source::pictures(settings).map(|pictures| reconstruct::forecast(settings, &pictures)).transpose()
}

/// What was made.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Prepared {
    /// The format of the source; empty when it is unknown.
    pub source_format: &'static str,
    /// What is worth knowing: cameras whose rates or counts differ, calibrations that were fitted, points per frame.
    pub notes: Vec<String>,
    /// Points of each triangulated frame, by frame.
    pub points: Vec<(u32, usize)>,
    /// Of the capture; when the source itself is faulty, of the source, and nothing was made.
    pub report: Report,
}

/// Makes a capture folder, or completes one that an interrupted run began. A second run changes nothing.
///
/// Faults of the source, and of the finished capture, are in the report.
///
/// # Errors
/// [`Error::Data`] when a setting is out of its range, when the output holds what was not made from this source with these
/// settings (and [`PrepareSettings::force`] is off), when ffmpeg, COLMAP or Python is needed and missing or fails, or when
/// a file cannot be read or written.
pub fn prepare(settings: &PrepareSettings, progress: &(dyn Fn(Progress) + Sync)) -> Result<Prepared> {
    settings.check()?;
    let Some(pictures) = source::pictures(settings) else { return prepare_posed(settings, None, Vec::new(), progress) };
    let mut journal = Journal::open(settings)?;
    let (posed, notes) = reconstruct::make(settings, &pictures, &mut journal, progress)?;
    let prepared = prepare_posed(&posed, Some(journal), notes, progress)?;
    Ok(Prepared { source_format: pictures.name(), ..prepared })
}

/// Prepares a source that has cameras.
fn prepare_posed(
    settings: &PrepareSettings,
    journal: Option<Journal>,
    notes: Vec<String>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Prepared> {
    let mut faults = Faults::default();
    let source = Source::read(settings, &mut faults)?;
    // What is missing is told before a picture is decoded.
    if source.cameras.iter().any(|camera| matches!(camera.footage, Footage::Video(_))) {
        [FFMPEG, FFPROBE].iter().try_for_each(|program| program.require(&settings.source))?;
    }
    let images = Images::plan(&source, settings, &mut faults);
    if faults.n() > 0 {
        let mut report = Report::new(&settings.source, source.format);
        report.set_faults(faults);
        return Ok(Prepared { source_format: source.format, notes: source.notes, points: Vec::new(), report });
    }
    triangulate::require(&images, &source, settings)?;
    if settings.flow && (settings.force || !flow::left(&images).is_empty()) {
        flow::python(&settings.source)?;
    }
    let mut journal = match journal {
        Some(journal) => journal,
        None => Journal::open(settings)?,
    };
    let output = &settings.output;
    images.make(&mut journal, progress)?;
    let points = triangulate::make(&images, &source, settings, &mut journal, progress)?;
    if settings.flow {
        flow::make(&images, settings, &mut journal, progress)?;
    }
    images.carry_sound(settings)?;
    let true_offsets = clocks::true_offsets(&source, &images);
    if !true_offsets.is_empty() {
        write_true_offsets(output, true_offsets)?;
    }
    let exists = |name: &str| output.join(name).is_dir();
    let manifest = Manifest {
        fps: images.fps,
        frames: images.n_frames(),
        reference_frame: 0,
        test_cameras: images.test_cameras(),
        masks: exists("masks"),
        foreground: exists("foreground"),
        covisible: exists("covisible"),
        points: exists("points"),
        flow: exists("flow"),
        depth: exists("depth"),
        audio: exists("audio"),
    };
    if Manifest::read(output).ok().as_ref() != Some(&manifest) {
        manifest.write(output)?;
    }
    let mut notes: Vec<String> = notes.into_iter().chain(source.notes).chain(images.notes).collect();
    if settings.scale < 1.0 && !points.is_empty() && points.iter().all(|(_, n)| *n == 0) {
        let note = "no point was found in pictures of this size: prepare without --scale, then the result with --scale, \
                    which keeps its points";
        notes.push(note.to_owned());
    }
    let report = check_capture(output, &CaptureSettings::default());
    Ok(Prepared { source_format: source.format, notes, points, report })
}
