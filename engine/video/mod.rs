//! Moving pictures: frames as they are rendered go into ffmpeg, with sound, or into a Y4M file.

mod local;
mod y4m;

pub(crate) use local::{chapters, input, is_later_chapter, picture};

use std::ffi::OsString;
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::files::{Temporary, cannot_write, folder_of, remove_temporaries};
use crate::scene::Frame;
use local::{file_url, words};

const INSTALL: &str =
    "install ffmpeg 5.1 or newer (Debian: apt-get install ffmpeg), or choose a file that ends in .y4m";

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
    /// Without it, pictures go into the temporary file itself.
    encoder: Option<Encoder>,
    temporary: Temporary,
    settings: VideoSettings,
    n_frames: u64,
    /// For a shell, where ffmpeg is not installed.
    command: Option<String>,
}

struct Encoder {
    program: Program,
    to: BufWriter<ChildStdin>,
    said: JoinHandle<String>,
}

/// A program that ends when it is dropped.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Video {
    /// Begins a video: .y4m without loss and sound, .mp4 as H.264 and AAC, .mov and .mkv as H.264 and 24-bit PCM, by an installed ffmpeg.
    /// Without one the pictures go to the name with .y4m, and [`Video::finish`] tells the command.
    pub fn create(path: &Path, settings: VideoSettings) -> Result<Video> {
        let VideoSettings { width, height, fps, .. } = settings;
        let ending = Self::check(path, [width, height], fps)?;
        let (path, temporary) = (path.to_owned(), beside(path, &ending)?);
        let mut video = Video { path, encoder: None, temporary, settings, n_frames: 0, command: None };
        if ending != "y4m" {
            video.encode()?;
        }
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
            let reason = format!("{width} x {height} pixels: both must be even");
            return fault(reason, "choose another size, or write a .y4m");
        }
        if !(fps.is_finite() && (0.1..=1000.0).contains(&fps)) {
            return fault(format!("{fps} frames per second: expected 0.1 to 1000"), "choose another rate");
        }
        Ok(ending)
    }

    /// Starts ffmpeg, or without one turns to a file of pictures.
    fn encode(&mut self) -> Result<()> {
        let arguments = self.arguments("pipe:0".into(), self.temporary.path());
        match Command::new("ffmpeg").args(&arguments).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn() {
            Ok(child) => self.encoder = Some(Encoder::new(child, &self.path)?),
            Err(fault) if fault.kind() == ErrorKind::NotFound => {
                let pictures = self.path.with_extension("y4m");
                let words = self.arguments(file_url(&pictures), &self.path);
                let words: Vec<String> = words.iter().map(|word| quoted(&word.to_string_lossy())).collect();
                self.command = Some(format!("ffmpeg {}", words.join(" ")));
                self.temporary = beside(&pictures, "y4m")?;
                self.path = pictures;
            }
            Err(fault) => return Err(Error::data(&self.path, "", format!("ffmpeg does not start: {fault}"), INSTALL)),
        }
        Ok(())
    }

    /// The arguments of ffmpeg, from `pictures` to `output`.
    fn arguments(&self, pictures: OsString, output: &Path) -> Vec<OsString> {
        let is_mp4 = self.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"));
        let mut all = words(&["-v", "error", "-nostdin", "-y", "-f", "yuv4mpegpipe", "-i"]);
        all.push(pictures);
        if let Some((file, from)) = &self.settings.sound {
            all.extend(words(&["-ss", &from.to_string()]));
            all.extend(input(file));
            all.extend(words(&["-map", "0:v", "-map", "1:a"]));
            all.extend(words(if is_mp4 { &["-c:a", "aac", "-b:a", "320k"] } else { &["-c:a", "pcm_s24le"] }));
            // Sound that is longer than the pictures ends with them; shorter sound is followed by silence.
            all.extend(words(&["-af", "apad", "-shortest"]));
        }
        // The pictures are of BT.709 in the narrow range, and their file does not say so.
        let colors = "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=limited,format=yuv420p";
        all.extend(words(&[
            "-vf",
            colors,
            "-c:v",
            "libx264",
            "-crf",
            "18",
            "-preset",
            "medium",
            "-colorspace",
            "bt709",
        ]));
        all.extend(words(&["-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"]));
        if is_mp4 {
            all.extend(words(&["-movflags", "+faststart"]));
        }
        all.push(file_url(output));
        all
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
        let Some(encoder) = &mut self.encoder else {
            // Frames are long: nothing is won by a buffer.
            return self.temporary.file().write_all(bytes).map_err(|fault| cannot_write(&self.path, &fault));
        };
        if encoder.to.write_all(bytes).is_ok() {
            return Ok(());
        }
        // A program that ended early says why.
        let why = self.encoder.take().and_then(|encoder| encoder.end(&self.path).err());
        Err(why.unwrap_or_else(|| Error::data(&self.path, "", "ffmpeg stopped reading", "try again")))
    }

    /// Completes the file and gives it its name.
    pub fn finish(self) -> Result<Made> {
        let Video { path: file, encoder, temporary, n_frames, command, .. } = self;
        if n_frames == 0 {
            return Err(Error::data(&file, "", "no frame was rendered", "render at least one"));
        }
        encoder.map_or(Ok(()), |encoder| encoder.end(&file))?;
        temporary.keep()?;
        let is_whole = file.extension().is_none_or(|ending| ending != "y4m");
        Ok(if is_whole { Made::Whole(file) } else { Made::Pictures { file, command } })
    }
}

impl Encoder {
    fn new(child: Child, path: &Path) -> Result<Encoder> {
        let mut program = Program(child);
        let (Some(to), Some(mut errors)) = (program.0.stdin.take(), program.0.stderr.take()) else {
            return Err(Error::data(path, "", "ffmpeg has no input", "try again"));
        };
        // Read while it runs: a full pipe would stop it.
        let said = std::thread::spawn(move || {
            let mut said = Vec::new();
            let _ = errors.read_to_end(&mut said);
            String::from_utf8_lossy(&said).into_owned()
        });
        Ok(Encoder { program, to: BufWriter::with_capacity(1 << 20, to), said })
    }

    fn end(mut self, path: &Path) -> Result<()> {
        let flushed = self.to.flush();
        drop(self.to);
        let lost = |fault| Error::data(path, "", format!("ffmpeg is lost: {fault}"), "try again");
        let status = self.program.0.wait().map_err(lost)?;
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
