//! Pictures of a video, each known by the time at which it is shown.

use std::ffi::OsString;
use std::io::{ErrorKind, Read};
use std::sync::mpsc::Receiver;

use super::Video;
use crate::error::{Error, Result};
use crate::prepare::fit::Crop;
use crate::prepare::program::{FFMPEG, last_line};
use crate::video::input;

/// Seconds by which the time of a picture may differ from its packet's.
const NEAR: f64 = 5e-4;
/// Pictures that are decoded before the first one of interlaced video, whose lines it is made of too.
const BEFORE: usize = 3;

/// Decodes a part of `pictures` (growing numbers in [`Video::times`]), scaled to `size`, and gives each to `take`, with its place among
/// them, as packed RGB. ffmpeg seeks to the key frame before the first.
pub(in crate::internals::prepare) fn decode(
    video: &Video,
    pictures: &[usize],
    crop: Crop,
    size: (u32, u32),
    threads: usize,
    mut take: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let wanted: Vec<f64> = pictures.iter().filter_map(|picture| video.times.get(*picture).copied()).collect();
    let Some(first) = pictures.first().filter(|_| wanted.len() == pictures.len()) else { return Ok(()) };
    let (path, arguments) = (video.path.as_path(), arguments(video, *first, &wanted, crop, size, threads));
    let (mut running, lines) = FFMPEG.start(arguments, path)?;
    let mut from = running.child.stdout.take();
    let mut frame = vec![0; 3 * size.0 as usize * size.1 as usize];
    // Both are rounded to microseconds; neighbours are farther from each other.
    let near = (0.25 / video.fps).min(NEAR);
    let mut n_read = 0;
    while n_read < wanted.len() {
        match from.as_mut().map_or(Ok(()), |from| from.read_exact(&mut frame)) {
            Ok(()) => {}
            Err(fault) if fault.kind() == ErrorKind::UnexpectedEof => break,
            Err(fault) => return Err(Error::data(path, "", format!("ffmpeg cannot be heard: {fault}"), "try again")),
        }
        let Some(time) = next_time(&lines) else { break };
        if (time - wanted[n_read]).abs() < near {
            take(n_read, &frame)?;
            n_read += 1;
        } else if time > wanted[n_read] {
            break;
        }
    }
    drop(from);
    if n_read == wanted.len() {
        return Ok(());
    }
    let (_, said) = running.end(path)?;
    let said: Vec<&str> = said.lines().filter(|line| !is_of_time(line) && !line.contains("Broken pipe")).collect();
    let said = last_line(&said.join("\n")).map_or_else(String::new, |line| format!("; ffmpeg says: {line}"));
    let reason = format!("gave {n_read} of {} frames, then none at {:.3} s{said}", wanted.len(), wanted[n_read]);
    Err(Error::data(path, "", reason, "copy the video again, or end before that time with --frames"))
}

/// The arguments of ffmpeg: pictures go to its output, and the time of each, microseconds, before it to its standard error.
fn arguments(
    video: &Video,
    first: usize,
    wanted: &[f64],
    crop: Crop,
    (width, height): (u32, u32),
    threads: usize,
) -> Vec<OsString> {
    let Crop { x, y, width: w, height: h } = crop;
    let mut filters = Vec::new();
    let mut begin = first;
    if let Some(top_first) = video.top_first {
        let parity = if top_first { "tff" } else { "bff" };
        filters.push(format!("bwdif=mode=send_frame:parity={parity}:deint=all"));
        begin = first.saturating_sub(BEFORE);
    }
    // From the first picture on; and where those that are wanted are evenly spaced, what is near their steps.
    let mut passed = format!("gte(t\\,{:.6})", wanted[0] - NEAR);
    if let Some((step, near)) = even(&video.times[first..], wanted) {
        passed += &format!("*lt(abs(mod(t-{:.6}+{step:.9}/2\\,{step:.9})-{step:.9}/2)\\,{near:.6})", wanted[0]);
    }
    filters.push(format!("select={passed}"));
    filters
        .push("settb=AVTB,metadata=mode=add:key=ivv:value=1,metadata=mode=print:file='pipe\\:2':direct=1".to_owned());
    filters.extend(video.colour.as_ref().map(|colour| colour.filter.clone()));
    filters.push(format!("crop={w}:{h}:{x}:{y}:exact=1,scale={width}:{height}"));
    // Containers find a key frame by when it is stored, before it is shown; ffmpeg counts from where the file begins.
    let key = video.keys[..video.keys.partition_point(|key| *key <= video.times[begin] + NEAR)].last();
    let seek = key.map(|key| key + NEAR - video.begins).filter(|to| *to > 0.1).map(|to| to.to_string());
    let threads = threads.to_string();
    let before = ["-v", "error", "-nostdin", "-copyts", "-threads", &threads].into_iter();
    let before = before.chain(seek.iter().flat_map(|to| ["-noaccurate_seek", "-ss", to])).map(OsString::from);
    let filters = filters.join(",");
    let after = ["-map", "0:v:0", "-vf", &filters, "-sws_flags", "area+accurate_rnd+full_chroma_int"];
    let output = ["-fps_mode", "passthrough", "-enc_time_base", "-1", "-pix_fmt", "rgb24", "-f", "rawvideo", "pipe:1"];
    before.chain(input(&video.path)).chain(after.iter().chain(&output).map(OsString::from)).collect()
}

/// The step of wanted times that are evenly spaced among `times` and leave some out, and how far from it they are at most.
fn even(times: &[f64], wanted: &[f64]) -> Option<(f64, f64)> {
    let (first, last) = (wanted.first()?, wanted.last()?);
    let n_between = times.iter().take_while(|time| *time <= last).count();
    if wanted.len() < 2 || n_between == wanted.len() {
        return None;
    }
    let step = (last - first) / (wanted.len() - 1) as f64;
    let off = (0_u32..).zip(wanted).map(|(k, time)| (time - first - f64::from(k) * step).abs()).fold(0.0, f64::max);
    let near = off + 1e-3;
    (near < 0.25 * step).then_some((step, near))
}

fn is_of_time(line: &str) -> bool {
    line.starts_with("frame:") || line == "ivv=1"
}

/// The time of the next picture, seconds: `frame:0 pts:40000 pts_time:0.04`. None where ffmpeg has ended.
fn next_time(lines: &Receiver<String>) -> Option<f64> {
    let line = lines.iter().find(|line| line.starts_with("frame:"))?;
    let microseconds = line.split_whitespace().find_map(|word| word.strip_prefix("pts:"))?;
    microseconds.parse::<f64>().ok().map(|time| time * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::even;

    #[test]
    fn every_third_picture_is_sieved_and_uneven_ones_are_not() {
        let times: Vec<f64> = (0..100).map(|frame| f64::from(frame) / 25.0).collect();
        let third: Vec<f64> = times.iter().copied().step_by(3).collect();
        let (step, near) = even(&times, &third).unwrap();
        assert!((step - 0.12).abs() < 1e-9 && (1e-3..2e-3).contains(&near), "{step} {near}");
        assert_eq!(even(&times, &times), None);
        assert_eq!(even(&times, &[0.0, 0.04, 3.0]), None);
    }
}
