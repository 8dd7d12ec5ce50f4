//! Video, by the installed ffmpeg.

use std::ffi::OsString;
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::fit::Part;
use super::program::{FFMPEG, FFPROBE, last_line};
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::video::input;

/// Rates differ when their ratio is farther from 1: 29.97 and 30 differ by 1e-3.
pub(super) const RATE_TOLERANCE: f64 = 5e-4;

/// What a video file holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Video {
    /// Pixels, as shown: after a rotation that the file asks for.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Frames per second.
    pub fps: f64,
    pub n_frames: u32,
    pub has_sound: bool,
    /// Whether its frames follow one another evenly, so that each is where its number says.
    pub is_steady: bool,
    /// How much later than the file its first frame is, seconds: sound may begin before it.
    pub late: f64,
    /// When the first frame was recorded by the camera's clock, frames since midnight; none where the file does not say.
    pub timecode: Option<u32>,
}

#[derive(serde::Deserialize)]
struct Probe {
    streams: Vec<Stream>,
    #[serde(default)]
    format: Container,
}

#[derive(Default, serde::Deserialize)]
struct Container {
    start_time: Option<String>,
    #[serde(default)]
    tags: Tags,
}

#[derive(Default, serde::Deserialize)]
struct Tags {
    timecode: Option<String>,
}

#[derive(serde::Deserialize)]
struct Stream {
    codec_type: String,
    width: Option<u32>,
    height: Option<u32>,
    avg_frame_rate: Option<String>,
    r_frame_rate: Option<String>,
    nb_frames: Option<String>,
    nb_read_packets: Option<String>,
    start_time: Option<String>,
    #[serde(default)]
    tags: Tags,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(serde::Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Looks at a video file: what its container tells, and only where that does not tell how many frames there are, at all of it.
/// Nothing is decoded.
pub(super) fn probe(path: &Path) -> Result<Video> {
    let bad = |reason: &str| Error::data(path, "", reason, "give a video that ffmpeg can read");
    let probe = ask(path, &[])?;
    let timecodes = probe.streams.iter().map(|stream| &stream.tags).chain([&probe.format.tags]);
    let timecode = timecodes.filter_map(|tags| tags.timecode.clone()).next();
    let seconds =
        |time: &Option<String>| time.as_deref().and_then(|time| time.parse::<f64>().ok()).filter(|s| s.is_finite());
    let begins = seconds(&probe.format.start_time).unwrap_or_default();
    let has_sound = probe.streams.iter().any(|stream| stream.codec_type == "audio");
    let of_video = |probe: Probe| probe.streams.into_iter().find(|stream| stream.codec_type == "video");
    let stream = of_video(probe).ok_or_else(|| bad("holds no video"))?;
    let rate = |rate: &Option<String>| {
        let (above, below) = rate.as_deref()?.split_once('/')?;
        Some(above.parse::<f64>().ok()? / below.parse::<f64>().ok()?).filter(|fps| fps.is_finite() && *fps > 0.0)
    };
    let fps = rate(&stream.avg_frame_rate).ok_or_else(|| bad("has no frame rate"))?;
    let is_steady = rate(&stream.r_frame_rate).is_some_and(|base| (base / fps - 1.0).abs() < 1e-6);
    let number = |n: Option<String>| n.and_then(|n| n.parse().ok()).filter(|n: &u32| *n > 0);
    let n_frames = match number(stream.nb_frames) {
        Some(n) => Some(n),
        None => of_video(ask(path, &["-count_packets"])?).and_then(|stream| number(stream.nb_read_packets)),
    };
    let n_frames = n_frames.ok_or_else(|| bad("holds no frame"))?;
    let (Some(width), Some(height)) = (stream.width, stream.height) else { return Err(bad("has no size")) };
    let turned = stream.side_data_list.iter().filter_map(|data| data.rotation).any(|turn| turn.abs() % 180.0 == 90.0);
    let (width, height) = if turned { (height, width) } else { (width, height) };
    let timecode = timecode.and_then(|code| frame_of_day(&code, fps));
    let late = seconds(&stream.start_time).map_or(0.0, |first| (first - begins).max(0.0));
    Ok(Video { width, height, fps, n_frames, has_sound, is_steady, late, timecode })
}

/// What ffprobe tells of a file.
fn ask(path: &Path, options: &[&str]) -> Result<Probe> {
    let entries = "stream=codec_type,width,height,avg_frame_rate,r_frame_rate,nb_frames,nb_read_packets,start_time:\
                   stream_side_data=rotation:stream_tags=timecode:format=start_time:format_tags=timecode";
    let shown = ["-show_entries", entries, "-of", "json"];
    let arguments = ["-v", "error"].iter().chain(options).chain(&shown).map(OsString::from);
    let arguments: Vec<OsString> = arguments.chain(input(path)).collect();
    let output = FFPROBE.run(arguments, path)?;
    serde_json::from_slice(&output)
        .map_err(|_| Error::data(path, "", "is not understood by ffprobe", "give a video that ffmpeg can read"))
}

/// The number since midnight of the frame with a time code, HH:MM:SS:FF; with a semicolon before the frames two numbers are left out
/// at the beginning of every minute but each tenth, so that the code keeps up with the clock at 29.97 and 59.94 frames a second.
fn frame_of_day(code: &str, fps: f64) -> Option<u32> {
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

/// Which frames of a video: `start`, `start + every`, and so on, `n` of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Selection {
    pub start: u32,
    pub every: u32,
    pub n: u32,
}

/// Decodes a part of frames in order, `size` pixels each (scaled by area), and gives each to `take` as packed RGB. Where `video` is
/// steady, nothing before the key frame of the first one is decoded.
pub(super) fn decode(
    (path, video): (&Path, &Video),
    select: Selection,
    part: Part,
    size: (u32, u32),
    threads: usize,
    mut take: impl FnMut(u32, &[u8]) -> Result<()>,
) -> Result<()> {
    let Selection { start, every, n } = select;
    // To half a frame before the first one, so that no rounding of times takes another; ffmpeg counts from where the file begins.
    let seek = (video.is_steady && start > 0).then(|| (video.late + (f64::from(start) - 0.5) / video.fps).to_string());
    let first = if seek.is_some() { 0 } else { start };
    let (width, height) = size;
    let Part { x, y, width: w, height: h } = part;
    let filter = format!(
        "select=gte(n\\,{first})*not(mod(n-{first}\\,{every})),crop={w}:{h}:{x}:{y}:exact=1,scale={width}:{height}"
    );
    let (threads, n_text) = (threads.to_string(), n.to_string());
    let before = ["-v", "error", "-nostdin", "-threads", &threads].into_iter();
    let before = before.chain(seek.iter().flat_map(|to| ["-ss", to])).map(OsString::from);
    let after = ["-map", "0:v:0", "-vf", &filter, "-sws_flags", "area+accurate_rnd+full_chroma_int"];
    let output = ["-fps_mode", "passthrough", "-frames:v", &n_text, "-pix_fmt", "rgb24", "-f", "rawvideo", "pipe:1"];
    let arguments = before.chain(input(path));
    let mut running = FFMPEG.start(arguments.chain(after.iter().chain(&output).map(OsString::from)), path)?;
    let mut from = running.child.stdout.take();
    let mut frame = vec![0; 3 * width as usize * height as usize];
    let mut n_read = 0;
    while n_read < n {
        match from.as_mut().map_or(Ok(()), |from| from.read_exact(&mut frame)) {
            Ok(()) => take(n_read, &frame)?,
            Err(fault) if fault.kind() == ErrorKind::UnexpectedEof => break,
            Err(fault) => return Err(Error::data(path, "", format!("ffmpeg cannot be heard: {fault}"), "try again")),
        }
        n_read += 1;
    }
    drop(from);
    let (status, said) = running.end(path)?;
    if n_read < n {
        let said = last_line(&said).map_or_else(String::new, |line| format!("; ffmpeg says: {line}"));
        let reason = format!("gave {n_read} of {n} frames from frame {start} on{said}");
        let remedy = "copy the video again, or take fewer frames with --frames";
        return Err(Error::data(path, "", reason, remedy));
    }
    if status.success() { Ok(()) } else { Err(FFMPEG.failed(path, status, last_line(&said))) }
}

/// Writes the sound of a part of a video as WAV of one channel; times in seconds from the first frame of `video`. Where it has none
/// yet it is silent.
pub(super) fn sound((path, video): (&Path, &Video), from: f64, length: f64, to: &Path) -> Result<()> {
    let (from, length) = ((video.late + from).to_string(), length.to_string());
    let before = ["-v", "error", "-nostdin", "-ss", &from, "-t", &length].map(OsString::from);
    let filled = ["-af", "aresample=async=1:first_pts=0"];
    let after = ["-map", "0:a:0", "-vn", "-ac", "1", "-c:a", "pcm_s16le", "-f", "wav", "pipe:1"];
    let after = filled.into_iter().chain(after);
    let arguments = before.into_iter().chain(input(path)).chain(after.map(OsString::from));
    let mut wav = FFMPEG.run(arguments, path)?;
    set_wav_length(&mut wav);
    write_atomic(to, |to| to.write_all(&wav))
}

/// ffmpeg cannot go back in a pipe, so its header does not know the length.
fn set_wav_length(wav: &mut [u8]) {
    let n = wav.len();
    let Some(data) = wav.windows(4).position(|name| name == b"data") else { return };
    let lengths = [(4, n.saturating_sub(8)), (data + 4, n.saturating_sub(data + 8))];
    for (at, length) in lengths {
        if let (Some(field), Ok(length)) = (wav.get_mut(at..at + 4), u32::try_from(length)) {
            field.copy_from_slice(&length.to_le_bytes());
        }
    }
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
