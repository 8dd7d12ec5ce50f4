//! Which frames of several videos are of one moment, by the time codes that cameras write into them.

use std::collections::BTreeMap;

use super::timeline::is_same;
use super::video::Video;

/// Cameras whose clocks were set together begin within so many seconds; others' codes say nothing.
pub(super) const LONGEST: f64 = 600.0;

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
pub(super) fn shifts(videos: &[(&str, Option<&Video>)]) -> Option<BTreeMap<String, f64>> {
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

/// A note where time codes say that cameras did not begin together, and nobody asked for them.
pub(super) fn note(videos: &[(&str, Option<&Video>)]) -> Option<String> {
    let shifts = shifts(videos)?;
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
