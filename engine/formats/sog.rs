//! PlayCanvas' SOG, version 2: `meta.json` and lossless WebP images of the attributes, in a folder or a zip archive, a `.sog`.

use super::convert::{complete_quaternion, logit_of_byte};
use super::format::{Reader, first_bytes};
use super::scene::{Scene, compensated};
use crate::error::{Error, Result};
use crate::files::archive::Archive;
use crate::files::read_bytes;
use crate::scene::Splats;
use image::codecs::webp::WebPDecoder;
use image::{DynamicImage, ImageDecoder, RgbaImage};
use serde::Deserialize;
use std::io::Cursor;
use std::path::Path;

/// An image may have twice as many pixels as values and this many more; a larger one is refused before decoding.
const SLACK_PIXELS: u64 = 256 * 256;
const MAX_META_BYTES: u64 = 1 << 20;
/// Palette entries in a row of their image.
const PALETTE_COLUMNS: usize = 64;
const ZIP: &[u8] = b"PK\x03\x04";
pub(super) const READER: Reader = Reader {
    what: "a SOG scene (version 2): a .sog, or its folder or meta.json",
    knows: |start| start.bytes == ZIP || start.path.is_dir() || start.ends_in("json"),
    read: |path| if path.is_dir() { read(&path.join("meta.json")) } else { read(path) },
};

const REMEDY: &str = "the scene is damaged: copy or export it again";

#[derive(Deserialize)]
struct Meta {
    version: u32,
    count: u32,
    #[serde(default)]
    antialias: bool,
    /// `antialiased` or `2dgs`; none of 3DGS.
    model: Option<String>,
    means: Means,
    scales: Coded,
    quats: Single,
    sh0: Coded,
    #[serde(rename = "shN")]
    rest: Option<Palette>,
}

#[derive(Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Deserialize)]
struct Single {
    files: [String; 1],
}

#[derive(Deserialize)]
struct Coded {
    codebook: Vec<f32>,
    files: [String; 1],
}

#[derive(Deserialize)]
struct Palette {
    count: u32,
    bands: u32,
    codebook: Vec<f32>,
    files: [String; 2],
}

fn read(path: &Path) -> Result<Scene> {
    let files = Files::open(path)?;
    let meta = Meta::read(&files)?;
    let notes = match meta.model.as_deref() {
        _ if meta.antialias => vec![compensated("`antialias`")],
        Some("antialiased") => vec![compensated("model `antialiased`")],
        None | Some("default") => Vec::new(),
        Some(model) => vec![format!("it is of the model `{}`, and is read as one of 3DGS", model.escape_debug())],
    };
    Ok(Scene { notes, ..gaussians(&files, &meta)?.into() })
}

fn gaussians(files: &Files, meta: &Meta) -> Result<Splats> {
    let path = files.path;
    let n = meta.count as usize;
    let attribute = |name: &str| Pixels::read(files, name, n as u64);
    let mut splats = Splats::new(meta.rest.as_ref().map_or(0, |palette| palette.bands));
    splats.n_static = n;
    let [low, high] = &meta.means.files;
    let (low, high) = (attribute(low)?, attribute(high)?);
    splats.source_row = (0..meta.count).collect();
    splats.position = (0..n).map(|i| meta.means.position(low.at(i), high.at(i))).collect();
    let [name] = &meta.quats.files;
    let quaternions = attribute(name)?;
    splats.rotation = (0..n).map(|i| rotation(path, name, i, quaternions.at(i))).collect::<Result<_>>()?;
    let scales = attribute(&meta.scales.files[0])?;
    splats.scale = (0..n).map(|i| decode(&meta.scales.codebook, scales.at(i))).collect();
    let colors = attribute(&meta.sh0.files[0])?;
    splats.opacity = (0..n).map(|i| logit_of_byte(colors.at(i)[3])).collect();
    let dc = |i: usize| decode(&meta.sh0.codebook, colors.at(i));
    let Some(palette) = &meta.rest else {
        splats.sh = (0..n).map(dc).collect();
        return Ok(splats);
    };
    let entries = palette.read(files)?;
    let labels = attribute(&palette.files[1])?;
    for i in 0..n {
        let [low, high, ..] = labels.at(i);
        let label = u16::from_le_bytes([low, high]);
        if u32::from(label) >= palette.count {
            let place = format!("{}, Gaussian {i}", palette.files[1]);
            let reason = format!("palette entry {label}, there are {}", palette.count);
            return Err(Error::data(path, place, reason, REMEDY));
        }
        // Entries lie side by side, so their pixels follow each other.
        let first = usize::from(label) * palette.coefficients();
        splats.sh.push(dc(i));
        let rest = first..first + palette.coefficients();
        splats.sh.extend(rest.map(|pixel| decode(&palette.codebook, entries.at(pixel))));
    }
    Ok(splats)
}

impl Meta {
    fn read(files: &Files) -> Result<Self> {
        let (path, text) = (files.path, files.meta()?);
        let fault = |place: &str, reason: String| Err(Error::data(path, place, reason, REMEDY));
        let meta: Meta = serde_json::from_slice(&text).map_err(|cause| {
            let reason = format!("is no SOG description: {cause}");
            Error::data(path, "", reason, "give the meta.json or the .sog of a scene, version 2")
        })?;
        if meta.version != 2 {
            return fault("field `version`", format!("is {}, only 2 is supported", meta.version));
        }
        let rest = meta.rest.as_ref().map(|palette| ("shN", &palette.codebook));
        let codebooks = [("scales", &meta.scales.codebook), ("sh0", &meta.sh0.codebook)];
        for (name, codebook) in codebooks.into_iter().chain(rest) {
            if codebook.len() != 256 {
                let reason = format!("has {} entries, a byte addresses 256", codebook.len());
                return fault(&format!("field `{name}.codebook`"), reason);
            }
        }
        match &meta.rest {
            Some(Palette { bands, count, .. }) if !(1..=3).contains(bands) || *count > 1 << 16 => {
                fault("field `shN`", format!("{bands} bands and {count} entries, 1 to 3 and at most 65536 are allowed"))
            }
            _ => Ok(meta),
        }
    }
}

fn decode(codebook: &[f32], [r, g, b, _]: [u8; 4]) -> [f32; 3] {
    [r, g, b].map(|byte| codebook[usize::from(byte)])
}

impl Means {
    /// 16 bits for each axis between the extremes of sign(x) ln(1 + |x|).
    fn position(&self, low: [u8; 4], high: [u8; 4]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let t = f64::from(u16::from_le_bytes([low[axis], high[axis]])) / 65535.0;
            let log = self.mins[axis] + (self.maxs[axis] - self.mins[axis]) * t;
            (log.abs().exp_m1().copysign(log)) as f32
        })
    }
}

impl Palette {
    /// Pixels of an entry.
    fn coefficients(&self) -> usize {
        (self.bands as usize + 1).pow(2) - 1
    }

    fn read(&self, files: &Files) -> Result<Pixels> {
        let width = PALETTE_COLUMNS * self.coefficients();
        let height = (self.count as usize).div_ceil(PALETTE_COLUMNS);
        let pixels = Pixels::read(files, &self.files[0], (width * height) as u64)?;
        if pixels.0.width() as usize != width {
            let reason = format!("is {} pixels wide, {} bands need {width}", pixels.0.width(), self.bands);
            return Err(Error::data(files.path, self.files[0].clone(), reason, REMEDY));
        }
        Ok(pixels)
    }
}

/// Bytes 252 to 255 name the largest entry of (w, x, y, z), the others cover +-1/sqrt(2).
fn rotation(path: &Path, file: &str, i: usize, [a, b, c, tag]: [u8; 4]) -> Result<[f32; 4]> {
    let Some(largest) = tag.checked_sub(252) else {
        let reason = format!("the tag of a quaternion is {tag}, not 252 to 255");
        return Err(Error::data(path, format!("{file}, Gaussian {i}"), reason, REMEDY));
    };
    let entry = |byte: u8| (f64::from(byte) / 127.5 - 1.0) * std::f64::consts::FRAC_1_SQRT_2;
    Ok(complete_quaternion([a, b, c].map(entry), largest.into()).map(|v| v as f32))
}

struct Files<'a> {
    /// `meta.json`, or the archive.
    path: &'a Path,
    archive: Option<Archive>,
}

impl<'a> Files<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let is_archive = first_bytes(path)? == ZIP;
        Ok(Files { path, archive: is_archive.then(|| Archive::open(path, REMEDY)).transpose()? })
    }

    fn meta(&self) -> Result<Vec<u8>> {
        let Some(archive) = &self.archive else { return read_bytes(self.path) };
        let text = archive.read("meta.json", MAX_META_BYTES);
        text.map_err(|reason| Error::data(self.path, "file `meta.json`", reason, "give the .sog of a scene, version 2"))
    }

    /// An image of at most `most` pixels, which in the archive takes no more bytes than undecoded, and its headers.
    fn image(&self, name: &str, most: u64) -> Result<Vec<u8>> {
        if name.is_empty() || name.contains(['/', '\\']) || name.contains("..") {
            return Err(self.fault(name, "is not the plain name of a file beside this one".to_owned()));
        }
        let Some(archive) = &self.archive else { return read_bytes(&self.path.with_file_name(name)) };
        let bytes = archive.read(name, 4 * most + SLACK_PIXELS);
        bytes.map_err(|reason| self.fault(name, reason))
    }

    fn fault(&self, name: &str, reason: String) -> Error {
        Error::data(self.path, format!("image `{}`", name.escape_debug()), reason, REMEDY)
    }
}

struct Pixels(RgbaImage);

impl Pixels {
    fn read(files: &Files, name: &str, n: u64) -> Result<Self> {
        let most = 2 * n + SLACK_PIXELS;
        let bytes = files.image(name, most)?;
        let fault = |reason| files.fault(name, reason);
        if bytes.get(12..16) == Some(b"VP8 ") {
            return Err(fault("is a lossy WebP, which destroys the values".to_owned()));
        }
        let decoder = WebPDecoder::new(Cursor::new(&bytes)).map_err(|cause| fault(format!("is no WebP: {cause}")))?;
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        if pixels < n || pixels > most {
            return Err(fault(format!("has {width} x {height} pixels for {n} values")));
        }
        let image = DynamicImage::from_decoder(decoder).map_err(|cause| fault(format!("does not decode: {cause}")))?;
        Ok(Pixels(image.into_rgba8()))
    }

    fn at(&self, index: usize) -> [u8; 4] {
        std::array::from_fn(|channel| self.0.as_raw()[4 * index + channel])
    }
}
