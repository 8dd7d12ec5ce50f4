use super::fingerprints::{Changes, Fingerprints};
use crate::error::{Error, Result};
use crate::files::{read_file, write_atomic};
use crate::scene::capture::{Calibration, Capture, CaptureSettings};
use crate::scene::{Similarity, View};
use crate::settings::Constants;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where a run's images come from and how they are rendered: `run.json` of its folder.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Absolute.
    pub capture: PathBuf,
    #[serde(default)]
    pub capture_settings: CaptureSettings,
    pub test_cameras: Vec<String>,
    /// See [`Capture::viewpoints`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub viewpoints: Vec<View>,
    /// Of cameras, by name, that the run took over from another.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub calibration: BTreeMap<String, Calibration>,
    /// From the capture to the frame that training computes in.
    pub world: Similarity,
    pub constants: Constants,
    pub held: CaptureSummary,
    /// None in runs of old versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprints: Option<Fingerprints>,
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptureSummary {
    /// Cameras, with the test cameras.
    pub cameras: usize,
    pub frames: u32,
    pub fps: f64,
    pub training_images: usize,
    pub test_images: usize,
    pub masks: usize,
    /// Largest width and largest height, pixels.
    pub largest_image: [u32; 2],
    pub points: usize,
}

impl CaptureSummary {
    pub fn new(capture: &Capture) -> Self {
        let shots = capture.cameras.iter().flat_map(|camera| &camera.shots);
        let largest =
            |side: fn(&crate::scene::capture::Camera) -> u32| capture.cameras.iter().map(side).max().unwrap_or(0);
        CaptureSummary {
            cameras: capture.cameras.len(),
            frames: capture.n_frames,
            fps: capture.fps,
            training_images: capture.training_frames().len(),
            test_images: capture.test_frames().len(),
            masks: shots.filter(|shot| shot.mask.is_some()).count(),
            largest_image: [largest(|c| c.intrinsics.width), largest(|c| c.intrinsics.height)],
            points: capture.points.len(),
        }
    }
}

impl Run {
    pub fn new(capture: &Capture, constants: Constants) -> Result<Self> {
        let absolute = std::path::absolute(&capture.path)
            .map_err(|e| Error::data(&capture.path, "", format!("has no absolute path: {e}"), "give another path"))?;
        if absolute.to_str().is_none() || capture.settings().images.to_str().is_none() {
            let remedy = "rename the folder, or give a link with another name";
            return Err(Error::data(&absolute, "", "has a name that is not UTF-8, which run.json cannot hold", remedy));
        }
        let tests = capture.cameras.iter().filter(|camera| camera.is_test);
        Ok(Run {
            capture: absolute,
            capture_settings: capture.settings().clone(),
            test_cameras: tests.map(|camera| camera.name.clone()).collect(),
            viewpoints: capture.viewpoints.clone(),
            calibration: capture.calibration.clone(),
            world: capture.normalisation(),
            constants,
            held: CaptureSummary::new(capture),
            fingerprints: Some(Fingerprints::of(capture)?),
        })
    }

    /// Constants in the capture's own frame, which is that of scene.ply.
    pub fn constants_of_capture(&self) -> Constants {
        Constants { near: (f64::from(self.constants.near) / self.world.scale) as f32, ..self.constants }
    }

    /// `constants` of the capture's own frame in the frame of training.
    pub fn constants_of_training(&self, constants: Constants) -> Constants {
        Constants { near: (f64::from(constants.near) * self.world.scale) as f32, ..constants }
    }

    pub fn file(folder: &Path) -> PathBuf {
        folder.join("run.json")
    }

    pub fn read(folder: &Path) -> Result<Self> {
        let file = Self::file(folder);
        let fault = |reason: String| Error::data(&file, "", reason, "give the folder of a run of `ivv train`");
        let text = read_file(&file).map_err(|e| fault(format!("cannot be read: {e}")))?;
        serde_json::from_slice(&text).map_err(|e| fault(e.to_string()))
    }

    pub fn write(&self, folder: &Path) -> Result<()> {
        write_atomic(&Self::file(folder), |to| Ok(serde_json::to_writer_pretty(to, self)?))
    }

    /// `capture` is in its own world.
    pub fn in_training(&self, capture: Capture) -> Capture {
        capture.transformed(&self.world)
    }

    /// As [`Run::open_capture`], with the changes of its cameras and pictures since the run began.
    pub fn compare_capture(&self, moved_to: Option<&Path>) -> Result<(Capture, Changes)> {
        let capture = self.open_capture(moved_to)?;
        let changes = match &self.fingerprints {
            Some(before) => before.changes(&Fingerprints::of(&capture)?),
            None => Changes::default(),
        };
        Ok((capture, changes))
    }

    /// Opens the capture, in its own world and with the run's test cameras, at `moved_to` if it has moved.
    pub fn open_capture(&self, moved_to: Option<&Path>) -> Result<Capture> {
        let path = moved_to.unwrap_or(&self.capture);
        // A file of cameras may stand for its folder.
        if !path.exists() {
            let remedy =
                "the capture has moved: give its new place (`ivv train --resume -o RUN CAPTURE`, elsewhere --capture)";
            return Err(Error::data(path, "", "no such folder", remedy));
        }
        let settings =
            CaptureSettings { test_cameras: Some(self.test_cameras.clone()), ..self.capture_settings.clone() };
        let mut capture = Capture::open_with(path, &settings)?;
        capture.viewpoints.clone_from(&self.viewpoints);
        let holds = CaptureSummary::new(&capture);
        if holds != self.held {
            // A run that trains no static Gaussians was made without photographs.
            let without = capture.clone().without_photos();
            if CaptureSummary::new(&without) == self.held {
                return Ok(without.calibrated(&self.calibration));
            }
            let reason = format!("holds {holds:?}, the run's held {:?}", self.held);
            return Err(Error::data(path, "", reason, "give the capture of this run, or train again"));
        }
        Ok(capture.calibrated(&self.calibration))
    }
}
