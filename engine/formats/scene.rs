//! A scene as a file holds it.

use super::four_dgs::{Sounds, World};
use super::rendering::{Own, Rendering, own, unusual};
use crate::scene::{Splats, View};
use crate::settings::Constants;

/// A scene as a file holds it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The Gaussians, static ones first.
    pub splats: Splats,
    /// When they are shown, from where, and how they are rendered.
    pub clip: Clip,
    /// A sentence, without the file's name, for each thing that the reader left out, guessed or converted.
    pub notes: Vec<String>,
}

/// A scene's data beside its Gaussians. A `.4dgs` holds all of it, other formats parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    /// Length and frame rate, where known: normalised time 0 to 1 is `clock.seconds()`.
    pub clock: Option<Clock>,
    /// Views to start from, in the scene's frame.
    pub views: Vec<View>,
    /// Sources of sound, and the ears that hear them.
    pub sounds: Sounds,
    /// The direction that is up, and metres per unit, where known.
    pub world: Option<World>,
    /// The constants that the scene is rendered with.
    pub constants: Constants,
    /// Background colour, linear RGB as rendered, where known.
    pub background: Option<[f32; 3]>,
    /// The temporal factor, 0 to 1, below which a `.4dgs` of another program hides a Gaussian, where that shows.
    pub cutoff: Option<f64>,
}

/// The clock of a clip: normalised time 0 to 1 is 0 to `frames / fps` seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Frames per second, positive.
    pub fps: f64,
    /// Frames of the clip, at least 1.
    pub frames: u32,
}

impl Clock {
    /// A scene in which nothing changes: one frame.
    pub const STILL: Clock = Clock { fps: 1.0, frames: 1 };

    /// Length of the clip, seconds.
    pub fn seconds(self) -> f64 {
        f64::from(self.frames) / self.fps
    }
}

impl Scene {
    /// A scene whose file says `own` of its rendering.
    pub(super) fn new(splats: Splats, mut notes: Vec<String>, own: Option<&Own>) -> Self {
        let Rendering { constants, background, notes: wrong } = own.map(Rendering::of).unwrap_or_default();
        notes.extend(wrong);
        Scene { splats, clip: Clip { constants, background, ..Clip::default() }, notes }
    }
}

impl From<Splats> for Scene {
    fn from(splats: Splats) -> Self {
        Scene { splats, ..Scene::default() }
    }
}

impl Clip {
    /// All values, with the background of the first view where none is known.
    pub(super) fn own(&self) -> Own {
        let background = self.background.or(self.views.first().map(|view| view.background));
        own(&self.constants, background.unwrap_or_default())
    }

    pub(super) fn unusual(&self) -> Own {
        unusual(&self.constants, self.background)
    }
}

pub(super) fn compensated(tag: &str) -> String {
    format!(
        "it was trained for a renderer that makes Gaussians fainter as blur makes them larger ({tag}); ivv does not, so thin and \
         distant things look thicker than they should, and a smaller --blur comes nearer"
    )
}

pub(super) fn cut_harmonics(degree: u32, n_cut: usize, n: usize) -> String {
    format!("harmonics of degree {degree} are cut to degree 3, of {n_cut} of {n} Gaussians")
}
