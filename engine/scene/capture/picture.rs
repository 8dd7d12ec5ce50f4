//! Decoded images of a capture.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageDecoder, metadata::Orientation};

use super::{
    BROKEN, DECODER_SLACK, Fault, PriorSource, decoder_of, fault, guarded, half_bits, half_value, is_prior, is_turned,
    read_size,
};
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
    /// Row by row, top first: red in the lowest 8 bits, green, blue; then 255, or 0 where the mask excludes the pixel.
    pub pixels: Vec<u32>,
    /// Depth priors by pixel, as [halves](super::half_bits), not finite where there is none; may be empty.
    pub depth: Vec<u16>,
    /// Flow priors by pixel, columns and rows in pixels, likewise.
    pub flow: Vec<[u16; 2]>,
    /// Pixels that the mask does not exclude.
    pub n_visible: u32,
    /// Of these, pixels that have a depth prior.
    pub n_depth: u32,
    /// Of these, pixels that have a flow prior.
    pub n_flow: u32,
}

fn counts(word: u32) -> bool {
    word >> 24 != 0
}

/// Bytes of a pixel of a [`Picture`].
pub fn pixel_bytes(has_depth: bool, has_flow: bool) -> u64 {
    let with = |has: bool, bytes: usize| if has { bytes } else { 0 };
    (size_of::<u32>() + with(has_depth, size_of::<u16>()) + with(has_flow, size_of::<[u16; 2]>())) as u64
}

impl Picture {
    /// A picture of these `pixels`, without priors.
    pub fn new(width: u32, height: u32, pixels: Vec<u32>) -> Picture {
        let n_visible = pixels.iter().filter(|word| counts(**word)).count() as u32;
        Picture { width, height, pixels, n_visible, ..Picture::default() }
    }

    #[doc(hidden)]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.pixels[..]) + size_of_val(&self.depth[..]) + size_of_val(&self.flow[..])
    }

    #[must_use]
    #[doc(hidden)]
    pub fn with_priors(self, depth: Vec<u16>, flow: Vec<[u16; 2]>) -> Picture {
        let n = |has: &mut dyn Iterator<Item = bool>| {
            self.pixels.iter().zip(has).filter(|(word, has)| counts(**word) && *has).count() as u32
        };
        let n_depth = n(&mut depth.iter().map(|half| is_prior(&[*half])));
        let n_flow = n(&mut flow.iter().map(|halves| is_prior(halves)));
        Picture { depth, flow, n_depth, n_flow, ..self }
    }

    /// The picture in means of those of `factor` x `factor` pixels that count, rounded to 8 bits; priors likewise, flow in the new pixels.
    /// A remainder at the right and the bottom is cut off.
    #[doc(hidden)]
    pub fn reduced(&self, factor: u32) -> Picture {
        let (width, height) = (self.width / factor, self.height / factor);
        let (mut pixels, mut depth, mut flow) = (Vec::new(), Vec::new(), Vec::new());
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let rows = (0..factor).map(|row| {
                let first = (factor * y + row) as usize * self.width as usize + (factor * x) as usize;
                first..first + factor as usize
            });
            let shown = || rows.clone().flatten().filter(|pixel| counts(self.pixels[*pixel]));
            let (mut sums, mut n) = ([0; 3], 0);
            for pixel in shown() {
                let [r, g, b, _] = self.pixels[pixel].to_le_bytes();
                sums = [sums[0] + u32::from(r), sums[1] + u32::from(g), sums[2] + u32::from(b)];
                n += 1;
            }
            let [r, g, b] = if n > 0 { sums.map(|sum| ((2 * sum + n) / (2 * n)) as u8) } else { [0; 3] };
            pixels.push(u32::from_le_bytes([r, g, b, if n > 0 { 255 } else { 0 }]));
            if !self.depth.is_empty() {
                let [mean] = mean(shown().map(|pixel| [self.depth[pixel]]));
                depth.push(half_bits(mean as f32));
            }
            if !self.flow.is_empty() {
                let mean = mean(shown().map(|pixel| self.flow[pixel]));
                flow.push(mean.map(|mean| half_bits((mean / f64::from(factor)) as f32)));
            }
        }
        Picture::new(width, height, pixels).with_priors(depth, flow)
    }
}

/// The mean of the priors that are some; NaN without any.
fn mean<const N: usize>(priors: impl Iterator<Item = [u16; N]>) -> [f64; N] {
    let (mut sums, mut n) = ([0.0; N], 0.0);
    for prior in priors.filter(|prior| is_prior(prior)) {
        sums.iter_mut().zip(prior).for_each(|(sum, half)| *sum += half_value(half));
        n += 1.0;
    }
    sums.map(|sum| sum / n)
}

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

/// Decodes an image with its mask and priors, and reduces them.
pub(super) fn decode(source: &Source) -> Result<Picture, Fault> {
    let mut pixels = pack(pixels_of(&source.image, source.width, source.height)?, source.background);
    if let Some(mask) = &source.mask {
        let mask = pixels_of(mask, source.width, source.height)?.into_luma8();
        for (pixel, weight) in pixels.iter_mut().zip(mask.as_raw()) {
            if *weight == 0 {
                *pixel &= 0x00ff_ffff;
            }
        }
    }
    let (depth, flow) = source.priors.decode(source.width, source.height)?;
    let whole = Picture::new(source.width, source.height, pixels).with_priors(depth, flow);
    Ok(if source.reduction > 1 { whole.reduced(source.reduction) } else { whole })
}

/// True where a mask for the image of `source` is at least 128; of the image itself, where its alpha is.
pub(super) fn bright(path: &Path, source: &Source) -> error::Result<Vec<bool>> {
    let mask = pixels_of(path, source.width, source.height)?;
    let levels = if path == source.image { alpha_of(mask) } else { mask.into_luma8().into_raw() };
    Ok(levels.iter().map(|level| *level >= 128).collect())
}

pub(crate) fn alpha_of(image: DynamicImage) -> Vec<u8> {
    image.into_rgba8().as_raw().as_chunks::<4>().0.iter().map(|pixel| pixel[3]).collect()
}

pub(crate) fn decode_image(path: &Path, width: u32, height: u32) -> error::Result<DynamicImage> {
    Ok(pixels_of(path, width, height)?)
}

fn pixels_of(path: &Path, width: u32, height: u32) -> Result<DynamicImage, Fault> {
    guarded(path, || {
        // Finds a file that is cut off, of which a decoder would make half a picture.
        read_size(path)?;
        // 16 bits for each of four channels is the most that a PNG has.
        let mut decoder = decoder_of(path, 8 * u64::from(width) * u64::from(height) + DECODER_SLACK)?;
        let found = decoder.dimensions();
        let turns = found != (width, height) && found == (height, width) && is_turned(path);
        if found != (width, height) && !turns {
            let reason = format!("is {} x {}, its camera is {width} x {height}", found.0, found.1);
            return Err(fault(path, reason, "give an image of the size of the calibration"));
        }
        let broken = |cause| fault(path, format!("does not decode: {cause}"), BROKEN);
        let turn = if turns { decoder.orientation().map_err(broken)? } else { Orientation::NoTransforms };
        let mut image = DynamicImage::from_decoder(decoder).map_err(broken)?;
        image.apply_orientation(turn);
        Ok(image)
    })
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
