//! Moving pictures: frames as they are rendered go into ffmpeg, with sound, or into a Y4M file.

mod local;
mod y4m;

pub(crate) use local::{chapters, input, is_later_chapter, picture};

use std::ffi::OsString;
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::files::{Temporary, folder_of, remove_temporaries};
use crate::scene::Frame;
use local::file_url;

const INSTALL: &str =
    "install ffmpeg 5.1 or newer (Debian: apt-get install ffmpeg), or choose a file that ends in .y4m";

/// Settings of a video.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoSettings {
    /// Pixels; even, but for .y4m.
    pub width: u32,
    /// Pixels; even, but for .y4m.
    pub height: u32,
    /// Frames per second.
    pub fps: f64,
    /// A sound file that ffmpeg reads, and the second of it at which the first frame stands.
    pub sound: Option<(PathBuf, f64)>,
}

/// The written video.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Made {
    /// The file that was asked for, with its sound.
    Whole(PathBuf),
    /// Pictures alone, and the command that makes the whole of them and the sound.
    Pictures {
        /// Y4M.
        file: PathBuf,
        /// For a shell; none where the pictures are all that was asked for.
        command: Option<String>,
    },
}

/// A video that is being written. It takes its name when it is finished; one that is dropped before leaves nothing.
pub struct Video {
    path: PathBuf,
    /// Until it is finished.
    temporary: Option<Temporary>,
    settings: VideoSettings,
    n_frames: u64,
    sink: Option<Sink>,
    /// The command for a shell, where ffmpeg is not installed.
    command: Option<String>,
}

enum Sink {
    Ffmpeg(Encoder),
    /// The temporary file itself.
    File,
}

struct Encoder {
    child: Child,
    to: BufWriter<ChildStdin>,
    said: JoinHandle<String>,
}

impl Video {
    /// Begins a video: .y4m without loss and sound, .mp4 as H.264 and AAC, .mov and .mkv as H.264 and 24-bit PCM, by an installed ffmpeg.
    /// Without one the pictures go to the name with .y4m, and [`Video::finish`] tells the command.
    pub fn create(path: &Path, settings: VideoSettings) -> Result<Video> {
        let VideoSettings { width, height, fps, .. } = settings;
        let ending = Self::check(path, [width, height], fps)?;
        let mut video = Video {
            temporary: Some(beside(path, &ending)?),
            path: path.to_owned(),
            settings,
            n_frames: 0,
            sink: None,
            command: None,
        };
        video.sink = Some(if ending == "y4m" { Sink::File } else { video.encoder()? });
        let header = y4m::header([width, height], fps);
        video.write(header.as_bytes())?;
        Ok(video)
    }

    /// The ending of a video of this name, size and rate, or the reason why there can be none.
    pub fn check(path: &Path, [width, height]: [u32; 2], fps: f64) -> Result<String> {
        let fault = |reason: String, remedy: &str| Err(Error::data(path, "", reason, remedy));
        let ending = path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase());
        if !["mp4", "mov", "mkv", "y4m"].contains(&ending.as_str()) {
            return fault("unsupported video type".to_owned(), "use .mp4, .mov, .mkv or .y4m");
        }
        if width == 0 || height == 0 || (ending != "y4m" && (width % 2, height % 2) != (0, 0)) {
            return fault(
                format!("{width} x {height} pixels: both must be even"),
                "choose another size, or write a .y4m",
            );
        }
        if !(fps.is_finite() && (0.1..=1000.0).contains(&fps)) {
            return fault(format!("{fps} frames per second: expected 0.1 to 1000"), "choose another rate");
        }
        Ok(ending)
    }

    /// ffmpeg, or without one a file of pictures.
    fn encoder(&mut self) -> Result<Sink> {
        let path = self.path.clone();
        let arguments = self.arguments("pipe:0".into(), self.temporary.as_ref().map_or(&path, Temporary::path));
        let started = Command::new("ffmpeg").args(&arguments).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
        match started {
            Ok(child) => Ok(Sink::Ffmpeg(Encoder::new(child, &path)?)),
            Err(fault) if fault.kind() == ErrorKind::NotFound => {
                let pictures = path.with_extension("y4m");
                let words = self.arguments(file_url(&pictures), &path);
                let words: Vec<String> = words.iter().map(|word| quoted(&word.to_string_lossy())).collect();
                self.command = Some(format!("ffmpeg {}", words.join(" ")));
                self.temporary = Some(beside(&pictures, "y4m")?);
                self.path = pictures;
                Ok(Sink::File)
            }
            Err(fault) => Err(Error::data(&path, "", format!("ffmpeg does not start: {fault}"), INSTALL)),
        }
    }

    /// The arguments of ffmpeg, from `pictures` to `output`.
    fn arguments(&self, pictures: OsString, output: &Path) -> Vec<OsString> {
        let is_mp4 = self.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"));
        let mut words: Vec<OsString> = Vec::new();
        fn plain<'a>(words: &'a [&str]) -> impl Iterator<Item = OsString> + 'a {
            words.iter().map(OsString::from)
        }
        words.extend(plain(&["-v", "error", "-nostdin", "-y", "-f", "yuv4mpegpipe", "-i"]));
        words.push(pictures);
        if let Some((file, from)) = &self.settings.sound {
            words.extend(plain(&["-ss", &from.to_string()]));
            words.extend(input(file));
            words.extend(plain(&["-map", "0:v", "-map", "1:a"]));
        }
        let mut add = |more: &[&str]| words.extend(plain(more));
        if self.settings.sound.is_some() {
            add(if is_mp4 { &["-c:a", "aac", "-b:a", "320k"] } else { &["-c:a", "pcm_s24le"] });
            // Sound that is longer than the pictures ends with them; shorter sound is followed by silence.
            add(&["-af", "apad", "-shortest"]);
        }
        // The pictures are of BT.709 in the narrow range, and their file does not say so.
        let colors = "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=limited,format=yuv420p";
        add(&["-vf", colors, "-c:v", "libx264", "-crf", "18", "-preset", "medium"]);
        add(&["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"]);
        if is_mp4 {
            add(&["-movflags", "+faststart"]);
        }
        words.push(file_url(output));
        words
    }

    /// Adds a frame. The error has what ffmpeg says, where that is the reason.
    pub fn push(&mut self, frame: &Frame) -> Result<()> {
        let VideoSettings { width, height, .. } = self.settings;
        if (frame.width, frame.height) != (width, height) || frame.color.len() != width as usize * height as usize {
            let reason = format!("has {width} x {height} pixels, a frame {} x {}", frame.width, frame.height);
            return Err(Error::data(&self.path, "", reason, "render all frames in one size"));
        }
        self.n_frames += 1;
        self.write(&y4m::frame(&frame.color))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let outcome = match &mut self.sink {
            Some(Sink::Ffmpeg(encoder)) => encoder.to.write_all(bytes),
            // Frames are long: nothing is won by a buffer.
            Some(Sink::File) => self.temporary.as_ref().map_or(Ok(()), |file| file.file().write_all(bytes)),
            None => Ok(()),
        };
        match (outcome, self.sink.take()) {
            (Ok(()), sink) => {
                self.sink = sink;
                Ok(())
            }
            // A program that ended early says why.
            (Err(_), Some(Sink::Ffmpeg(encoder))) => Err(encoder
                .end(&self.path)
                .err()
                .unwrap_or_else(|| Error::data(&self.path, "", "ffmpeg stopped reading", "try again"))),
            (Err(fault), _) => Err(self.cannot_write(&fault)),
        }
    }

    /// Completes the file and gives it its name.
    pub fn finish(mut self) -> Result<Made> {
        if self.n_frames == 0 {
            return Err(Error::data(&self.path, "", "no frame was rendered", "render at least one"));
        }
        match self.sink.take() {
            Some(Sink::Ffmpeg(encoder)) => encoder.end(&self.path)?,
            Some(Sink::File) | None => {}
        }
        self.temporary.take().map_or(Ok(()), Temporary::keep)?;
        let file = self.path.clone();
        let is_whole = file.extension().is_none_or(|ending| ending != "y4m");
        Ok(if is_whole { Made::Whole(file) } else { Made::Pictures { file, command: self.command.take() } })
    }

    fn cannot_write(&self, fault: &io::Error) -> Error {
        let remedy = "check that the folder exists, is writable and not full";
        Error::data(&self.path, "", format!("cannot be written: {fault}"), remedy)
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        if let Some(Sink::Ffmpeg(mut encoder)) = self.sink.take() {
            let _ = encoder.child.kill();
            let _ = encoder.child.wait();
        }
    }
}

impl Encoder {
    fn new(mut child: Child, path: &Path) -> Result<Encoder> {
        let (Some(to), Some(mut errors)) = (child.stdin.take(), child.stderr.take()) else {
            let _ = child.kill();
            return Err(Error::data(path, "", "ffmpeg has no input", "try again"));
        };
        // Read while it runs: a full pipe would stop it.
        let said = std::thread::spawn(move || {
            let mut said = Vec::new();
            let _ = errors.read_to_end(&mut said);
            String::from_utf8_lossy(&said).into_owned()
        });
        Ok(Encoder { child, to: BufWriter::with_capacity(1 << 20, to), said })
    }

    fn end(mut self, path: &Path) -> Result<()> {
        let flushed = self.to.flush();
        drop(self.to);
        let status = self
            .child
            .wait()
            .map_err(|fault| Error::data(path, "", format!("ffmpeg is lost: {fault}"), "try again"))?;
        let said = self.said.join().unwrap_or_default();
        if status.success() && flushed.is_ok() {
            return Ok(());
        }
        let last = said.lines().rev().map(str::trim).find(|line| !line.is_empty()).unwrap_or("no reason is given");
        let last: String = last.chars().take(300).collect();
        Err(Error::data(path, "", format!("ffmpeg failed ({status}): {last}"), INSTALL))
    }
}

/// An unfinished video's name, with ffmpeg's ending. Those of killed processes are removed.
fn beside(path: &Path, ending: &str) -> Result<Temporary> {
    let temporary = Temporary::beside(path, &format!(".{ending}"))?;
    remove_temporaries(folder_of(path), 0)?;
    Ok(temporary)
}

/// A word for a POSIX shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
