//! Which frames of several videos are of one moment, by the time codes that cameras write into them.

use std::collections::BTreeMap;

use super::settings::PrepareSettings;
use super::source::{Footage, Source};
use super::video::{self, RATE_TOLERANCE, Video};
use crate::error::{Error, Result};
use crate::parallel::in_parallel;

/// Cameras that were told the time together begin within so many seconds; others' codes say nothing.
const LONGEST: f64 = 600.0;

/// By name, frames by which the clip begins later in a camera's video, so that all begin with the last one. `None` where one has no
/// time code, or they are too far apart or of different rates.
fn shifts(videos: &[(&str, Option<&Video>)]) -> Option<BTreeMap<String, i32>> {
    let told: Vec<(&str, u32, f64)> = videos
        .iter()
        .map(|(name, video)| Some((*name, video.as_ref()?.timecode?, video.as_ref()?.fps)))
        .collect::<Option<_>>()?;
    let last = told.iter().map(|(_, code, _)| *code).max()?;
    let fps = told.first()?.2;
    let agrees = |(_, code, rate): &(&str, u32, f64)| {
        (rate / fps - 1.0).abs() < RATE_TOLERANCE && f64::from(last - code) <= LONGEST * fps
    };
    told.iter()
        .all(agrees)
        .then(|| told.iter().map(|(name, code, _)| ((*name).to_owned(), (last - code) as i32)).collect())
}

/// What time codes say, where nobody asked for them and they say that cameras did not begin together.
pub(super) fn note(videos: &[(&str, Option<&Video>)]) -> Option<String> {
    let shifts = shifts(videos)?;
    let told: Vec<String> =
        shifts.iter().filter(|(_, shift)| **shift != 0).map(|(name, shift)| format!("{name}={shift}")).collect();
    (!told.is_empty()).then(|| {
        format!(
            "the videos' time codes say that the cameras did not begin together; if their clocks were set together, give --shift \
             timecode, which is --shift {}",
            told.join(",")
        )
    })
}

/// `settings` with the shifts that the time codes of the videos of `source` say.
///
/// # Errors
/// [`Error::Data`] where they do not say any.
pub(super) fn applied(settings: &PrepareSettings, source: &Source) -> Result<PrepareSettings> {
    let probe = |index: usize| match &source.cameras[index].footage {
        Footage::Video(path) => video::probe(path).map(Some),
        Footage::Images(_) => Ok(None),
    };
    let videos = in_parallel(source.cameras.len(), settings.threads, probe, |_| {})?;
    let named = source.cameras.iter().map(|camera| camera.name.as_str());
    let videos: Vec<_> = named.zip(videos.iter().map(Option::as_ref)).collect();
    let Some(shifts) = shifts(&videos) else {
        let without: Vec<&str> = videos
            .iter()
            .filter(|(_, video)| video.is_none_or(|video| video.timecode.is_none()))
            .map(|(name, _)| *name)
            .collect();
        let reason = match without.is_empty() {
            true => format!("has videos whose time codes are more than {LONGEST} seconds apart, or whose rates differ"),
            false => format!("has cameras without a time code: {}", without.join(", ")),
        };
        return Err(Error::data(
            &settings.source,
            "--shift timecode",
            reason,
            "give the shifts as --shift CAMERA=FRAMES",
        ));
    };
    Ok(PrepareSettings { shifts, by_timecode: false, ..settings.clone() })
}
