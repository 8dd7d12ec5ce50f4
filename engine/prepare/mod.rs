//! From recordings to the project's capture folder (SPEC 8): video decoded, lenses undistorted, points triangulated frame by frame,
//! optical flow estimated.
//!
//! Every stage continues where an interrupted run stopped: files are written whole, and `prepare.json` notes from what each stage was
//! made. `capture.toml` comes last.

mod colmap;
mod database;
mod estimate;
mod fit;
mod flow;
mod forecast;
mod foreign;
mod images;
mod journal;
mod model;
mod photos;
mod pictures;
mod program;
mod reconstruct;
mod settings;
mod shifts;
mod sound;
mod source;
mod timeline;
mod track;
mod triangulate;
mod video;

use std::collections::BTreeMap;

pub use self::estimate::{Estimate, StageEstimate, estimate};
pub use self::forecast::Forecast;
use self::foreign::{Kind, kind};
use self::images::{Images, plan};
use self::journal::Journal;
use self::pictures::Pictures;
use self::program::{FFMPEG, FFPROBE};
pub use self::settings::{ImageFormat, OnProgress, PrepareSettings, Progress, Share, ShiftBy, Stage, Triangulate};
use self::source::{Clocks, Footage, Source, SourceCamera};
pub use self::source::{Recognised, recognise};
use crate::error::{Error, Result};
use crate::scene::capture::{
    CaptureSettings, Faults, Manifest, Report, Shot, check_asked, check_capture, write_true_offsets,
};

/// The work of COLMAP before pictures without cameras can be prepared; nothing where the source has cameras.
pub fn forecast(settings: &PrepareSettings) -> Result<Option<Forecast>> {
    pictures(settings)?.map(|pictures| forecast::forecast(settings, &pictures)).transpose()
}

fn pictures(settings: &PrepareSettings) -> Result<Option<Pictures>> {
    settings.check()?;
    let pictures = source::pictures(settings);
    if pictures.is_some() {
        check_asked(&settings.source, "", &settings.capture)?;
    }
    reconstruct::check_moving(settings, pictures.as_ref())?;
    photos::check(settings, pictures.as_ref())?;
    Ok(pictures)
}

#[derive(Clone, Debug, serde::Serialize)]
pub struct Prepared {
    /// The format of the source; empty when it is unknown.
    pub source_format: &'static str,
    /// Notes: cameras whose rates or counts differ, calibrations that were fitted, points per frame.
    pub notes: Vec<String>,
    /// Points of each triangulated frame, by frame.
    pub points: Vec<(u32, usize)>,
    /// Of the capture; when the source itself is faulty, of the source, and nothing was made.
    pub report: Report,
}

/// Makes a capture folder, or completes one that an interrupted run began; a second run changes nothing. Faults of the source, and of
/// the finished capture, are in the report.
pub fn prepare(settings: &PrepareSettings, progress: OnProgress) -> Result<Prepared> {
    let Some(pictures) = pictures(settings)? else {
        return make(Preparation::new(settings)?, None, Vec::new(), progress);
    };
    let (settings, mut notes) = in_step(settings, &pictures)?;
    let journal = Journal::open(&settings)?;
    let (posed, placed) = reconstruct::make(&settings, &pictures, &journal, progress)?;
    notes.extend(placed);
    let prepared = make(Preparation::new(&posed)?, Some(journal), notes, progress)?;
    Ok(Prepared { source_format: pictures.name(), ..prepared })
}

/// The settings with the shifts that the videos of pictures without cameras tell, and what is worth knowing of them.
fn in_step(settings: &PrepareSettings, pictures: &Pictures) -> Result<(PrepareSettings, Vec<String>)> {
    let Pictures::Videos(folder) = pictures else { return Ok((settings.clone(), Vec::new())) };
    let videos: Vec<_> = reconstruct::videos(folder).map(|(name, path)| (name, Some(path))).collect();
    shifts::resolved(settings, &videos)
}

/// Makes a share of one stage of [`prepare`], so that several machines with one file system do it together: stage by stage, each when all
/// shares of the one before are made. [`prepare`] then completes the capture.
pub fn prepare_share(settings: &PrepareSettings, stage: Stage, share: Share, progress: OnProgress) -> Result<()> {
    let pictures = pictures(settings)?;
    let early = |reason: String, stage: &str| {
        let remedy = format!("run the same command with --only {stage} first");
        Err(Error::data(&settings.output, "", reason, remedy))
    };
    let posed = match (&pictures, stage) {
        (Some(pictures), _) if stage == Stage::Cameras || reconstruct::is_placed(&settings.output) => {
            if share.part > 0 && stage == Stage::Cameras {
                return Ok(());
            }
            let settings = in_step(settings, pictures)?.0;
            Some(reconstruct::make(&settings, pictures, &Journal::open(&settings)?, progress)?.0)
        }
        (Some(_), _) => return early("holds no cameras yet".to_owned(), "cameras"),
        (None, _) => None,
    };
    if stage == Stage::Cameras {
        return Ok(());
    }
    let planned = Preparation::faultless(posed.as_ref().unwrap_or(settings))?;
    let Preparation { source, images, settings, .. } = &planned;
    let journal = Journal::open(settings)?;
    if stage == Stage::Images {
        return images.make(share, &journal, progress);
    }
    if let Some(image) = images.unmade() {
        return early(format!("has no {} yet", image.display()), "images");
    }
    if stage == Stage::Flow {
        return flow::make(images, settings, share, &journal, progress);
    }
    triangulate::require(images, source, settings)?;
    triangulate::make(images, source, settings, share, &journal, progress).map(|_| ())
}

/// A preparation of a source that has cameras, before anything is made.
struct Preparation {
    source: Source,
    images: Images,
    settings: PrepareSettings,
    faults: Faults,
    photos: Option<Box<Preparation>>,
}

impl Preparation {
    fn new(settings: &PrepareSettings) -> Result<Preparation> {
        let mut faults = Faults::default();
        let mut source = Source::read(settings, &mut faults)?;
        // Missing programs are reported before a picture is decoded.
        let needs_ffmpeg = |camera: &SourceCamera| {
            let is_converted = |shot: &Shot| kind(&shot.image) == Kind::Converted;
            matches!(camera.footage, Footage::Video(_)) || camera.footage.shots().iter().any(is_converted)
        };
        if source.cameras.iter().any(needs_ffmpeg) {
            [FFMPEG, FFPROBE].iter().try_for_each(|program| program.require(&settings.source))?;
        }
        let (settings, notes) = shifts::resolved(settings, &shifts::videos_of(&source))?;
        source.notes.extend(notes);
        let images = plan(&source, &settings, &mut faults);
        let photos =
            photos::settings_of(&settings, &source).map(|of_photos| Preparation::new(&of_photos)).transpose()?;
        Ok(Preparation { source, images, settings, faults, photos: photos.map(Box::new) })
    }

    fn faultless(settings: &PrepareSettings) -> Result<Preparation> {
        let mut planned = Preparation::new(settings)?;
        match planned.faulty().and_then(|report| report.faults.into_iter().next()) {
            Some(fault) => Err(fault.into()),
            None => Ok(planned),
        }
    }

    /// The report of a source that is faulty, or whose photographs are.
    fn faulty(&mut self) -> Option<Report> {
        if self.faults.n() == 0 {
            return self.photos.as_mut()?.faulty();
        }
        Some(Report::of_faults(&self.settings.source, self.source.format, std::mem::take(&mut self.faults)))
    }
}

fn make(
    mut planned: Preparation,
    journal: Option<Journal>,
    notes: Vec<String>,
    progress: OnProgress,
) -> Result<Prepared> {
    if let Some(report) = planned.faulty() {
        let Source { format, notes, .. } = planned.source;
        return Ok(Prepared { source_format: format, notes, points: Vec::new(), report });
    }
    let Preparation { source, images, settings, photos, .. } = planned;
    let settings = &settings;
    triangulate::require(&images, &source, settings)?;
    flow::require(&images, settings)?;
    let journal = match journal {
        Some(journal) => journal,
        None => Journal::open(settings)?,
    };
    if let Some(text) = forecast::announced(&images, &source, settings) {
        progress(Progress { stage: "all", done: 0, total: 0, piece: &text });
    }
    images.make(Share::ALL, &journal, progress)?;
    let points = triangulate::make(&images, &source, settings, Share::ALL, &journal, progress)?;
    if settings.flow {
        flow::make(&images, settings, Share::ALL, &journal, progress)?;
    }
    sound::carry(&images, settings, &journal)?;
    let output = &settings.output;
    let true_offsets = true_offsets(&source, &images);
    if !true_offsets.is_empty() {
        write_true_offsets(output, true_offsets)?;
    }
    let mut has_photos = false;
    if let Some(photos) = photos {
        let made = make(*photos, None, Vec::new(), &|told| progress(Progress { stage: "photos", ..told }))?;
        if made.report.n_faults > 0 {
            return Ok(Prepared { source_format: source.format, ..made });
        }
        has_photos = made.report.n_images > 0;
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
        photos: has_photos,
        absent: images.absent(),
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

/// By camera, the frames by which its pictures show a later time than their number says; the mean camera's are the zero of measured
/// times. A camera whose clock is unknown at a chosen frame is left out.
fn true_offsets(source: &Source, images: &Images) -> BTreeMap<String, f64> {
    let select = images.select;
    let every = f64::from(select.every);
    match &source.clocks {
        Clocks::Unknown => images.rests.clone(),
        Clocks::Offsets(offsets) => {
            let shifted = images.cameras.iter().filter_map(|camera| {
                let shift = f64::from(camera.start) - f64::from(select.start);
                Some((camera.name.clone(), (offsets.get(&camera.name)? + shift) / every))
            });
            shifted.collect()
        }
        Clocks::Times(times) => {
            let known = images.cameras.iter().filter_map(|camera| {
                let times = times.get(&camera.name)?;
                let frames = (0..select.n).filter(|frame| camera.has(*frame));
                let late = |frame: u32| {
                    let time = times.get(camera.source_frame(frame, select.every)? as usize).copied().flatten()?;
                    Some(time * images.fps - f64::from(frame))
                };
                let late: Vec<f64> = frames.map(late).collect::<Option<_>>()?;
                Some((camera.name.clone(), late.iter().sum::<f64>() / late.len().max(1) as f64))
            });
            let mut offsets: BTreeMap<String, f64> = known.collect();
            let mean = offsets.values().sum::<f64>() / offsets.len().max(1) as f64;
            offsets.values_mut().for_each(|offset| *offset -= mean);
            offsets
        }
    }
}
