//! A recording, as every source is read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::footage;
use crate::prepare::settings::PrepareSettings;
use crate::scene::Pose;
use crate::scene::capture::{Faults, FramePoints, Point, Shot, camera_place};
use crate::scene::undistort::Lens;

#[derive(Clone, Debug, PartialEq)]
pub(in crate::internals::prepare) enum Footage {
    Video(PathBuf),
    /// By frame of the source.
    Images(Vec<Shot>),
}

impl Footage {
    /// The video, or the folder of the images.
    pub fn place(&self) -> &Path {
        match self {
            Footage::Video(path) => path,
            Footage::Images(shots) => shots.first().and_then(|shot| shot.image.parent()).unwrap_or(Path::new("")),
        }
    }

    pub fn shots(&self) -> &[Shot] {
        match self {
            Footage::Video(_) => &[],
            Footage::Images(shots) => shots,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(in crate::internals::prepare) struct SourceCamera {
    /// Unique; fit as a file name.
    pub name: String,
    pub lens: Lens,
    pub pose: Pose,
    /// The pose at frames of the source, when the camera moves.
    pub poses: BTreeMap<u32, Pose>,
    pub footage: Footage,
    pub is_test: bool,
}

impl SourceCamera {
    pub(super) fn still(name: &str, lens: Lens, pose: Pose, footage: Footage) -> Self {
        SourceCamera { name: name.to_owned(), lens, pose, poses: BTreeMap::new(), footage, is_test: false }
    }
}

/// By camera, the mask of each frame of its footage.
pub(in crate::internals::prepare) type Masks = BTreeMap<String, BTreeMap<u32, PathBuf>>;

/// A point and the names of the cameras that saw it.
pub(in crate::internals::prepare) type SourcePoint = (Point, Vec<String>);

/// Known times of the cameras' pictures.
#[derive(Debug, Default, PartialEq)]
pub(in crate::internals::prepare) enum Clocks {
    #[default]
    Unknown,
    /// By camera, frames of the source by which its pictures show a later time than their number says.
    Offsets(BTreeMap<String, f64>),
    /// By camera, seconds of each frame of the source; the zero is the same for all.
    Times(BTreeMap<String, Vec<Option<f64>>>),
}

#[derive(Debug, Default)]
pub(in crate::internals::prepare) struct Source {
    pub format: &'static str,
    /// The file that the cameras come from, for faults.
    pub calibration: PathBuf,
    pub cameras: Vec<SourceCamera>,
    pub clocks: Clocks,
    /// Of image sequences that say so.
    pub fps: Option<f64>,
    /// Of a static scene, or of frame 0.
    pub points: Vec<SourcePoint>,
    /// Of every frame.
    pub frame_points: Option<FramePoints>,
    /// A folder of photographs of what rests, which are a capture of their own.
    pub photos: Option<PathBuf>,
    /// True if a camera may be without an image of some frames.
    pub may_lack: bool,
    pub masks: Masks,
    pub notes: Vec<String>,
}

impl Source {
    pub(super) fn of(calibration: &Path) -> Self {
        Source { calibration: calibration.to_owned(), ..Source::default() }
    }

    /// Adds a camera that stands still, whose footage lies in the folder `footage`.
    pub(super) fn add(
        &mut self,
        name: &str,
        calibrated: Result<(Lens, Pose), String>,
        footage: &Path,
        remedy: &str,
        faults: &mut Faults,
    ) {
        match calibrated {
            Ok((lens, pose)) => {
                let footage = footage::take(footage, name, &self.calibration, faults);
                self.cameras.extend(footage.map(|footage| SourceCamera::still(name, lens, pose, footage)));
            }
            Err(reason) => faults.add(&self.calibration, camera_place(name), reason, remedy),
        }
    }
}

/// How a source is read: its folder and where its footage is.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub settings: &'a PrepareSettings,
    pub folder: &'a Path,
    pub footage: &'a Path,
}
