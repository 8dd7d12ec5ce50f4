//! COLMAP's calibration (text or binary) with a video or an image sequence of each camera: ImViD, and what others export for
//! COLMAP. An image named `<camera>.<ext>` or `<camera>/<frame>.<ext>` gives a camera's pose; several of one camera, a moving
//! camera's at those frames.

use std::collections::BTreeMap;
use std::path::Path;

use super::footage;
use super::recording::{Footage, Place, Source, SourceCamera};
use crate::scene::capture::{Faults, Posed, images_folder, model_folder, read_images};

/// Whether the cameras of the model have footage: a video, or more images than the model has of them. Where more of the model's images
/// are there and have none, it is a plain project, in which a film or a folder of which one image was placed has strayed.
pub(super) fn is_rig(place: Place) -> bool {
    // A capture folder is read as one.
    if place.folder.join("capture.toml").is_file() {
        return false;
    }
    let Some(folder) = model_folder(place.folder) else { return false };
    let model = read_images(&folder, &mut Faults::default());
    let images = images_folder(place.folder, &place.settings.capture);
    let image_of = |posed: &Posed| images.join(&posed.name);
    // Phones put a film beside a photo, with its name (Live Photo); what is given as footage is no such film.
    let is_live = |posed: &[&Posed], video: &Path| {
        place.settings.footage.is_none()
            && posed
                .iter()
                .map(|posed| image_of(posed))
                .any(|image| image.is_file() && image.parent() == video.parent())
    };
    let (mut n_with, mut n_without) = (0, 0);
    for (name, posed) in by_camera(&model.images) {
        match footage::find(place.footage, &name) {
            Some(Footage::Video(video)) if !is_live(&posed, &video) => n_with += posed.len(),
            Some(Footage::Images(shots)) if posed.len() == 1 && shots.len() > 1 => n_with += 1,
            // A camera that moves looks like a folder of a plain project.
            Some(Footage::Images(_)) if posed.len() > 1 && posed.iter().all(|posed| number(posed).is_some()) => {}
            // An image of a plain project, or a camera of a rig whose footage is missing: a fault tells of that one.
            _ => n_without += posed.iter().filter(|posed| image_of(posed).is_file()).count(),
        }
    }
    n_with > n_without
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
    let model = model_folder(place.folder).map(|folder| read_images(&folder, faults)).unwrap_or_default();
    let mut source = Source { calibration: model.file.clone(), ..Source::default() };
    // Frames may be counted from 0 or from 1; the lowest number of all moving cameras tells.
    let cameras = by_camera(&model.images);
    let moving = cameras.values().filter(|posed| posed.len() > 1).flatten();
    let first = moving.filter_map(|posed| number(posed)).min().unwrap_or(0).min(1);
    if first == 1 {
        source.notes.push("frames are counted from 1: <camera>/1 is the first of the video".to_owned());
    }
    for (name, posed) in cameras {
        let mut fault = |reason: String, remedy: &str| {
            faults.add(&model.file, format!("camera `{}`", name.escape_debug()), reason, remedy);
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
        let Some(footage) = footage::take(place.footage, &name, &model.file, faults) else { continue };
        source.cameras.push(SourceCamera { pose: posed[0].pose, name, lens, poses, footage, is_test: false });
    }
    source
}

/// The frame that an image's name tells.
fn number(posed: &Posed) -> Option<u32> {
    posed.name.file_stem()?.to_str()?.parse().ok()
}
