//! Video, by the installed ffmpeg.

mod colour;
mod decode;
mod probe;
mod times;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use image::ExtendedColorType;

use crate::error::Result;
use crate::files::write_atomic;
use crate::prepare::fit::Crop;
use crate::prepare::program::FFMPEG;
use crate::prepare::settings::{ImageFormat, OnProgress, Progress};
use crate::video::input;

pub(super) use self::colour::{Conversion, can_convert};
pub(super) use self::decode::decode;
pub(super) use self::probe::probe;

/// Rates differ when their ratio is farther from 1: 29.97 and 30 differ by 1e-3.
pub(super) const RATE_TOLERANCE: f64 = 5e-4;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Video {
    pub path: PathBuf,
    /// Pixels, as shown: after a rotation that the file asks for.
    pub width: u32,
    pub height: u32,
    /// Frames per second where none is lost.
    pub fps: f64,
    /// When each picture is shown, seconds of the file's clock, in order; at least one.
    pub times: Vec<f64>,
    /// When the camera began to record: the time of the first picture, or that of the file's beginning where its pictures begin much later.
    pub began: f64,
    /// The earliest time of all that the file holds, sound too: from here ffmpeg counts.
    pub begins: f64,
    pub has_sound: bool,
    /// When the first frame was recorded by the camera's clock, frames since midnight; none where the file does not say.
    pub timecode: Option<u32>,
    /// How many pictures the file's index names, where it names more than are there.
    pub named: Option<u32>,
    /// The conversion of its pictures to BT.709; nothing where they are.
    pub colour: Option<Conversion>,
    /// True if the first field of an interlaced picture is the top one; none where pictures are whole.
    pub top_first: Option<bool>,
    /// When key frames are shown that ffmpeg finds, in order.
    keys: Vec<f64>,
}

impl Video {
    pub fn n_frames(&self) -> u32 {
        u32::try_from(self.times.len()).unwrap_or(u32::MAX)
    }
}

/// Which frames are taken: `start`, `start + every`, and so on, `n` of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Selection {
    pub start: u32,
    pub every: u32,
    pub n: u32,
}

/// Writes the sound of a part of a video, silent before it begins, as WAV of one channel; `from` in seconds of the file's clock.
pub(super) fn sound(video: &Video, from: f64, length: f64, to: &Path) -> Result<()> {
    let (from, length) = ((from - video.begins).max(0.0).to_string(), length.to_string());
    let part = ["-ss", &from, "-t", &length];
    let mut wav = heard(&video.path, &part, &["-c:a", "pcm_s16le", "-f", "wav"])?;
    set_wav_length(&mut wav);
    write_atomic(to, |to| to.write_all(&wav))
}

/// The sound of a video, one channel of `rate` samples per second, from where its file begins on; at most so many seconds.
pub(super) fn samples(path: &Path, rate: u32, seconds: f64) -> Result<Vec<f32>> {
    let (rate, seconds) = (rate.to_string(), seconds.to_string());
    let bytes = heard(path, &["-t", &seconds], &["-ar", &rate, "-c:a", "pcm_f32le", "-f", "f32le"])?;
    Ok(bytes.as_chunks().0.iter().map(|sample| f32::from_le_bytes(*sample)).collect())
}

/// The sound of a part of a video, one channel, silent where there is none.
fn heard(path: &Path, part: &[&str], format: &[&str]) -> Result<Vec<u8>> {
    let before = ["-v", "error", "-nostdin"].iter().chain(part).map(OsString::from);
    let after = ["-af", "aresample=async=1:first_pts=0", "-map", "0:a:0", "-vn", "-ac", "1"];
    let after = after.iter().chain(format).chain(&["pipe:1"]).map(OsString::from);
    FFMPEG.run(before.chain(input(path)).chain(after), path)
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

/// Writes pictures of a video as JPEG to `folder`, unless all are there; `name` gives each its name by its place among them.
pub(super) fn write_pictures(
    folder: &Path,
    video: &Video,
    pictures: &[usize],
    threads: usize,
    name: impl Fn(u32) -> String,
    progress: OnProgress,
) -> Result<()> {
    let n = pictures.len();
    let file = |place: u32| folder.join(name(place));
    if (0..n as u32).all(|place| file(place).is_file()) {
        return Ok(());
    }
    let size = (video.width, video.height);
    decode(video, pictures, Crop::whole(size), size, threads, |place, rgb| {
        ImageFormat::Jpeg.write(&file(place as u32), rgb, size, ExtendedColorType::Rgb8)?;
        progress(Progress { stage: "frames", done: place + 1, total: n, piece: &name(place as u32) });
        Ok(())
    })
}
