//! The interface of a scene format.

use super::four_dgs::Grades;
use super::rendering::list;
use super::scene::{Clip, Scene};
use crate::error::{Error, Result};
use crate::files::{cannot_read, open_file};
use crate::scene::Splats;
use crate::settings::Constants;
use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::Read;
use std::path::Path;

pub(super) const ELSEWHERE: &str = "export it as .4dgs or PLY, or as it is at one time (--time)";

/// A format that scenes are read from.
pub(super) struct Reader {
    /// Its files, for the message that no format recognises a file.
    pub what: &'static str,
    pub knows: fn(&Start) -> bool,
    pub read: fn(&Path) -> Result<Scene>,
}

pub(super) struct Start<'a> {
    pub path: &'a Path,
    /// The first four bytes, or fewer where there are no more; none of a folder.
    pub bytes: &'a [u8],
}

/// The first four bytes of a file, or fewer where there are no more.
pub(super) fn first_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = open_file(path).and_then(|file| file.take(4).read_to_end(&mut bytes));
    read.map_err(|fault| cannot_read(path, &fault))?;
    Ok(bytes)
}

impl Start<'_> {
    pub fn ends_in(&self, ending: &str) -> bool {
        self.path.extension().and_then(OsStr::to_str).is_some_and(|own| own.eq_ignore_ascii_case(ending))
    }
}

/// A format that scenes are written in.
#[derive(Debug)]
pub struct Writer {
    /// Its name, as `ivv export --format` takes it.
    pub name: &'static str,
    /// The ending of its files; none where that is the ending of a format before it.
    pub ending: Option<&'static str>,
    /// A description in one line.
    pub about: &'static str,
    /// Which parts of a clip it stores.
    pub keeps: Keeps,
    /// Writes a file, and returns a note for each thing that it lost.
    pub(super) write: fn(&Path, &Splats, &Clip, &WriteOptions) -> Result<Vec<String>>,
}

impl Writer {
    /// A note for each part of `clip` that the format has no place for.
    pub(super) fn lost(&self, clip: &Clip) -> Vec<String> {
        let unusual = clip.unusual();
        let mut lost = Vec::new();
        if !self.keeps.constants && !unusual.is_empty() {
            lost.push(format!("the format {} has no place for {}; viewers use theirs", self.name, list(&unusual)));
        }
        if !self.keeps.sounds && !clip.sounds.is_empty() {
            lost.push(format!("the format {} has no place for sound", self.name));
        }
        lost
    }
}

/// The finite Gaussians for a format of one moment, in the order of their rows; an error where one is dynamic or there is none.
pub(super) fn static_rows(path: &Path, splats: &Splats, ending: &str) -> Result<Vec<usize>> {
    let rows = splats.static_rows(path)?;
    require_some(path, &rows, ending)?;
    Ok(rows)
}

pub(super) fn require_some(path: &Path, rows: &[usize], ending: &str) -> Result<()> {
    let none = || Error::data(path, "", "there is no Gaussian to write", format!("a {ending} needs at least one"));
    if rows.is_empty() { Err(none()) } else { Ok(()) }
}

/// The parts of a [`Clip`] that a format stores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keeps {
    /// Constants and background.
    pub constants: bool,
    /// The clock, or views to start from.
    pub views: bool,
    /// Sound.
    pub sounds: bool,
    /// Gaussians with a parameter that is not finite, which are never drawn.
    pub non_finite: bool,
}

impl Keeps {
    pub(super) const NOTHING: Keeps = Keeps { constants: false, views: false, sounds: false, non_finite: false };
    pub(super) const ALL: Keeps = Keeps { constants: true, views: true, sounds: true, non_finite: false };
}

/// How a scene is written.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// The format; by the file's ending where none is given.
    pub format: Option<&'static Writer>,
    /// Writes the scene at this normalised time, 0 to 1, as static Gaussians.
    pub time: Option<f64>,
    /// With `time`: leaves out Gaussians less opaque than this, 0 to 1.
    pub min_opacity: f32,
    /// How finely a `.4dgs` stores each attribute.
    pub grades: Grades,
    /// Writes a `.4dgs` even if it changes the colours of more than 1 in 10 Gaussians by more than 2 levels of 255.
    pub clamp_colors: bool,
    /// Writes a `.4dgs` several times as fast, and larger, without a note or refusal for colours that it changes.
    pub is_quick: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        WriteOptions {
            format: None,
            time: None,
            min_opacity: Constants::default().alpha_min,
            grades: Grades::default(),
            clamp_colors: false,
            is_quick: false,
        }
    }
}

impl WriteOptions {
    /// The scene at this normalised time, 0 to 1, as static Gaussians, which every format can hold.
    pub fn at(time: f64) -> Self {
        WriteOptions { time: Some(time), ..WriteOptions::default() }
    }

    /// The Gaussians that are written of `splats`.
    #[doc(hidden)]
    pub fn moment<'a>(&self, splats: &'a Splats) -> Cow<'a, Splats> {
        self.time.map_or(Cow::Borrowed(splats), |time| Cow::Owned(splats.at(time, self.min_opacity)))
    }
}

/// A file that was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// Gaussians in it.
    pub n: usize,
    /// Dynamic ones among them.
    pub n_dynamic: usize,
    /// Gaussians that are left out, since a parameter is not finite.
    pub n_left_out: usize,
    /// Degree of the spherical harmonics of the scene.
    pub sh_degree: u32,
    /// Length of the file.
    pub bytes: u64,
    /// The losses and changes of the format: a sentence each, without the file's name.
    pub notes: Vec<String>,
}

impl Written {
    pub(super) fn of(splats: &Splats, keep: impl Fn(usize) -> bool, notes: Vec<String>) -> Self {
        let n_static = (0..splats.n_static).filter(|i| keep(*i)).count();
        let n_dynamic = (splats.n_static..splats.len()).filter(|i| keep(*i)).count();
        let n = n_static + n_dynamic;
        Written { n, n_dynamic, n_left_out: splats.len() - n, sh_degree: splats.sh_degree, bytes: 0, notes }
    }
}
