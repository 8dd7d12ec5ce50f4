//! Decoded images of a capture, as the device takes them.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageDecoder};

use super::decoder::{DECODER_SLACK, decoder_of, guarded};
use super::header::{BROKEN, fault, read_size};
use super::priors::{PriorSource, Priors, prior_of, prior_word};
use super::report::Fault;
use crate::error;

/// Most pixels of an image: 1 GiB when decoded.
pub(super) const MAX_PIXELS: u64 = 1 << 28;

/// A decoded image with its mask, as the device takes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Row by row, top first: red in the lowest 8 bits, then green and blue; the highest 8 bits are 255 where the pixel
    /// counts and 0 where the mask excludes it.
    pub pixels: Vec<u32>,
    /// Priors of depth and flow, by pixel, see [`prior_word`](super::prior_word); empty where there are none.
    pub priors: Vec<[u32; 2]>,
    /// Pixels that count and have a prior of depth.
    pub n_depth: u32,
    /// Pixels that count and have a prior of flow.
    pub n_flow: u32,
}

impl Picture {
    /// The picture in pixels that are the means of `factor` x `factor` of its own, of those that count, rounded to 8 bits; a
    /// pixel counts when one of them does. Priors are means likewise, the flow's in its own pixels. What does not fill a pixel
    /// at the right and at the bottom is cut off.
    pub fn reduced(&self, factor: u32) -> Picture {
        let (width, height) = (self.width / factor, self.height / factor);
        let mut out = Picture { width, height, ..Picture::default() };
        let n_pixels = width as usize * height as usize;
        out.pixels.reserve_exact(n_pixels);
        out.priors.reserve_exact(if self.priors.is_empty() { 0 } else { n_pixels });
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let rows = (0..factor).map(|row| {
                let first = (factor * y + row) as usize * self.width as usize + (factor * x) as usize;
                first..first + factor as usize
            });
            let (mut sums, mut n) = ([0; 3], 0);
            for word in rows.clone().flat_map(|row| &self.pixels[row]).filter(|word| **word >> 24 != 0) {
                let [r, g, b, _] = word.to_le_bytes();
                sums = [sums[0] + u32::from(r), sums[1] + u32::from(g), sums[2] + u32::from(b)];
                n += 1;
            }
            let [r, g, b] = if n > 0 { sums.map(|sum| ((2 * sum + n) / (2 * n)) as u8) } else { [0; 3] };
            out.pixels.push(u32::from_le_bytes([r, g, b, if n > 0 { 255 } else { 0 }]));
            if !self.priors.is_empty() {
                let counts = |pixel: &usize| self.pixels[*pixel] >> 24 != 0;
                out.add_prior(rows.flatten().filter(counts).map(|pixel| self.priors[pixel]), factor);
            }
        }
        out
    }

    /// Appends the mean of the priors of the pixels that become one.
    fn add_prior(&mut self, words: impl Iterator<Item = [u32; 2]>, factor: u32) {
        let (mut depth, mut flow) = (Mean::default(), [Mean::default(); 2]);
        for word in words {
            let (own_depth, own_flow) = prior_of(word);
            own_depth.into_iter().for_each(|value| depth.add(value.into()));
            if let Some(own) = own_flow {
                flow.iter_mut().zip(own).for_each(|(mean, value)| mean.add(value / f64::from(factor)));
            }
        }
        self.n_depth += u32::from(depth.value().is_finite());
        self.n_flow += u32::from(flow[0].value().is_finite());
        self.priors.push(prior_word(depth.value() as f32, flow.map(|mean| mean.value() as f32)));
    }
}

/// The mean of some values; not a number without any.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    n: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.n += 1.0;
    }

    fn value(self) -> f64 {
        self.sum / self.n
    }
}

/// What is needed to decode one image; the threads of a cache share it.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub image: PathBuf,
    pub mask: Option<PathBuf>,
    pub width: u32,
    pub height: u32,
    pub background: [f32; 3],
    pub priors: PriorSource,
    /// Pixels along each side that become one; at least 1, at most the shorter side.
    pub reduction: u32,
}

/// Decodes an image and its mask, and reduces them.
///
/// # Errors
/// `Error::Data` naming the image or the mask.
pub(super) fn decode(source: &Source) -> error::Result<Picture> {
    Ok(decode_or_fault(source)?)
}

/// As [`decode`], with an error that can be told more than once.
pub(super) fn decode_or_fault(source: &Source) -> Result<Picture, Fault> {
    let image = guarded(&source.image, || pixels_of(&source.image, source))?;
    let mut pixels = pack(image, source.background);
    if let Some(mask) = &source.mask {
        let mask = guarded(mask, || pixels_of(mask, source))?.into_luma8();
        for (pixel, weight) in pixels.iter_mut().zip(mask.as_raw()) {
            if *weight == 0 {
                *pixel &= 0x00ff_ffff;
            }
        }
    }
    let (width, height) = (source.width, source.height);
    let whole = if source.priors.is_empty() {
        Picture { width, height, pixels, ..Picture::default() }
    } else {
        let Priors { words, n_depth, n_flow } = source.priors.decode(width, height, &pixels)?;
        Picture { width, height, pixels, priors: words, n_depth, n_flow }
    };
    Ok(if source.reduction > 1 { whole.reduced(source.reduction) } else { whole })
}

/// Whether each pixel of a mask for the image of `source` is at least 128; of the image itself, whether its alpha is.
///
/// # Errors
/// `Error::Data` naming the mask.
pub(super) fn bright(path: &Path, source: &Source) -> error::Result<Vec<bool>> {
    let mask = guarded(path, || pixels_of(path, source))?;
    if path == source.image {
        return Ok(alpha_of(mask).iter().map(|level| *level >= 128).collect());
    }
    Ok(mask.into_luma8().as_raw().iter().map(|level| *level >= 128).collect())
}

/// The alpha channel of an image, row by row.
pub(crate) fn alpha_of(image: DynamicImage) -> Vec<u8> {
    image.into_rgba8().as_raw().as_chunks::<4>().0.iter().map(|pixel| pixel[3]).collect()
}

/// Decodes an image or a mask of a known size.
///
/// # Errors
/// `Error::Data` naming the image.
pub(crate) fn decode_image(path: &Path, width: u32, height: u32) -> error::Result<DynamicImage> {
    let (image, priors) = (path.to_owned(), PriorSource::default());
    let source = Source { image, mask: None, width, height, background: [0.0; 3], priors, reduction: 1 };
    Ok(guarded(path, || pixels_of(path, &source))?)
}

fn pixels_of(path: &Path, source: &Source) -> Result<DynamicImage, Fault> {
    let pixels = u64::from(source.width) * u64::from(source.height);
    // Tells a file that is cut off, of which a decoder would make half a picture.
    read_size(path)?;
    // 16 bits for each of four channels is the most that a PNG has.
    let decoder = decoder_of(path, 8 * pixels + DECODER_SLACK)?;
    let (width, height) = decoder.dimensions();
    if (width, height) != (source.width, source.height) {
        let reason = format!("is {width} x {height}, its camera is {} x {}", source.width, source.height);
        return Err(fault(path, reason, "give an image of the size of the calibration"));
    }
    DynamicImage::from_decoder(decoder).map_err(|cause| fault(path, format!("does not decode: {cause}"), BROKEN))
}

/// Opaque pixels as they are; others over the background, in the stored values (SPEC 1: no gamma), rounded.
fn pack(image: DynamicImage, background: [f32; 3]) -> Vec<u32> {
    let opaque = |[r, g, b]: [u8; 3]| u32::from_le_bytes([r, g, b, 255]);
    if !image.color().has_alpha() {
        let rgb = image.into_rgb8();
        return rgb.as_raw().as_chunks().0.iter().map(|&pixel| opaque(pixel)).collect();
    }
    let behind = background.map(|c| f64::from(c) * 255.0);
    let over = |&[r, g, b, a]: &[u8; 4]| {
        if a == 255 {
            return opaque([r, g, b]);
        }
        let alpha = f64::from(a) / 255.0;
        let mix = |c: u8, behind: f64| (f64::from(c) * alpha + behind * (1.0 - alpha)).round() as u8;
        opaque([mix(r, behind[0]), mix(g, behind[1]), mix(b, behind[2])])
    };
    image.into_rgba8().as_raw().as_chunks().0.iter().map(over).collect()
}
