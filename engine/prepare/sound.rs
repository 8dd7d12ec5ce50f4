//! Sound and keypoints that lie beside a source's pictures.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::images::{Camera, Images, take_over};
use super::journal::{Journal, SOUND, stamps};
use super::settings::PrepareSettings;
use super::video::Selection;
use crate::error::Result;
use crate::files::{cannot_list, make_folder, read_json, write_atomic};
use crate::scene::undistort::Undistortion;

/// Writes the sound of the videos, and takes over `audio/*.wav` and `keypoints/<camera>.json` of a source that is taken from its first
/// frame on. Keypoints are undistorted with their pictures.
#[tracing::instrument(level = "info", name = "sound", skip_all)]
pub(super) fn carry(images: &Images, settings: &PrepareSettings, journal: &Journal) -> Result<()> {
    let Selection { start, every, n } = images.select;
    let sounds = sounds(&settings.source, &images.cameras, start)?;
    let points = images.cameras.iter().filter_map(|camera| keypoints(&settings.source, camera));
    journal.begin(SOUND, stamps(sounds.iter().cloned().chain(points)))?;
    images.write_sound()?;
    for from in sounds {
        let to = images.output.join("audio").join(from.file_name().unwrap_or_default());
        if !to.exists() {
            make_folder(&images.output.join("audio"))?;
            take_over(&from, &to)?;
        }
    }
    for camera in &images.cameras {
        let Some(from) = keypoints(&settings.source, camera) else { continue };
        let to = images.output.join(format!("keypoints/{}.json", camera.name));
        if !to.exists() {
            make_folder(&images.output.join("keypoints"))?;
            let moved = moved(&from, camera, every, n)?;
            write_atomic(&to, |to| Ok(serde_json::to_writer(to, &moved)?))?;
        }
    }
    Ok(())
}

fn sounds(source: &Path, cameras: &[Camera], start: u32) -> Result<Vec<PathBuf>> {
    let audio = source.join("audio");
    if start != 0 || !audio.is_dir() {
        return Ok(Vec::new());
    }
    let is_taken = |path: &PathBuf| {
        let is_of = |camera: &Camera| path.file_stem().is_some_and(|stem| stem == camera.name.as_str());
        let is_shifted = cameras.iter().any(|camera| camera.start != 0 && is_of(camera));
        path.extension().is_some_and(|ending| ending == "wav") && !is_shifted
    };
    let entries = fs::read_dir(&audio).map_err(|fault| cannot_list(&audio, &fault))?.flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_taken).collect();
    files.sort();
    Ok(files)
}

fn keypoints(source: &Path, camera: &Camera) -> Option<PathBuf> {
    let path = source.join(format!("keypoints/{}.json", camera.name));
    (camera.start == 0 && path.is_file()).then_some(path)
}

/// The detections of the chosen frames; a point that no pinhole shows gets the score 0.
fn moved(path: &Path, camera: &Camera, every: u32, n: u32) -> Result<Value> {
    let remedy = "give the list of detections of each frame";
    let mut frames: Vec<Value> = read_json(path, "list of detections", remedy)?;
    let undistortion = Undistortion::new(camera.lens, camera.pinhole);
    let place = |point: &Value| {
        let [x, y] = [0, 1].map(|k| point.get(k).and_then(Value::as_f64));
        undistortion.target_of(camera.scaled([x?, y?]))
    };
    frames.retain_mut(|frame| {
        let number = frame.get("frame_id").and_then(Value::as_u64).filter(|id| id % u64::from(every) == 0);
        let Some(number) = number.map(|id| id / u64::from(every)).filter(|id| *id < u64::from(n)) else { return false };
        frame["frame_id"] = number.into();
        for instance in frame.get_mut("instances").and_then(Value::as_array_mut).into_iter().flatten() {
            let found = instance.get("keypoints").and_then(Value::as_array).cloned().unwrap_or_default();
            for (index, point) in found.iter().enumerate() {
                let to = place(point);
                instance["keypoints"][index] = to.unwrap_or_default().as_slice().into();
                if to.is_none() && instance["keypoint_scores"].get(index).is_some() {
                    instance["keypoint_scores"][index] = 0.into();
                }
            }
            let corners = instance.get("bbox").and_then(|bbox| bbox.get(0)).and_then(Value::as_array).cloned();
            if let Some([left, top, right, bottom]) = corners.as_deref() {
                let ends = [[left, top], [right, bottom]].map(|[x, y]| place(&Value::from(vec![x.clone(), y.clone()])));
                if let [Some([l, t]), Some([r, b])] = ends {
                    instance["bbox"][0] = [l, t, r, b].as_slice().into();
                }
            }
        }
        true
    });
    Ok(frames.into())
}
