//! Finding the pictures of a camera that a calibration names.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::prepare::foreign::{Kind, converted, counts, kind, of_most};
use crate::prepare::source::recording::{Footage, SourceCamera};
use crate::scene::capture::{Faults, Shot, by_number, camera_place, is_hidden, is_image, relative};
use crate::video::{chapters, is_later_chapter};
use crate::words::listed;

const VIDEOS: [&str; 9] = ["mp4", "mov", "mkv", "avi", "webm", "m4v", "mts", "m2ts", "mxf"];
/// Folders of videos, or of folders of images, below a source.
const FOLDERS: [&str; 5] = ["", "videos", "images", "calibration/extrinsic", "recordings"];

/// The video `<folder>/<name>.mp4` (or another ending), the images of `<folder>/<name>` or its `images`, numbered from the first on, or
/// the one clip in `<folder>/<name>`.
pub(in crate::internals::prepare) fn find(footage: &Path, name: &str) -> Option<Footage> {
    FOLDERS.iter().find_map(|folder| {
        let stem = footage.join(folder).join(name);
        let pictures = || [stem.clone(), stem.join("images")].iter().find_map(|path| images(path));
        match (loose(&stem).into_iter().next(), pictures(), clips(&stem).as_slice()) {
            (Some(video), ..) => Some(Footage::Video(video)),
            // A clip has a still beside it at times.
            (_, Some(Footage::Images(shots)), [clip]) if shots.len() == 1 => Some(Footage::Video(clip.clone())),
            (_, Some(pictures), _) => Some(pictures),
            (_, None, [clip]) => Some(Footage::Video(clip.clone())),
            _ => None,
        }
    })
}

/// The videos that are named `stem` and an ending; the first is taken.
fn loose(stem: &Path) -> Vec<PathBuf> {
    let endings = VIDEOS.iter().flat_map(|ending| [(*ending).to_owned(), ending.to_uppercase()]);
    endings.map(|ending| with_ending(stem, &ending)).filter(|path| path.is_file()).collect()
}

/// The clips in a folder: its videos but for those that continue another.
pub(super) fn clips(folder: &Path) -> Vec<PathBuf> {
    let mut files = files(folder);
    files.retain(|path| is_video(path) && !is_later_chapter(path));
    files
}

/// The entries of a folder that are not hidden, in the order of numbers.
pub(in crate::internals::prepare) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries.filter(|path| !is_hidden(path)).collect();
    files.sort_by_cached_key(|path| by_number(&path.file_name().unwrap_or_default().to_string_lossy()));
    files
}

/// As [`find`]; that there is none, or that the name leads out of the folder, is a fault of the calibration.
pub(super) fn take(footage: &Path, name: &str, calibration: &Path, faults: &mut Faults) -> Option<Footage> {
    let place = || camera_place(name);
    if let Err(reason) = relative(name) {
        faults.add(calibration, place(), reason, "rename the camera");
        return None;
    }
    if name.contains('/') {
        faults.add(calibration, place(), "has a name that is not fit as a file name", "rename the camera");
        return None;
    }
    let found = find(footage, name);
    if found.is_none() {
        let (reason, remedy) = absent(footage, name);
        faults.add(calibration, place(), reason, remedy);
    }
    found
}

fn absent(footage: &Path, name: &str) -> (String, String) {
    let place = footage.display();
    let reason = "has neither a video nor images";
    let Some(folder) = FOLDERS.iter().map(|folder| footage.join(folder).join(name)).find(|path| path.is_dir()) else {
        let remedy = format!(
            "add {name}.mp4, or a folder {name} of images or with one clip, to {place}, or say with --footage where they are"
        );
        return (reason.to_owned(), remedy);
    };
    let clips: Vec<PathBuf> = clips(&folder);
    if clips.len() > 1 {
        let remedy = format!(
            "keep one of them, or join them in one file: (cd '{}' && printf \"file '%s'\\n\" {} > list.txt && ffmpeg -f concat -safe 0 \
             -i list.txt -c copy ../{name}.mp4)",
            folder.display(),
            clips.iter().map(|clip| format!("'{}'", name_of(clip))).collect::<Vec<_>>().join(" "),
        );
        return (format!("has {} clips in {}: {}", clips.len(), folder.display(), listed(&names(&clips))), remedy);
    }
    let held = files(&folder);
    let holds = if held.is_empty() { "is empty".to_owned() } else { format!("holds {}", counts(&held)) };
    let remedy =
        format!("put a clip, or .png, .jpg, .tif, .webp, .exr or .dpx pictures there, or add {name}.mp4 to {place}");
    (format!("{reason}: {} {holds}", folder.display()), remedy)
}

pub(super) fn notes(cameras: &[SourceCamera]) -> Vec<String> {
    let mut notes = Vec::new();
    let mut begins: Vec<(&String, u64)> = Vec::new();
    for camera in cameras {
        match &camera.footage {
            Footage::Video(path) => {
                let own = name_of(path);
                let mut others = names(&loose(&path.with_extension("")));
                others.retain(|other| *other != own);
                if !others.is_empty() {
                    notes.push(format!("{own} is taken; {} lies beside it and is not", others.join(", ")));
                }
                let parts = chapters(path);
                if parts.len() > 1 {
                    notes.push(format!(
                        "camera `{}`: {} chapters of one take are joined: {}",
                        camera.name,
                        parts.len(),
                        listed(&names(&parts))
                    ));
                }
            }
            Footage::Images(shots) => {
                let stem = shots.first().and_then(|shot| shot.image.file_stem()).unwrap_or_default().to_string_lossy();
                let digits = stem.trim_start_matches(|c: char| !c.is_ascii_digit());
                begins.extend(digits.parse().ok().filter(|_| shots.len() > 1).map(|first| (&camera.name, first)));
            }
        }
    }
    let last = begins.iter().map(|(_, first)| *first).max().unwrap_or(0);
    let earlier = begins.iter().filter(|(_, first)| *first < last);
    let earlier: Vec<String> = earlier.map(|(name, first)| format!("{name}={}", last - first)).collect();
    if !earlier.is_empty() {
        notes.push(format!(
            "the numbers of the images begin at different ones in some cameras, and the first image of each is taken for its first \
             frame; if equal numbers are of one moment, give --shift {}",
            earlier.join(",")
        ));
    }
    let shots = cameras.iter().flat_map(|camera| camera.footage.shots());
    notes.extend(converted(&shots.map(|shot| shot.image.clone()).collect::<Vec<_>>()));
    notes
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn names(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|file| name_of(file)).collect()
}

pub(in crate::internals::prepare) fn is_video(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    !is_hidden(path) && ending.is_some_and(|e| VIDEOS.iter().any(|ending| e == *ending)) && path.is_file()
}

/// True if a film has the ending of those that phones put beside a photo, with its name (Live Photo).
pub(super) fn is_of_phone(film: &Path) -> bool {
    film.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mov"))
}

/// True if a folder of a source holds a video, or folders of several cameras with a clip each; the film of a Live Photo is none.
pub(in crate::internals::prepare) fn has_video(footage: &Path) -> bool {
    let is_loose = FOLDERS.iter().filter_map(|folder| fs::read_dir(footage.join(folder)).ok()).any(|entries| {
        let files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        let photos = files.iter().filter(|file| kind(file) != Kind::Other);
        let photos: HashSet<_> = photos.filter_map(|photo| photo.file_stem()).collect();
        let has_photo = |film: &&PathBuf| film.file_stem().is_some_and(|stem| photos.contains(stem));
        let (beside, alone): (Vec<_>, Vec<_>) = files.iter().filter(|file| is_video(file)).partition(has_photo);
        // Some phones write .mp4, as cameras do: photos are stills of videos where most have one.
        !alone.is_empty() || 2 * beside.iter().filter(|film| !is_of_phone(film)).count() > photos.len()
    });
    is_loose || (loose_names(footage).is_empty() && camera_folders(footage).len() > 1)
}

/// Names of all videos in the folders of a source, in the order of numbers; else of the folders that hold one clip each.
pub(in crate::internals::prepare) fn video_names(footage: &Path) -> Vec<String> {
    let names = loose_names(footage);
    if names.is_empty() { camera_folders(footage) } else { names }
}

fn loose_names(footage: &Path) -> Vec<String> {
    let videos = FOLDERS.iter().flat_map(|folder| clips(&footage.join(folder)));
    sorted(videos.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())))
}

fn camera_folders(footage: &Path) -> Vec<String> {
    let folders = FOLDERS.iter().flat_map(|folder| files(&footage.join(folder)));
    let cameras = folders.filter(|path| path.is_dir() && clips(path).len() == 1);
    let names = cameras.filter_map(|path| path.file_name()?.to_str().map(str::to_owned));
    let is_camera = |name: &String| matches!(find(footage, name), Some(Footage::Video(_)));
    sorted(names.filter(|name| !FOLDERS.contains(&name.as_str()) && is_camera(name)))
}

/// Names of the folders of images in the folders of a source, in the order of numbers.
pub(super) fn sequence_names(footage: &Path) -> Vec<String> {
    let folders = FOLDERS.iter().flat_map(|folder| files(&footage.join(folder))).filter(|path| path.is_dir());
    let names = folders.filter_map(|folder| folder.file_name()?.to_str().map(str::to_owned));
    sorted(names.filter(|name| matches!(find(footage, name), Some(Footage::Images(_)))))
}

fn sorted(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut names: Vec<String> = names.collect();
    names.sort_by_cached_key(|name| by_number(name));
    names.dedup();
    names
}

fn with_ending(stem: &Path, ending: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(format!(".{ending}"));
    name.into()
}

/// The images of a folder; where none is a PNG or JPEG, those of the kind that most are, which ffmpeg reads.
fn images(folder: &Path) -> Option<Footage> {
    let mut files = files(folder);
    if files.iter().any(|path| is_image(path)) {
        files.retain(|path| is_image(path));
    } else {
        files = of_most(files);
    }
    let frames = numbered(&files).unwrap_or_else(|| (0..).take(files.len()).collect());
    let shots = frames.into_iter().zip(files).map(|(frame, image)| Shot { frame, image, ..Shot::default() });
    let shots: Vec<Shot> = shots.collect();
    (!shots.is_empty()).then_some(Footage::Images(shots))
}

/// The frames of `files` by the numbers that their names end with, so that a lost image does not move later ones. None where the names
/// are not numbers in even steps, such as times.
pub(super) fn numbered(files: &[PathBuf]) -> Option<Vec<u32>> {
    let split = |path: &PathBuf| -> Option<(String, u64)> {
        let stem = path.file_stem()?.to_str()?;
        let text = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        Some((text.to_owned(), stem[text.len()..].parse().ok()?))
    };
    let names: Vec<(String, u64)> = files.iter().map(split).collect::<Option<_>>()?;
    let (text, first) = names.first()?;
    let steps: Vec<u64> = names.windows(2).map(|two| two[1].1.checked_sub(two[0].1)).collect::<Option<_>>()?;
    let step = steps.iter().copied().min().unwrap_or(1).max(1);
    let is_even = steps.iter().all(|&n| n > 0 && n % step == 0) && names.iter().all(|(other, _)| other == text);
    let frames = names.iter().map(|(_, number)| u32::try_from((number - first) / step).ok());
    let frames: Vec<u32> = frames.collect::<Option<_>>()?;
    let most_are_there = frames.last().is_some_and(|&last| (last as usize) < 2 * files.len());
    (is_even && most_are_there).then_some(frames)
}
