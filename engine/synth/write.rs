//! The files of a capture.

use super::cast::{Picture, covisible, picture};
use super::options::Options;
use super::points::points;
use super::rig::{Camera, photographers, rig};
use super::room::room;
use super::truth::truth;
use super::world::World;
use super::{colmap, files, priors, sound};
use crate::error::{Error, Result};
use crate::files::make_folder;
use crate::parallel::in_parallel;
use crate::scene::prior::{write_depth, write_flow};
use crate::scene::write_exr;
use image::ExtendedColorType;
use serde_json::json;
use std::fs;
use std::path::Path;

const MARKER: &str = "synth.json";
/// The parts of a capture in the order in which an old one is removed: first those that make it valid.
const PARTS: [&str; 14] = [
    "capture.toml",
    "photos",
    "truth.json",
    "truth",
    "keypoints",
    "audio",
    "foreground",
    "covisible",
    "masks",
    "depth",
    "flow",
    "points",
    "images",
    "sparse",
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// With the test cameras.
    pub cameras: u32,
    pub test_cameras: u32,
    pub frames: u32,
    pub images: u64,
    /// Of all frames, with the outliers.
    pub points: u64,
    pub outliers: u64,
}

#[derive(Clone, Copy)]
enum Job {
    Picture(usize, u32),
    Points(u32),
    Sound(usize),
}

struct Capture<'a> {
    folder: &'a Path,
    options: &'a Options,
    world: World,
    cameras: Vec<Camera>,
}

/// Writes a synthetic capture to `folder`, in place of an earlier one. The bytes depend on `options` only. The calling thread calls
/// `progress` as (pieces done, pieces in all).
#[tracing::instrument(level = "info", name = "write capture", skip_all)]
pub fn write_capture(
    folder: &Path,
    options: &Options,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Summary> {
    if let Some((name, reason)) = options.fault() {
        return Err(Error::data(folder, format!("option `{name}`"), reason, "give a value in this range"));
    }
    prepare(folder)?;
    files::json(&folder.join(MARKER), &json!({ "made_by": "ivv synth", "options": options }))?;
    let (world, cameras) = (room(options), rig(options));
    let capture = Capture { folder, options, world, cameras };
    capture.make_folders()?;
    let jobs = capture.jobs();
    let counts = in_parallel(jobs.len(), threads, |index| capture.run(jobs[index]), |n| progress(n, jobs.len()))?;
    let point_lists: Vec<_> = counts.into_iter().flatten().collect();
    let outliers: Vec<Vec<u32>> = point_lists.iter().map(|(_, outliers)| outliers.clone()).collect();
    if let Some(n) = options.photos {
        write_photos(&folder.join("photos"), options, n, threads)?;
    }
    capture.finish(&outliers)?;
    let n_test = capture.cameras.iter().filter(|camera| camera.is_test).count();
    Ok(Summary {
        cameras: options.cameras,
        test_cameras: n_test as u32,
        frames: options.frames,
        images: u64::from(options.cameras) * u64::from(options.frames),
        points: point_lists.iter().map(|(n, _)| n).sum(),
        outliers: outliers.iter().map(|rows| rows.len() as u64).sum(),
    })
}

/// Writes photographs of the room without what moves, and their points: a capture of one frame.
fn write_photos(folder: &Path, options: &Options, n: u32, threads: usize) -> Result<()> {
    let (mut world, cameras) = (room(options), photographers(options, n));
    world.bodies.retain(|body| !body.dynamic);
    let take = |index: usize| {
        let camera: &Camera = &cameras[index];
        let made = picture(&world, options, index, camera, colmap::REFERENCE_FRAME);
        let to = folder.join("images").join(&camera.name);
        make_folder(&to)?;
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        files::png(&to.join("00000.png"), &made.rgb, width, height, ExtendedColorType::Rgb8)
    };
    in_parallel(cameras.len(), threads, take, |_| {})?;
    let model = folder.join("sparse/0");
    make_folder(&model)?;
    let points = points(&world, options, &cameras, colmap::REFERENCE_FRAME);
    colmap::write(&model, &Options { bent: false, ..options.clone() }, &cameras, &points)?;
    let manifest = format!("# Photographs, made by `ivv synth`.\nfps = {}.0\nframes = 1\n", options.fps);
    files::bytes(&folder.join("capture.toml"), manifest.as_bytes())
}

/// Makes the folder, or empties one that this tool filled.
fn prepare(folder: &Path) -> Result<()> {
    make_folder(folder)?;
    let fault = |path: &Path, fault: std::io::Error| {
        Error::data(path, "", format!("cannot be emptied: {fault}"), "choose another folder with -o")
    };
    if fs::read_dir(folder).map_err(|e| fault(folder, e))?.next().is_none() {
        return Ok(());
    }
    if !folder.join(MARKER).is_file() {
        let reason = format!("is not empty and not a folder of `ivv synth` (it has no {MARKER})");
        return Err(Error::data(folder, "", reason, "choose another folder with -o, or empty this one"));
    }
    for part in PARTS {
        let path = folder.join(part);
        let removed = match (path.is_dir(), path.exists()) {
            (true, _) => fs::remove_dir_all(&path),
            (_, true) => fs::remove_file(&path),
            _ => Ok(()),
        };
        removed.map_err(|e| fault(&path, e))?;
    }
    Ok(())
}

impl Capture<'_> {
    fn make_folders(&self) -> Result<()> {
        let make = |folder: &str| make_folder(&self.folder.join(folder));
        ["sparse/0", "points", "audio", "keypoints"].into_iter().try_for_each(make)?;
        for Camera { name, is_test, hood, .. } in &self.cameras {
            let kinds = ["images", "flow", "depth", "foreground", "truth/exact"].into_iter();
            let kinds = kinds.chain(is_test.then_some("covisible")).chain(hood.then_some("masks"));
            kinds.map(|kind| format!("{kind}/{name}")).try_for_each(|folder| make(&folder))?;
        }
        Ok(())
    }

    fn jobs(&self) -> Vec<Job> {
        let n = self.cameras.len();
        let pictures = (0..self.options.frames).flat_map(|frame| (0..n).map(move |index| Job::Picture(index, frame)));
        pictures.chain((0..self.options.frames).map(Job::Points)).chain((0..n).map(Job::Sound)).collect()
    }

    /// For points, gives how many there are and which of them are outliers.
    fn run(&self, job: Job) -> Result<Option<(u64, Vec<u32>)>> {
        match job {
            Job::Picture(index, frame) => {
                let camera = &self.cameras[index];
                let made = picture(&self.world, self.options, index, camera, frame);
                self.write_picture(&made, index, camera, frame)?;
                Ok(None)
            }
            Job::Points(frame) => {
                let points = points(&self.world, self.options, &self.cameras, frame);
                colmap::write_points(&self.folder.join(format!("points/{frame:05}.ply")), &points)?;
                if frame == colmap::REFERENCE_FRAME {
                    colmap::write(&self.folder.join("sparse/0"), self.options, &self.cameras, &points)?;
                }
                let outliers = (0_u32..).zip(&points).filter(|(_, point)| point.outlier);
                Ok(Some((points.len() as u64, outliers.map(|(row, _)| row).collect())))
            }
            Job::Sound(index) => {
                let camera = &self.cameras[index];
                let heard = sound::recording(&self.world, self.options, camera);
                files::wav(&self.folder.join(format!("audio/{}.wav", camera.name)), &heard, sound::RATE)?;
                let seen = sound::keypoints(&self.world, self.options, index, camera);
                files::json(&self.folder.join(format!("keypoints/{}.json", camera.name)), &seen)?;
                Ok(None)
            }
        }
    }

    fn write_picture(&self, picture: &Picture, index: usize, camera: &Camera, frame: u32) -> Result<()> {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let path = |kind: &str, extension: &str| {
            self.folder.join(kind).join(&camera.name).join(format!("{frame:05}.{extension}"))
        };
        files::png(&path("images", "png"), &picture.rgb, width, height, ExtendedColorType::Rgb8)?;
        let mask = |kind: &str, bright: &[bool]| {
            let levels: Vec<u8> = bright.iter().map(|&bright| if bright { 255 } else { 0 }).collect();
            files::png(&path(kind, "png"), &levels, width, height, ExtendedColorType::L8)
        };
        mask("foreground", &picture.dynamic)?;
        if camera.is_test {
            mask("covisible", &covisible(&self.world, &self.cameras, index, frame))?;
        }
        if camera.hood {
            let clear: Vec<bool> = camera.pixels().map(|(column, row)| !camera.is_hooded(column, row)).collect();
            mask("masks", &clear)?;
        }
        // There is no frame after the last that an estimator could have seen.
        if frame + 1 < self.options.frames {
            let flow = priors::flow(picture, self.options, index, frame);
            write_flow(&path("flow", "flo"), &flow, width, height)?;
        }
        let depth = priors::depth(picture, self.options, index, camera, frame);
        write_depth(&path("depth", "npy"), &depth, width, height)?;
        let exact = vec![
            ("depth.Z", picture.depth.iter().map(|&v| v as f32).collect()),
            ("flow.X", picture.flow.iter().map(|v| v.x as f32).collect()),
            ("flow.Y", picture.flow.iter().map(|v| v.y as f32).collect()),
            ("body", picture.body.iter().map(|&v| v as f32).collect()),
        ];
        write_exr(&path("truth/exact", "exr"), exact, width, height)
    }

    /// The files that come last, `capture.toml` last of all.
    fn finish(&self, outliers: &[Vec<u32>]) -> Result<()> {
        files::wav(&self.folder.join("truth/source.wav"), &sound::source(self.options), sound::RATE)?;
        files::json(&self.folder.join("truth.json"), &truth(&self.world, self.options, &self.cameras, outliers))?;
        let tests: Vec<String> =
            self.cameras.iter().filter(|camera| camera.is_test).map(|camera| format!("{:?}", camera.name)).collect();
        let manifest = format!(
            "# Synthetic capture, made by `ivv synth`; truth.json holds the hidden values.\n\
             fps = {}.0\nframes = {}\nreference_frame = {}\ntest_cameras = [{}]\n\
             masks = {}\nforeground = true\ncovisible = {}\npoints = true\nflow = {}\ndepth = true\naudio = true\n{}",
            self.options.fps,
            self.options.frames,
            colmap::REFERENCE_FRAME,
            tests.join(", "),
            self.options.masks,
            !tests.is_empty(),
            // A single frame has no next one.
            self.options.frames > 1,
            if self.options.photos.is_some() { "photos = true\n" } else { "" },
        );
        files::bytes(&self.folder.join("capture.toml"), manifest.as_bytes())
    }
}
