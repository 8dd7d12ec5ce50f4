//! All faults of a capture, and its contents in numbers.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::as_text;

/// Faults kept in full; beyond them they are only counted, so that a hostile file cannot fill the memory with them.
const MAX_KEPT: usize = 10_000;

/// One thing that is wrong with a capture.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Fault {
    /// The file or folder.
    #[serde(serialize_with = "as_text")]
    pub file: PathBuf,
    /// Where in it: a line, a byte offset, a camera, a frame; empty for the file as a whole.
    pub place: String,
    /// The fault.
    pub reason: String,
    /// The remedy.
    pub remedy: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Error::from(self.clone()).fmt(f)
    }
}

impl From<Fault> for Error {
    fn from(fault: Fault) -> Self {
        Error::Data { file: fault.file, place: fault.place, reason: fault.reason, remedy: fault.remedy }
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        match error {
            Error::Data { file, place, reason, remedy } => Fault { file, place, reason, remedy },
            other => {
                let remedy = "this is no fault of the capture: try again".to_owned();
                Fault { file: PathBuf::new(), place: String::new(), reason: other.to_string(), remedy }
            }
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct Faults {
    pub kept: Vec<Fault>,
    n: u64,
}

impl Faults {
    pub fn add(&mut self, file: &Path, place: impl Into<String>, reason: impl Into<String>, remedy: impl Into<String>) {
        self.push(Fault { file: file.to_owned(), place: place.into(), reason: reason.into(), remedy: remedy.into() });
    }

    pub fn append(&mut self, others: Faults) {
        let n_uncounted = others.n - others.kept.len() as u64;
        others.kept.into_iter().for_each(|fault| self.push(fault));
        self.n += n_uncounted;
    }

    pub fn push(&mut self, fault: Fault) {
        self.n += 1;
        if self.kept.len() < MAX_KEPT {
            self.kept.push(fault);
        }
    }

    /// The value, or `None` with its error noted.
    pub fn take<T>(&mut self, outcome: Result<T>) -> Option<T> {
        outcome.map_err(|error| self.push(error.into())).ok()
    }

    pub fn first(&self) -> Option<Error> {
        self.kept.first().cloned().map(Error::from)
    }

    pub fn n(&self) -> u64 {
        self.n
    }
}

pub(crate) fn camera_place(name: &str) -> String {
    format!("camera `{}`", name.escape_debug())
}

/// The report of `ivv check` on a capture.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Report {
    /// The folder; of a folder that only holds a capture, that one.
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// Its format; empty when none was recognised.
    pub format: String,
    /// Frames of the clip.
    pub n_frames: u32,
    /// Frames per second.
    pub fps: f64,
    /// Cameras, with the test cameras.
    pub n_cameras: usize,
    /// Cameras kept for testing.
    pub n_test_cameras: usize,
    /// Photographs of the static scene, which are no cameras of the clip.
    pub n_photos: usize,
    /// Images, with the photographs.
    pub n_images: usize,
    /// Images that have a mask.
    pub n_masks: usize,
    /// Images that have a foreground mask.
    pub n_foregrounds: usize,
    /// Images that have an alpha channel.
    pub n_alphas: usize,
    /// Images that have optical flow.
    pub n_flows: usize,
    /// Images that have a depth prior.
    pub n_depths: usize,
    /// Sound files of the capture.
    pub n_sounds: usize,
    /// Sparse points.
    pub n_points: usize,
    /// True if every frame has points of its own.
    pub has_frame_points: bool,
    /// Bytes of all images when decoded, 4 for each pixel.
    pub bytes_decoded: u64,
    /// Notes that are no fault.
    pub notes: Vec<String>,
    /// How many faults there are.
    pub n_faults: u64,
    /// The faults, in the order of the files; at most 10,000 of them.
    pub faults: Vec<Fault>,
}

impl Report {
    pub(crate) fn of_faults(path: &Path, format: &str, Faults { kept, n }: Faults) -> Self {
        Report { path: path.to_owned(), format: format.to_owned(), n_faults: n, faults: kept, ..Report::default() }
    }

    /// The faults, those that are equal but for numbers and files together, in the order of the first.
    #[doc(hidden)]
    pub fn grouped(&self) -> Vec<Vec<&Fault>> {
        let mut groups: Vec<Vec<&Fault>> = Vec::new();
        let mut of: HashMap<(String, String), usize> = HashMap::new();
        for fault in &self.faults {
            let group = *of.entry((masked(&fault.reason), masked(&fault.remedy))).or_insert(groups.len());
            if group == groups.len() {
                groups.push(Vec::new());
            }
            groups[group].push(fault);
        }
        groups
    }

    /// The first fault, with how many more there are and where to see them all.
    pub(crate) fn first_error(&self) -> Option<Error> {
        let mut first = self.faults.first()?.clone();
        if self.n_faults > 1 {
            let (more, path) = (self.n_faults - 1, self.path.display());
            first.remedy += &format!(" ({more} more: `ivv check {path}` lists them all)");
        }
        Some(first.into())
    }
}

/// A text with one sign in the place of each of its numbers, however it was written.
fn masked(text: &str) -> String {
    let mut masked = String::with_capacity(text.len());
    let mut is_number = false;
    for (at, c) in text.char_indices() {
        let before = text[..at].chars().next_back();
        // A fraction, an exponent and its sign belong to the number.
        let goes_on = is_number && (c == '.' || c == 'e' || c == '-' && before == Some('e'));
        is_number = c.is_ascii_digit() || goes_on;
        if c.is_ascii_digit() && !masked.ends_with('#') {
            masked.push('#');
        } else if !is_number {
            masked.push(c);
        }
    }
    masked
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_masked_however_they_are_written() {
        let masked = |text: &str| super::masked(text);
        assert_eq!(masked("of length 1.01, not 1"), masked("of length 1.0099999999999998, not 1"));
        assert_eq!(masked("has fx = 1e-320 pixels"), masked("has fx = 25 pixels"));
        assert_ne!(masked("image 7 is missing"), masked("image 7 is broken"));
    }
}
