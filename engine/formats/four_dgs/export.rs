//! Scenes as `.4dgs`, whole or part by part, and the colours that it cannot hold.

use super::FourDgs;
use super::encode::{Contents, Encoded};
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::internals::formats::format::{Keeps, WriteOptions, Writer, Written};
use crate::internals::formats::scene::{Clip, Clock, Scene};
use crate::scene::{Parts, Splats, View};
use crate::words::count;
use std::path::Path;

/// Part of the Gaussians whose colours may be off by more than shows.
const MOST_OFF: f64 = 0.1;

pub(in crate::internals::formats) const WRITER: Writer = Writer {
    name: "4dgs",
    ending: Some(".4dgs"),
    about: "with the clock and the cameras of the clip, for players",
    keeps: Keeps::ALL,
    write: |path, splats, clip, options| {
        let (bytes, notes) = encode(path, splats, clip, options)?;
        write_atomic(path, |to| to.write_all(&bytes))?;
        Ok(notes)
    },
};

impl FourDgs {
    /// The bytes that [`write`](crate::internals::formats::write) would write; errors name `path`.
    pub fn encode(path: &Path, scene: &Scene, options: &WriteOptions) -> Result<(Vec<u8>, Written)> {
        let splats = options.moment(&scene.splats);
        let (bytes, notes) = encode(path, &splats, &scene.clip, options)?;
        let written = Written::of(&splats, |i| splats.is_finite(i), notes);
        Ok((bytes, written))
    }

    /// Writes a clip with one part at a time in memory, at the finest grades.
    pub fn write_parts(path: &Path, parts: &mut dyn Parts, clip: &Clip, options: &WriteOptions) -> Result<Written> {
        let contents = Contents::of(path, clip, false, options)?;
        let (mut losses, mut written) = (Losses::default(), Written::default());
        let measure = contents.measure(parts, |encoded| {
            losses.count(encoded, contents.views);
            written.n += encoded.len();
            written.n_dynamic += encoded.n_dynamic;
            written.n_left_out += encoded.n_left_out;
        })?;
        written.notes.extend(losses.judge(path, options.clamp_colors)?);
        contents.write(path, parts, &measure)?;
        let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
        Ok(Written { sh_degree: parts.sh_degree(), bytes, ..written })
    }
}

impl<'a> Contents<'a> {
    /// Refuses a moving `clip` without a clock.
    pub fn of(path: &Path, clip: &'a Clip, is_still: bool, options: &WriteOptions) -> Result<Self> {
        let clock = match clip.clock {
            Some(clock) => clock,
            None if is_still => Clock::STILL,
            None => {
                let reason = "expected the clock of the clip, found none";
                return Err(Error::data(path, "", reason, "set `Clip::clock`, or write the scene at one time"));
            }
        };
        let Clip { views, sounds, world, cutoff, .. } = clip;
        let (world, cutoff) = (*world, *cutoff);
        Ok(Contents { clock, views, own: clip.own(), sounds, world, cutoff, is_quick: options.is_quick })
    }
}

fn encode(path: &Path, splats: &Splats, clip: &Clip, options: &WriteOptions) -> Result<(Vec<u8>, Vec<String>)> {
    let contents = Contents::of(path, clip, splats.motion.is_empty(), options)?;
    let encoded = Encoded::new(splats, contents.clock);
    let mut notes = Vec::new();
    if !options.is_quick {
        notes.extend(encoded.losses(contents.views).judge(path, options.clamp_colors)?);
    }
    Ok((encoded.bytes(path, &contents, options.grades)?, notes))
}

impl Encoded {
    pub fn losses(&self, views: &[View]) -> Losses {
        let mut losses = Losses::default();
        losses.count(self, views);
        losses
    }
}

#[derive(Debug, Default)]
pub struct Losses {
    n: usize,
    n_clamped_colors: usize,
    n_clamped_harmonics: usize,
    n_off: usize,
}

impl Losses {
    pub fn count(&mut self, encoded: &Encoded, views: &[View]) {
        self.n += encoded.len();
        self.n_clamped_colors += encoded.n_clamped_colors;
        self.n_clamped_harmonics += encoded.n_clamped_harmonics;
        self.n_off += encoded.n_off(views);
    }

    /// The note on colours that are cut, if any. Refuses a file that makes too many colours wrong, unless `clamp_colors`.
    pub fn judge(&self, path: &Path, clamp_colors: bool) -> Result<Option<String>> {
        let Losses { n, n_clamped_colors, n_clamped_harmonics, n_off } = *self;
        if n_off as f64 > MOST_OFF * n as f64 && !clamp_colors {
            let reason = format!(
                "expected colours that a .4dgs holds, found {n_off} of {} off by more than 2 levels of 255",
                count(n, "Gaussian")
            );
            return Err(Error::data(path, "", reason, "export as PLY, or give --clamp-colors"));
        }
        Ok((n_clamped_colors + n_clamped_harmonics > 0).then(|| {
            format!(
                "{} with a base colour beyond 0 to 1, {n_clamped_harmonics} with harmonics beyond -4 to 4: cut to that, and the \
                 rest of their coefficients makes it good; {n_off} are off by more than 2 levels of 255",
                count(n_clamped_colors, "Gaussian")
            )
        }))
    }
}
