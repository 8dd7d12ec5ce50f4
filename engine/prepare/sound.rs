//! Sound and keypoints that lie beside a source's pictures.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::images::{Camera, Images, take_over};
use super::journal::{cannot_list, make_folder};
use super::settings::PrepareSettings;
use super::video::Selection;
use crate::error::{Error, Result};
use crate::files::{read_file, write_atomic};
use crate::scene::undistort::Undistortion;

/// Takes over `audio/*.wav` and `keypoints/<camera>.json` of a source from whose first frame on all is taken, but for those of cameras
/// of which later frames are taken. Keypoints are undistorted with their pictures.
#[tracing::instrument(level = "info", name = "sound", skip_all)]
pub(super) fn carry(images: &Images, settings: &PrepareSettings) -> Result<()> {
    let Selection { start, every, n } = images.select();
    let audio = settings.source.join("audio");
    if start == 0 && audio.is_dir() {
        make_folder(&images.output.join("audio"))?;
        for entry in fs::read_dir(&audio).map_err(|fault| cannot_list(&audio, &fault))?.flatten() {
            let to = images.output.join("audio").join(entry.file_name());
            let is_shifted = images.cameras.iter().any(|camera| {
                camera.start != 0 && entry.path().file_stem().is_some_and(|stem| stem == camera.name.as_str())
            });
            if entry.path().extension().is_some_and(|ending| ending == "wav") && !to.exists() && !is_shifted {
                take_over(&entry.path(), &to)?;
            }
        }
    }
    for camera in images.cameras.iter().filter(|camera| camera.start == 0) {
        let name = format!("keypoints/{}.json", camera.name);
        let (from, to) = (settings.source.join(&name), images.output.join(&name));
        if from.is_file() && !to.exists() {
            make_folder(&images.output.join("keypoints"))?;
            let moved = moved(&from, camera, every, n)?;
            write_atomic(&to, |to| Ok(serde_json::to_writer(to, &moved)?))?;
        }
    }
    Ok(())
}

/// The detections of the chosen frames, `{"frame_id", "instances": [{"keypoints": [[x, y], ..], "keypoint_scores", "bbox"}]}`;
/// a point that no pinhole shows gets the score 0.
fn moved(path: &Path, camera: &Camera, every: u32, n: u32) -> Result<Value> {
    let fault = |reason: String| Error::data(path, "", reason, "give the list of detections of each frame");
    let bytes = read_file(path).map_err(|fault_of| fault(format!("cannot be read: {fault_of}")))?;
    let mut frames: Vec<Value> = serde_json::from_slice(&bytes).map_err(|fault_of| fault(fault_of.to_string()))?;
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
