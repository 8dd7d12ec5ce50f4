//! Formats of a header and numbers: Middlebury's .flo, NumPy's .npy, PFM.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::{Error, Result};
use crate::files::npy::{Float, Header};
use crate::files::{cannot_read, open_file};

const REMEDY: &str = "make or copy the file again";
const MAX_WORD: usize = 32;

/// Where the numbers are and how they are stored.
pub(super) struct Layout {
    start: u64,
    float: Float,
    big_endian: bool,
    bottom_up: bool,
}

type Found = ((u32, u32), Layout);

/// "PIEH", width, height, then (x, y) per pixel (Baker et al. 2011).
pub(super) fn flo(path: &Path) -> Result<Found> {
    let mut from = open(path)?;
    let mut start = [0; 12];
    from.read_exact(&mut start).map_err(|_| fault(path, "is no .flo file: it has no 12 bytes"))?;
    let words: &[[u8; 4]] = start.as_chunks().0;
    if words[0] != *b"PIEH" {
        return Err(fault(path, "is no .flo file: it does not begin with PIEH"));
    }
    let size = (u32::from_le_bytes(words[1]), u32::from_le_bytes(words[2]));
    checked(path, size, 2, Layout { start: 12, float: Float::F32, big_endian: false, bottom_up: false })
}

/// An array of shape [H, W] for one channel, [H, W, channels] for more.
pub(super) fn npy(path: &Path, channels: usize) -> Result<Found> {
    let header = Header::read(&mut open(path)?).map_err(|reason| fault(path, reason))?;
    let side = |side: usize| u32::try_from(side).ok();
    let size = match header.shape[..] {
        [height, width] if channels == 1 => side(width).zip(side(height)),
        [height, width, n] if channels > 1 && n == channels => side(width).zip(side(height)),
        _ => None,
    };
    let Some(size) = size else {
        let wanted = if channels == 1 { "[H, W]" } else { "[H, W, 2]" };
        return Err(fault(path, format!("has the shape {:?}, not {wanted}", header.shape)));
    };
    let layout = Layout { start: header.size, float: header.float, big_endian: false, bottom_up: false };
    checked(path, size, channels, layout)
}

/// "Pf", width, height and a scale whose sign tells the byte order, as words; then rows from the bottom up (Debevec's PFM).
pub(super) fn pfm(path: &Path) -> Result<Found> {
    let mut from = open(path)?;
    let mut n_read = 0;
    let mut word = || -> Result<String> {
        let mut word = String::new();
        loop {
            let mut byte = [0];
            from.read_exact(&mut byte).map_err(|_| fault(path, "ends within its header"))?;
            n_read += 1;
            match byte[0] {
                space if space.is_ascii_whitespace() && !word.is_empty() => return Ok(word),
                space if space.is_ascii_whitespace() && n_read > 1 => {}
                other if other.is_ascii_graphic() && word.len() < MAX_WORD => word.push(other.into()),
                _ => return Err(fault(path, "is no .pfm file: its header is not text")),
            }
        }
    };
    match word()?.as_str() {
        "Pf" => {}
        "PF" => return Err(fault(path, "has three channels, depth has one")),
        _ => return Err(fault(path, "is no .pfm file: it does not begin with Pf")),
    }
    let (width, height, scale) = (word()?, word()?, word()?);
    let (width, height) = (width.parse::<u32>().ok(), height.parse::<u32>().ok());
    let scale = scale.parse::<f64>().ok().filter(|scale| scale.is_finite() && *scale != 0.0);
    let (Some(size), Some(scale)) = (width.zip(height), scale) else {
        return Err(fault(path, "has a header without width, height and scale"));
    };
    let layout = Layout { start: n_read, float: Float::F32, big_endian: scale > 0.0, bottom_up: true };
    checked(path, size, 1, layout)
}

fn checked(path: &Path, size: (u32, u32), channels: usize, layout: Layout) -> Result<Found> {
    let n_bytes = std::fs::metadata(path).map_err(|cause| cannot_read(path, &cause))?.len();
    let per_pixel = (channels * layout.float.size()) as u128;
    let promised = u128::from(layout.start) + u128::from(size.0) * u128::from(size.1) * per_pixel;
    if size.0 == 0 || size.1 == 0 {
        return Err(fault(path, format!("is {} x {}", size.0, size.1)));
    }
    if promised != u128::from(n_bytes) {
        let reason = format!("is {} x {}, which takes {promised} bytes, and has {n_bytes}", size.0, size.1);
        return Err(fault(path, reason));
    }
    Ok((size, layout))
}

/// Reads the numbers; the size fits the length of the file.
pub(super) fn read<const N: usize>(path: &Path, size: (u32, u32), layout: Layout) -> Result<Vec<[f32; N]>> {
    let failed = |cause| cannot_read(path, &cause);
    let mut from = open(path)?;
    from.seek(SeekFrom::Start(layout.start)).map_err(failed)?;
    let (width, height) = (size.0 as usize, size.1 as usize);
    let mut row = vec![0; width * N * layout.float.size()];
    let mut pixels = vec![[0.0; N]; width * height];
    for line in 0..height {
        from.read_exact(&mut row).map_err(failed)?;
        if layout.big_endian {
            row.chunks_exact_mut(layout.float.size()).for_each(<[u8]>::reverse);
        }
        let line = if layout.bottom_up { height - 1 - line } else { line };
        let to = pixels[line * width..(line + 1) * width].as_flattened_mut();
        to.iter_mut().zip(layout.float.values(&row)).for_each(|(to, value)| *to = value as f32);
    }
    Ok(pixels)
}

fn open(path: &Path) -> Result<BufReader<File>> {
    Ok(BufReader::new(open_file(path).map_err(|cause| cannot_read(path, &cause))?))
}

fn fault(path: &Path, reason: impl Into<String>) -> Error {
    Error::data(path, "", reason, REMEDY)
}
