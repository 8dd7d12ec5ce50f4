//! When the pictures of a video are shown.

use std::ffi::OsString;
use std::path::Path;

use super::RATE_TOLERANCE;
use crate::error::{Error, Result};
use crate::prepare::program::FFPROBE;
use crate::report::statistics::median_high;
use crate::video::input;

/// When each picture is shown, seconds, in order, and how many are not shown: those before the beginning of a clip that was trimmed
/// without encoding it again.
pub(super) struct Shown {
    pub times: Vec<f64>,
    /// When key frames are shown, at which decoding can begin.
    pub keys: Vec<f64>,
    pub n_hidden: usize,
    /// True if all packets that are shown have a time. Else the video was decoded.
    pub by_packets: bool,
}

/// Looks at the packets of a video, and where some have no time (AVI with B frames, fields in packets of their own), decodes it.
pub(super) fn shown(path: &Path) -> Result<Shown> {
    let mut shown = of_packets(&rows(path, "packet=pts_time,flags")?);
    if !shown.by_packets {
        shown.times = of_frames(&rows(path, "frame=best_effort_timestamp_time")?);
    }
    shown.times.sort_by(f64::total_cmp);
    shown.times.dedup();
    shown.keys.sort_by(f64::total_cmp);
    Ok(shown)
}

/// Reads packets. What comes before the first key frame, or is shown before it, needs pictures that were cut off: no player shows it.
fn of_packets(rows: &str) -> Shown {
    let packets: Vec<(Option<f64>, &str)> =
        rows.lines().filter_map(|row| row.split_once(',')).map(|(time, flags)| (seconds(time), flags)).collect();
    let first_key = packets.iter().position(|(_, flags)| flags.contains('K')).unwrap_or(0);
    let begin = packets.get(first_key).and_then(|(time, _)| *time).unwrap_or(f64::MIN);
    let shown =
        packets[first_key..].iter().filter(|(time, flags)| !flags.contains('D') && time.is_none_or(|t| t >= begin));
    let shown: Vec<Option<f64>> = shown.map(|(time, _)| *time).collect();
    let times: Vec<f64> = shown.iter().copied().flatten().collect();
    let keys = packets.iter().filter(|(_, flags)| flags.contains('K')).filter_map(|(time, _)| *time).collect();
    Shown { by_packets: times.len() == shown.len(), n_hidden: packets.len() - shown.len(), times, keys }
}

/// The times of frames, as ffmpeg gives them: one without comes a step after the one before it.
fn of_frames(rows: &str) -> Vec<f64> {
    let mut times: Vec<f64> = Vec::new();
    for row in rows.lines().filter(|row| !row.is_empty()) {
        let next = match times.as_slice() {
            [.., before, last] => Some(2.0 * last - before),
            _ => None,
        };
        times.extend(row.split(',').next().and_then(seconds).or(next));
    }
    times
}

fn seconds(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|seconds| seconds.is_finite())
}

fn rows(path: &Path, entries: &str) -> Result<String> {
    let arguments = ["-v", "error", "-select_streams", "v:0", "-show_entries", entries, "-of", "csv=p=0"];
    let arguments: Vec<OsString> = arguments.iter().map(OsString::from).chain(input(path)).collect();
    let output = FFPROBE.run(arguments, path)?;
    String::from_utf8(output)
        .map_err(|_| Error::data(path, "", "is not understood by ffprobe", "give a video that ffmpeg can read"))
}

/// Rates of cameras, from low to high.
const USUAL: [f64; 10] =
    [24_000.0 / 1001.0, 24.0, 25.0, 30_000.0 / 1001.0, 30.0, 50.0, 60_000.0 / 1001.0, 60.0, 100.0, 120.0];
/// Pictures that tell whether a rate fits them. Over more, one that is all but right is a frame off.
const ASKED: usize = 200;
/// How far pictures may be off the steps of a rate that fits them, frames: at random it were 0.29.
const OFF: f64 = 0.2;
/// Pictures of the rate at the beginning that count as much as all those that are seen until then.
const TRUSTED: f64 = 10.0;

/// Pictures per second where none is lost: a rate that the file states, or that cameras have, where rounded times are close to it.
pub(super) fn rate(times: &[f64], stated: &[f64]) -> Option<f64> {
    let steps = times.windows(2).map(|two| two[1] - two[0]);
    let Some(middle) = median_high(steps).filter(|step| *step > 0.0) else { return stated.first().copied() };
    let usual = USUAL.into_iter().find(|rate| fits(times, *rate));
    let begin = Some(1.0 / middle).filter(|rate| fits(times, *rate)).or(usual).unwrap_or(1.0 / middle);
    // Each picture's number, by the rate of those before it: what one is early or late does not add up.
    let (mut number, mut rate) = (0.0, begin);
    let mut numbers = vec![0.0];
    for time in &times[1..] {
        let since = time - times[0];
        number += (since * rate - number).round().max(1.0);
        rate = (number + TRUSTED) / (since + TRUSTED / begin);
        numbers.push(number);
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let (mean_time, mean_number) = (mean(times), mean(&numbers));
    let from_mean = || times.iter().zip(&numbers).map(|(time, number)| (time - mean_time, number - mean_number));
    let found = from_mean().map(|(t, n)| t * n).sum::<f64>() / from_mean().map(|(t, _)| t * t).sum::<f64>();
    let off = (from_mean().map(|(t, n)| (n - found * t).powi(2)).sum::<f64>() / times.len() as f64).sqrt();
    let distance = |rate: &f64| (rate / found - 1.0).abs();
    let close = stated.iter().chain(&USUAL).filter(|rate| distance(rate) < RATE_TOLERANCE + 4.0 * off / number);
    Some(close.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied().unwrap_or(found))
}

/// True if the first pictures are near the steps of a rate, each at one of its own.
fn fits(times: &[f64], rate: f64) -> bool {
    let times = &times[..times.len().min(ASKED)];
    let frames: Vec<f64> = times.iter().map(|time| (time - times[0]) * rate).collect();
    let off: Vec<f64> = frames.iter().map(|frame| frame - frame.round()).collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let spread = off.iter().map(|off| (off - mean).powi(2)).sum::<f64>() / off.len() as f64;
    frames.windows(2).all(|two| two[0].round() < two[1].round()) && spread.sqrt() < OFF
}

#[cfg(test)]
mod tests {
    use super::{Shown, of_frames, of_packets, rate};

    fn times(n: u32, fps: f64, unit: f64, lost: &[u32]) -> Vec<f64> {
        let of = |frame: u32| (f64::from(frame) / fps / unit).round() * unit;
        (0..n).filter(|frame| !lost.contains(frame)).map(of).collect()
    }

    #[test]
    fn packets_that_are_hidden_or_cannot_be_decoded_are_not_shown() {
        let trimmed = "-0.100000,KD_\n-0.033333,_D_\n0.000000,___\n0.066667,___\n0.033333,___\n";
        let parsed = |rows: &str| {
            let Shown { times, keys, n_hidden, by_packets } = of_packets(rows);
            (times, keys, n_hidden, by_packets)
        };
        assert_eq!(parsed(trimmed), (vec![0.0, 0.066667, 0.033333], vec![-0.1], 2, true));
        // Cut within a group of pictures: two of the old group, and one that is shown before the first key frame.
        let cut = "0.1,__\n0.2,__\n0.4,K_\n0.3,__\n0.5,__,\n\n";
        assert_eq!(parsed(cut), (vec![0.4, 0.5], vec![0.4], 3, true));
        assert_eq!(parsed("N/A,K_\n0.1,__\n"), (vec![0.1], vec![], 0, false));
        assert_eq!(parsed(""), (vec![], vec![], 0, true));
    }

    #[test]
    fn a_frame_without_a_time_comes_a_step_later() {
        assert_eq!(of_frames("0.5\n0.75,\nN/A\n\n1.25\n"), [0.5, 0.75, 1.0, 1.25]);
        assert_eq!(of_frames("N/A\n1.0\n"), [1.0]);
    }

    #[test]
    fn a_rate_is_that_of_the_frames_that_are_not_lost() {
        let ntsc = 30_000.0 / 1001.0;
        // Milliseconds, as Matroska has them; the mean rate of a file that has lost frames is no rate of its frames.
        assert_eq!(rate(&times(60, ntsc, 1e-3, &[]), &[ntsc]), Some(ntsc));
        assert_eq!(rate(&times(300, 30.0, 1e-3, &[100, 101, 102, 103, 104]), &[29.5, 30.0]), Some(30.0));
        assert_eq!(rate(&times(300, 30.0, 1e-6, &[7]), &[29.9]), Some(30.0));
        assert_eq!(rate(&times(300, 29.83, 1e-6, &[7]), &[29.7]).map(|rate| (rate * 1e3).round()), Some(29_830.0));
        // A phone that is never on time.
        let shaky = times(300, 30.0, 1e-6, &[3, 10, 11, 50]).into_iter();
        let shaky: Vec<f64> = shaky.enumerate().map(|(k, time)| time + 0.3 / 30.0 * (k as f64).sin()).collect();
        assert_eq!(rate(&shaky, &[]), Some(30.0));
        assert_eq!(rate(&times(100, 15.0, 1e-6, &[5]), &[]).map(|rate| (rate * 1e6).round()), Some(15e6));
        assert_eq!((rate(&[0.0], &[24.0]), rate(&[0.0], &[])), (Some(24.0), None));
    }
}
