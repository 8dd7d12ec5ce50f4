use crate::error::{Error, Result};
use std::path::Path;

pub(super) const EARS: &str = "ears.bin";
const MAGIC: &[u8; 8] = b"IVVEARS1";
const RATE: u32 = 48_000;
/// Limits of a grid: rows, directions of a row, taps, bytes of text.
const MOST_ROWS: u32 = 181;
const MOST_IN_ROW: u32 = 720;
const MOST_TAPS: u32 = 1024;
const MOST_TEXT: u32 = 4096;

/// Responses of both ears, 48 kHz, on rows of even elevation from straight below to straight above, each of some directions of
/// even azimuth from the front on, counter-clockwise.
///
/// As an attachment, little-endian: `IVVEARS1`; u32 samples per second (48000), taps, rows, directions of each row; f32 value of a
/// step; u32 bytes of a text in UTF-8 that says where the responses come from, and the text; then, direction by direction, the
/// taps of the left ear and those of the right, i16 steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Ears {
    about: String,
    rows: Vec<u32>,
    taps: usize,
    step: f32,
    samples: Vec<i16>,
}

impl Ears {
    /// Responses `[left, right]` of equal length, in the order of [`Ears::grid`]; `about` is their source, cut to 4096 bytes.
    #[doc(hidden)]
    pub fn new(mut about: String, rows: Vec<u32>, responses: &[[Vec<f32>; 2]]) -> Self {
        let most = about.char_indices().map(|(at, c)| at + c.len_utf8()).take_while(|end| *end <= MOST_TEXT as usize);
        about.truncate(most.last().unwrap_or(0));
        let loudest = responses.iter().flatten().flatten().fold(0f32, |most, x| most.max(x.abs()));
        let step = loudest.max(f32::MIN_POSITIVE) / f32::from(i16::MAX);
        let samples = responses.iter().flatten().flatten().map(|x| (x / step).round() as i16).collect();
        let taps = responses.first().map_or(0, |ears| ears[0].len());
        Ears { about, rows, taps, step, samples }
    }

    /// Azimuth (counter-clockwise) and elevation of each direction of a grid, degrees, row by row.
    #[doc(hidden)]
    pub fn grid(rows: &[u32]) -> Vec<[f64; 2]> {
        let elevation = |row: usize| 180.0 * row as f64 / (rows.len().max(2) - 1) as f64 - 90.0;
        let row = |(at, n): (usize, &u32)| {
            let (el, n) = (elevation(at), *n);
            (0..n).map(move |k| [360.0 * f64::from(k) / f64::from(n), el])
        };
        rows.iter().enumerate().flat_map(row).collect()
    }

    #[doc(hidden)]
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// The response of direction `at` of the grid to an ear; 0 is the left one.
    #[doc(hidden)]
    pub fn response(&self, at: usize, ear: usize) -> Vec<f32> {
        self.samples[(2 * at + ear) * self.taps..][..self.taps].iter().map(|x| f32::from(*x) * self.step).collect()
    }

    /// The source of the responses.
    pub fn about(&self) -> &str {
        &self.about
    }

    #[doc(hidden)]
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let head = [RATE, self.taps as u32, self.rows.len() as u32];
        head.iter().chain(&self.rows).for_each(|n| bytes.extend(n.to_le_bytes()));
        bytes.extend(self.step.to_le_bytes());
        bytes.extend((self.about.len() as u32).to_le_bytes());
        bytes.extend(self.about.as_bytes());
        self.samples.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes
    }

    /// Parses an attachment of the file `path`.
    #[doc(hidden)]
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let fault = |reason: String| {
            let remedy = "the file is damaged: copy it again, or export it again with --hrtf";
            Error::data(path, format!("attachment {EARS}"), reason, remedy)
        };
        let cut = || fault(format!("expected more than its {} bytes", bytes.len()));
        let mut rest = bytes.strip_prefix(MAGIC).ok_or_else(|| fault("expected IVVEARS1 at its beginning".into()))?;
        let mut word = || rest.split_off(..4).and_then(|word| <[u8; 4]>::try_from(word).ok()).ok_or_else(cut);
        let mut number = |name: &str, most: u32| {
            let n = u32::from_le_bytes(word()?);
            let reason = || fault(format!("expected {name} from 1 to {most}, found {n}"));
            (1..=most).contains(&n).then_some(n).ok_or_else(reason)
        };
        let rate = number("samples per second", u32::MAX)?;
        if rate != RATE {
            return Err(fault(format!("expected {RATE} samples per second, found {rate}")));
        }
        let taps = number("taps", MOST_TAPS)? as usize;
        let n_rows = number("rows", MOST_ROWS)?;
        let rows = (0..n_rows).map(|_| number("directions of a row", MOST_IN_ROW)).collect::<Result<Vec<u32>>>()?;
        let step = f32::from_le_bytes(word()?);
        if !(step.is_normal() && step > 0.0 && step < 1e3) {
            return Err(fault(format!("expected a positive step below 1000, found {step}")));
        }
        let length = u32::from_le_bytes(word()?);
        if length > MOST_TEXT {
            return Err(fault(format!("expected at most {MOST_TEXT} bytes of text, found {length}")));
        }
        let text = rest.split_off(..length as usize).ok_or_else(cut)?;
        let about = String::from_utf8(text.to_vec()).map_err(|_| fault("expected text in UTF-8".into()))?;
        let wanted = 4 * taps * rows.iter().map(|n| *n as usize).sum::<usize>();
        if rest.len() != wanted {
            return Err(fault(format!("expected {wanted} bytes of responses, found {}", rest.len())));
        }
        let samples = rest.as_chunks().0.iter().map(|x| i16::from_le_bytes(*x)).collect();
        Ok(Ears { about, rows, taps, step, samples })
    }
}
