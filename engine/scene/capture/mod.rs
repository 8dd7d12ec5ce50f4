//! Captures of several cameras (SPEC 8), in others' formats and the project's own. Opening one reads calibrations and the headers of
//! images, never pixels; [`FrameCache`] streams those.

mod builder;
mod cache;
mod camera;
mod colmap;
mod dynamic;
mod folder;
mod foreign;
mod frames;
pub(super) mod header;
mod llff;
mod locate;
mod masks;
mod missing;
mod named;
mod names;
mod opened;
mod opensfm;
mod picture;
mod points;
mod priors;
mod report;
mod settings;
mod transforms;
mod truth;

pub use cache::{Asked, CacheStats, FrameCache, decoded_bytes, share_of_memory};
pub use camera::{Calibration, Camera, Extent, Point, Shot};
pub use folder::Manifest;
pub use frames::Frames;
pub use opened::{Capture, TRAINING_RADIUS};
pub use picture::{Picture, pixel_bytes};
pub use points::FramePoint;
pub use priors::{PriorPlan, half_bits, half_value};
pub use report::{Fault, Report};
pub use settings::{Alpha, CaptureSettings};

pub(crate) use builder::{CaptureBuilder, RATES, check_names};
pub(crate) use colmap::{Posed, chosen_model, images_folder, read_images, seen_points, tracks};
pub(crate) use folder::{JOURNAL, PHOTOS, is_unfinished};
pub(crate) use foreign::unread_poses;
pub(crate) use header::{has_alpha, read_size, size_for, whole_side};
pub(crate) use llff::{camera_of_row, read_rows};
pub(crate) use names::{by_number, is_hidden, is_image, relative};
pub(crate) use picture::{alpha_of, decode_image};
pub(crate) use points::FramePoints;
pub(crate) use report::{Faults, camera_place};
pub(crate) use truth::write_true_offsets;

// Names that the readers share.
use builder::MAX_FRAMES;
use camera::{MAX_COORDINATE, check_place, extent};
use colmap::read_model;
use header::{BROKEN, DECODER_SLACK, MAX_SIDE, decoder_of, fault, guarded, is_turned};
use locate::{Wanted, images_of, listed};
use named::Named;
use names::{Spelled, flat, is_picture, spelled, with_image_extension};
use picture::{MAX_PIXELS, Source};
use points::read_cloud;
use priors::{PriorSource, is_prior};
use truth::read_true_offsets;

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

impl Capture {
    /// Opens a capture with the default settings.
    ///
    /// # Errors
    /// As [`Capture::open_with`].
    pub fn open(path: impl AsRef<Path>) -> Result<Capture> {
        Capture::open_with(path.as_ref(), &CaptureSettings::default())
    }

    /// Opens the folder of a capture; the format is recognised from its content (see [`check_capture`]).
    ///
    /// # Errors
    /// [`Error::Data`](crate::Error::Data) with the first fault and the number of the others.
    pub fn open_with(path: &Path, settings: &CaptureSettings) -> Result<Capture> {
        let (capture, report) = read(path, settings);
        report.first_error().map_or(Ok(capture), Err)
    }
}

/// Reads a capture as [`Capture::open_with`] does and reports all of its faults at once.
///
/// A folder with `capture.toml` is the project's own (SPEC 8); with `train_meta.json`, Dynamic3DGaussians'; with `transforms.json` or
/// `transforms_train.json`, nerfstudio's, instant-ngp's or D-NeRF's; with `cameras.bin` or `cameras.txt` in a folder of `sparse`, in
/// `sparse` or itself, COLMAP's; with `poses_bounds.npy` and images, LLFF's; with `reconstruction.json`, OpenSfM's. One of these files
/// stands for its folder. Else the only capture one or two folders below is read, with a note.
pub fn check_capture(path: &Path, settings: &CaptureSettings) -> Report {
    read(path, settings).1
}

type Recogniser = fn(&Named) -> bool;
type Reader = fn(&Named, &CaptureSettings, &mut Faults) -> CaptureBuilder;

/// Of every format: its name, how a folder is recognised, how it is read. The first that fits is taken.
const FORMATS: [(&str, Recogniser, Reader); 7] = [
    (OWN, |named| named.folder.join("capture.toml").is_file(), folder::read),
    (OWN, |named| folder::is_unfinished(&named.folder), folder::unfinished),
    ("Dynamic3DGaussians", |named| named.folder.join("train_meta.json").is_file(), dynamic::read),
    ("transforms.json", transforms::is_transforms, transforms::read),
    ("COLMAP", |named| named.model.is_some() || colmap::model_folder(&named.folder).is_some(), colmap::read_capture),
    ("LLFF", llff::is_static, llff::read),
    ("OpenSfM", opensfm::is_reconstruction, opensfm::read),
];
const OWN: &str = "ivv capture folder";

pub(crate) fn is_capture(path: &Path) -> bool {
    let named = Named::of(path);
    FORMATS.into_iter().any(|(_, is, _)| is(&named)) || only_below(&named).is_ok()
}

/// Refuses what only a plain COLMAP project has: folders of smaller images, and several models.
pub(crate) fn check_asked(path: &Path, format: &str, settings: &CaptureSettings) -> Result<()> {
    let refused = |option, reason, remedy| Err(Error::data(path, option, reason, remedy));
    if settings.model.is_some() && !["COLMAP", "COLMAP rig"].contains(&format) {
        return refused("--model", "is for a plain COLMAP project, which may have several", "leave it out");
    }
    if settings.downscale.is_some() && !["COLMAP", "LLFF"].contains(&format) {
        let reason = "is for a plain COLMAP project, which has images_2, images_4 and so on";
        let remedy = "leave it out; `ivv prepare --scale` makes smaller pictures of any capture";
        return refused("--downscale", reason, remedy);
    }
    Ok(())
}

/// A capture as its format describes it, before it is compared with the images; `None` where no format fits.
pub(crate) fn describe(
    path: &Path,
    settings: &CaptureSettings,
    faults: &mut Faults,
) -> Option<(&'static str, CaptureBuilder)> {
    let named = Named::of(path);
    let found = described(&named, settings, faults);
    let lacks_images = |found: &(&str, CaptureBuilder)| found.0 != OWN && found.1.has_no_image();
    if found.as_ref().is_some_and(|found| !lacks_images(found)) {
        return found;
    }
    // Where nothing is recognised, or no image is there, the capture that is meant may lie below: an undistorted copy, say.
    let Ok(inside) = only_below(&named) else { return found };
    let relative = |path: &Path| path.strip_prefix(&named.folder).unwrap_or(path).display().to_string();
    let mut own = Faults::default();
    let below = Named { folder: inside.clone(), ..Named::default() };
    let Some((format, mut builder)) = described(&below, settings, &mut own) else { return found };
    if found.is_none() && format == "COLMAP" && builder.has_no_image() {
        // Many keep the images beside the folder in which COLMAP works.
        let model = builder.model.as_ref().map(|(model, _)| model.clone());
        let beside = Named { folder: named.folder.clone(), model, file: None };
        let mut of_beside = Faults::default();
        let found = described(&beside, settings, &mut of_beside);
        if let Some((format, mut builder)) = found.filter(|(_, builder)| !builder.has_no_image()) {
            let note = format!("{} is read, with the images that lie beside", relative(&builder.calibration));
            builder.notes.insert(0, note);
            faults.append(of_beside);
            return Some((format, builder));
        }
    }
    let note = match &found {
        Some(_) if builder.has_no_image() => return found,
        Some((_, without)) => format!(
            "none of the images that {} names is there; {}, whose images are, is read instead",
            relative(&without.calibration),
            relative(&builder.calibration)
        ),
        None => format!("{} is read, the only capture in {}", relative(&inside), path.display()),
    };
    builder.notes.insert(0, note);
    builder.inside = Some(inside);
    if found.is_some() {
        // Faults of the capture that is not read.
        *faults = Faults::default();
    }
    faults.append(own);
    Some((format, builder))
}

fn described(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> Option<(&'static str, CaptureBuilder)> {
    let (format, _, read) = FORMATS.into_iter().find(|(_, is, _)| is(named))?;
    let mut builder = read(named, settings, faults);
    faults.take(check_asked(&named.folder, format, settings));
    builder.unmirror();
    builder.exclude(&settings.exclude, faults);
    Some((format, builder))
}

/// The only capture of others one or two folders below; or all that are there.
fn only_below(named: &Named) -> std::result::Result<PathBuf, Vec<PathBuf>> {
    if named.file.is_some() || named.model.is_some() {
        return Err(Vec::new());
    }
    let found = named::captures_below(&named.folder);
    let is_own = |path: &Path| path.join("capture.toml").exists() || path.join(JOURNAL).exists();
    match found.as_slice() {
        [one] if !is_own(one) && !named::has_videos(&named.folder) => Ok(one.clone()),
        _ => Err(found),
    }
}

/// Adds the fault of a path that is no capture; gives notes of what is there.
fn unknown(path: &Path, faults: &mut Faults) -> Vec<String> {
    let below = only_below(&Named::of(path)).err().unwrap_or_default();
    let reason = match (path.is_dir(), path.exists()) {
        (true, _) => "not a recognised capture",
        (_, true) => "is a file of no capture",
        _ => "no such folder",
    };
    let remedy = match below.first() {
        Some(_) => "name the capture in it that is meant",
        None => {
            "give a folder with capture.toml, train_meta.json, transforms.json, a COLMAP model in sparse/0, \
             poses_bounds.npy or reconstruction.json; `ivv prepare` makes one from other formats"
        }
    };
    faults.add(path, "", reason, remedy);
    let named = |inside: &PathBuf| format!("it holds a capture: `ivv check {}`", inside.display());
    below.iter().take(5).map(named).chain(unread_poses(path)).collect()
}

fn read(path: &Path, settings: &CaptureSettings) -> (Capture, Report) {
    let mut faults = Faults::default();
    let (format, builder) = describe(path, settings, &mut faults).unwrap_or_else(|| {
        let notes = unknown(path, &mut faults);
        ("", CaptureBuilder { notes, ..CaptureBuilder::default() })
    });
    builder.finish(path, format, settings, faults)
}
