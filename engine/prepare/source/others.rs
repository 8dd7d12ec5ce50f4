//! Hints at the content of a folder that is no source.

use std::path::{Path, PathBuf};

use super::footage::{clips, files};
use crate::error::Error;
use crate::prepare::foreign::{Kind, counts, kind};
use crate::scene::capture::{is_capture, unread_poses};
use crate::words::listed;

/// Folders that are searched for a source, at each depth.
const SEARCHED: usize = 64;
/// The path to give for a source, and its kind.
type Recognise = fn(&Path) -> Option<(PathBuf, String)>;

pub(super) fn unknown(path: &Path, recognise: Recognise) -> Error {
    let bad = |reason: &str, remedy: &str| Error::data(path, "", reason, remedy);
    if !path.exists() {
        return bad("no such folder", "check its name");
    }
    if path.is_file() {
        let reason = format!("is {}, no folder and no video", counts(&[path.to_owned()]));
        return bad(&reason, "give the folder that it lies in");
    }
    let held = files(path);
    if held.is_empty() {
        return bad("is empty", "give a folder of photos, of videos, or of a recording");
    }
    let pictures = held.iter().filter(|file| kind(file) != Kind::Other).count();
    if pictures == 1 && held.len() < 3 {
        let remedy = "give three or more that overlap, from different places";
        return bad("holds one picture, which is not enough", remedy);
    }
    let reason = format!("not a recognised recording: it holds {}", counts(&held));
    let inside = inside(&held, recognise);
    if let Some((first, _)) = inside.first() {
        let named: Vec<String> = inside.iter().map(|(folder, what)| format!("{} ({what})", folder.display())).collect();
        let of_several = if inside.len() > 1 && inside.iter().all(|(folder, _)| is_of_photos(folder)) {
            "; photos of one scene go into one folder, and images of cameras that filmed together into a video of each"
        } else {
            ""
        };
        let remedy = format!(
            "give what lies in it: {}; as `ivv prepare {} -o CAPTURE`{of_several}",
            listed(&named),
            first.display()
        );
        return bad(&reason, &remedy);
    }
    let poses = unread_poses(path).first().map_or_else(String::new, |poses| format!("{poses}; "));
    let remedy = "give a folder with models.json, poses_bounds.npy, camera_array.toml, intri.yml and extri.yml, a calibration of Pose2Sim \
                  or anipose, cameras.txt and images.txt beside videos, capture.toml, train_meta.json, transforms.json or a COLMAP model \
                  in sparse/0; or photos, a video or a folder of videos, whose cameras COLMAP finds";
    bad(&reason, &(poses + remedy))
}

fn is_of_photos(folder: &Path) -> bool {
    files(folder).iter().filter(|file| kind(file) != Kind::Other).nth(1).is_some()
}

/// A source one or two folders down.
fn inside(held: &[PathBuf], recognise: Recognise) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for folder in held.iter().filter(|path| path.is_dir()).take(SEARCHED) {
        let deeper = files(folder).into_iter().filter(|path| path.is_dir()).take(SEARCHED);
        found.extend(std::iter::once(folder.clone()).chain(deeper).find_map(|folder| known(folder, recognise)));
    }
    found
}

fn known(folder: PathBuf, recognise: Recognise) -> Option<(PathBuf, String)> {
    if is_capture(&folder) {
        return Some((folder, "a capture".to_owned()));
    }
    // One clip is that of a scene that stands still.
    if let [clip] = clips(&folder).as_slice() {
        return Some((clip.clone(), "a video".to_owned()));
    }
    recognise(&folder)
}
