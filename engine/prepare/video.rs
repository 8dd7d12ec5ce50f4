//! Video, by the installed ffmpeg.

use std::ffi::OsString;
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::fit::Part;
use super::program::{FFMPEG, FFPROBE, last_line};
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::video::input;

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
}

#[derive(serde::Deserialize)]
struct Probe {
    streams: Vec<Stream>,
}

#[derive(serde::Deserialize)]
struct Stream {
    codec_type: String,
    width: Option<u32>,
    height: Option<u32>,
    avg_frame_rate: Option<String>,
    nb_read_packets: Option<String>,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(serde::Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Looks at a video file; its packets are counted, not decoded.
pub(super) fn probe(path: &Path) -> Result<Video> {
    let entries = "stream=codec_type,width,height,avg_frame_rate,nb_read_packets:stream_side_data=rotation";
    let arguments = ["-v", "error", "-count_packets", "-show_entries", entries, "-of", "json"].map(OsString::from);
    let output = FFPROBE.run(arguments.into_iter().chain(input(path)), path)?;
    let bad = |reason: &str| Error::data(path, "", reason, "give a video that ffmpeg can read");
    let probe: Probe = serde_json::from_slice(&output).map_err(|_| bad("is not understood by ffprobe"))?;
    let has_sound = probe.streams.iter().any(|stream| stream.codec_type == "audio");
    let stream = probe.streams.into_iter().find(|stream| stream.codec_type == "video");
    let stream = stream.ok_or_else(|| bad("holds no video"))?;
    let fps = stream.avg_frame_rate.as_deref().and_then(|rate| {
        let (above, below) = rate.split_once('/')?;
        Some(above.parse::<f64>().ok()? / below.parse::<f64>().ok()?)
    });
    let fps = fps.filter(|fps| fps.is_finite() && *fps > 0.0).ok_or_else(|| bad("has no frame rate"))?;
    let n_frames = stream.nb_read_packets.and_then(|n| n.parse().ok()).filter(|n| *n > 0);
    let n_frames = n_frames.ok_or_else(|| bad("holds no frame"))?;
    let (Some(width), Some(height)) = (stream.width, stream.height) else { return Err(bad("has no size")) };
    let turned = stream.side_data_list.iter().filter_map(|data| data.rotation).any(|turn| turn.abs() % 180.0 == 90.0);
    let (width, height) = if turned { (height, width) } else { (width, height) };
    Ok(Video { width, height, fps, n_frames, has_sound })
}

/// Which frames of a video: `start`, `start + every`, and so on, `n` of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Selection {
    pub start: u32,
    pub every: u32,
    pub n: u32,
}

/// Decodes a part of frames in order, `size` pixels each (scaled by area), and gives each to `take` as packed RGB.
pub(super) fn decode(
    path: &Path,
    select: Selection,
    part: Part,
    size: (u32, u32),
    threads: usize,
    mut take: impl FnMut(u32, &[u8]) -> Result<()>,
) -> Result<()> {
    let Selection { start, every, n } = select;
    let (width, height) = size;
    let Part { x, y, width: w, height: h } = part;
    let filter =
        format!("select=gte(n\\,{start})*not(mod(n-{start}\\,{every})),crop={w}:{h}:{x}:{y},scale={width}:{height}");
    let (threads, n_text) = (threads.to_string(), n.to_string());
    let before = ["-v", "error", "-nostdin", "-threads", &threads].map(OsString::from);
    let after = ["-map", "0:v:0", "-vf", &filter, "-sws_flags", "area+accurate_rnd+full_chroma_int"];
    let output = ["-fps_mode", "passthrough", "-frames:v", &n_text, "-pix_fmt", "rgb24", "-f", "rawvideo", "pipe:1"];
    let arguments = before.into_iter().chain(input(path));
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

/// Writes the sound of a part of a video as WAV of one channel; times in seconds.
pub(super) fn sound(path: &Path, from: f64, length: f64, to: &Path) -> Result<()> {
    let (from, length) = (from.to_string(), length.to_string());
    let before = ["-v", "error", "-nostdin", "-ss", &from, "-t", &length].map(OsString::from);
    let after = ["-map", "0:a:0", "-vn", "-ac", "1", "-c:a", "pcm_s16le", "-f", "wav", "pipe:1"];
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
