//! The views of a verb: from a capture, from a run's capture, or from a cameras file.

use crate::run::capture::{self, CaptureArgs};
use crate::run::files::config_of;
use anyhow::{bail, ensure};
use ivv::internals::files::folder_of;
use ivv::internals::scene::capture::{Capture, CaptureSettings};
use ivv::internals::scene::{View, read_views};
use ivv::internals::train::Run;
use std::ops::Range;
use std::path::Path;

#[derive(clap::Args)]
// Here `--frames` chooses views.
#[command(mut_arg("max_frames", |of_capture| of_capture.visible_alias(None)))]
pub struct ViewArgs {
    /// Takes only this camera of the capture; can be given several times.
    #[arg(long = "camera", value_name = "NAME")]
    names: Vec<String>,
    /// Takes only the frames from A up to, but not including, B, counted from 0. `A:`, `:B` and one number work too.
    #[arg(long, value_name = "A:B", value_parser = frames)]
    frames: Option<Range<u32>>,
    #[command(flatten)]
    read: CaptureArgs,
}

fn frames(text: &str) -> Result<Range<u32>, String> {
    let fault = || format!("expected A:B with A below B, for example 0:10, found {text}");
    let bound = |text: &str, otherwise: u32| match text {
        "" => Ok(otherwise),
        text => text.parse::<u32>().map_err(|_| fault()),
    };
    let range = match (text.split_once(':'), text.parse::<u32>()) {
        (Some((from, to)), _) => bound(from, 0)?..bound(to, u32::MAX)?,
        (None, Ok(frame)) => frame..frame.saturating_add(1),
        (None, Err(_)) => return Err(fault()),
    };
    if range.is_empty() { Err(fault()) } else { Ok(range) }
}

pub fn clip_time(text: &str) -> Result<f64, String> {
    let time = text.parse::<f64>().ok().filter(|time| (0.0..=1.0).contains(time));
    time.ok_or_else(|| format!("expected a time from 0 (the clip's start) to 1 (its end), found {text}"))
}

impl ViewArgs {
    pub fn choose(&self) -> bool {
        !self.names.is_empty() || self.frames.is_some()
    }

    pub fn settings(&self) -> CaptureSettings {
        // Test cameras do not matter here, and a capture of one image has a view too.
        CaptureSettings { test_every: 0, ..self.read.settings() }
    }

    /// Refuses options of how to read a capture that differ from those of `run`.
    pub fn agree_with(&self, run: &Run) -> anyhow::Result<()> {
        let differ = self.read.differ_from(run);
        ensure!(
            differ.is_empty(),
            "the capture of a run is read as for its training, but {}; leave these out",
            differ.join("; ")
        );
        Ok(())
    }

    /// Refuses options of how to read a capture if none is read.
    pub fn need_no_capture(&self, instead: &str) -> anyhow::Result<()> {
        ensure!(
            self.read.are_default(),
            "--images, --max-frames and the like say how a capture is read, but {instead}; leave them out"
        );
        Ok(())
    }

    /// A view of each chosen image, camera by camera; at a given `time` one of a static camera. Photographs must be named.
    pub fn of(&self, capture: &Capture, time: Option<f64>) -> anyhow::Result<Vec<View>> {
        let has = |name: &String| capture.cameras.iter().any(|camera| camera.name == *name);
        if let Some(name) = self.names.iter().find(|name| !has(name)) {
            let known: Vec<&str> = capture.cameras.iter().map(|camera| camera.name.as_str()).collect();
            bail!("--camera {name}: the capture has no camera of this name; it has {}", known.join(", "));
        }
        let mut views = Vec::new();
        for (index, camera) in capture.cameras.iter().enumerate() {
            let is_taken = if self.names.is_empty() { !camera.is_photo } else { self.names.contains(&camera.name) };
            if !is_taken {
                continue;
            }
            let is_asked = |frame: &u32| self.frames.as_ref().is_none_or(|frames| frames.contains(frame));
            let shots = camera.shots.iter().map(|shot| shot.frame).filter(is_asked);
            for frame in shots.take(if time.is_some() && !camera.moves() { 1 } else { usize::MAX }) {
                views.push(capture.view(index, frame)?);
            }
        }
        ensure!(
            !views.is_empty(),
            "expected at least one image, found none of these cameras and frames; the clip has frames 0 to {}",
            capture.n_frames.saturating_sub(1)
        );
        Ok(views)
    }

    /// The views of the capture of the run in `folder`, over the run's background. `moved_to` is where the capture is now.
    pub fn of_run(&self, folder: &Path, moved_to: Option<&Path>, time: Option<f64>) -> anyhow::Result<Vec<View>> {
        let run = Run::read(folder)?;
        self.agree_with(&run)?;
        let capture = run.open_capture(moved_to)?;
        let background = config_of(folder)?.background;
        Ok(self.of(&capture, time)?.into_iter().map(|view| View { background, ..view }).collect())
    }

    pub fn of_capture(&self, path: &Path, time: Option<f64>) -> anyhow::Result<Vec<View>> {
        self.of(&capture::open(path, &self.settings())?, time)
    }

    /// The views of `path`: a cameras file, a transforms.json or the folder of a capture.
    pub fn of_cameras(&self, path: &Path, time: Option<f64>) -> anyhow::Result<Vec<View>> {
        if path.is_dir() {
            return self.of_capture(path, time);
        }
        if path.file_name().is_some_and(|name| name == "transforms.json" || name == "transforms_train.json") {
            return self.of_capture(folder_of(path), time);
        }
        ensure!(
            !self.choose(),
            "--camera and --frames choose from a capture; {} is a cameras file, whose views are all taken",
            path.display()
        );
        self.need_no_capture(&format!("{} is a cameras file", path.display()))?;
        Ok(read_views(path)?)
    }
}
