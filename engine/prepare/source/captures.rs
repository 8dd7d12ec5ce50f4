//! Sources that are captures: the project's own folder, Dynamic3DGaussians, transforms.json and plain COLMAP.

use std::collections::HashMap;

use super::footage;
use super::recording::{Clocks, Footage, Place, Source, SourceCamera};
use crate::scene::capture::{
    Alpha, Camera, CaptureBuilder, CaptureSettings, Faults, Frames, PHOTOS, describe, has_alpha, seen_points,
};

pub(super) fn read(place: Place, faults: &mut Faults) -> Option<Source> {
    let asked = &place.settings.capture;
    let images = place.settings.footage.clone().unwrap_or(asked.images.clone());
    let settings = CaptureSettings { images, frames: Frames::default(), ..asked.clone() };
    let (format, mut builder) = describe(place.folder, &settings, faults)?;
    let listed: HashMap<String, usize> =
        builder.cameras.iter().map(|camera| (camera.name.clone(), camera.shots.len())).collect();
    let before = faults.n();
    builder.check_missing(place.folder, &settings, faults);
    if faults.n() > before {
        // What is missing of a camera is told: the rest of it would be told again as gaps.
        builder.cameras.retain(|camera| listed.get(&camera.name) == Some(&camera.shots.len()));
    }
    if settings.alpha == Alpha::Mask {
        for shot in builder.cameras.iter_mut().flat_map(|camera| &mut camera.shots) {
            let alpha = has_alpha(&shot.image).then(|| shot.image.clone());
            shot.foreground = shot.foreground.take().or(alpha);
        }
    }
    if builder.n_frames > 1 {
        merge_moving(&mut builder);
    }
    let mut source = Source {
        format,
        calibration: builder.calibration.clone(),
        fps: Some(builder.fps),
        notes: std::mem::take(&mut builder.notes),
        frame_points: builder.frame_points.take(),
        clocks: Clocks::Offsets(std::mem::take(&mut builder.true_offsets)),
        may_lack: place.folder.join("capture.toml").is_file(),
        photos: builder.photos.take().map(|_| place.folder.join(PHOTOS)),
        ..Source::default()
    };
    let is_told = place.settings.footage.is_some();
    if format == "COLMAP" && !is_told && !footage::video_names(place.footage).is_empty() {
        let note = "videos beside the images are left out; if they are the footage, name their folder with --footage";
        source.notes.push(note.to_owned());
    }
    // Of other formats nothing tells who saw a point.
    source.points = match builder.model.take() {
        Some((model, ids)) => {
            let points = faults.take(seen_points(&model)).unwrap_or_default();
            let named = |by: Vec<u32>| by.iter().filter_map(|id| ids.get(id).cloned()).collect();
            points.into_iter().map(|(point, by)| (point, named(by))).collect()
        }
        None => builder.points.iter().map(|point| (*point, Vec::new())).collect(),
    };
    let camera = |camera: &Camera| SourceCamera {
        name: camera.name.clone(),
        lens: builder.lens(camera),
        pose: camera.world_to_camera,
        poses: camera.shots.iter().filter_map(|shot| Some((shot.frame, shot.world_to_camera?))).collect(),
        footage: Footage::Images(camera.shots.clone()),
        is_test: camera.is_test,
    };
    source.cameras = builder.cameras.iter().map(camera).collect();
    Some(source)
}

/// Images of one moving lens are one camera when each time has one image, as in the `transforms.json` of a single camera.
fn merge_moving(builder: &mut CaptureBuilder) {
    let lens = |camera: &Camera| Camera {
        name: String::new(),
        world_to_camera: Default::default(),
        is_test: false,
        shots: Vec::new(),
        ..camera.clone()
    };
    let same = builder.cameras.windows(2).all(|pair| lens(&pair[0]) == lens(&pair[1]));
    let mut frames: Vec<u32> = builder.cameras.iter().flat_map(|c| c.shots.iter().map(|shot| shot.frame)).collect();
    frames.sort_unstable();
    let each_once = frames.iter().copied().eq(0..builder.n_frames);
    if builder.cameras.len() < 2 || !same || !each_once {
        return;
    }
    let mut merged = builder.cameras[0].clone();
    let distortion = builder.distorted.get(&merged.name).copied();
    merged.shots.clear();
    for camera in &builder.cameras {
        let posed = camera.shots.iter().cloned();
        merged.shots.extend(posed.map(|mut shot| {
            shot.world_to_camera = shot.world_to_camera.or(Some(camera.world_to_camera));
            shot
        }));
    }
    merged.shots.sort_by_key(|shot| shot.frame);
    (merged.name, merged.is_test) = ("camera".to_owned(), false);
    merged.world_to_camera = merged.shots[0].world_to_camera.unwrap_or(merged.world_to_camera);
    builder.distorted = distortion.into_iter().map(|distortion| (merged.name.clone(), distortion)).collect();
    builder.cameras = vec![merged];
}
