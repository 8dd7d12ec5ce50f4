//! Cameras for pictures that have none: COLMAP places them, on the CPU, as a plain project in `reconstruction/` of the output.

use std::cell::Cell;
use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::json;

use super::colmap::{Arguments, Colmap, OFF, ON};
use super::database;
use super::journal::{Journal, stamps};
use super::model;
use super::photos::Together;
use super::pictures::{Photos, Pictures, images};
use super::program::{COLMAP, FFMPEG, FFPROBE};
use super::settings::{OnProgress, PrepareSettings, Progress};
use super::source::Footage;
use super::source::footage::{find, video_names};
use super::timeline::Timeline;
use super::track::Track;
use super::video::{self, Video};
use crate::error::{Error, Result};
use crate::files::{cannot_list, make_folder, write_atomic};
use crate::parallel::in_parallel;
use crate::scene::capture::{Faults, Frames, PHOTOS, read_images};
use crate::video::chapters;
use crate::words::{count, listed};

/// Most pictures that are taken of a single video, evenly chosen.
const OF_VIDEO: u32 = 120;
/// Pictures of a video that each is matched with, after it.
pub(super) const OVERLAP: usize = 10;
/// Fewer placed pictures are no capture.
const LEAST_PLACED: usize = 3;
/// Pictures are searched for features in this size at most: larger ones take long on a CPU and hardly place better.
pub(super) const MAX_SIDE: u32 = 1600;
/// How COLMAP's mapper ends where it placed none.
const NOTHING_PLACED: &str = "failed to create sparse model";
/// Pictures of a block of pairs; progress is reported after each block.
const BLOCK: usize = 10;

pub(super) fn require(settings: &PrepareSettings, pictures: &Pictures) -> Result<()> {
    match pictures {
        Pictures::Photos(folder) => Photos::of(folder)?.require(LEAST_PLACED)?,
        _ => [FFMPEG, FFPROBE].iter().try_for_each(|program| program.require(&settings.source))?,
    }
    COLMAP.require(&settings.source)
}

/// True if COLMAP has placed the pictures: the model's last file is there.
pub(super) fn is_placed(output: &Path) -> bool {
    is_whole(&output.join("reconstruction/sparse/0"))
}

fn is_whole(model: &Path) -> bool {
    // As COLMAP's model is kept, and as that of a moving rig is written.
    ["images.bin", "points3D.txt"].iter().any(|file| model.join(file).is_file())
}

pub(super) fn check_moving(settings: &PrepareSettings, pictures: Option<&Pictures>) -> Result<()> {
    if settings.moving.is_none() {
        return Ok(());
    }
    let found = match pictures {
        Some(Pictures::Videos(_)) => return Ok(()),
        Some(other) => other.name(),
        None => "a source with cameras",
    };
    let remedy = "leave --moving out, or give a folder with a video of each camera of the rig and no calibration";
    let reason = format!("expects a folder of videos without calibration, found {found}");
    Err(Error::data(&settings.source, "--moving", reason, remedy))
}

/// Settings that prepare what COLMAP placed, with notes about it. What an earlier run has done is not done again.
#[tracing::instrument(level = "info", name = "cameras", skip_all)]
pub(super) fn make(
    settings: &PrepareSettings,
    pictures: &Pictures,
    journal: &Journal,
    progress: OnProgress,
) -> Result<(PrepareSettings, Vec<String>)> {
    require(settings, pictures)?;
    let project = settings.output.join("reconstruction");
    let (frames, shifts) = (settings.frames, settings.shifts_noted());
    let mut made_from = json!({
        "pictures": stamps(files(pictures)?), "source": settings.source.to_string_lossy(), "frames": frames, "shifts": shifts,
    });
    if let Some(photos) = settings.photos.as_deref().and_then(Pictures::at) {
        made_from["photos"] = stamps(files(&photos)?);
    }
    if let Some(step) = settings.moving {
        made_from["moving"] = json!(step);
    }
    if let Some(fps) = settings.fps {
        made_from["fps"] = json!(fps);
    }
    journal.begin("reconstruction", made_from)?;
    make_folder(&project)?;
    let mut notes = pictures.notes(&settings.source)?;
    let folder = match pictures {
        Pictures::Photos(folder) if !Photos::of(folder)?.are_copied => folder.clone(),
        _ => project.join("images"),
    };
    // Absolute, since the project is read as a capture, whose images are looked for in its own folder.
    let images_folder = std::path::absolute(&folder).unwrap_or(folder);
    let together = Together::take(settings, &images_folder)?;
    notes.extend(together.notes.iter().cloned());
    let work = Reconstruction { settings, pictures, project, images: images_folder, together, progress };
    work.take_pictures()?;
    let names = images(&work.images)?;
    if names.len() < LEAST_PLACED {
        let (what, remedy) = match pictures {
            Pictures::Videos(_) => (
                "video",
                "give a video of each of three cameras or more; or a single video of a scene that stands still as a file",
            ),
            _ => ("picture", "give more pictures that overlap"),
        };
        let reason = format!("has {}, at least {LEAST_PLACED} are needed", count(names.len(), what));
        return Err(Error::data(&settings.source, "", reason, remedy));
    }
    let model = work.model();
    if !is_whole(&model) {
        work.place(&names)?;
    }
    notes.extend(work.notes(&names)?);
    if let (Some(step), Pictures::Videos(folder)) = (settings.moving, pictures) {
        let track = Track::new(settings, folder, &model, &work.project, step, progress)?;
        if !is_placed(&settings.output) {
            track.make(&model, &work.project.join("sparse/0"))?;
        }
        notes.extend(track.notes());
    }
    let mut derived = settings.clone();
    derived.moving = None;
    derived.source = work.project.clone();
    derived.capture.images = work.images.clone();
    derived.capture.downscale = None;
    let photos = work.of_photos();
    derived.photos = photos.join("sparse/0").is_dir().then_some(photos);
    match pictures {
        Pictures::Videos(folder) => derived.footage = Some(folder.clone()),
        // The chosen frames are pictures of one moment now.
        _ => (derived.frames, derived.footage) = (Frames::default(), None),
    }
    Ok((derived, notes))
}

pub(super) fn videos(folder: &Path) -> impl Iterator<Item = (String, PathBuf)> {
    video_names(folder).into_iter().filter_map(move |name| match find(folder, &name) {
        Some(Footage::Video(path)) => Some((name, path)),
        _ => None,
    })
}

fn files(pictures: &Pictures) -> Result<Vec<PathBuf>> {
    Ok(match pictures {
        Pictures::Photos(folder) => Photos::of(folder)?.files,
        Pictures::Video(path) => chapters(path),
        Pictures::Videos(folder) => videos(folder).flat_map(|(_, path)| chapters(&path)).collect(),
    })
}

/// The pictures of a video to place: the frames that are asked for, or evenly chosen ones where none is to be left out.
pub(super) fn of_video(settings: &PrepareSettings, video: &Video) -> Vec<usize> {
    let timeline = settings.fps.and_then(|_| Timeline::new([("", video)], settings));
    let n_frames = timeline.as_ref().and_then(|timeline| timeline.n("")).unwrap_or(video.n_frames());
    let asked = settings.frames;
    let n = asked.of(n_frames).len() as u32;
    let every = if asked.every > 1 { asked.every } else { n.div_ceil(OF_VIDEO).max(1) };
    let frames = Frames { every, ..asked }.of(n_frames);
    let mut pictures: Vec<usize> = match timeline {
        Some(timeline) => frames.filter_map(|frame| timeline.nearest("", video, frame)).collect(),
        None => frames.map(|frame| frame as usize).collect(),
    };
    pictures.dedup();
    pictures
}

struct Reconstruction<'a> {
    settings: &'a PrepareSettings,
    pictures: &'a Pictures,
    project: PathBuf,
    images: PathBuf,
    together: Together,
    progress: OnProgress<'a>,
}

impl Reconstruction<'_> {
    fn tell(&self, stage: &'static str, done: usize, total: usize, piece: &str) {
        (self.progress)(Progress { stage, done: done.min(total), total, piece });
    }

    /// Where the model of the pictures comes to. Of cameras that move, they are those of the first frame alone.
    fn model(&self) -> PathBuf {
        self.project.join(if self.settings.moving.is_some() { "first" } else { "sparse/0" })
    }

    fn take_pictures(&self) -> Result<()> {
        match self.pictures {
            Pictures::Photos(folder) => {
                let photos = Photos::of(folder)?;
                // Where nothing is copied, the images are those of the folder, spelled absolutely.
                if !photos.are_copied {
                    return Ok(());
                }
                let done = AtomicUsize::new(0);
                photos.copy(&self.images, self.settings.threads, &|n, piece| {
                    self.tell("pictures", done.fetch_add(1, Ordering::Relaxed) + 1, n, piece);
                })
            }
            Pictures::Video(path) => {
                let video = video::probe(path)?;
                let pictures = of_video(self.settings, &video);
                self.take(&video, &pictures, |place| format!("{place:05}.jpg"))
            }
            Pictures::Videos(folder) => {
                let (names, paths): (Vec<String>, Vec<PathBuf>) = videos(folder).unzip();
                let probe = |index: usize| video::probe(&paths[index]);
                let probed = in_parallel(paths.len(), self.settings.threads, probe, |_| {})?;
                let named = names.iter().map(String::as_str).zip(&probed);
                let Some(timeline) = Timeline::new(named.clone(), self.settings) else { return Ok(()) };
                for (name, video) in named {
                    // The frame may be lost: cameras stand still, and the next will do.
                    let picture = timeline.nearest(name, video, self.settings.frames.from);
                    self.take(video, picture.as_slice(), |_| format!("{name}.jpg"))?;
                }
                Ok(())
            }
        }
    }

    fn take(&self, video: &Video, pictures: &[usize], name: impl Fn(u32) -> String) -> Result<()> {
        make_folder(&self.images)?;
        video::write_pictures(&self.images, video, pictures, self.settings.threads, name, self.progress)
    }

    fn place(&self, names: &[OsString]) -> Result<()> {
        let n = names.len() + self.together.names.len();
        let colmap = Colmap {
            about: &self.settings.source,
            folder: self.images.clone(),
            database: self.project.join("database.db"),
            threads: self.settings.threads.max(1).to_string(),
            on_gpu: OFF,
        };
        let (models, side) = (self.project.join("models"), MAX_SIDE.to_string());
        // Most lines say nothing of progress.
        let run = |verb: &str, arguments: &Arguments, hear: &dyn Fn(&str) -> Option<()>| {
            colmap.attempt(verb, arguments, &mut |line| _ = hear(line))?.1
        };
        let word = OsStr::new;
        // Cameras of a rig are different ones; other pictures of one size are taken to be of one camera.
        let groups = [(names, matches!(self.pictures, Pictures::Videos(_))), (&self.together.names, false)];
        let before = [0, names.len()];
        for (((names, is_rig), list), before) in groups.into_iter().zip(["cameras.txt", "photos.txt"]).zip(before) {
            if names.is_empty() {
                continue;
            }
            let sizes = names.iter().filter_map(|name| crate::scene::capture::read_size(&self.images.join(name)).ok());
            let is_single = !is_rig && sizes.collect::<HashSet<_>>().len() == 1;
            let list = self.project.join(list);
            write_atomic(&list, |to| names.iter().try_for_each(|name| writeln!(to, "{}", name.to_string_lossy())))?;
            let find = [
                ("--image_path", self.images.as_os_str()),
                ("--image_list_path", list.as_os_str()),
                ("--ImageReader.single_camera", word(if is_single { ON } else { OFF })),
                ("--SiftExtraction.use_gpu", word(OFF)),
                ("--SiftExtraction.max_image_size", word(&side)),
                ("--SiftExtraction.num_threads", word(&colmap.threads)),
            ];
            run("feature_extractor", &find, &|line| {
                let (done, _) = line.strip_prefix("Processed file [")?.strip_suffix(']')?.split_once('/')?;
                self.tell("features", before + done.parse::<usize>().ok()?, n, "COLMAP");
                Some(())
            })?;
        }
        let (overlap, block) = (OVERLAP.to_string(), BLOCK.to_string());
        let (verb, order) = match self.pictures {
            Pictures::Video(_) => ("sequential_matcher", ("--SequentialMatching.overlap", word(&overlap))),
            _ => ("exhaustive_matcher", ("--ExhaustiveMatching.block_size", word(&block))),
        };
        let n_blocks = if verb == "sequential_matcher" { n } else { n.div_ceil(BLOCK) * n.div_ceil(BLOCK) };
        let done = Cell::new(0);
        run(verb, &[&colmap.matching()[..], &[order]].concat(), &|line| {
            if line.starts_with("Matching ") && line.contains(" in ") {
                done.set(done.get() + 1);
                self.tell("matches", done.get(), n_blocks, "COLMAP");
            }
            Some(())
        })?;
        let _ = fs::remove_dir_all(&models);
        make_folder(&models)?;
        let place = [
            ("--image_path", self.images.as_os_str()),
            ("--output_path", models.as_os_str()),
            ("--Mapper.num_threads", word(&colmap.threads)),
        ];
        let placed = run("mapper", &place, &|line| {
            let placed = line.strip_prefix("Registering image #")?.split_once('(')?.1.strip_suffix(')')?;
            self.tell("cameras", placed.parse().ok()?, n, "COLMAP");
            Some(())
        });
        match placed {
            Err(fault) if fault.to_string().contains(NOTHING_PLACED) => Err(self.unplaced()),
            Err(fault) => Err(fault),
            Ok(()) => self.keep_largest(&models, names),
        }
    }

    /// COLMAP makes several models of pictures that do not hang together; the one with most pictures is kept.
    fn keep_largest(&self, models: &Path, cameras: &[OsString]) -> Result<()> {
        let folders = fs::read_dir(models).map_err(|fault| cannot_list(models, &fault))?.flatten();
        let found = folders.map(|folder| folder.path()).filter(|folder| folder.join("cameras.bin").is_file());
        let n_placed = |folder: &Path| {
            let images = read_images(folder, &mut Faults::default()).images;
            images.iter().filter(|image| !self.together.has(&image.name)).count()
        };
        let counted = found.map(|folder| (n_placed(&folder), folder));
        let Some((n, model)) = counted.max().filter(|(n, _)| *n >= LEAST_PLACED) else {
            return Err(self.unplaced());
        };
        let (of_cameras, of_photos) = self.together.split(&model, cameras, &self.settings.source)?;
        let of_photos = of_photos.filter(|model| !read_images(model, &mut Faults::default()).images.is_empty());
        let parts = of_photos.map(|model| (model, self.of_photos().join("sparse/0"))).into_iter();
        // Whether all is placed is judged by the cameras.
        for (model, to) in parts.chain([(of_cameras, self.model())]) {
            make_folder(&to)?;
            // The images come last: where they are the model is whole.
            for name in ["cameras.bin", "points3D.bin", "images.bin"] {
                let bytes = crate::files::read_file(&model.join(name)).map_err(|fault| {
                    let remedy = format!("check that the folder is writable; {n} pictures were placed");
                    Error::data(&model.join(name), "", format!("cannot be read: {fault}"), remedy)
                })?;
                write_atomic(&to.join(name), |to| to.write_all(&bytes))?;
            }
        }
        let _ = fs::remove_dir_all(models);
        Ok(())
    }

    fn unplaced(&self) -> Error {
        database::unplaced(&self.settings.source, self.pictures, &self.project.join("database.db"))
    }

    fn of_photos(&self) -> PathBuf {
        self.project.join(PHOTOS)
    }

    fn notes(&self, names: &[OsString]) -> Result<Vec<String>> {
        let model = model::read(&self.model())?;
        let placed: HashSet<&OsStr> = model.iter().map(|image| image.name.as_os_str()).collect();
        let mut notes = vec![format!("COLMAP placed {} of {} pictures", placed.len(), names.len())];
        if !self.together.names.is_empty() {
            let n = read_images(&self.of_photos().join("sparse/0"), &mut Faults::default()).images.len();
            notes.push(format!("and {n} of {} photographs of the place", self.together.names.len()));
        }
        let left_out = names.iter().filter(|name| !placed.contains(name.as_os_str()));
        let left_out: Vec<_> = left_out.map(|name| name.to_string_lossy()).collect();
        if !left_out.is_empty() {
            notes.push(format!("left out, since too little of them is in others: {}", listed(&left_out)));
        }
        Ok(notes)
    }
}
