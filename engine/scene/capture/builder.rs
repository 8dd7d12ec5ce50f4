//! A capture as its format gives it, and its checks against the images.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::{
    Alpha, Camera, Capture, CaptureSettings, Faults, FramePoints, Frames, MAX_COORDINATE, MAX_PIXELS, Point, Report,
    Shot, camera_place, has_alpha, is_turned, read_size,
};
use crate::error::Error;
use crate::parallel::{in_parallel, threads};
use crate::scene::prior::{depth_size, flow_size};
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose, Similarity};

pub(super) const MAX_FRAMES: u32 = 1 << 20;
/// Frames per second of a clip: from pictures hours apart to the fastest cameras.
pub(crate) const RATES: std::ops::RangeInclusive<f64> = 1e-4..=1e5;

type ReadSize = fn(&Path) -> Result<(u32, u32), Error>;

#[derive(Default)]
pub(crate) struct CaptureBuilder {
    pub fps: f64,
    pub n_frames: u32,
    pub reference_frame: u32,
    pub cameras: Vec<Camera>,
    pub points: Vec<Point>,
    /// By name of the camera; a pinhole where it is absent.
    pub distorted: BTreeMap<String, Distortion>,
    pub frame_points: Option<FramePoints>,
    pub true_offsets: BTreeMap<String, f64>,
    pub notes: Vec<String>,
    pub n_sounds: usize,
    pub photos: Option<Box<CaptureBuilder>>,
    /// The capture below the named folder that was read in its place.
    pub inside: Option<PathBuf>,
    pub calibration: PathBuf,
    /// COLMAP's model, and the names of the cameras by the ids of its images.
    pub model: Option<(PathBuf, HashMap<u32, String>)>,
    /// How the format writes a pose, for faults; `None` where it is as [`View`](crate::scene::View) has it.
    pub pose_remedy: Option<&'static str>,
    /// Where images may be that are not where the files say.
    pub elsewhere: Vec<PathBuf>,
}

impl CaptureBuilder {
    pub fn still(settings: &CaptureSettings, calibration: PathBuf) -> Self {
        CaptureBuilder { fps: settings.fps, n_frames: 1, calibration, ..CaptureBuilder::default() }
    }

    /// Adds a camera of one image; each `test_every`-th is kept for testing.
    pub fn add_still(&mut self, name: String, lens: Lens, pose: Pose, image: PathBuf, settings: &CaptureSettings) {
        let is_test = settings.test_every > 0 && self.cameras.len().is_multiple_of(settings.test_every);
        let shots = vec![Shot { image, ..Shot::default() }];
        let Lens { intrinsics, distortion } = lens;
        self.distorted.insert(name.clone(), distortion);
        self.cameras.push(Camera { name, intrinsics, world_to_camera: pose, is_test, is_photo: false, shots });
    }

    /// Checks what no format checks: poses, sizes, images, names of test cameras.
    pub fn finish(
        mut self,
        path: &Path,
        format: &str,
        settings: &CaptureSettings,
        mut faults: Faults,
    ) -> (Capture, Report) {
        let path = self.inside.take().unwrap_or_else(|| path.to_owned());
        self.cut(&path, settings.frames, &mut faults);
        let (mut n_photos, mut photo_points) = (0, Vec::new());
        if let Some(photos) = self.photos.take() {
            n_photos = photos.cameras.len();
            self.distorted.extend(photos.distorted);
            self.cameras.extend(photos.cameras);
            photo_points = photos.points;
        }
        self.cameras.iter_mut().for_each(|camera| camera.shots.sort_by_key(|shot| shot.frame));
        self.check_clip(&mut faults);
        self.check_missing(&path, settings, &mut faults);
        let n_alphas = self.check_images(settings, &mut faults);
        self.check_cameras(settings, &mut faults);
        self.choose_test_cameras(settings, &mut faults);
        self.check_lenses(&path, &mut faults);
        // An empty capture whose reason is known needs no second fault.
        if self.cameras.iter().all(|camera| camera.is_test || camera.shots.is_empty()) && faults.n() == 0 {
            faults.add(&path, "", "has no image to train on", "add images, or choose other test cameras");
        }
        self.foretell(&faults);
        let shots = || self.cameras.iter().flat_map(|camera| &camera.shots);
        let n_with = |file: fn(&Shot) -> &Option<PathBuf>| shots().filter(|shot| file(shot).is_some()).count();
        let decoded = |camera: &Camera| 4 * camera.intrinsics.n_pixels() * camera.shots.len() as u64;
        let report = Report {
            path: path.clone(),
            format: format.to_owned(),
            n_frames: self.n_frames,
            fps: self.fps,
            n_cameras: self.cameras.len() - n_photos,
            n_test_cameras: self.cameras.iter().filter(|camera| camera.is_test).count(),
            n_photos,
            n_images: shots().count(),
            n_masks: n_with(|shot| &shot.mask),
            n_foregrounds: n_with(|shot| &shot.foreground),
            n_alphas,
            n_flows: n_with(|shot| &shot.flow),
            n_depths: n_with(|shot| &shot.depth),
            n_sounds: self.n_sounds,
            n_points: self.points.len(),
            has_frame_points: self.frame_points.is_some(),
            bytes_decoded: self.cameras.iter().map(decoded).sum(),
            notes: self.notes.clone(),
            n_faults: faults.n(),
            faults: faults.kept,
        };
        let capture = Capture {
            path,
            fps: self.fps,
            n_frames: self.n_frames,
            reference_frame: self.reference_frame,
            cameras: self.cameras,
            points: self.points,
            photo_points,
            background: settings.background,
            frame_points: self.frame_points,
            true_offsets: self.true_offsets,
            viewpoints: Vec::new(),
            calibration: BTreeMap::new(),
            notes: self.notes,
            settings: settings.clone(),
            moved: Similarity::default(),
        };
        (capture, report)
    }

    /// Drops the frames that are not used, and counts the others from 0.
    pub fn cut(&mut self, path: &Path, frames: Frames, faults: &mut Faults) {
        let (n, n_used) = (self.n_frames, frames.of(self.n_frames).len() as u32);
        if n_used == n || n > MAX_FRAMES {
            return;
        }
        if n_used == 0 {
            let remedy = "ask for frames of the clip, which are counted from 0";
            faults.add(path, "--frames", format!("begins at frame {}, the clip has {n} frames", frames.from), remedy);
            return;
        }
        self.notes.push(match frames {
            Frames { from: 0, every: 1, .. } => format!("only the first {n_used} of {n} frames are used"),
            _ => format!("only {n_used} of {n} frames are used: {frames}"),
        });
        for camera in &mut self.cameras {
            let shots = std::mem::take(&mut camera.shots).into_iter();
            let used = shots.filter_map(|shot| Some(Shot { frame: frames.index(shot.frame, n)?, ..shot }));
            // The flow of the last frame leads nowhere.
            let flow = |shot: &Shot| frames.every == 1 && shot.frame + 1 < n_used;
            camera.shots = used.map(|shot| Shot { flow: shot.flow.clone().filter(|_| flow(&shot)), ..shot }).collect();
        }
        if let Some(points) = &mut self.frame_points {
            points.frames = frames;
        }
        self.true_offsets.values_mut().for_each(|offset| *offset /= f64::from(frames.every));
        self.fps /= f64::from(frames.every);
        self.n_frames = n_used;
        // The last used frame that is not behind the reference frame stands for it, or the first one.
        let past = self.reference_frame.saturating_sub(frames.from);
        self.reference_frame = (past / frames.every).min(n_used - 1);
    }

    pub fn lens(&self, camera: &Camera) -> Lens {
        let distortion = self.distorted.get(&camera.name).copied().unwrap_or(Distortion::None);
        Lens { intrinsics: camera.intrinsics, distortion }
    }

    /// Only pinholes are trained: one fault for all lenses, behind those that `ivv prepare` would stop at too.
    fn check_lenses(&self, path: &Path, faults: &mut Faults) {
        let mut lenses: Vec<Lens> = Vec::new();
        for lens in self.cameras.iter().map(|camera| self.lens(camera)) {
            if lens.distortion != Distortion::None && !lenses.contains(&lens) {
                lenses.push(lens);
            }
        }
        let models: BTreeSet<&str> = lenses.iter().map(|lens| lens.distortion.model()).collect();
        let models = models.into_iter().collect::<Vec<_>>().join(", ");
        let reason = match lenses.len() {
            0 => return,
            1 => format!("the lens distorts ({models}); only pinholes are trained"),
            n => format!("{n} lenses distort ({models}); only pinholes are trained"),
        };
        let remedy = format!("`ivv prepare {} -o CAPTURE` takes seconds: it undistorts the images", path.display());
        faults.add(&self.calibration, "", reason, remedy);
    }

    fn check_clip(&self, faults: &mut Faults) {
        if faults.n() > 0 && self.cameras.is_empty() {
            return;
        }
        if !RATES.contains(&self.fps) {
            let reason =
                format!("has {} frames per second, {} to {} are allowed", self.fps, RATES.start(), RATES.end());
            faults.add(&self.calibration, "field `fps`", reason, "give the rate at which the pictures were taken");
        }
        if !(1..=MAX_FRAMES).contains(&self.n_frames) {
            let reason = format!("has {} frames, 1 to {MAX_FRAMES} are allowed", self.n_frames);
            faults.add(&self.calibration, "", reason, "give the number of frames of the clip");
        } else if self.reference_frame >= self.n_frames {
            let reason = format!("is {}, the clip has {} frames", self.reference_frame, self.n_frames);
            faults.add(&self.calibration, "reference frame", reason, "choose a frame of the clip");
        }
    }

    fn check_images(&mut self, settings: &CaptureSettings, faults: &mut Faults) -> usize {
        if settings.rescale {
            self.cameras.iter_mut().for_each(rescale);
        }
        if let Some(factor) = common_factor(&self.cameras) {
            self.cameras.iter_mut().for_each(rescale);
            let size = format!("images of {factor} of the calibration's size");
            self.notes.push(format!("{size} in all cameras: the calibration is scaled to them"));
        }
        self.check_sizes(faults);
        self.note_alpha(settings)
    }

    /// Compares the size of every image, mask and prior with its camera's, with all cores: network disks answer slowly.
    fn check_sizes(&mut self, faults: &mut Faults) {
        let of_picture: ReadSize = |file| read_size(file).map_err(Error::from);
        let mut files: Vec<(&Camera, &PathBuf, ReadSize)> = Vec::new();
        for camera in &self.cameras {
            for shot in &camera.shots {
                files.extend(shot.pictures().map(|file| (camera, file, of_picture)));
                files.extend(shot.flow.iter().map(|file| (camera, file, flow_size as ReadSize)));
                files.extend(shot.depth.iter().map(|file| (camera, file, depth_size as ReadSize)));
            }
        }
        let read = |index: usize| {
            let (_, file, size) = files[index];
            Ok(size(file))
        };
        let mut n_turned = 0_usize;
        let sizes = in_parallel(files.len(), threads(), read, |_| {}).unwrap_or_default();
        for ((camera, file, _), size) in files.iter().zip(sizes) {
            let calibrated = (camera.intrinsics.width, camera.intrinsics.height);
            let Some((width, height)) = faults.take(size).filter(|size| *size != calibrated) else { continue };
            if (height, width) == calibrated && is_turned(file) {
                n_turned += 1;
                continue;
            }
            // Without the camera's name, so that faults of one kind can be told together.
            let (w, h) = calibrated;
            let reason = format!("is {width} x {height}, its camera is calibrated for {w} x {h}");
            let remedy = "give the images of the calibration, or scale the calibration with --rescale";
            faults.add(file, "", reason, remedy);
        }
        if n_turned > 0 {
            self.notes.push(format!(
                "images that carry an EXIF turn, and fit their cameras only so: {n_turned}; they are turned"
            ));
        }
    }

    /// Counts the images that have an alpha channel, and takes it as their foreground mask where that is asked for.
    fn note_alpha(&mut self, settings: &CaptureSettings) -> usize {
        let mut n = 0;
        for camera in &mut self.cameras {
            // Images of a camera are of one kind.
            if !camera.shots.first().is_some_and(|shot| has_alpha(&shot.image)) {
                continue;
            }
            n += camera.shots.len();
            if settings.alpha == Alpha::Mask {
                for shot in camera.shots.iter_mut().filter(|shot| shot.foreground.is_none()) {
                    shot.foreground = has_alpha(&shot.image).then(|| shot.image.clone());
                }
            }
        }
        match (n, settings.alpha) {
            (0, Alpha::Background) => {}
            (0, Alpha::Mask) => self.notes.push("--alpha mask changes nothing: no image has an alpha channel".to_owned()),
            (_, Alpha::Mask) => self.notes.push(format!("images whose alpha is taken as their foreground mask: {n}")),
            (_, Alpha::Background) => self.notes.push(format!(
                "images with an alpha channel: {n}; the background shows through it (--alpha mask takes it as a foreground \
                 mask too)"
            )),
        }
        n
    }

    fn check_cameras(&self, settings: &CaptureSettings, faults: &mut Faults) {
        let mut names = HashSet::new();
        for camera in &self.cameras {
            let place = camera_place(&camera.name);
            if !names.insert(camera.name.as_str()) {
                let remedy = "give every camera or image its own name, also without its extension";
                faults.add(&self.calibration, &place, "has the name of an earlier one", remedy);
            }
            let Intrinsics { width, height, .. } = camera.intrinsics;
            if camera.intrinsics.n_pixels() > MAX_PIXELS {
                let reason = format!("has {width} x {height} pixels, at most {MAX_PIXELS}");
                faults.add(&self.calibration, &place, reason + " are allowed", "give smaller images");
            }
            if let Some(reason) = self.lens(camera).fault() {
                faults.add(&self.calibration, &place, reason, "calibrate the camera again, or correct the file");
                continue;
            }
            let moving = camera.shots.iter().filter_map(|shot| Some((shot.frame, shot.world_to_camera.as_ref()?)));
            let fixed = moving.clone().next().is_none().then_some((0, &camera.world_to_camera));
            for (frame, pose) in moving.chain(fixed) {
                let checked = camera.view(frame, self.n_frames, pose, settings.background).check();
                let far = pose.translation.abs().max_element() > MAX_COORDINATE;
                if let Some((field, reason, remedy)) = checked {
                    let remedy = self.pose_remedy.unwrap_or(remedy);
                    faults.add(&self.calibration, format!("{place}, frame {frame}, {field}"), reason, remedy);
                } else if far {
                    let reason = format!("has a position beyond {MAX_COORDINATE}");
                    faults.add(&self.calibration, format!("{place}, frame {frame}"), reason, "scale the scene");
                }
            }
        }
    }

    fn choose_test_cameras(&mut self, settings: &CaptureSettings, faults: &mut Faults) {
        let Some(chosen) = &settings.test_cameras else { return };
        let names: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("test cameras", chosen, &names, &self.calibration, faults);
        self.cameras.iter_mut().for_each(|camera| camera.is_test = chosen.contains(&camera.name));
    }
}

/// Adds a fault for each name that no camera has.
pub(crate) fn check_names<'a>(
    place: &str,
    names: impl IntoIterator<Item = &'a String>,
    cameras: &[&str],
    file: &Path,
    faults: &mut Faults,
) {
    for name in names.into_iter().filter(|name| !cameras.contains(&name.as_str())) {
        let some = cameras[..cameras.len().min(5)].join(", ");
        let reason = format!("no camera is named `{}`", name.escape_debug());
        faults.add(file, place, reason, format!("there are {} cameras: {some}, ...", cameras.len()));
    }
}

/// The one factor, other than 1, by which the images of all cameras differ from their calibration, as a word: `1/4` or a number.
fn common_factor(cameras: &[Camera]) -> Option<String> {
    let (mut low, mut high) = (0.0_f64, f64::INFINITY);
    for camera in cameras {
        let Some((width, height)) = camera.shots.iter().find_map(|shot| read_size(&shot.image).ok()) else { continue };
        for (found, calibrated) in [(width, camera.intrinsics.width), (height, camera.intrinsics.height)] {
            let [found, calibrated] = [found, calibrated].map(f64::from);
            // Rounded to the nearest, or down.
            (low, high) = (low.max((found - 0.5) / calibrated), high.min((found + 1.0) / calibrated));
        }
    }
    if !(low < high && high.is_finite()) || (low..=high).contains(&1.0) {
        return None;
    }
    let parts = (2.0 / (low + high)).round();
    let is_part = parts > 1.0 && (low..=high).contains(&(1.0 / parts));
    Some(if is_part { format!("1/{parts}") } else { format!("{:.4}", 0.5 * (low + high)) })
}

/// Scales intrinsics to the size of the first readable image, also when its shape is another.
fn rescale(camera: &mut Camera) {
    let Some((width, height)) = camera.shots.iter().find_map(|shot| read_size(&shot.image).ok()) else { return };
    camera.intrinsics = camera.intrinsics.scaled(width, height);
}
