//! Pose2Sim: videos and, in `calibration/`, Qualisys' `*.qca.txt` or a `Calib*.toml`; and anipose, freemocap, aniposelib, which have
//! such a file of any name beside the videos.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use super::footage::{self, files};
use super::opencv::{self, Rotation};
use super::recording::{Place, Source};
use crate::error::Error;
use crate::files::read_text;
use crate::scene::capture::{Faults, is_capture, whole_side};
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose, rotation_of_rows};
use glam::DVec3;

const REMEDY: &str = "calibrate the cameras again, or export the calibration again";
/// Qualisys gives focal lengths and centres in parts of a pixel.
const SUBPIXELS: f64 = 64.0;
/// and lengths in millimetres.
const MILLIMETRES: f64 = 1000.0;

const CALIBRATION: &str = "calib";
/// Videos of cameras that a calibration one folder up must have before it is taken for theirs.
const LEAST_ALIKE: usize = 2;

/// The calibration of a project: in a folder `calibration`, or beside its videos. Of a trial of several it lies one folder up.
pub(super) fn calibration(place: Place) -> Option<PathBuf> {
    in_folder(place.folder).or_else(|| above(place))
}

pub(super) fn is_anipose(place: Place) -> bool {
    in_folder(place.folder).is_some_and(|file| file.parent() == Some(place.folder))
}

fn in_folder(folder: &Path) -> Option<PathBuf> {
    let name = |path: &Path| path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_lowercase();
    let is_toml = |path: &PathBuf| name(path).ends_with(".toml");
    let named = |path: &PathBuf| name(path).ends_with(".qca.txt") || is_toml(path) && name(path).starts_with("calib");
    let folders: Vec<PathBuf> =
        files(folder).into_iter().filter(|path| name(path).contains(CALIBRATION) && path.is_dir()).collect();
    let mut found: Vec<PathBuf> = folders.iter().flat_map(|folder| files(folder)).filter(named).collect();
    // Pose2Sim's own file comes before that of Qualisys.
    found.sort_by_key(|path| (name(path).ends_with(".qca.txt"), path.clone()));
    // A capture says more.
    let own = (!is_capture(folder)).then(|| folder.to_owned());
    let mut others = own.into_iter().chain(folders).flat_map(|folder| files(&folder));
    found.into_iter().next().or_else(|| others.find(|path| is_toml(path) && has_cameras(path)))
}

/// The calibration of a project with several trials, where `place` is the folder of one.
fn above(place: Place) -> Option<PathBuf> {
    let folder = std::path::absolute(place.folder).ok().filter(|folder| !is_capture(folder))?;
    let found = in_folder(folder.parent()?)?;
    let videos = footage_names(place.footage);
    let cameras = cameras(&found).ok()?;
    let alike = cameras.iter().filter(|(name, _)| videos.iter().any(|video| bare(video) == bare(name)));
    (alike.count() >= LEAST_ALIKE).then_some(found)
}

/// True if a file is a calibration of this form, whatever its name: Pose2Sim and others have settings in files of this kind too.
fn has_cameras(path: &Path) -> bool {
    let table = read_text(path).ok().and_then(|text| toml::from_str::<toml::Table>(&text).ok());
    let is_camera =
        |value: &toml::Value| ["matrix", "rotation", "translation"].iter().all(|key| value.get(key).is_some());
    table.is_some_and(|table| table.values().any(is_camera))
}

/// The folders of a project that has a calibration and no footage of its own, which have some: each is a trial.
pub(super) fn trials(place: Place) -> Vec<PathBuf> {
    let mut names = footage_names(place.footage);
    names.retain(|name| !name.to_lowercase().contains(CALIBRATION));
    if in_folder(place.folder).is_none() || !names.is_empty() {
        return Vec::new();
    }
    let folders = files(place.folder).into_iter().filter(|path| path.is_dir());
    folders.filter(|folder| above(Place { folder, footage: folder, ..place }).is_some()).collect()
}

fn footage_names(footage: &Path) -> Vec<String> {
    [footage::video_names(footage), footage::sequence_names(footage)].concat()
}

/// `cam_01`, `int_cam01_img` and `cam01` are one camera.
fn bare(name: &str) -> String {
    let name = name.trim_start_matches("int_").trim_end_matches("_img").to_lowercase();
    name.chars().filter(char::is_ascii_alphanumeric).collect::<String>()
}

type Calibrated = (String, Result<(Lens, Pose), String>);

fn cameras(calibration: &Path) -> Result<Vec<Calibrated>, String> {
    let is_toml = calibration.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
    let text = read_text(calibration).map_err(|fault| format!("cannot be read: {fault}"))?;
    if is_toml { of_toml(&text) } else { of_qualisys(&text) }
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = calibration(place).unwrap_or_else(|| place.folder.join("calibration"));
    let mut source = Source::of(&calibration);
    let trials = trials(place);
    if let Some(first) = trials.first() {
        let names: Vec<_> =
            trials.iter().filter_map(|trial| trial.file_name()).map(|name| name.to_string_lossy()).collect();
        let reason = format!("holds {} trials and no footage of its own: {}", trials.len(), names.join(", "));
        let remedy = format!("prepare one at a time: `ivv prepare {} -o CAPTURE`", first.display());
        faults.add(place.folder, "", reason, remedy);
        return source;
    }
    let cameras = cameras(&calibration).map_err(|reason| Error::data(&calibration, "", reason, REMEDY));
    let Some(cameras) = faults.take(cameras) else { return source };
    if !calibration.starts_with(place.folder) {
        source.notes.push(format!("the calibration is that of the folder above, {}", calibration.display()));
    }
    let videos = footage_names(place.footage);
    for (name, calibrated) in cameras {
        let alike = videos.iter().find(|video| bare(video) == bare(&name));
        source.add(alike.unwrap_or(&name), calibrated, place.footage, REMEDY, faults);
    }
    source
}

#[derive(serde::Deserialize)]
struct Section {
    name: Option<String>,
    size: [f64; 2],
    matrix: [[f64; 3]; 3],
    distortions: Vec<f64>,
    /// Rotation vector from world to camera.
    rotation: [f64; 3],
    translation: [f64; 3],
    #[serde(default)]
    fisheye: bool,
}

fn of_toml(text: &str) -> Result<Vec<Calibrated>, String> {
    let table: toml::Table = toml::from_str(text).map_err(|fault| format!("is no TOML: {}", fault.message()))?;
    let sections = table.into_iter().filter(|(key, value)| key != "metadata" && value.is_table());
    let camera = |(key, value): (String, toml::Value)| match value.try_into::<Section>() {
        Ok(section) => (section.name.clone().unwrap_or(key), section.calibrated()),
        Err(fault) => (key, Err(format!("is no camera: {}", fault.message()))),
    };
    Ok(sections.map(camera).collect())
}

impl Section {
    fn calibrated(&self) -> Result<(Lens, Pose), String> {
        let size = whole_side(self.size[0]).zip(whole_side(self.size[1]));
        let (width, height) = size.ok_or_else(|| format!("has the size {:?}", self.size))?;
        let lens = opencv::lens([width, height], &self.matrix, &self.distortions, self.fisheye)?;
        let rotation = Rotation::Vector(self.rotation).matrix();
        Ok((lens, Pose { rotation, translation: self.translation.into() }))
    }
}

fn of_qualisys(text: &str) -> Result<Vec<Calibrated>, String> {
    let document = Document::parse(text).map_err(|fault| format!("is no XML: {fault}"))?;
    let cameras = document.descendants().filter(|node| node.has_tag_name("camera"));
    let named = cameras.enumerate().map(|(index, camera)| {
        let name = camera.attribute("serial").map_or_else(|| format!("number {index}"), str::to_owned);
        (name, qualisys_camera(camera))
    });
    Ok(named.collect())
}

fn qualisys_camera(camera: Node) -> Result<(Lens, Pose), String> {
    let child =
        |name: &str| camera.children().find(|node| node.has_tag_name(name)).ok_or_else(|| format!("has no <{name}>"));
    let number = |node: Node, name: &str| {
        let text = node.attribute(name).ok_or_else(|| format!("has no {name}"))?;
        let value: f64 = text.parse().map_err(|_| format!("has {name} = `{}`", text.escape_debug()))?;
        if value.is_finite() { Ok(value) } else { Err(format!("has {name} = {value}")) }
    };
    if camera.attribute("viewrotation").is_some_and(|turn| turn != "0") {
        return Err("is turned (viewrotation is not 0), which is not read".to_owned());
    }
    let (view, intrinsic, transform) = (child("fov_video")?, child("intrinsic")?, child("transform")?);
    let (left, top) = (number(view, "left")?, number(view, "top")?);
    let (right, bottom) = (number(view, "right")?, number(view, "bottom")?);
    let size = whole_side(right - left + 1.0).zip(whole_side(bottom - top + 1.0));
    let (width, height) = size.ok_or("has a <fov_video> that is no size of an image")?;
    let pixels = |name: &str| Ok::<f64, String>(number(intrinsic, name)? / SUBPIXELS);
    if number(intrinsic, "skew")? != 0.0 {
        return Err("has skew".to_owned());
    }
    // The coefficients are of OpenCV's kind; Pose2Sim divides them by the lengths, which leaves no distortion.
    let radial = ["radialDistortion1", "radialDistortion2", "radialDistortion3"].map(|name| number(intrinsic, name));
    let [k1, k2, k3] = radial;
    let tangential = [number(intrinsic, "tangentalDistortion1")?, number(intrinsic, "tangentalDistortion2")?];
    let intrinsics = Intrinsics {
        width,
        height,
        fx: pixels("focalLengthU")?,
        fy: pixels("focalLengthV")?,
        cx: pixels("centerPointU")? - left + 0.5,
        cy: pixels("centerPointV")? - top + 0.5,
    };
    let lens = Lens { intrinsics, distortion: Distortion::brown([k1?, k2?, k3?, 0.0, 0.0, 0.0], tangential) };
    // The rows are the camera's axes, of which y points up and z backward.
    let vector = |[x, y, z]: [&str; 3]| -> Result<DVec3, String> {
        Ok(DVec3::new(number(transform, x)?, number(transform, y)?, number(transform, z)?))
    };
    let axes = [vector(["r11", "r12", "r13"])?, -vector(["r21", "r22", "r23"])?, -vector(["r31", "r32", "r33"])?];
    let pose = Pose::at(vector(["x", "y", "z"])? / MILLIMETRES, rotation_of_rows(axes));
    lens.fault().map_or(Ok((lens, pose)), Err)
}
