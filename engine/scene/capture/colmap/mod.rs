//! COLMAP's sparse model, and a plain COLMAP project as a static capture.

mod bin;
mod choice;
mod facing;
mod raw;
mod text;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

pub(crate) use self::choice::chosen_model;
pub(super) use self::choice::model_folder;
use self::facing::Facing;
use self::raw::{DAMAGED, RawCamera, RawImage, RawPoint, STEMS, is_there};
use crate::scene::Pose;
use crate::scene::capture::{
    CaptureBuilder, CaptureSettings, Faults, MAX_COORDINATE, Named, Point, Wanted, check_place, flat, listed, masks,
    read_cloud, spelled,
};
use crate::scene::undistort::Lens;
use encoding_rs::{BIG5, EUC_KR, Encoding, GBK, SHIFT_JIS, WINDOWS_1251, WINDOWS_1252};
use glam::{DVec3, DVec4};

/// Largest deviation of a quaternion's length from 1 that is not worth a note; COLMAP writes all digits.
const QUATERNION_TOLERANCE: f64 = 1e-3;
const SHORTEST_QUATERNION: f64 = 1e-6;
/// Code pages in which COLMAP on Windows writes names that are not ASCII.
const ENCODINGS: [&Encoding; 6] = [GBK, SHIFT_JIS, EUC_KR, BIG5, WINDOWS_1251, WINDOWS_1252];

pub(crate) struct Posed {
    /// Relative, without `..`; the likeliest, where its encoding is unknown.
    pub name: PathBuf,
    pub id: u32,
    pub camera_id: u32,
    pub pose: Pose,
    pub lens: Lens,
    wanted: Wanted,
}

#[derive(Default)]
pub(crate) struct Model {
    pub images: Vec<Posed>,
    pub points: Vec<Point>,
    pub file: PathBuf,
    pub notes: Vec<String>,
}

/// Reads a model, in which `points3D` may be absent, without its faulty parts.
pub(super) fn read_model(folder: &Path, faults: &mut Faults) -> Model {
    read(folder, true, faults)
}

pub(crate) fn read_images(folder: &Path, faults: &mut Faults) -> Model {
    read(folder, false, faults)
}

fn read(folder: &Path, with_points: bool, faults: &mut Faults) -> Model {
    // All files of a model are of one kind, but for a copy of which some were left behind.
    let is_binary = is_there(folder, STEMS[0]).is_none_or(|(_, is_binary)| is_binary);
    let file = |stem: &str| folder.join(format!("{stem}.{}", if is_binary { "bin" } else { "txt" }));
    let [cameras, images, _] = STEMS.map(file);
    let raw = if is_binary { bin::cameras(&cameras, faults) } else { text::cameras(&cameras, faults) };
    let known = check_cameras(&cameras, raw, faults);
    let n_before = faults.n();
    let (raw, n_alone) = if is_binary { (bin::images(&images, faults), 0) } else { text::images(&images, faults) };
    // A model that could not be read whole says nothing of the tracks.
    let ids = (faults.n() == n_before).then(|| raw.iter().map(|image| image.id).collect());
    let mut facing = Facing::default();
    for image in &raw {
        if let Some(Some(lens)) = known.get(&image.camera_id) {
            facing.add_camera(image.id, *lens, image.quaternion, image.translation);
        }
    }
    let mut model = Model { file: images.clone(), ..Model::default() };
    if n_alone > 0 {
        model.notes.push(format!("images without a line of observations behind them, not even a blank one: {n_alone}"));
    }
    check_images(raw, &known, &mut model, faults);
    if with_points {
        let mut checked = CheckedPoints::new(folder, ids);
        checked.read(faults, |point, seen_in| {
            facing.add(point.position, seen_in);
            model.points.push(point);
        });
        if checked.n_astray > 0 {
            let n = checked.n_astray;
            model.notes.push(format!("points seen in images that the model does not have: {n}"));
        }
        // Programs of Gaussian splatting leave their copy of the points beside the cameras.
        let cloud = folder.join("points3D.ply");
        if checked.file.is_none() && cloud.is_file() {
            model.points = faults.take(read_cloud(&cloud)).unwrap_or_default();
        }
        match facing.verdict() {
            Some((reason, Some(remedy))) => faults.add(&images, "", reason, remedy),
            Some((reason, None)) => model.notes.push(reason),
            None => {}
        }
    }
    model
}

/// The cameras by id; `None` for one that is known and faulty.
fn check_cameras(file: &Path, raw: Vec<RawCamera>, faults: &mut Faults) -> HashMap<u32, Option<Lens>> {
    let mut known = HashMap::new();
    for camera in raw {
        let place = format!("{}, camera {}", camera.place, camera.id);
        if known.contains_key(&camera.id) {
            faults.add(file, place, "has the id of an earlier camera", DAMAGED);
            continue;
        }
        let lens = camera.lens().map_err(|(reason, remedy)| faults.add(file, place, reason, remedy));
        known.insert(camera.id, lens.ok());
    }
    known
}

fn check_images(raw: Vec<RawImage>, known: &HashMap<u32, Option<Lens>>, model: &mut Model, faults: &mut Faults) {
    let (mut ids, mut names) = (HashSet::new(), HashSet::new());
    let file = model.file.clone();
    let (mut n_long, mut largest) = (0_usize, 1.0_f64);
    for image in raw {
        let place = format!("{}, image {}", image.place, image.id);
        let mut fault = |reason: String| faults.add(&file, &place, reason, DAMAGED);
        if !ids.insert(image.id) {
            fault("has the id of an earlier image".to_owned());
            continue;
        }
        let (name, pose) = (image.wanted(), image.pose());
        for reason in [name.as_ref().err(), pose.as_ref().err()].into_iter().flatten() {
            fault(reason.clone());
        }
        let lens = known.get(&image.camera_id);
        if lens.is_none() {
            fault(format!("was taken by camera {}, which is not in the list of cameras", image.camera_id));
        }
        let (Ok(wanted), Ok((pose, length)), Some(Some(lens))) = (name, pose, lens) else { continue };
        if (length - 1.0).abs() > QUATERNION_TOLERANCE {
            n_long += 1;
            largest = if (length - 1.0).abs() > (largest - 1.0).abs() { length } else { largest };
        }
        let name = wanted.readings[0].clone();
        if names.insert(name.clone()) {
            let (id, camera_id) = (image.id, image.camera_id);
            model.images.push(Posed { name, id, camera_id, pose, lens: *lens, wanted });
        } else {
            fault(format!("has the name of an earlier image, `{}`", name.display()));
        }
    }
    if n_long > 0 {
        let note = format!("quaternions that are not of length 1: {n_long} (up to {largest:.4}); they are normalised");
        model.notes.push(note);
    }
}

impl RawImage {
    fn pose(&self) -> Result<(Pose, f64), String> {
        let (length, translation) = (DVec4::from(self.quaternion).length(), DVec3::from(self.translation));
        // Written positively, so that NaN fails.
        let is_near = translation.abs().cmple(DVec3::splat(MAX_COORDINATE)).all();
        if !(length.is_finite() && is_near) {
            let reason = format!("has the pose {:?}, {:?}", self.quaternion, self.translation);
            return Err(reason + ": a number is not finite or too large");
        }
        if length < SHORTEST_QUATERNION {
            return Err(format!("has a quaternion of length {length}, which is no rotation"));
        }
        Ok((Pose::of_quaternion(self.quaternion, translation), length))
    }

    /// The readings of the name: more than one path where it is not UTF-8, as COLMAP writes it on some Windows.
    fn wanted(&self) -> Result<Wanted, String> {
        if let Ok(name) = std::str::from_utf8(&self.name) {
            return spelled(name).map(Wanted::from);
        }
        let mut wanted: Option<Wanted> = None;
        for encoding in ENCODINGS {
            let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(&self.name) else { continue };
            let Ok(found) = spelled(&text) else { continue };
            match &mut wanted {
                Some(wanted) if wanted.readings.contains(&found.path) => {}
                Some(wanted) => wanted.readings.push(found.path),
                None => wanted = Some(found.into()),
            }
        }
        wanted.ok_or_else(|| {
            let start: String =
                self.name.iter().take(80).flat_map(|byte| byte.escape_ascii()).map(char::from).collect();
            format!("the name `{start}` is not UTF-8, nor in any encoding that COLMAP may have written")
        })
    }
}

/// Points one by one: their file can be far larger than what is kept.
struct CheckedPoints {
    /// The file, and if it is binary; `None` where the model has none.
    file: Option<(PathBuf, bool)>,
    /// Ids of the images; `None` where they could not be read.
    images: Option<HashSet<u32>>,
    ids: HashSet<u64>,
    n_astray: usize,
}

impl CheckedPoints {
    fn new(folder: &Path, images: Option<HashSet<u32>>) -> Self {
        CheckedPoints { file: is_there(folder, STEMS[2]), images, ids: HashSet::new(), n_astray: 0 }
    }

    fn read(&mut self, faults: &mut Faults, mut take: impl FnMut(Point, &[u32])) {
        let Some((file, is_binary)) = self.file.clone() else { return };
        let mut add = |point: RawPoint, faults: &mut Faults| {
            if let Some((point, seen_in)) = self.check(&file, point, faults) {
                take(point, &seen_in);
            }
        };
        if is_binary { bin::points(&file, faults, &mut add) } else { text::points(&file, faults, &mut add) }
    }

    fn check(&mut self, file: &Path, mut point: RawPoint, faults: &mut Faults) -> Option<(Point, Vec<u32>)> {
        let place = || format!("{}, point {}", point.place, point.id);
        if !self.ids.insert(point.id) {
            faults.add(file, place(), "has the id of an earlier point", DAMAGED);
            return None;
        }
        if let Err(reason) = check_place(point.position) {
            faults.add(file, place(), reason, DAMAGED);
            return None;
        }
        if let Some(images) = &self.images {
            let before = point.seen_in.len();
            point.seen_in.retain(|id| images.contains(id));
            self.n_astray += usize::from(point.seen_in.len() < before);
        }
        Some((Point { position: point.position, color: point.color }, point.seen_in))
    }
}

/// The points of a model, each with the ids of the images that saw it, ascending, each once.
pub(crate) fn seen_points(folder: &Path) -> crate::Result<Vec<(Point, Vec<u32>)>> {
    let mut faults = Faults::default();
    let mut points = Vec::new();
    CheckedPoints::new(folder, None).read(&mut faults, |point, seen_in| {
        let mut seen_in = seen_in.to_vec();
        seen_in.sort_unstable();
        seen_in.dedup();
        points.push((point, seen_in));
    });
    faults.first().map_or(Ok(points), Err)
}

/// The points of a model that COLMAP wrote, each with the names of the images that saw it.
pub(crate) fn tracks(folder: &Path) -> crate::Result<Vec<(Point, Vec<PathBuf>)>> {
    let mut faults = Faults::default();
    let images = read_images(folder, &mut faults).images;
    let names: HashMap<u32, PathBuf> = images.into_iter().map(|image| (image.id, image.name)).collect();
    if let Some(error) = faults.first() {
        return Err(error);
    }
    let named = |(point, seen_in): (Point, Vec<u32>)| {
        let mut names: Vec<PathBuf> = seen_in.iter().filter_map(|id| names.get(id).cloned()).collect();
        names.sort_unstable();
        (point, names)
    };
    Ok(seen_points(folder)?.into_iter().map(named).collect())
}

/// The folder of a plain COLMAP project's images: as asked for or, where that is absent, the largest of its smaller copies.
pub(crate) fn images_folder(path: &Path, settings: &CaptureSettings) -> PathBuf {
    let images = path.join(&settings.images);
    let smaller = |n: u32| {
        let mut name = images.clone().into_os_string();
        name.push(format!("_{n}"));
        PathBuf::from(name)
    };
    match settings.downscale {
        Some(1) => images,
        Some(n) => smaller(n),
        None if images.is_dir() => images,
        None => [2, 4, 8].map(smaller).into_iter().find(|folder| folder.is_dir()).unwrap_or(images),
    }
}

/// A plain COLMAP project as a clip of one frame, in which every image is a camera.
pub(super) fn read_capture(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let given = named.model.clone().map(|model| Ok(Some((model, None))));
    let chosen = given.unwrap_or_else(|| chosen_model(path, settings));
    let Some(Some((folder, note))) = faults.take(chosen) else { return CaptureBuilder::default() };
    let mut model = read_model(&folder, faults);
    if model.images.is_empty() && faults.n() == 0 {
        faults.add(&model.file, "", "holds no image", "run COLMAP's mapper, or export the model again");
    }
    model.images.sort_by(|a, b| a.name.cmp(&b.name));
    let images = images_folder(path, settings);
    let mut builder = CaptureBuilder::still(settings, model.file.clone());
    builder.points = std::mem::take(&mut model.points);
    builder.notes = note.into_iter().chain(model.notes.drain(..)).collect();
    let asked = path.join(&settings.images);
    if let Some(n) = settings.downscale.filter(|_| !images.is_dir()) {
        let remedy = format!("make it with pictures of 1/{n} of the size, or choose another --downscale");
        faults.add(&images, "", "is missing", remedy);
        return builder;
    } else if settings.downscale.is_none() && images != asked {
        let [taken, asked] =
            [&images, &asked].map(|path| path.strip_prefix(path.parent().unwrap_or(path)).unwrap_or(path));
        builder.notes.push(format!("there is no folder {}: {} is taken", asked.display(), taken.display()));
    }
    add_cameras(named, settings, &folder, &images, &model, &mut builder);
    builder
}

fn add_cameras(
    named: &Named,
    settings: &CaptureSettings,
    folder: &Path,
    images: &Path,
    model: &Model,
    builder: &mut CaptureBuilder,
) {
    // A folder that somebody has chosen is not looked for elsewhere.
    let is_asked = settings.asked_images().is_some() || settings.downscale.is_some();
    let root = if is_asked { images } else { &named.folder };
    let wanted: Vec<Wanted> = model.images.iter().map(|posed| posed.wanted.clone()).collect();
    let files = builder.locate(root, images, &model.file, &wanted);
    let mut ids = HashMap::new();
    for (posed, (image, reading)) in model.images.iter().zip(&files) {
        let name = flat(&posed.wanted.readings[*reading]);
        ids.insert(posed.id, name.clone());
        builder.add_still(name, posed.lens, posed.pose, image.clone(), settings);
    }
    builder.model = Some((folder.to_owned(), ids));
    note_encodings(&model.images, &files, &mut builder.notes);
    let used: HashSet<&Path> = files.iter().map(|(file, _)| file.as_path()).collect();
    let there = listed(images, 3);
    let mut unused = there.iter().filter(|name| !used.contains(images.join(name).as_path()));
    let n = unused.clone().count();
    if let Some(first) = unused.next().filter(|_| n < there.len() && files.iter().any(|(file, _)| file.exists())) {
        let folder = images.strip_prefix(&named.folder).unwrap_or(images).display();
        builder.notes.push(format!(
            "pictures in {folder} without a camera: {n} of {}, as {}",
            there.len(),
            first.display()
        ));
    }
    masks::find(&named.folder, images, builder);
}

fn note_encodings(images: &[Posed], files: &[(PathBuf, usize)], notes: &mut Vec<String>) {
    let odd = || images.iter().zip(files).filter(|(posed, _)| posed.wanted.readings.len() > 1);
    let n = odd().count();
    let found = if let Some((_, (file, _))) = odd().find(|(_, (file, _))| file.exists()) {
        format!("they are those of files that are there, as {}", file.display())
    } else if let Some((posed, _)) = odd().next() {
        let readings: Vec<String> = posed.wanted.readings.iter().map(|path| path.display().to_string()).collect();
        format!("no file has one of their readings: {}", readings.join(", "))
    } else {
        return;
    };
    notes.push(format!("names that are not UTF-8: {n}; {found}"));
}
