//! Masks from a folder of their own (`--masks`): what is bright in them counts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::footage::{files, numbered};
use super::recording::{Footage, Masks, Source, SourceCamera};
use crate::prepare::foreign::{Kind, counts, kind};
use crate::scene::capture::Faults;
use crate::words::listed;

/// Folders that a recording may have its masks in.
const FOLDERS: [&str; 3] = ["masks", "mask", "fmasks"];

/// Finds the masks of a source's cameras: `<folder>/<camera>/` with one of each frame, or `<folder>/<picture>.png` of one picture. None at
/// all is a fault.
pub(super) fn find(source: &mut Source, folder: &Path, faults: &mut Faults) {
    let found = source.cameras.iter().filter_map(|camera| Some((camera.name.clone(), of_camera(camera, folder)?)));
    let found: Masks = found.collect();
    if found.is_empty() && !source.cameras.is_empty() {
        let held = files(folder);
        let reason = match folder.is_dir() {
            true => format!("has no mask of any camera; it holds {}", counts(&held)),
            false => "no such folder".to_owned(),
        };
        let name = &source.cameras[0].name;
        let remedy =
            format!("give a folder with one mask for each frame in {name}/ and so on, or of photographs {name}.png");
        faults.add(folder, "--masks", reason, remedy);
    }
    let without: Vec<&str> =
        source.cameras.iter().map(|camera| camera.name.as_str()).filter(|name| !found.contains_key(*name)).collect();
    if !found.is_empty() && !without.is_empty() {
        let (n, of) = (without.len(), source.cameras.len());
        source.notes.push(format!("{n} of {of} cameras have no masks: {}", listed(&without)));
    }
    source.masks = found;
}

pub(super) fn note(folder: &Path) -> Option<String> {
    let found = FOLDERS.iter().map(|name| folder.join(name)).find(|path| path.is_dir())?;
    Some(format!("the masks in {} are not used: give --masks {0} to use them", found.display()))
}

fn of_camera(camera: &SourceCamera, folder: &Path) -> Option<BTreeMap<u32, PathBuf>> {
    let mut own = files(&folder.join(&camera.name));
    own.retain(|path| [Kind::Own, Kind::Converted].contains(&kind(path)));
    match &camera.footage {
        Footage::Images(shots) => {
            let with_name =
                |image: &Path| own.iter().find(|path| is_of(path, image)).cloned().or_else(|| mask_of(folder, image));
            let by_name = shots.iter().filter_map(|shot| Some((shot.frame, with_name(&shot.image)?)));
            let by_name: BTreeMap<u32, PathBuf> = by_name.collect();
            let by_order = || shots.iter().map(|shot| shot.frame).zip(own.iter().cloned()).collect();
            let found = if by_name.is_empty() && own.len() == shots.len() { by_order() } else { by_name };
            (!found.is_empty()).then_some(found)
        }
        Footage::Video(_) => {
            let frames = numbered(&own).unwrap_or_else(|| (0..).take(own.len()).collect());
            (!own.is_empty()).then(|| frames.into_iter().zip(own).collect())
        }
    }
}

/// True if a mask has the name of a picture: `a.png` or `a.jpg.png` of `a.jpg`.
fn is_of(mask: &Path, image: &Path) -> bool {
    let stem = mask.file_stem();
    stem.is_some() && (stem == image.file_stem() || stem == image.file_name())
}

/// The mask of a picture below a folder that has the picture's name, with that of its folder or without.
fn mask_of(folder: &Path, image: &Path) -> Option<PathBuf> {
    let parent = image.parent().and_then(Path::file_name).map(|name| folder.join(name));
    let places = parent.into_iter().chain([folder.to_owned()]);
    places.flat_map(|place| files(&place)).find(|path| kind(path) == Kind::Own && is_of(path, image))
}
