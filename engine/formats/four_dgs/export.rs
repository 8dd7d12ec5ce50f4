use super::FourDgs;
use super::encode::{Contents, Encoded};
use super::losses::Losses;
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::internals::formats::clock::Clock;
use crate::internals::formats::format::{Keeps, WriteOptions, Writer, Written};
use crate::internals::formats::scene::{Clip, Scene};
use crate::scene::{Parts, Splats, View};
use std::path::Path;

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
