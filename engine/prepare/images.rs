//! The pictures of a capture: decoded or taken over, scaled, undistorted.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::imageops::FilterType;
use image::{DynamicImage, ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

use super::fit::{Part, fitted};
use super::journal::{Journal, make_folder};
use super::settings::{ImageFormat, JPEG_QUALITY, PrepareSettings, Progress};
use super::source::{Footage, Source, SourceCamera};
use super::video::{self, Selection, Video};
use crate::error::{Error, Result};
use crate::files::{open_file, write_atomic};
use crate::parallel::in_parallel;
use crate::scene::capture::{Faults, RATES, Shot, alpha_of, decode_image, read_size};
use crate::scene::prior::{read_depth, read_flow, write_depth, write_flow};
use crate::scene::undistort::{Distortion, Lens, Undistortion};
use crate::scene::{Intrinsics, Pose};

/// Rates differ when their ratio is farther from 1.
const RATE_TOLERANCE: f64 = 1e-3;

/// What becomes of a source's pictures.
pub(super) struct Images {
    pub output: PathBuf,
    pub cameras: Vec<Camera>,
    /// Frames per second of the capture.
    pub fps: f64,
    pub notes: Vec<String>,
    select: Selection,
    format: ImageFormat,
    threads: usize,
    /// See [`Journal::begin`].
    made_from: Value,
}

/// A camera of the capture.
pub(super) struct Camera {
    pub name: String,
    pub is_test: bool,
    /// First frame of the footage that is taken.
    pub start: u32,
    /// Of the finished pictures.
    pub pinhole: Lens,
    /// One, or one for each frame when the camera moves.
    pub poses: Vec<Pose>,
    /// Of the pictures as they are recorded.
    recorded: (u32, u32),
    /// What is taken of them.
    part: Part,
    /// Of that part, scaled.
    pub lens: Lens,
    material: Material,
}

enum Material {
    Video(PathBuf, Video),
    /// By frame of the capture.
    Images(Vec<Shot>),
}

enum Job {
    Video(usize),
    Image(usize, u32),
}

impl Images {
    /// Compares the cameras with their footage and with each other; everything that does not fit is a fault.
    pub fn plan(source: &Source, settings: &PrepareSettings, faults: &mut Faults) -> Images {
        let mut notes = Vec::new();
        let material: Vec<_> = source.cameras.iter().map(|camera| Recorded::look(camera, source, faults)).collect();
        let counts: Vec<_> =
            material.iter().zip(&source.cameras).filter_map(|(m, c)| Some((m.as_ref()?.n_frames, &c.name))).collect();
        let (least, most) = (counts.iter().min(), counts.iter().max());
        if let (Some((least, shortest)), Some((most, longest))) = (least, most)
            && least != most
        {
            notes.push(format!(
                "the cameras have different numbers of frames, {least} (`{shortest}`) to {most} (`{longest}`): \
                 what all have is used, in the hope that they begin together (--shift tells when they do not)"
            ));
        }
        let rates: Vec<f64> = material.iter().flatten().filter_map(|recorded| recorded.fps).collect();
        if let Some(other) = rates.iter().find(|rate| (*rate / rates[0] - 1.0).abs() > RATE_TOLERANCE) {
            notes.push(format!(
                "the cameras have different rates, {} and {other} frames per second: their frames are paired by number",
                rates[0]
            ));
        }
        let PrepareSettings { start, every, ref shifts, .. } = *settings;
        let left = |n: u32, name: &str| u32::try_from(i64::from(n) - i64::from(settings.shift(name))).unwrap_or(0);
        let available = counts.iter().map(|(n, name)| left(*n, name)).min().unwrap_or(0);
        let n = available.saturating_sub(start).div_ceil(every).min(settings.frames.unwrap_or(u32::MAX));
        if n == 0 && faults.n() == 0 {
            let reason = format!("begins at frame {start}, the cameras have {available}");
            faults.add(&source.calibration, "--start", reason, "begin earlier");
        }
        if settings.frames.is_some_and(|frames| frames > n) && n > 0 {
            notes.push(format!("only {n} frames are there"));
        }
        let select = Selection { start, every, n };
        let fps = rates.first().copied().or(source.fps).unwrap_or(settings.capture.fps) / f64::from(every);
        if !RATES.contains(&fps) {
            let reason = format!("has {fps} frames per second, {} to {} are allowed", RATES.start(), RATES.end());
            faults.add(&source.calibration, "", reason, "give the rate at which the pictures were taken with --fps");
        }
        let mut planned = Planned { source, settings, select, notes, of_cameras: Vec::new(), faults };
        let pairs = source.cameras.iter().zip(material);
        let cameras: Vec<Camera> = pairs.filter_map(|(camera, material)| planned.camera(camera, material?)).collect();
        let mut notes = planned.notes;
        notes.extend(grouped(&planned.of_cameras, source.cameras.len()));
        if cameras.iter().all(|camera| camera.is_test) && faults.n() == 0 {
            let remedy = "choose fewer cameras with --test-cameras";
            faults.add(&source.calibration, "", "has only test cameras", remedy);
        }
        let mut made_from = json!({
            "source": settings.source.to_string_lossy(), "source format": source.format, "start": start, "every": every, "frames": n,
            "scale": settings.scale, "format": settings.format, "cameras": cameras.iter().map(Camera::stamp).collect::<Vec<_>>(),
        });
        if !shifts.is_empty() {
            made_from["shifts"] = json!(shifts);
        }
        let (output, format, threads) = (settings.output.clone(), settings.format, settings.threads);
        Images { output, cameras, fps, notes, select, format, threads, made_from }
    }

    pub fn n_frames(&self) -> u32 {
        self.select.n
    }

    /// Seconds of a camera's footage at which the clip begins, and its length.
    fn span(&self, camera: &Camera) -> (f64, f64) {
        let rate = self.fps * f64::from(self.select.every);
        (f64::from(camera.start) / rate, f64::from(self.select.n) / self.fps)
    }

    pub fn select(&self) -> Selection {
        self.select
    }

    pub fn test_cameras(&self) -> Vec<String> {
        self.cameras.iter().filter(|camera| camera.is_test).map(|camera| camera.name.clone()).collect()
    }

    /// Name of an image below `images/`.
    pub fn image_name(&self, camera: &Camera, frame: u32) -> String {
        let taken_over = camera.taken_over(frame);
        let extension = taken_over.and_then(|shot| shot.image.extension()?.to_str()).unwrap_or(self.format.extension());
        format!("{}/{frame:05}.{}", camera.name, extension.to_lowercase())
    }

    /// Makes the pictures that are not there yet.
    #[tracing::instrument(level = "info", name = "images", skip_all)]
    pub fn make(&self, journal: &mut Journal, progress: &(dyn Fn(Progress) + Sync)) -> Result<()> {
        journal.begin("images", self.made_from.clone())?;
        let n = self.select.n;
        let mut jobs = Vec::new();
        for (index, camera) in self.cameras.iter().enumerate() {
            make_folder(&self.output.join("images").join(&camera.name))?;
            match &camera.material {
                Material::Video(..) => jobs.push(Job::Video(index)),
                Material::Images(_) => jobs.extend((0..n).map(|frame| Job::Image(index, frame))),
            }
        }
        let (done, total) = (AtomicUsize::new(0), self.cameras.len() * n as usize);
        let tell = |piece: &str| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(Progress { stage: "images", done, total, piece });
        };
        let work = |index: usize| match jobs[index] {
            Job::Video(camera) => self.decode_video(&self.cameras[camera], &tell),
            Job::Image(camera, frame) => self.convert_image(&self.cameras[camera], frame, &tell),
        };
        in_parallel(jobs.len(), self.threads, work, |_| {}).map(|_| ())
    }

    /// The sound of videos that have some.
    pub fn write_sound(&self) -> Result<()> {
        for camera in &self.cameras {
            if let Material::Video(path, video) = &camera.material {
                let (from, length) = self.span(camera);
                let to = self.output.join(format!("audio/{}.wav", camera.name));
                if video.has_sound && !to.exists() {
                    make_folder(&self.output.join("audio"))?;
                    video::sound(path, from, length, &to)?;
                }
            }
        }
        Ok(())
    }

    fn decode_video(&self, camera: &Camera, tell: &dyn Fn(&str)) -> Result<()> {
        let Material::Video(path, _) = &camera.material else { return Ok(()) };
        let maker = Maker::new(self, camera);
        let image = |frame: u32| self.output.join("images").join(self.image_name(camera, frame));
        let is_done = |frame: &u32| image(*frame).is_file() && maker.mask_is_done(*frame);
        // What an earlier run decoded is not decoded again.
        let first =
            (0..self.select.n).take_while(is_done).map(|frame| tell(&self.image_name(camera, frame))).count() as u32;
        if first == self.select.n {
            return Ok(());
        }
        let Selection { every, n, .. } = self.select;
        let rest = Selection { start: camera.start + first * every, every, n: n - first };
        let threads = (self.threads / self.cameras.len().max(1)).max(1);
        video::decode(
            path,
            rest,
            camera.part,
            (camera.lens.intrinsics.width, camera.lens.intrinsics.height),
            threads,
            |index, rgb| {
                let frame = first + index;
                if !image(frame).is_file() {
                    let (pixels, _) = rgb.as_chunks::<3>();
                    self.write(&image(frame), &maker.image(pixels), &camera.pinhole, ExtendedColorType::Rgb8)?;
                }
                maker.write_mask(frame, None)?;
                tell(&self.image_name(camera, frame));
                Ok(())
            },
        )
    }

    fn convert_image(&self, camera: &Camera, frame: u32, tell: &dyn Fn(&str)) -> Result<()> {
        let Material::Images(shots) = &camera.material else { return Ok(()) };
        let shot = &shots[frame as usize];
        let maker = Maker::new(self, camera);
        let name = self.image_name(camera, frame);
        let to = self.output.join("images").join(&name);
        if !to.is_file() {
            if camera.taken_over(frame).is_some() {
                take_over(&shot.image, &to)?;
            } else {
                let image = maker.scaled(&shot.image, FilterType::Triangle)?;
                if !image.color().has_alpha() {
                    let rgb = image.into_rgb8();
                    let pixels = maker.image(rgb.as_raw().as_chunks::<3>().0);
                    self.write(&to, &pixels, &camera.pinhole, ExtendedColorType::Rgb8)?;
                } else if self.format == ImageFormat::Png {
                    let rgba = image.into_rgba8();
                    let pixels = maker.image(rgba.as_raw().as_chunks::<4>().0);
                    self.write(&to, &pixels, &camera.pinhole, ExtendedColorType::Rgba8)?;
                } else {
                    let reason = "has an alpha channel, which JPEG does not hold";
                    return Err(Error::data(&shot.image, "", reason, "give --format png"));
                }
            }
        }
        maker.write_mask(frame, shot.mask.as_deref())?;
        for (folder, mask) in [("foreground", &shot.foreground), ("covisible", &shot.covisible)] {
            if let Some(mask) = mask {
                maker.write_plane(folder, frame, mask, *mask == shot.image)?;
            }
        }
        maker.write_priors(frame, shot)?;
        tell(&name);
        Ok(())
    }

    fn write<const C: usize>(&self, to: &Path, pixels: &[[u8; C]], lens: &Lens, kind: ExtendedColorType) -> Result<()> {
        let (bytes, width, height) = (pixels.as_flattened(), lens.intrinsics.width, lens.intrinsics.height);
        write_atomic(to, |to| {
            let done = match self.format {
                ImageFormat::Png => PngEncoder::new(to).write_image(bytes, width, height, kind),
                ImageFormat::Jpeg => {
                    JpegEncoder::new_with_quality(to, JPEG_QUALITY).write_image(bytes, width, height, kind)
                }
            };
            done.map_err(std::io::Error::other)
        })
    }
}

impl Camera {
    /// Whether its pictures stay as they are.
    fn is_as_recorded(&self) -> bool {
        let whole = (self.lens.intrinsics.width, self.lens.intrinsics.height) == self.recorded
            && self.part == Part::whole(self.recorded);
        whole && self.lens.distortion == Distortion::None
    }

    /// The shot of a frame when its image is taken over as it is.
    fn taken_over(&self, frame: u32) -> Option<&Shot> {
        match &self.material {
            Material::Images(shots) if self.is_as_recorded() => shots.get(frame as usize),
            _ => None,
        }
    }

    /// A place of the recorded pictures in the scaled part.
    pub fn scaled(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Part { x: left, y: top, width, height } = self.part;
        let scale = |side: u32, of: u32| f64::from(side) / f64::from(of);
        let (across, down) = (scale(self.lens.intrinsics.width, width), scale(self.lens.intrinsics.height, height));
        [(x - f64::from(left)) * across, (y - f64::from(top)) * down]
    }

    /// What the camera's pictures are made from.
    fn stamp(&self) -> Value {
        // Not every name of a file is text, which JSON must be.
        let file = |path: &Path| {
            let name = path.to_string_lossy();
            let data = fs::metadata(path).ok();
            let time = data.as_ref().and_then(|data| data.modified().ok());
            let seconds =
                time.and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok()).map(|age| age.as_secs());
            json!([name, data.map(|data| data.len()), seconds])
        };
        let footage = match &self.material {
            Material::Video(path, _) => vec![file(path)],
            Material::Images(shots) => shots.iter().flat_map(Shot::pictures).map(|path| file(path)).collect(),
        };
        json!({ "name": self.name, "lens": self.lens, "pinhole": self.pinhole, "footage": footage })
    }
}

/// Footage that has been looked at.
struct Recorded {
    size: (u32, u32),
    n_frames: u32,
    fps: Option<f64>,
    video: Option<Video>,
}

impl Recorded {
    fn look(camera: &SourceCamera, source: &Source, faults: &mut Faults) -> Option<Recorded> {
        match &camera.footage {
            Footage::Video(path) => {
                let video = faults.take(video::probe(path))?;
                let Video { width, height, n_frames, fps, .. } = video;
                Some(Recorded { size: (width, height), n_frames, fps: Some(fps), video: Some(video) })
            }
            Footage::Images(shots) => {
                let Some(last) = shots.iter().map(|shot| shot.frame).max() else {
                    let place = format!("camera `{}`", camera.name.escape_debug());
                    faults.add(&source.calibration, place, "has no image", "add its images, or remove the camera");
                    return None;
                };
                let size = faults.take(read_size(&shots[0].image).map_err(Error::from))?;
                Some(Recorded { size, n_frames: last + 1, fps: None, video: None })
            }
        }
    }
}

impl Recorded {
    /// The first picture.
    fn first(&self, footage: &Footage) -> Result<Vec<[u8; 3]>> {
        let (width, height) = self.size;
        match footage {
            Footage::Video(path) => {
                let mut pixels = Vec::new();
                let select = Selection { start: 0, every: 1, n: 1 };
                video::decode(path, select, Part::whole(self.size), self.size, 1, |_, rgb| {
                    pixels.extend_from_slice(rgb.as_chunks().0);
                    Ok(())
                })?;
                Ok(pixels)
            }
            Footage::Images(shots) => {
                let image = decode_image(&shots[0].image, width, height)?.into_rgb8();
                Ok(image.as_raw().as_chunks().0.to_vec())
            }
        }
    }
}

/// What the plan of a camera needs.
struct Planned<'a> {
    source: &'a Source,
    settings: &'a PrepareSettings,
    select: Selection,
    notes: Vec<String>,
    /// Cameras by name, and what is noted of each.
    of_cameras: Vec<(String, String)>,
    faults: &'a mut Faults,
}

/// Notes of cameras, those of one text together.
fn grouped(of_cameras: &[(String, String)], n_cameras: usize) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for (camera, note) in of_cameras {
        match groups.iter_mut().find(|(text, _)| text == note) {
            Some((_, cameras)) => cameras.push(camera),
            None => groups.push((note, vec![camera])),
        }
    }
    let told = groups.into_iter().map(|(note, cameras)| match cameras.as_slice() {
        [camera] => format!("camera `{}`: {note}", camera.escape_debug()),
        all if all.len() == n_cameras => format!("all {n_cameras} cameras: {note}"),
        some => format!("{} cameras ({}): {note}", some.len(), some.join(", ")),
    });
    told.collect()
}

impl Planned<'_> {
    fn camera(&mut self, camera: &SourceCamera, recorded: Recorded) -> Option<Camera> {
        let place = format!("camera `{}`", camera.name.escape_debug());
        let (width, height) = recorded.size;
        let fitted = fitted(&camera.lens, recorded.size, || recorded.first(&camera.footage));
        let rescaled = self.settings.capture.rescale.then(|| {
            let note = format!("the calibration is scaled to the pictures, {width} x {height}");
            (camera.lens.resized(width, height), Part::whole(recorded.size), Some(note))
        });
        let Some((lens, part, note)) = self.faults.take(fitted)?.or(rescaled) else {
            let Intrinsics { width: w, height: h, .. } = camera.lens.intrinsics;
            let reason = format!("is calibrated for {w} x {h}, its pictures are {width} x {height}");
            let remedy =
                "give the footage of this calibration, calibrate again, or scale the calibration with --rescale";
            self.faults.add(&self.source.calibration, place, reason, remedy);
            return None;
        };
        self.of_cameras.extend(note.map(|note| (camera.name.clone(), note)));
        let side = |side: u32| ((f64::from(side) * self.settings.scale).round() as u32).max(1);
        let lens = lens.resized(side(part.width), side(part.height));
        let kept = |pinhole: &Lens| {
            let (kept, whole) = (pinhole.intrinsics, lens.intrinsics);
            kept.width >= whole.width.div_ceil(16) && kept.height >= whole.height.div_ceil(16)
        };
        let Some(pinhole) = lens.pinhole().filter(kept) else {
            let reason = "has a distortion after which no rectangle of a sixteenth of the picture's sides is left";
            self.faults.add(&self.source.calibration, place, reason, "calibrate it again");
            return None;
        };
        let shift = self.settings.shift(&camera.name);
        let Some(start) = self.select.start.checked_add_signed(shift) else {
            let reason = format!("is to begin {} frames before its footage", shift.unsigned_abs() - self.select.start);
            let remedy = format!("give --start {} or more", shift.unsigned_abs());
            self.faults.add(&self.source.calibration, place, reason, remedy);
            return None;
        };
        let frames: Vec<u32> = (0..self.select.n).map(|i| start + i * self.select.every).collect();
        let poses = if camera.poses.is_empty() {
            vec![camera.pose]
        } else {
            let absent: Vec<_> = frames.iter().filter(|frame| !camera.poses.contains_key(frame)).collect();
            if let Some(first) = absent.first() {
                let reason = format!("moves and has no pose at {} frames, the first is {first}", absent.len());
                self.faults.add(&self.source.calibration, place, reason, "add the poses, or take fewer frames");
                return None;
            }
            frames.iter().filter_map(|frame| camera.poses.get(frame).copied()).collect()
        };
        let material = match (&camera.footage, recorded.video) {
            (Footage::Video(path), Some(video)) => Material::Video(path.clone(), video),
            (Footage::Images(shots), _) => {
                let mut shots = self.shots(&place, shots, &frames, recorded.size)?;
                self.choose_flow(&mut shots);
                Material::Images(shots)
            }
            (Footage::Video(_), None) => return None,
        };
        let (name, is_test) = (camera.name.clone(), camera.is_test);
        Some(Camera { name, is_test, start, pinhole, poses, recorded: recorded.size, part, lens, material })
    }

    /// Flow leads to the next frame of the source, which must be the next frame of the capture.
    fn choose_flow(&mut self, shots: &mut [Shot]) {
        // The frame that the last flow leads to is not taken.
        shots.last_mut().map(|shot| shot.flow.take());
        if self.settings.every == 1 || shots.iter().all(|shot| shot.flow.is_none()) {
            return;
        }
        let note = "flow does not skip frames: left out".to_owned();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
        for shot in shots {
            shot.flow = None;
        }
    }

    /// The shots of the chosen frames, each compared with the size of the camera's images.
    fn shots(&mut self, place: &str, shots: &[Shot], frames: &[u32], size: (u32, u32)) -> Option<Vec<Shot>> {
        let mut chosen = Vec::new();
        for frame in frames {
            match shots.iter().find(|shot| shot.frame == *frame) {
                Some(shot) => chosen.push(shot.clone()),
                None => {
                    let reason =
                        format!("has no image of frame {frame}; a capture folder has all frames of every camera");
                    let remedy = "add it, choose other frames, or train on the source as it is";
                    self.faults.add(&self.source.calibration, place, reason, remedy);
                }
            }
        }
        let before = self.faults.n();
        for path in chosen.iter().flat_map(Shot::pictures) {
            if let Some((w, h)) = self.faults.take(read_size(path).map_err(Error::from)).filter(|found| *found != size)
            {
                let reason = format!("is {w} x {h}, the camera's first image is {} x {}", size.0, size.1);
                self.faults.add(path, "", reason, "give images and masks of one size");
            }
        }
        (chosen.len() == frames.len() && self.faults.n() == before).then_some(chosen)
    }
}

/// Makes the pictures of a camera.
struct Maker<'a> {
    output: &'a Path,
    camera: &'a Camera,
    undistortion: Option<Undistortion>,
    /// From the part as it is recorded to the finished pictures: this one scales too.
    from_recorded: Option<Undistortion>,
    validity: Option<Vec<u8>>,
}

impl<'a> Maker<'a> {
    fn new(images: &'a Images, camera: &'a Camera) -> Self {
        let distorts = camera.lens.distortion != Distortion::None;
        let undistortion = distorts.then(|| Undistortion::new(camera.lens, camera.pinhole));
        let validity = undistortion.as_ref().and_then(Undistortion::validity);
        let Part { width, height, .. } = camera.part;
        let recorded = || Undistortion::new(camera.lens.resized(width, height), camera.pinhole);
        let from_recorded = (!camera.is_as_recorded()).then(recorded);
        Maker { output: &images.output, camera, undistortion, from_recorded, validity }
    }

    fn image<const C: usize>(&self, pixels: &[[u8; C]]) -> Vec<[u8; C]> {
        self.undistortion.as_ref().map_or_else(|| pixels.to_vec(), |undistortion| undistortion.image(pixels))
    }

    /// An image of the recorded size, scaled.
    fn scaled(&self, path: &Path, filter: FilterType) -> Result<DynamicImage> {
        let (width, height) = self.camera.recorded;
        let mut image = decode_image(path, width, height)?;
        let (part, Intrinsics { width, height, .. }) = (self.camera.part, self.camera.lens.intrinsics);
        if part != Part::whole(self.camera.recorded) {
            image = image.crop_imm(part.x, part.y, part.width, part.height);
        }
        if (width, height) == (part.width, part.height) {
            return Ok(image);
        }
        Ok(image.resize_exact(width, height, filter))
    }

    fn path(&self, folder: &str, frame: u32) -> PathBuf {
        self.output.join(folder).join(&self.camera.name).join(format!("{frame:05}.png"))
    }

    fn mask_is_done(&self, frame: u32) -> bool {
        self.validity.is_none() || self.path("masks", frame).is_file()
    }

    /// The mask of the source, or what of the undistorted picture is valid, if there is need of one.
    fn write_mask(&self, frame: u32, mask: Option<&Path>) -> Result<()> {
        match (mask, &self.validity) {
            (Some(mask), _) => self.write_plane("masks", frame, mask, false),
            (None, Some(validity)) => self.write_png("masks", frame, validity),
            (None, None) => Ok(()),
        }
    }

    /// A mask, or the alpha of an image, scaled and undistorted.
    fn write_plane(&self, folder: &str, frame: u32, from: &Path, of_alpha: bool) -> Result<()> {
        if self.path(folder, frame).is_file() {
            return Ok(());
        }
        let plane = self.scaled(from, FilterType::Nearest)?;
        let plane = if of_alpha { alpha_of(plane) } else { plane.into_luma8().into_raw() };
        let plane = self.undistortion.as_ref().map_or_else(|| plane.clone(), |undistortion| undistortion.mask(&plane));
        self.write_png(folder, frame, &plane)
    }

    /// What is taken of a plane of the recorded size.
    fn part<T: Copy>(&self, plane: &[T]) -> Vec<T> {
        let Part { x, y, width, height } = self.camera.part;
        let [across, x, width] = [self.camera.recorded.0, x, width].map(|side| side as usize);
        let rows = plane.chunks_exact(across).skip(y as usize).take(height as usize);
        rows.flat_map(|row| &row[x..x + width]).copied().collect()
    }

    /// Flow and depth of the source, scaled and undistorted as the pictures are.
    fn write_priors(&self, frame: u32, shot: &Shot) -> Result<()> {
        let (width, height) = self.camera.recorded;
        let Intrinsics { width: to_width, height: to_height, .. } = self.camera.pinhole.intrinsics;
        let file = |folder: &str, extension: &str| -> Result<Option<PathBuf>> {
            let path = self.path(folder, frame).with_extension(extension);
            if path.is_file() {
                return Ok(None);
            }
            make_folder(&self.output.join(folder).join(&self.camera.name))?;
            Ok(Some(path))
        };
        if let Some(from) = &shot.flow
            && let Some(to) = file("flow", "flo")?
        {
            let mut flow = read_flow(from, width, height)?;
            if let Some(to) = &self.from_recorded {
                flow = to.flow(&self.part(&flow));
            }
            write_flow(&to, &flow, to_width, to_height)?;
        }
        if let Some(from) = &shot.depth
            && let Some(to) = file("depth", "npy")?
        {
            let mut depth = read_depth(from, width, height)?;
            if let Some(to) = &self.from_recorded {
                depth = to.depth(&self.part(&depth));
            }
            write_depth(&to, &depth, to_width, to_height)?;
        }
        Ok(())
    }

    fn write_png(&self, folder: &str, frame: u32, plane: &[u8]) -> Result<()> {
        let path = self.path(folder, frame);
        if path.is_file() {
            return Ok(());
        }
        make_folder(&self.output.join(folder).join(&self.camera.name))?;
        let Intrinsics { width, height, .. } = self.camera.pinhole.intrinsics;
        write_atomic(&path, |to| {
            let encoder = PngEncoder::new(to);
            encoder.write_image(plane, width, height, ExtendedColorType::L8).map_err(std::io::Error::other)
        })
    }
}

/// A file of the source as it is: a hard link where both are on one file system, else a copy.
pub(super) fn take_over(from: &Path, to: &Path) -> Result<()> {
    let fault = |fault: std::io::Error| {
        Error::data(
            from,
            "",
            format!("cannot be copied to {}: {fault}", to.display()),
            "check permissions and free space",
        )
    };
    // A link to the source's own link would follow it, so that moving the source breaks nothing.
    let from_real = fs::canonicalize(from).map_err(fault)?;
    if fs::hard_link(&from_real, to).is_ok() {
        return Ok(());
    }
    let mut file = open_file(&from_real).map_err(fault)?;
    write_atomic(to, |to| std::io::copy(&mut file, to).map(|_| ()))
}
