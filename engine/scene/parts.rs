//! Clips that may be longer than memory: their dynamic Gaussians in parts, by when they are there.

use super::Splats;
use crate::error::Result;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// A part of the dynamic Gaussians of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// From when some of them may be there, normalised time; may be -infinity.
    pub from: f64,
    /// Up to when, this moment not included; may be infinity.
    pub to: f64,
    /// How many they are.
    pub n: usize,
}

/// A clip of which what is there at a time can be read alone.
pub trait Parts: Send {
    /// What faults are told of.
    fn path(&self) -> &Path;

    /// Degree of the spherical harmonics, 0 to 3, that all of [`Parts::still`] and [`Parts::part`] have.
    fn sh_degree(&self) -> u32;

    /// The parts. Each dynamic Gaussian is in one of them.
    fn parts(&self) -> &[Part];

    /// Reads the static Gaussians.
    ///
    /// # Errors
    /// [`Error::Data`](crate::Error::Data) where they cannot be read.
    fn still(&mut self) -> Result<Splats>;

    /// Reads the Gaussians of a part, all of them dynamic.
    ///
    /// # Errors
    /// As [`Parts::still`].
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

/// Those parts of a clip that are needed about one time, in memory.
pub(crate) struct Resident {
    clip: Box<dyn Parts>,
    /// Where the parts that are needed change, normalised time, ascending.
    borders: Vec<f64>,
    held: BTreeMap<usize, Arc<Splats>>,
    /// The stretch between borders of which all parts are held: so many borders are at its begin or before it.
    stretch: Option<usize>,
}

impl Resident {
    /// Nothing is read yet.
    pub fn new(clip: Box<dyn Parts>) -> Self {
        let mut borders: Vec<f64> = clip.parts().iter().flat_map(|part| [part.from, part.to]).collect();
        borders.retain(|border| border.is_finite());
        borders.sort_unstable_by(f64::total_cmp);
        borders.dedup();
        Resident { clip, borders, held: BTreeMap::new(), stretch: None }
    }

    /// The clip.
    pub fn clip(&mut self) -> &mut dyn Parts {
        &mut *self.clip
    }

    fn stretch_of(&self, time: f64) -> usize {
        self.borders.partition_point(|border| *border <= time)
    }

    /// Whether all parts that are there at `time` are held.
    pub fn holds(&self, time: f64) -> bool {
        self.stretch == Some(self.stretch_of(time))
    }

    /// Holds the parts that are there at `time` and drops all others. Gives from when to when they are all that there is, and them.
    ///
    /// # Errors
    /// As [`Parts::part`].
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
