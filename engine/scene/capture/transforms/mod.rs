//! `transforms.json` of nerfstudio, instant-ngp and D-NeRF. Poses map camera to world, x right, y up, z backward (OpenGL).

mod document;
mod pose;
mod split;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use self::document::{Document, Frame, Unfit};
use crate::scene::Intrinsics;
use crate::scene::capture::{
    Camera, CaptureBuilder, CaptureSettings, Faults, MAX_FRAMES, Named, Shot, Wanted, flat, read_cloud, read_size,
    spelled,
};
use crate::scene::prior::depth_size;
use crate::scene::undistort::{Distortion, Lens};

pub(super) const REMEDY: &str = "correct the file, or export the capture again";
const POSE_REMEDY: &str = "give transform_matrix from camera to world, the camera's axes x right, y up, z back";
/// The files by whose names a folder is recognised, the likelier first.
const FILES: [&str; 2] = ["transforms_train.json", "transforms.json"];

const TIME_TOLERANCE: f64 = 1e-6;
/// How far a time may lie from the grid of frames, in frames.
const GRID_TOLERANCE: f64 = 0.05;
/// Most frames between the two closest times: irregular times have a fine common grid too, but not one of a clip.
const MAX_DIVISION: f64 = 8.0;

/// An image, until images of one place are one camera.
struct Entry {
    camera: Camera,
    distortion: Distortion,
    name: PathBuf,
    shot: Shot,
    time: Option<f64>,
}

pub(super) fn is_transforms(named: &Named) -> bool {
    named.file.is_some() || FILES.iter().any(|name| named.folder.join(name).is_file())
}

pub(super) fn read(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let [train, plain] = FILES.map(|name| path.join(name));
    let split = train.is_file() && named.file.as_ref().is_none_or(|file| file.ends_with(FILES[0]));
    let calibration = named.file.clone().unwrap_or(if split { train } else { plain.clone() });
    let mut builder = CaptureBuilder::still(settings, calibration.clone());
    builder.pose_remedy = Some(POSE_REMEDY);
    let mut reader = FrameReader { path, settings, builder: &mut builder, faults };
    let mut entries = reader.entries(&calibration);
    let mut has_test = entries.iter().any(|entry| entry.camera.is_test);
    let test = path.join("transforms_test.json");
    if split && test.is_file() {
        let tests = reader.entries(&test);
        has_test |= split::join(&mut entries, tests, &mut builder.notes);
    }
    let unread = [plain, path.join("transforms_val.json")].into_iter().filter(|file| split && file.is_file());
    for file in unread {
        let name = file.file_name().unwrap_or_default().display();
        builder.notes.push(format!("{name} is not read: transforms_train.json and transforms_test.json are"));
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    split::check_twice(&mut entries, &calibration, &mut builder.notes, faults);
    if !has_test && settings.test_every > 0 {
        entries.iter_mut().step_by(settings.test_every).for_each(|entry| entry.camera.is_test = true);
    }
    match frames_of(&entries) {
        Ok((frames, n_frames)) => {
            entries.iter_mut().zip(frames).for_each(|(entry, frame)| entry.shot.frame = frame);
            builder.n_frames = n_frames;
        }
        Err(reason) => faults.add(&calibration, "field `time`", reason, "give every frame a time on one grid, or none"),
    }
    group(entries, &mut builder);
    builder
}

struct ImageFrame<'a> {
    place: String,
    frame: &'a Frame,
    name: PathBuf,
    image: PathBuf,
}

struct FrameReader<'a> {
    path: &'a Path,
    settings: &'a CaptureSettings,
    builder: &'a mut CaptureBuilder,
    faults: &'a mut Faults,
}

impl FrameReader<'_> {
    /// The images that a file lists. The builder gets notes and points.
    fn entries(&mut self, file: &Path) -> Vec<Entry> {
        let Some(document) = self.faults.take(Document::read(file)) else { return Vec::new() };
        if document.frames.is_empty() {
            self.faults.add(file, "field `frames`", "holds no frame", "add at least one");
        }
        self.builder.notes.extend(document.notes());
        let frames = self.images(file, &document.frames);
        let masks = self.beside(file, &frames, "mask", |frame| frame.mask_path.as_ref(), |file| read_size(file).ok());
        let depths =
            self.beside(file, &frames, "depth", |frame| frame.depth_file_path.as_ref(), |file| depth_size(file).ok());
        if let Some(name) = &document.ply_file_path {
            self.read_points(file, name);
        }
        // Where the file gives no size, its images share one.
        let is_given = document.lens.w.is_some() && document.lens.h.is_some();
        let size = frames.iter().filter(|_| !is_given).find_map(|found| read_size(&found.image).ok());
        let (mut entries, mut scales, mut unsized_images) = (Vec::new(), pose::Scales::default(), Vec::new());
        for ((ImageFrame { place, frame, name, image }, mask), depth) in frames.into_iter().zip(masks).zip(depths) {
            let lens = frame.lens.resolved(&document.lens, size);
            let pose = pose::world_to_camera(&frame.transform_matrix, &mut scales);
            match lens.and_then(|lens| Ok((lens, pose?))) {
                Ok((Lens { intrinsics, distortion }, world_to_camera)) => {
                    let tests = document.test_filenames.as_ref();
                    let is_test = tests.is_some_and(|names| names.contains(&frame.file_path));
                    let camera =
                        Camera { name: flat(&name), intrinsics, world_to_camera, is_test, ..Camera::default() };
                    let shot = Shot { image, mask, depth, ..Shot::default() };
                    entries.push(Entry { camera, distortion, name, shot, time: frame.time });
                }
                Err(Unfit { needs_size: true, .. }) if size.is_none() => unsized_images.push(image),
                Err(Unfit { reason, .. }) => self.faults.add(file, place, reason, REMEDY),
            }
        }
        self.builder.notes.extend(scales.note());
        self.add_unsized(file, &unsized_images);
        entries
    }

    fn images<'a>(&mut self, file: &Path, frames: &'a [Frame]) -> Vec<ImageFrame<'a>> {
        let (mut named, mut wanted) = (Vec::new(), Vec::new());
        for (index, frame) in frames.iter().enumerate() {
            let place = format!("frame {index}");
            match spelled(&frame.file_path) {
                Ok(name) => {
                    named.push((place, frame, name.path.clone()));
                    wanted.push(Wanted::from(name));
                }
                Err(reason) => self.faults.add(file, place, reason, REMEDY),
            }
        }
        let asked = self.settings.asked_images().map(|images| self.path.join(images));
        let base = asked.as_deref().unwrap_or(self.path);
        let located = self.builder.locate(base, base, file, &wanted);
        let found = |((place, frame, name), (image, _))| ImageFrame { place, frame, name, image };
        named.into_iter().zip(located).map(found).collect()
    }

    /// The files of another kind that frames name, by frame, without those that are not there or not of their image's size.
    fn beside(
        &mut self,
        file: &Path,
        frames: &[ImageFrame],
        kind: &str,
        name: fn(&Frame) -> Option<&String>,
        size: fn(&Path) -> Option<(u32, u32)>,
    ) -> Vec<Option<PathBuf>> {
        let (mut n_named, mut n_absent, mut n_unfit) = (0_usize, 0_usize, 0_usize);
        let mut of_frame = |found: &ImageFrame| {
            let name = name(found.frame)?;
            n_named += 1;
            let path = match spelled(name) {
                Ok(name) => self.path.join(name.path),
                Err(reason) => {
                    self.faults.add(file, &found.place, reason, REMEDY);
                    return None;
                }
            };
            let is_absent = !path.is_file();
            // An image that is not there has its own fault.
            let is_unfit = !is_absent && read_size(&found.image).is_ok_and(|of_image| size(&path) != Some(of_image));
            (n_absent, n_unfit) = (n_absent + usize::from(is_absent), n_unfit + usize::from(is_unfit));
            (!is_absent && !is_unfit).then_some(path)
        };
        let files = frames.iter().map(&mut of_frame).collect();
        let unfit = "that cannot be read, or are not of the size of their images";
        for (n, what) in [(n_absent, "that are not there"), (n_unfit, unfit)].into_iter().filter(|(n, _)| *n > 0) {
            self.builder.notes.push(format!("{kind} files {what}: {n} of {n_named}; they are not used"));
        }
        files
    }

    /// Points of nerfstudio's `ply_file_path`, which are in the world of the frames.
    fn read_points(&mut self, file: &Path, name: &str) {
        match spelled(name).map(|name| self.path.join(name.path)) {
            Ok(cloud) if cloud.is_file() => {
                self.builder.points = self.faults.take(read_cloud(&cloud)).unwrap_or_default();
            }
            Ok(_) => self.builder.notes.push(format!("the points of `{}` are not there", name.escape_debug())),
            Err(reason) => self.faults.add(file, "field `ply_file_path`", reason, REMEDY),
        }
    }

    /// Without any image that can be read the size is unknown; that they are missing says it better.
    fn add_unsized(&mut self, file: &Path, images: &[PathBuf]) {
        let Some(first) = images.first() else { return };
        let there = images.iter().filter(|image| image.exists());
        let broken: Vec<_> = there.filter_map(|image| read_size(image).err()).collect();
        if broken.is_empty() {
            let (n, at) = (images.len(), first.strip_prefix(self.path).unwrap_or(first).display());
            let reason =
                format!("gives no w and h, and none of the {n} images that it names is there: looked for {at}");
            self.faults.add(file, "", reason, "add the images, or name their folder with --images FOLDER");
        }
        broken.into_iter().for_each(|fault| self.faults.push(fault));
    }
}

/// Images of one place, lens and part at different frames are one camera.
fn group(entries: Vec<Entry>, builder: &mut CaptureBuilder) {
    let cameras = &mut builder.cameras;
    let mut known: HashMap<(Vec<u64>, bool), usize> = HashMap::new();
    for Entry { camera, distortion, shot, .. } in entries {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
        let (pose, lens) = (camera.world_to_camera.rows(), [fx, fy, cx, cy, width.into(), height.into()]);
        let numbers = pose.as_flattened().iter().chain(&lens);
        let key = (numbers.map(|v| v.to_bits()).collect(), camera.is_test);
        let at = known.get(&key).copied();
        match at.filter(|&at| cameras[at].shots.iter().all(|other| other.frame != shot.frame)) {
            Some(at) => cameras[at].shots.push(shot),
            None => {
                known.insert(key, cameras.len());
                builder.distorted.insert(camera.name.clone(), distortion);
                cameras.push(Camera { shots: vec![shot], ..camera });
            }
        }
    }
}

/// Each image's frame and the number of frames. Times must lie on a grid of their greatest common divisor, from frame 0.
fn frames_of(entries: &[Entry]) -> Result<(Vec<u32>, u32), String> {
    let times: Vec<f64> = entries.iter().filter_map(|entry| entry.time).collect();
    if times.is_empty() {
        return Ok((vec![0; entries.len()], 1));
    }
    if times.len() != entries.len() {
        return Err(format!("{} of {} frames have one", times.len(), entries.len()));
    }
    if let Some(time) = times.iter().find(|time| !time.is_finite()) {
        return Err(format!("is {time}"));
    }
    let mut sorted = times.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, span) = (sorted[0], sorted[sorted.len() - 1] - sorted[0]);
    let tolerance = TIME_TOLERANCE * span.max(f64::MIN_POSITIVE);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > tolerance);
    let smallest_gap = gaps.clone().fold(f64::INFINITY, f64::min);
    // Rounded times leave remainders that a smaller step would only follow, hence the bound.
    let step = gaps.fold(0.0_f64, |step, gap| {
        let (mut a, mut b) = (step.max(gap), step.min(gap));
        let smallest = GRID_TOLERANCE * if b > 0.0 { b } else { a };
        while b > smallest {
            (a, b) = (b, (a % b).min(b - a % b));
        }
        a
    });
    if step == 0.0 {
        return Ok((vec![0; entries.len()], 1));
    }
    let n_frames = (span / step).round() + 1.0;
    let grid = times.iter().map(|time| (time - first) / step);
    let too_fine = step * MAX_DIVISION < smallest_gap || n_frames > f64::from(MAX_FRAMES);
    if too_fine || grid.clone().any(|f| (f - f.round()).abs() > GRID_TOLERANCE) {
        return Err(format!("the {} times lie on no common grid of frames", times.len()));
    }
    Ok((grid.map(|f| f.round() as u32).collect(), n_frames as u32))
}
