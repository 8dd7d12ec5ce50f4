//! Optical flow of the finished images, by `tools/priors.py`.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::json;

use super::images::{Camera, Images};
use super::journal::Journal;
use super::program::last_line;
use super::settings::{OnProgress, PrepareSettings, Progress, Share};
use crate::error::{Error, Result};
use crate::parallel::{in_parallel, memory};

/// In the program, so that it works without a checkout.
const SCRIPT: &str = include_str!("../../tools/priors.py");
/// The first that has OpenCV is taken; Debian's package is only for its own Python.
const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];
const INSTALL: &str = "install OpenCV for Python (Debian: apt-get install python3-opencv), or leave out --flow";

/// Memory that the script takes for a pixel, bytes: 4.24 GB for pictures of 5312 x 2988.
const BYTES_OF_PIXEL: u64 = 270;

/// How many scripts run at once: at most `threads`, and no more than half of the memory holds.
fn at_once(threads: usize, pixels: u64, memory: u64) -> usize {
    let fit = memory / 2 / (BYTES_OF_PIXEL * pixels).max(1);
    threads.min(usize::try_from(fit).unwrap_or(usize::MAX)).max(1)
}

fn frames<'a>(images: &Images, camera: &'a Camera) -> impl Iterator<Item = u32> + use<'a> {
    (0..images.n_frames().saturating_sub(1)).filter(|frame| camera.has(*frame) && camera.has(frame + 1))
}

/// The cameras that do not bring all of their flow along.
fn estimated(images: &Images) -> Result<Vec<&Camera>> {
    let lacks = |camera: &&Camera| frames(images, camera).any(|frame| camera.flow(frame).is_none());
    let cameras: Vec<&Camera> = images.cameras.iter().filter(lacks).collect();
    // A folder holds flow of one kind; that of pictures which change becomes .npy.
    let other = cameras
        .iter()
        .copied()
        .filter(|camera| camera.is_as_recorded())
        .flat_map(|camera| frames(images, camera).filter_map(move |frame| camera.flow(frame)))
        .find(|flow| flow.extension().is_none_or(|ending| ending != "npy"));
    match other {
        Some(flow) => {
            let reason = "is flow of some frames of its camera only; --flow dis would write that of the others as .npy, and the \
                          flow of a camera cannot be in two formats";
            Err(Error::data(flow, "", reason, "give the flow of all frames, convert it to .npy, or leave out --flow"))
        }
        None => Ok(cameras),
    }
}

/// Estimates the missing flow to the next frame, of every frame but the last; the source's own flow stays.
#[tracing::instrument(level = "info", name = "flow", skip_all)]
pub(super) fn make(
    images: &Images,
    settings: &PrepareSettings,
    share: Share,
    journal: &Journal,
    progress: OnProgress,
) -> Result<()> {
    let output = &images.output;
    let estimated = estimated(images)?;
    if estimated.is_empty() {
        return Ok(());
    }
    let carries = |camera: &&Camera| frames(images, camera).any(|frame| camera.flow(frame).is_some());
    let kept = images.cameras.iter().filter(carries).map(|camera| output.join("flow").join(&camera.name));
    let kept: Vec<PathBuf> = kept.collect();
    journal.begin_beside("flow", json!({ "method": "dis at full resolution" }), &kept)?;
    let own = (0..).zip(estimated).filter(|(number, _)| share.has(*number)).map(|(_, camera)| camera);
    let own: Vec<&Camera> = own.collect();
    let (left, done): (Vec<&Camera>, Vec<&Camera>) = own.iter().partition(|camera| is_left(images, camera));
    let left: Vec<&str> = left.into_iter().map(|camera| camera.name.as_str()).collect();
    let count = |cameras: &[&Camera]| cameras.iter().map(|camera| frames(images, camera).count()).sum::<usize>();
    if left.is_empty() {
        return Ok(());
    }
    let python = python(output)?;
    let (done, total) = (AtomicUsize::new(count(&done)), count(&own));
    let tell = |piece: &str| {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Progress { stage: "flow", done, total, piece });
    };
    let pixels = images.cameras.iter().map(|camera| camera.pinhole.intrinsics.n_pixels()).max().unwrap_or(0);
    let at_once = at_once(settings.threads, pixels, memory());
    in_parallel(left.len(), at_once, |index| estimate(python, output, left[index], &tell), |_| {}).map(|_| ())
}

fn is_left(images: &Images, camera: &Camera) -> bool {
    let folder = images.output.join("flow").join(&camera.name);
    frames(images, camera)
        .any(|frame| camera.flow(frame).is_none() && !folder.join(format!("{frame:05}.npy")).is_file())
}

pub(super) fn require(images: &Images, settings: &PrepareSettings) -> Result<()> {
    if !settings.flow {
        return Ok(());
    }
    // With force, what is there may be made again.
    if estimated(images)?.into_iter().any(|camera| settings.force || is_left(images, camera)) {
        python(&settings.source)?;
    }
    Ok(())
}

fn python(about: &Path) -> Result<&'static str> {
    let has_opencv = |python: &&str| {
        let mut command = Command::new(python);
        command.args(["-c", "import cv2, numpy"]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    PYTHONS.into_iter().find(has_opencv).ok_or_else(|| {
        let reason = "needs python3 with OpenCV and NumPy for --flow dis, which is not installed";
        Error::data(about, "", reason, INSTALL)
    })
}

fn estimate(python: &str, capture: &Path, camera: &str, tell: &dyn Fn(&str)) -> Result<()> {
    let fault = |reason: String| Error::data(&capture.join("flow").join(camera), "", reason, INSTALL);
    let mut command = Command::new(python);
    command.arg("-").arg(capture).args(["--flow", "dis", "--cameras", camera]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child: Child = command.spawn().map_err(|e| fault(format!("{python} does not start: {e}")))?;
    // The script is small and read whole before it runs.
    if let Some(mut stdin) = child.stdin.take() {
        stdin.write_all(SCRIPT.as_bytes()).map_err(|e| fault(format!("{python} does not read: {e}")))?;
    }
    for line in child.stdout.take().into_iter().flat_map(|from| BufReader::new(from).lines()) {
        tell(&line.map_err(|e| fault(format!("{python} cannot be heard: {e}")))?);
    }
    let ended = child.wait_with_output().map_err(|e| fault(format!("{python} cannot be waited for: {e}")))?;
    if ended.status.success() {
        return Ok(());
    }
    let said = last_line(&String::from_utf8_lossy(&ended.stderr)).unwrap_or_default();
    Err(fault(format!("optical flow failed ({}): {said}", ended.status)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_at_once_fit_the_memory() {
        let large = 5312 * 2988;
        assert_eq!([32, 64, 1024].map(|gib| at_once(16, large, gib << 30)), [4, 8, 16]);
        assert_eq!([at_once(16, large, 1 << 30), at_once(16, 640 * 360, 8 << 30), at_once(2, 0, 0)], [1, 16, 1]);
    }
}
