//! By how much cameras began apart, as their videos tell: by time codes or by what they hear.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::settings::{PrepareSettings, ShiftBy};
use super::source::{Footage, Source};
use super::timeline::{Timeline, is_same};
use super::video::{self, Video};
use crate::error::{Error, Result};
use crate::parallel::in_parallel;
use crate::sound::lag::{CONFIDENT, Lag, lags};

/// Samples per second of the sound that is compared, and the seconds of it, at most.
const RATE: u32 = 8000;
const HEARD: f64 = 300.0;
/// Cameras whose clocks were set together begin within so many seconds; others' codes say nothing.
const LONGEST: f64 = 600.0;

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
        let mut shifts = by_timecodes(&named).ok_or_else(|| without_codes(settings, &named))?;
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
    let videos = heard.iter().map(|(name, video, _)| (*name, *video));
    let Some(timeline) = Timeline::new(videos, &settings) else { return Ok((settings, Vec::new())) };
    // By the clock of each file, one moment; and the last of the first pictures by it.
    let moment = |video: &Video, lag: Lag| video.begins + lag.seconds;
    let is_sure = |lag: &Lag| lag.stands_out >= CONFIDENT;
    let sure = heard.iter().filter_map(|(name, video, lag)| Some((*name, *video, lag.filter(is_sure)?)));
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
    let unsure: Vec<&str> =
        heard.iter().filter(|(.., lag)| !lag.is_some_and(|lag| is_sure(&lag))).map(|(name, ..)| *name).collect();
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

/// The number since midnight of the frame with a time code HH:MM:SS:FF; with a semicolon before the frames (drop-frame), two numbers are
/// left out at the beginning of every minute but each tenth.
pub(super) fn frame_of_day(code: &str, fps: f64) -> Option<u32> {
    let fields: Vec<u32> = code.split([':', ';']).map(|field| field.parse().ok()).collect::<Option<_>>()?;
    let [hours, minutes, seconds, frames] = fields[..] else { return None };
    let base = fps.round() as u32;
    if hours > 23 || minutes > 59 || seconds > 59 || frames >= base || base > 1000 {
        return None;
    }
    let minutes = 60 * hours + minutes;
    let left_out = if code.contains(';') { (base / 30 * 2) * (minutes - minutes / 10) } else { 0 };
    ((60 * minutes + seconds) * base + frames).checked_sub(left_out)
}

/// By name, frames by which the clip begins later in a camera's video. `None` where time codes are missing, too far apart, or of
/// different rates.
fn by_timecodes(videos: &[(&str, Option<&Video>)]) -> Option<BTreeMap<String, f64>> {
    let codes: Vec<(&str, u32, f64)> = videos
        .iter()
        .map(|(name, video)| Some((*name, video.as_ref()?.timecode?, video.as_ref()?.fps)))
        .collect::<Option<_>>()?;
    let last = codes.iter().map(|(_, code, _)| *code).max()?;
    let fps = codes.first()?.2;
    let agrees = |(_, code, rate): &(&str, u32, f64)| is_same(*rate, fps) && f64::from(last - code) <= LONGEST * fps;
    codes
        .iter()
        .all(agrees)
        .then(|| codes.iter().map(|(name, code, _)| ((*name).to_owned(), f64::from(last - code))).collect())
}

pub(super) fn note_timecodes(videos: &[(&str, Option<&Video>)]) -> Option<String> {
    let shifts = by_timecodes(videos)?;
    let codes: Vec<String> =
        shifts.iter().filter(|(_, shift)| **shift != 0.0).map(|(name, shift)| format!("{name}={shift}")).collect();
    (!codes.is_empty()).then(|| {
        format!(
            "the videos' time codes say that the cameras did not begin together; if their clocks were set together, give --shift \
             timecode, which is --shift {}",
            codes.join(",")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::frame_of_day;

    #[test]
    fn time_codes_count_frames_since_midnight() {
        assert_eq!(frame_of_day("00:00:01:05", 30.0), Some(35));
        assert_eq!(frame_of_day("01:00:00:00", 60.0), Some(216_000));
        // 29.97 frames a second: an hour has 107,892 frames, and ten minutes 17,982.
        let ntsc = 30_000.0 / 1001.0;
        assert_eq!(frame_of_day("01:00:00;00", ntsc), Some(107_892));
        assert_eq!(frame_of_day("00:10:00;00", ntsc), Some(17_982));
        assert_eq!((frame_of_day("00:00:59;29", ntsc), frame_of_day("00:01:00;02", ntsc)), (Some(1799), Some(1800)));
        assert_eq!(frame_of_day("00:01:00;04", 2.0 * ntsc), Some(3600));
        for bad in ["", "00:00:00", "24:00:00:00", "00:00:00:30", "a:b:c:d", "00:00:00:00:00", "-1:00:00:00"] {
            assert_eq!(frame_of_day(bad, 30.0), None, "{bad}");
        }
    }
}
