//! Finding the pictures of a camera that a calibration names.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::recording::Footage;
use crate::scene::capture::{Faults, Shot, is_hidden, is_image, relative};

const VIDEOS: [&str; 9] = ["mp4", "mov", "mkv", "avi", "webm", "MP4", "MOV", "MKV", "AVI"];
/// Folders of videos, or of folders of images, below a source.
const FOLDERS: [&str; 5] = ["", "videos", "images", "calibration/extrinsic", "recordings"];

/// The video `<folder>/<name>.mp4` (or of another ending), or the images of `<folder>/<name>` or `<folder>/<name>/images`,
/// the first of them being frame 0; what their numbers leave out is missing.
pub(in crate::prepare) fn find(footage: &Path, name: &str) -> Option<Footage> {
    FOLDERS.iter().find_map(|folder| {
        let stem = footage.join(folder).join(name);
        let video = VIDEOS.iter().map(|ending| with_ending(&stem, ending)).find(|path| path.is_file());
        video.map(Footage::Video).or_else(|| [stem.clone(), stem.join("images")].iter().find_map(|path| images(path)))
    })
}

/// As [`find`]; that there is none, or that the name leads out of the folder, is a fault of the calibration.
pub(super) fn take(footage: &Path, name: &str, calibration: &Path, faults: &mut Faults) -> Option<Footage> {
    let place = || format!("camera `{}`", name.escape_debug());
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
        let folder = footage.display();
        let remedy =
            format!("add {name}.mp4 or a folder {name} of images to {folder}, or say with --footage where they are");
        faults.add(calibration, place(), "has neither a video nor images", remedy);
    }
    found
}

/// Whether a path is a video, by its ending.
pub(in crate::prepare) fn is_video(path: &Path) -> bool {
    !is_hidden(path) && path.extension().is_some_and(|e| VIDEOS.iter().any(|ending| e == *ending)) && path.is_file()
}

/// Whether a film has the ending of those that phones put beside a photo, with its name (Live Photo).
pub(super) fn is_of_phone(film: &Path) -> bool {
    film.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mov"))
}

/// Whether a folder of a source holds a video. The short film of a Live Photo is none.
pub(in crate::prepare) fn has_video(footage: &Path) -> bool {
    FOLDERS.iter().filter_map(|folder| fs::read_dir(footage.join(folder)).ok()).any(|entries| {
        let files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        let photos = files.iter().filter(|file| is_image(file));
        let photos: HashSet<_> = photos.filter_map(|photo| photo.file_stem()).collect();
        let has_photo = |film: &&PathBuf| film.file_stem().is_some_and(|stem| photos.contains(stem));
        let (beside, alone): (Vec<_>, Vec<_>) = files.iter().filter(|file| is_video(file)).partition(has_photo);
        // Some phones write .mp4, as cameras do: photos are stills of videos where most have one.
        !alone.is_empty() || 2 * beside.iter().filter(|film| !is_of_phone(film)).count() > photos.len()
    })
}

/// Names of all videos in the folders of a source, without ending, sorted.
pub(in crate::prepare) fn video_names(footage: &Path) -> Vec<String> {
    let folders = FOLDERS.iter().filter_map(|folder| fs::read_dir(footage.join(folder)).ok());
    let files = folders.flat_map(|entries| entries.flatten().map(|entry| entry.path()));
    let videos = files.filter(|path| is_video(path));
    let mut names: Vec<_> = videos.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())).collect();
    names.sort();
    names.dedup();
    names
}

/// Names of the folders of images in the folders of a source, sorted.
pub(super) fn sequence_names(footage: &Path) -> Vec<String> {
    let folders = FOLDERS.iter().filter_map(|folder| fs::read_dir(footage.join(folder)).ok());
    let entries = folders.flat_map(|entries| entries.flatten()).filter(|entry| entry.path().is_dir());
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<_> = names.filter(|name| find(footage, name).is_some()).collect();
    names.sort();
    names.dedup();
    names
}

/// The key that sorts names as people count: 2.png comes before 10.png.
fn by_number(name: &str) -> Vec<(u64, String)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let (text, other) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (number, after) = other.split_at(other.find(|c: char| !c.is_ascii_digit()).unwrap_or(other.len()));
        // Text decides before the number behind it; of equal numbers the one that is written first comes first.
        parts.push((0, text.to_owned()));
        parts.push((number.parse().unwrap_or(u64::MAX), number.to_owned()));
        rest = after;
    }
    parts
}

/// The frames of `files` by the numbers that their names end with, so that a lost image does not move those behind it to earlier
/// frames. None where the names are not numbers in even steps with most of them there, such as times.
fn numbered(files: &[PathBuf]) -> Option<Vec<u32>> {
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

fn with_ending(stem: &Path, ending: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    PathBuf::from(name)
}

fn images(folder: &Path) -> Option<Footage> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| is_image(path));
    files.sort_by_cached_key(|path| by_number(&path.file_name().unwrap_or_default().to_string_lossy()));
    let frames = numbered(&files).unwrap_or_else(|| (0..).take(files.len()).collect());
    let shots = frames.into_iter().zip(files).map(|(frame, image)| Shot { frame, image, ..Shot::default() });
    let shots: Vec<Shot> = shots.collect();
    (!shots.is_empty()).then_some(Footage::Images(shots))
}
