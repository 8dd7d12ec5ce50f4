//! caliscope: `camera_array.toml`, the videos `cam_<id>.mp4`, and `timestamps.csv` with the arrival of each frame, from which
//! `tools/board_clocks.py` derives the time of each.

use std::collections::BTreeMap;
use std::path::Path;

use super::opencv::{self, Rotation};
use super::recording::{Clocks, Place, Source};
use crate::error::{self, Error};
use crate::files::{cannot_read, read_text};
use crate::scene::Pose;
use crate::scene::capture::Faults;
use crate::scene::undistort::Lens;

const REMEDY: &str = "calibrate all cameras with caliscope, or set ignore = true for this one";

#[derive(serde::Deserialize)]
struct Array {
    cameras: BTreeMap<String, Camera>,
}

#[derive(serde::Deserialize)]
struct Camera {
    #[serde(default)]
    rotation_count: i32,
    #[serde(default)]
    ignore: bool,
    size: [u32; 2],
    matrix: Option<[[f64; 3]; 3]>,
    distortions: Option<Vec<f64>>,
    translation: Option<[f64; 3]>,
    rotation: Option<Rotation>,
    #[serde(default)]
    fisheye: bool,
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = place.folder.join("camera_array.toml");
    let mut source = Source::of(&calibration);
    let text = read_text(&calibration).map_err(|fault| cannot_read(&calibration, &fault));
    let array = text.and_then(|text| {
        let bad = |fault: toml::de::Error| format!("is no camera array: {}", fault.message());
        toml::from_str::<Array>(&text).map_err(|fault| Error::data(&calibration, "", bad(fault), REMEDY))
    });
    let Some(array) = faults.take(array) else { return source };
    for (id, camera) in array.cameras.iter().filter(|(_, camera)| !camera.ignore) {
        source.add(&format!("cam_{id}"), camera.calibrated(), place.footage, REMEDY, faults);
    }
    let recording = source.cameras.first().and_then(|camera| camera.footage.place().parent());
    if let Some(file) = recording.map(|folder| folder.join("timestamps.csv")).filter(|file| file.is_file()) {
        source.clocks = faults.take(times(&file)).map_or(Clocks::Unknown, Clocks::Times);
    }
    source
}

/// The times of the cameras' frames, the n-th line of a camera being its video's frame n; one without a time is not known.
fn times(file: &Path) -> error::Result<BTreeMap<String, Vec<Option<f64>>>> {
    let bad = |line: usize, reason: String| {
        let remedy = "give the file that caliscope wrote beside the videos, or remove it";
        Error::data(file, format!("line {}", line + 1), reason, remedy)
    };
    let text = read_text(file).map_err(|fault| cannot_read(file, &fault))?;
    let header: Vec<&str> = text.lines().next().unwrap_or_default().split(',').map(str::trim).collect();
    let column = |name: &str| {
        let index = header.iter().position(|field| *field == name);
        index.ok_or_else(|| bad(0, format!("has no column `{name}`")))
    };
    let (id, time) = (column("cam_id")?, column("frame_time")?);
    let mut times: BTreeMap<String, Vec<Option<f64>>> = BTreeMap::new();
    for (line, fields) in text.lines().enumerate().skip(1).filter(|(_, fields)| !fields.trim().is_empty()) {
        let fields: Vec<&str> = fields.split(',').map(str::trim).collect();
        let (Some(id), Some(seconds)) = (fields.get(id), fields.get(time)) else {
            return Err(bad(line, format!("has {} fields, the first line {}", fields.len(), header.len())));
        };
        let seconds = match *seconds {
            "" => None,
            seconds => match seconds.parse::<f64>() {
                Ok(seconds) if seconds.is_finite() => Some(seconds),
                _ => return Err(bad(line, format!("has the time `{}`", seconds.escape_debug()))),
            },
        };
        times.entry(format!("cam_{id}")).or_default().push(seconds);
    }
    Ok(times)
}

impl Camera {
    fn calibrated(&self) -> Result<(Lens, Pose), String> {
        let (Some(matrix), Some(distortions), Some(translation), Some(rotation)) =
            (&self.matrix, &self.distortions, self.translation, &self.rotation)
        else {
            return Err("is not calibrated: matrix, distortions, translation or rotation is missing".to_owned());
        };
        if self.rotation_count != 0 {
            return Err(format!("is turned (rotation_count = {}), which is not read", self.rotation_count));
        }
        let lens = opencv::lens(self.size, matrix, distortions, self.fisheye)?;
        Ok((lens, Pose { rotation: rotation.matrix(), translation: translation.into() }))
    }
}
