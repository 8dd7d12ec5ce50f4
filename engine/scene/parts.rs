//! Clips that may be longer than memory: their dynamic Gaussians in parts by time.

use super::Splats;
use crate::error::Result;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// From when some of them may be there, normalised time, or -infinity.
    pub from: f64,
    /// Up to when, not included, or infinity.
    pub to: f64,
    pub n: usize,
}

/// A clip of which the Gaussians of a time can be read alone.
pub trait Parts: Send {
    /// The file that errors name.
    fn path(&self) -> &Path;
    /// Of all Gaussians, 0 to 3.
    fn sh_degree(&self) -> u32;
    /// Each dynamic Gaussian is in one of them.
    fn parts(&self) -> &[Part];
    /// Reads the static Gaussians.
    fn still(&mut self) -> Result<Splats>;
    /// Reads the Gaussians of a part, all of them dynamic.
    fn part(&mut self, index: usize) -> Result<Splats>;
}

/// A clip whose Gaussians are changed as they are read.
pub struct Mapped<F> {
    clip: Box<dyn Parts>,
    map: F,
}

impl<F: Fn(Splats) -> Splats + Send> Mapped<F> {
    /// `clip`, with `map` applied to its static Gaussians and to each part. `map` must keep number, degree and times.
    pub fn new(clip: Box<dyn Parts>, map: F) -> Self {
        Mapped { clip, map }
    }
}

impl<F: Fn(Splats) -> Splats + Send> Parts for Mapped<F> {
    fn path(&self) -> &Path {
        self.clip.path()
    }

    fn sh_degree(&self) -> u32 {
        self.clip.sh_degree()
    }

    fn parts(&self) -> &[Part] {
        self.clip.parts()
    }

    fn still(&mut self) -> Result<Splats> {
        self.clip.still().map(&self.map)
    }

    fn part(&mut self, index: usize) -> Result<Splats> {
        self.clip.part(index).map(&self.map)
    }
}

/// The parts of a clip about one time, in memory.
pub(crate) struct Resident {
    clip: Box<dyn Parts>,
    /// Begins and ends of parts, normalised time, ascending.
    borders: Vec<f64>,
    held: BTreeMap<usize, Arc<Splats>>,
    /// How many borders are at or before the time whose parts are all held.
    stretch: Option<usize>,
}

impl Resident {
    pub fn new(clip: Box<dyn Parts>) -> Self {
        let mut borders: Vec<f64> = clip.parts().iter().flat_map(|part| [part.from, part.to]).collect();
        borders.retain(|border| border.is_finite());
        borders.sort_unstable_by(f64::total_cmp);
        borders.dedup();
        Resident { clip, borders, held: BTreeMap::new(), stretch: None }
    }

    pub fn clip(&mut self) -> &mut dyn Parts {
        &mut *self.clip
    }

    fn stretch_of(&self, time: f64) -> usize {
        self.borders.partition_point(|border| *border <= time)
    }

    pub fn holds(&self, time: f64) -> bool {
        self.stretch == Some(self.stretch_of(time))
    }

    /// Holds the parts of `time` and drops all others. Gives from when to when they are all that there is, and them.
    pub fn reach(&mut self, time: f64) -> Result<([f64; 2], Vec<Arc<Splats>>)> {
        let at = self.stretch_of(time);
        let begin = at.checked_sub(1).map_or(f64::NEG_INFINITY, |before| self.borders[before]);
        let end = self.borders.get(at).copied().unwrap_or(f64::INFINITY);
        let parts = self.clip.parts().iter().enumerate();
        let needed: Vec<usize> =
            parts.filter(|(_, part)| part.from < end && part.to > begin).map(|(index, _)| index).collect();
        self.stretch = None;
        self.held.retain(|index, _| needed.binary_search(index).is_ok());
        for index in needed {
            if !self.held.contains_key(&index) {
                self.held.insert(index, Arc::new(self.clip.part(index)?));
            }
        }
        self.stretch = Some(at);
        Ok(([begin, end], self.held.values().cloned().collect()))
    }
}
