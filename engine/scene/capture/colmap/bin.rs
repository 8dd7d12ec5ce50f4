//! COLMAP's binary files: little-endian records after a count of 64 bits.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::raw::{DAMAGED, MODELS, RawCamera, RawImage, RawPoint};
use crate::error::{Error, Result};
use crate::files::{cannot_read, open_file};
use crate::scene::capture::Faults;

const MAX_NAME_BYTES: usize = 4096;
const OBSERVATION_BYTES: u64 = 24;
/// Fewest bytes of a camera: id, model, width, height, two parameters.
const CAMERA_BYTES: u64 = 24 + 2 * 8;
/// Fewest bytes of an image: id, pose, camera, an empty name, the number of observations.
const IMAGE_BYTES: u64 = 4 + 7 * 8 + 4 + 1 + 8;
/// Fewest bytes of a point: id, position, colour, error, length of its track.
const POINT_BYTES: u64 = 8 + 3 * 8 + 3 + 8 + 8;
const TRACK_BYTES: u64 = 8;

/// A file that knows how much of it is left, so that no count is believed beyond that.
struct Reader<'a> {
    path: &'a Path,
    from: BufReader<File>,
    length: u64,
    left: u64,
}

impl<'a> Reader<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = open_file(path).map_err(|fault| cannot_read(path, &fault))?;
        let length = file.metadata().map_err(|fault| cannot_read(path, &fault))?.len();
        Ok(Reader { path, from: BufReader::new(file), length, left: length })
    }

    fn place(&self) -> String {
        format!("byte {}", self.length - self.left)
    }

    fn fault(&self, reason: String) -> Error {
        Error::data(self.path, self.place(), reason, DAMAGED)
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        if self.left < N as u64 {
            return Err(self.fault(format!("ends where {N} more bytes are needed")));
        }
        self.from.read_exact(&mut bytes).map_err(|fault| cannot_read(self.path, &fault))?;
        self.left -= N as u64;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    fn u64(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.bytes()?);
        }
        Ok(values)
    }

    /// A count of records of at least `size` bytes, which must fit what is left.
    fn count(&mut self, what: &str, size: u64) -> Result<u64> {
        let n = self.u64()?;
        if n > self.left / size {
            return Err(self.fault(format!("says {n} {what}, {} bytes are left for them", self.left)));
        }
        Ok(n)
    }

    fn skip(&mut self, n_bytes: u64) -> Result<()> {
        let n = i64::try_from(n_bytes).map_err(|_| self.fault(format!("skips {n_bytes} bytes")))?;
        self.from.seek_relative(n).map_err(|fault| cannot_read(self.path, &fault))?;
        self.left -= n_bytes;
        Ok(())
    }

    /// A name that a zero byte ends.
    fn name(&mut self) -> Result<Vec<u8>> {
        let (start, mut name) = (self.place(), Vec::new());
        let read = self.from.by_ref().take(MAX_NAME_BYTES as u64 + 1).read_until(0, &mut name);
        self.left = self.left.saturating_sub(read.map_err(|fault| cannot_read(self.path, &fault))? as u64);
        match name.pop() {
            Some(0) => Ok(name),
            Some(_) if name.len() == MAX_NAME_BYTES => {
                let reason = format!("a name has more than {MAX_NAME_BYTES} bytes");
                Err(Error::data(self.path, start, reason, DAMAGED))
            }
            _ => Err(self.fault("ends where 1 more bytes are needed".to_owned())),
        }
    }

    fn end(&self) -> Result<()> {
        if self.left == 0 { Ok(()) } else { Err(self.fault(format!("{} bytes follow the last record", self.left))) }
    }
}

/// Reads records until the first fault of the file's structure: nothing after it can be located.
fn records(
    path: &Path,
    faults: &mut Faults,
    what: &str,
    size: u64,
    mut record: impl FnMut(&mut Reader, &mut Faults) -> Result<()>,
) {
    let mut all = |faults: &mut Faults| -> Result<()> {
        let mut reader = Reader::open(path)?;
        for _ in 0..reader.count(what, size)? {
            record(&mut reader, faults)?;
        }
        reader.end()
    };
    let outcome = all(faults);
    faults.take(outcome);
}

pub(super) fn cameras(path: &Path, faults: &mut Faults) -> Vec<RawCamera> {
    let mut cameras = Vec::new();
    records(path, faults, "cameras", CAMERA_BYTES, |reader, _| {
        let place = reader.place();
        let id = reader.u32()?;
        let model = i32::from_le_bytes(reader.bytes()?);
        let Some(kind) = MODELS.iter().find(|kind| kind.id == model) else {
            return Err(reader.fault(format!("camera {id} has the model {model}, which is unknown")));
        };
        let (width, height) = (reader.u64()?, reader.u64()?);
        let params = (0..kind.n_params).map(|_| Ok(f64::from_le_bytes(reader.bytes()?))).collect::<Result<_>>()?;
        cameras.push(RawCamera { place, id, kind, width, height, params });
        Ok(())
    });
    cameras
}

pub(super) fn images(path: &Path, faults: &mut Faults) -> Vec<RawImage> {
    let mut images = Vec::new();
    records(path, faults, "images", IMAGE_BYTES, |reader, _| {
        let place = reader.place();
        let (id, quaternion, translation) = (reader.u32()?, reader.f64s()?, reader.f64s()?);
        let (camera_id, name) = (reader.u32()?, reader.name()?);
        let n = reader.count("observations", OBSERVATION_BYTES)?;
        reader.skip(n * OBSERVATION_BYTES)?;
        images.push(RawImage { place, id, quaternion, translation, camera_id, name });
        Ok(())
    });
    images
}

/// Images of `images.bin`, as its first bytes say, and no more than there may be; 0 where it cannot be read.
pub(super) fn n_images(path: &Path) -> usize {
    let counted = Reader::open(path).and_then(|mut reader| reader.count("images", IMAGE_BYTES));
    counted.map_or(0, |n| n as usize)
}

pub(super) fn points(path: &Path, faults: &mut Faults, mut add: impl FnMut(RawPoint, &mut Faults)) {
    records(path, faults, "points", POINT_BYTES, |reader, faults| {
        let place = reader.place();
        let (id, position, color) = (reader.u64()?, reader.f64s()?, reader.bytes()?);
        let [_reprojection_error] = reader.f64s()?;
        let n = reader.count("observations of a point", TRACK_BYTES)?;
        let mut seen_in = Vec::new();
        for _ in 0..n {
            seen_in.push(reader.u32()?);
            reader.u32()?;
        }
        add(RawPoint { place, id, position, color, seen_in }, faults);
        Ok(())
    });
}
