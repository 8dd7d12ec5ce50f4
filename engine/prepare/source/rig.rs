//! COLMAP's calibration with a video or an image sequence of each camera, as ImViD's. An image named `<camera>.<ext>` or
//! `<camera>/<frame>.<ext>` gives a camera's pose; several of one camera, a moving camera's at those frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::footage;
use super::recording::{Footage, Place, Source, SourceCamera};
use crate::scene::capture::{Faults, Posed, camera_place, chosen_model, images_folder, read_images};

/// True if the cameras of the model have footage: a video, or more images than the model has of them. Footage may have strayed into a
/// plain project, as the film of a Live Photo; then most of the model's images must have footage.
pub(super) fn is_rig(place: Place) -> bool {
    // A capture folder is read as one.
    if place.folder.join("capture.toml").is_file() {
        return false;
    }
    let Some(folder) = model(place) else { return false };
    let model = read_images(&folder, &mut Faults::default());
    let images = images_folder(place.folder, &place.settings.capture);
    // A video that is given as footage is no film of a Live Photo.
    let may_be_live = place.settings.footage.is_none();
    let (mut n_with, mut n_perhaps, mut n_without, mut has_live) = (0, 0, 0, false);
    for (name, posed) in by_camera(&model.images) {
        let n_there = posed.iter().filter(|posed| images.join(&posed.name).is_file()).count();
        match footage::find(place.footage, &name) {
            Some(Footage::Video(film)) if may_be_live && is_beside(&posed, &film) => {
                has_live = true;
                // Some phones write .mp4, as cameras do: it is a rig where most have one.
                if footage::is_of_phone(&film) { n_without += n_there } else { n_perhaps += posed.len() }
            }
            Some(Footage::Video(_)) => n_with += posed.len(),
            Some(Footage::Images(shots)) if posed.len() == 1 && shots.len() > 1 => {
                let is_among = shots.iter().any(|shot| shot.image.ends_with(&posed[0].name));
                *(if is_among { &mut n_perhaps } else { &mut n_with }) += 1;
            }
            // A camera that moves looks like a folder of a plain project.
            Some(Footage::Images(_)) if posed.len() > 1 && posed.iter().all(|posed| number(posed).is_some()) => {}
            // An image of a plain project, or a camera of a rig whose footage is missing.
            _ => n_without += n_there,
        }
    }
    (n_with > 0 && !has_live) || n_with + n_perhaps > n_without
}

fn model(place: Place) -> Option<PathBuf> {
    Some(chosen_model(place.folder, &place.settings.capture).ok()??.0)
}

/// True if a film lies beside an image of its name, as phones put it there.
fn is_beside(posed: &[&Posed], film: &Path) -> bool {
    posed.iter().any(|posed| posed.name.file_name().is_some_and(|name| film.with_file_name(name).is_file()))
}

fn by_camera(images: &[Posed]) -> BTreeMap<String, Vec<&Posed>> {
    let mut cameras: BTreeMap<String, Vec<&Posed>> = BTreeMap::new();
    for posed in images {
        let parts: Vec<_> = posed.name.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let name = match parts.as_slice() {
            [folders @ .., _] if !folders.is_empty() => folders.join("_"),
            _ => posed.name.with_extension("").to_string_lossy().into_owned(),
        };
        cameras.entry(name).or_default().push(posed);
    }
    cameras
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let model = model(place).map(|folder| read_images(&folder, faults)).unwrap_or_default();
    let mut source = Source::of(&model.file);
    // Frames may be counted from 0 or from 1; the lowest number of all moving cameras tells.
    let cameras = by_camera(&model.images);
    let moving = cameras.values().filter(|posed| posed.len() > 1).flatten();
    let first = moving.filter_map(|posed| number(posed)).min().unwrap_or(0).min(1);
    if first == 1 {
        source.notes.push("frames are counted from 1: <camera>/1 is the first of the video".to_owned());
    }
    let mut is_complete = true;
    for (name, posed) in cameras {
        let mut fault = |reason: String, remedy: &str| {
            faults.add(&model.file, camera_place(&name), reason, remedy);
        };
        let lens = posed[0].lens;
        if posed.iter().any(|other| other.lens != lens) {
            fault("changes its intrinsics".to_owned(), "make it a camera for each of them");
            continue;
        }
        let mut poses = BTreeMap::new();
        if posed.len() > 1 {
            for image in &posed {
                let Some(frame) = number(image) else {
                    let reason = format!("has several images and one named `{}`", image.name.display());
                    fault(reason, "name the images of a moving camera <camera>/<frame>.<ext>");
                    continue;
                };
                if poses.insert(frame - first, image.pose).is_some() {
                    fault(format!("has two poses at frame {frame}"), "keep one");
                }
            }
        }
        let Some(footage) = footage::take(place.footage, &name, &model.file, faults) else {
            is_complete = false;
            continue;
        };
        source.cameras.push(SourceCamera { pose: posed[0].pose, name, lens, poses, footage, is_test: false });
    }
    if !is_complete {
        let note = "taken for a recording, since some cameras of the model have footage; if its images are what is meant, move the \
                    videos and folders that have their names out of the source";
        source.notes.push(note.to_owned());
    }
    source
}

fn number(posed: &Posed) -> Option<u32> {
    posed.name.file_stem()?.to_str()?.parse().ok()
}
