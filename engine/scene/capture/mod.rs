//! Captures: what several cameras saw (SPEC 8), from the formats that others write and from the project's own folder.
//!
//! Opening a capture reads calibrations and the headers of images, never pixels; [`FrameCache`] streams those.

mod builder;
mod cache;
mod calibration;
mod camera;
mod colmap;
pub(super) mod decoder;

mod dynamic;
mod folder;
mod frames;
pub(super) mod header;
mod names;
mod npz;
mod opened;
mod picture;
mod points;
mod priors;
mod report;
mod settings;
mod transforms;
mod truth;

pub use cache::{Asked, CacheStats, FrameCache, decoded_bytes, share_of_memory};
pub use calibration::Calibration;
pub use camera::{Camera, Extent, Point, Shot};
pub use folder::Manifest;
pub(crate) use folder::{JOURNAL, PHOTOS, is_unfinished};
pub use frames::Frames;
pub use opened::{Capture, TRAINING_RADIUS};
pub use picture::{Picture, pixel_bytes};
pub use points::FramePoint;
pub use priors::{PriorPlan, half_bits, half_value};
pub use report::{Fault, Report};
pub use settings::{Alpha, CaptureSettings};

use std::path::Path;

pub(crate) use builder::{CaptureBuilder, RATES, check_names};
pub(crate) use colmap::{Posed, images_folder, model_folder, read_images, tracks};
pub(crate) use header::{has_alpha, read_size};
pub(crate) use names::{is_hidden, is_image, relative};
pub(crate) use npz::read_npy;
pub(crate) use picture::{alpha_of, decode_image};
pub(crate) use points::FramePoints;
pub(crate) use report::Faults;
pub(crate) use truth::write_true_offsets;

use crate::error::Result;

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
    /// [`Error::Data`](crate::Error::Data) with the first fault and the number of the others.
    pub fn open_with(path: &Path, settings: &CaptureSettings) -> Result<Capture> {
        let (capture, report) = read(path, settings);
        match report.first_error() {
            Some(error) => Err(error),
            None => Ok(capture),
        }
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
type Reader = fn(&Path, &CaptureSettings, &mut Faults) -> CaptureBuilder;

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

/// Refuses folders of smaller images, for what is not a plain COLMAP project.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) where `settings` ask for one.
pub(crate) fn check_downscale(path: &Path, settings: &CaptureSettings) -> Result<()> {
    if settings.downscale.is_none() {
        return Ok(());
    }
    let reason = "is for a plain COLMAP project, which has images_2, images_4 and so on";
    let remedy = "leave it out; `ivv prepare --scale` makes smaller pictures of any capture";
    Err(crate::Error::data(path, "--downscale", reason, remedy))
}

/// What the files of a folder in one of the [`FORMATS`] say, lenses that distort included, before it is compared with the
/// images; `None` when the folder is in none of them.
pub(crate) fn describe(
    path: &Path,
    settings: &CaptureSettings,
    faults: &mut Faults,
) -> Option<(&'static str, CaptureBuilder)> {
    let (name, _, read) = FORMATS.into_iter().find(|(_, is, _)| is(path))?;
    let builder = read(path, settings, faults);
    if name != "COLMAP" {
        faults.take(check_downscale(path, settings));
    }
    Some((name, builder))
}

fn read(path: &Path, settings: &CaptureSettings) -> (Capture, Report) {
    let mut faults = Faults::default();
    let (format, builder) = describe(path, settings, &mut faults).unwrap_or_else(|| {
        let reason = if path.is_dir() { "not a recognised capture" } else { "no such folder" };
        let remedy = "give a folder with capture.toml, train_meta.json, transforms.json or a COLMAP model in sparse/0; \
                      `ivv prepare` makes one from other formats";
        faults.add(path, "", reason, remedy);
        ("", CaptureBuilder::default())
    });
    let mut report = Report::new(path, format);
    let capture = builder.finish(path, settings, &mut faults, &mut report);
    report.set_faults(faults);
    (capture, report)
}
