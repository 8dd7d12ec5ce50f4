//! By how much cameras began apart, as their videos tell: by time codes or by what they hear.

use std::path::{Path, PathBuf};

use super::settings::{PrepareSettings, ShiftBy};
use super::source::{Footage, Source};
use super::timecodes::{self, LONGEST};
use super::timeline::Timeline;
use super::video::{self, Video};
use crate::error::{Error, Result};
use crate::parallel::in_parallel;
use crate::sound::lag::{CONFIDENT, Lag, lags};

/// Samples per second of the sound that is compared, and the seconds of it, at most.
const RATE: u32 = 8000;
const HEARD: f64 = 300.0;

pub(super) fn videos_of(source: &Source) -> Vec<(String, Option<PathBuf>)> {
    let video = |footage: &Footage| match footage {
        Footage::Video(path) => Some(path.clone()),
        Footage::Images(_) => None,
    };
    source.cameras.iter().map(|camera| (camera.name.clone(), video(&camera.footage))).collect()
}

/// `settings` with the shifts that the videos tell, where they are asked, and what is worth knowing of them.
pub(super) fn resolved(
    settings: &PrepareSettings,
    videos: &[(String, Option<PathBuf>)],
) -> Result<(PrepareSettings, Vec<String>)> {
    if settings.shift_by == ShiftBy::Given {
        return Ok((settings.clone(), Vec::new()));
    }
    let probe = |index: usize| videos[index].1.as_deref().map(video::probe).transpose();
    let probed = in_parallel(videos.len(), settings.threads, probe, |_| {})?;
    let named: Vec<(&str, Option<&Video>)> =
        videos.iter().map(|(name, _)| name.as_str()).zip(probed.iter().map(Option::as_ref)).collect();
    let given = PrepareSettings { shift_by: ShiftBy::Given, ..settings.clone() };
    if settings.shift_by == ShiftBy::Timecode {
        let mut shifts = timecodes::shifts(&named).ok_or_else(|| without_codes(settings, &named))?;
        // Codes count the videos' own frames.
        let own = named.iter().find_map(|(_, video)| Some(video.as_ref()?.fps));
        let scale = settings.fps.zip(own).map_or(1.0, |(asked, own)| asked / own);
        shifts.values_mut().for_each(|frames| *frames *= scale);
        return Ok((PrepareSettings { shifts, ..given }, Vec::new()));
    }
    let silent = |named: &(&str, Option<&Video>)| !named.1.is_some_and(|video| video.has_sound);
    let silent: Vec<&str> = named.iter().filter(|it| silent(it)).map(|(name, _)| *name).collect();
    if !silent.is_empty() {
        return Err(unheard(settings, format!("has cameras without sound: {}", silent.join(", ")), &silent));
    }
    let listen = |index: usize| {
        let path = videos[index].1.as_deref().unwrap_or(Path::new(""));
        video::samples(path, RATE, HEARD)
    };
    let recordings = in_parallel(videos.len(), settings.threads, listen, |_| {})?;
    let lags = lags(&recordings, f64::from(RATE));
    let heard: Vec<(&str, &Video, Option<Lag>)> =
        named.iter().zip(lags).filter_map(|((name, video), lag)| Some((*name, (*video)?, lag))).collect();
    by_lags(given, &heard)
}

/// The shifts that put what cameras hear into step, so that the clip begins with the last of them.
fn by_lags(settings: PrepareSettings, heard: &[(&str, &Video, Option<Lag>)]) -> Result<(PrepareSettings, Vec<String>)> {
    let is_sure = |lag: &Option<Lag>| lag.is_some_and(|lag| lag.stands_out >= CONFIDENT);
    let videos = heard.iter().map(|(name, video, _)| (*name, *video));
    let Some(timeline) = Timeline::new(videos, &settings) else { return Ok((settings, Vec::new())) };
    // By the clock of each file, one moment; and the last of the first pictures by it.
    let moment = |video: &Video, lag: Lag| video.begins + lag.seconds;
    let sure =
        heard.iter().filter_map(|(name, video, lag)| Some((*name, *video, lag.filter(|lag| is_sure(&Some(*lag)))?)));
    let last = sure.clone().map(|(_, video, lag)| video.times[0] - moment(video, lag)).fold(f64::MIN, f64::max);
    let shift = |(name, video, lag): (&str, &Video, Lag)| {
        let frames = (moment(video, lag) + last - timeline.time(name, 0)) * timeline.fps;
        // To a thousandth of a frame, which is far below what sound tells.
        ((name.to_owned(), (frames * 1e3).round() / 1e3), lag.stands_out)
    };
    let shifts: Vec<((String, f64), f64)> = sure.map(shift).collect();
    let words = shifts.iter().map(|((name, frames), stands_out)| match stands_out.is_finite() {
        true => format!("{name}={frames:.2} ({:.3} s, {stands_out:.1} times)", frames / timeline.fps),
        false => format!("{name}={frames:.2} (the reference)"),
    });
    let words = words.collect::<Vec<_>>().join(", ");
    let unsure: Vec<&str> = heard.iter().filter(|(.., lag)| !is_sure(lag)).map(|(name, ..)| *name).collect();
    if !unsure.is_empty() {
        let reason = format!(
            "finds no clear match of the sound of {} with that of the others (a match must stand out {CONFIDENT} times)",
            unsure.join(", ")
        );
        let known = if shifts.len() > 1 { format!("; it found {words}") } else { String::new() };
        return Err(unheard(&settings, reason + &known, &unsure));
    }
    let note = format!(
        "by sound, frames by which the clip begins later in each video, and how far the match stands out over the next best: {words}"
    );
    let shifts = shifts.into_iter().map(|(shift, _)| shift).collect();
    Ok((PrepareSettings { shifts, ..settings }, vec![note]))
}

fn unheard(settings: &PrepareSettings, reason: String, names: &[&str]) -> Error {
    let remedy = format!(
        "give all shifts by hand, as --shift {}=FRAMES, or leave these cameras out; a clap that all cameras hear is enough",
        names.join("=FRAMES,")
    );
    Error::data(&settings.source, "--shift sound", reason, remedy)
}

fn without_codes(settings: &PrepareSettings, videos: &[(&str, Option<&Video>)]) -> Error {
    let without = videos.iter().filter(|(_, video)| video.is_none_or(|video| video.timecode.is_none()));
    let without: Vec<&str> = without.map(|(name, _)| *name).collect();
    let reason = match without.is_empty() {
        true => format!("has videos whose time codes are more than {LONGEST} seconds apart, or whose rates differ"),
        false => format!("has cameras without a time code: {}", without.join(", ")),
    };
    let remedy = "give the shifts as --shift CAMERA=FRAMES, or --shift sound where all cameras have sound";
    Error::data(&settings.source, "--shift timecode", reason, remedy)
}
