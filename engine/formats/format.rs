//! What a scene format is to those that read and write it.

use std::ffi::OsStr;
use std::path::Path;

use super::clock::Clock;
use super::four_dgs::World;
use super::imported::{Imported, Own};
use crate::error::Result;
use crate::scene::{Splats, View};

/// What to do with a scene that a format cannot hold for its spans.
pub(super) const ELSEWHERE: &str = "export it as .4dgs or PLY, or as it is at one time (--time)";

/// A format that scenes are read from.
pub(super) struct Reader {
    /// What to give, for the message that no format knows a file.
    pub what: &'static str,
    /// Whether a file, or a folder, is of this format.
    pub knows: fn(&Start) -> bool,
    /// Reads it.
    pub read: fn(&Path) -> Result<Imported>,
}

/// What tells the formats of files apart.
pub(super) struct Start<'a> {
    pub path: &'a Path,
    /// The first four bytes, or fewer where there are no more; none of a folder.
    pub bytes: &'a [u8],
}

impl Start<'_> {
    /// Whether the name ends in `.ending`, in whatever case.
    pub fn ends_in(&self, ending: &str) -> bool {
        self.path.extension().and_then(OsStr::to_str).is_some_and(|own| own.eq_ignore_ascii_case(ending))
    }
}

/// A format that scenes are written in, without player or sound.
#[derive(Debug)]
pub struct Writer {
    /// Its name, as `ivv export --format` takes it.
    pub name: &'static str,
    /// What its files end in; none where that is the ending of a format before it.
    pub ending: Option<&'static str>,
    /// What it is, in a line.
    pub about: &'static str,
    /// Whether it keeps how the scene is rendered.
    pub keeps_constants: bool,
    /// How it is written.
    pub write: WriteScene,
}

/// How a scene is written.
#[derive(Debug)]
pub enum WriteScene {
    /// From the Gaussians alone.
    Alone(fn(&Path, &Splats) -> Result<()>),
    /// With what is this project's own.
    WithOwn(fn(&Path, &Splats, &Own) -> Result<()>),
    /// With which way is up and how large it is, where something tells that.
    InWorld(fn(&Path, &Splats, Option<World>) -> Result<()>),
    /// With the clock of the clip, where something tells it, views to start from, and what is this project's own.
    WithClip(WriteClip),
}

/// As in [`WriteScene::WithClip`].
pub type WriteClip = fn(&Path, &Splats, Option<Clock>, &[View], &Own) -> Result<()>;
