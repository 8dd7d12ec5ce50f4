//! Truth, rendering and error map as inline PNG.

use crate::error::{Error, Result};
use crate::parallel::{in_parallel, threads};
use crate::scene::Frame;
use crate::scene::capture::Picture;
use crate::train::Scores;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::{ExtendedColorType, ImageEncoder, ImageError, codecs::png::PngEncoder};
use std::path::Path;

/// Larger pictures are averaged over squares.
const MAX_WIDTH: u32 = 480;
/// The ramp spans errors from 0 to 1 / GAIN.
pub(super) const GAIN: f32 = 4.0;
pub(super) const RAMP: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [66.0, 10.0, 104.0], [188.0, 55.0, 84.0], [249.0, 142.0, 9.0], [252.0, 255.0, 164.0]];
/// Hidden by the mask.
const HIDDEN: [f32; 3] = [128.0; 3];

#[derive(Clone, Debug)]
pub struct Example {
    pub view: String,
    /// Worst, median, best, or empty.
    pub why: &'static str,
    pub scores: Scores,
    pub truth: Picture,
    pub render: Frame,
}

fn heat(error: f32) -> [f32; 3] {
    // NaN becomes the brightest.
    let at = if error * GAIN < 1.0 { error * GAIN } else { 1.0 } * (RAMP.len() - 1) as f32;
    let low = (at as usize).min(RAMP.len() - 2);
    let t = at - low as f32;
    std::array::from_fn(|c| RAMP[low][c] * (1.0 - t) + RAMP[low + 1][c] * t)
}

pub(super) fn triples(examples: &[Example]) -> Result<Vec<[String; 3]>> {
    let of_example = |i: usize| {
        let Example { view, truth, render, .. } = &examples[i];
        triple(truth, render)
            .map_err(|e| Error::data(Path::new("report"), view, format!("cannot be encoded: {e}"), "report this"))
    };
    in_parallel(examples.len(), threads(), of_example, |_| ())
}

fn triple(truth: &Picture, render: &Frame) -> std::result::Result<[String; 3], ImageError> {
    let size = [truth.width, truth.height];
    let shown: Vec<[f32; 3]> = render.color.iter().map(|c| c.map(|x| 255.0 * x.clamp(0.0, 1.0))).collect();
    let real: Vec<[f32; 3]> = truth.pixels.iter().map(|word| levels(*word)).collect();
    let error = |((a, b), word): ((&[f32; 3], &[f32; 3]), &u32)| {
        let mean = (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f32>() / (3.0 * 255.0);
        if word >> 24 == 0 { HIDDEN } else { heat(mean) }
    };
    let errors: Vec<[f32; 3]> = shown.iter().zip(&real).zip(&truth.pixels).map(error).collect();
    Ok([url(&real, size)?, url(&shown, size)?, url(&errors, size)?])
}

fn url(pixels: &[[f32; 3]], size: [u32; 2]) -> std::result::Result<String, ImageError> {
    let (pixels, [w, h]) = reduced(pixels, size);
    let bytes: Vec<u8> = pixels.iter().flatten().map(|c| c.round() as u8).collect();
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(&bytes, w, h, ExtendedColorType::Rgb8)?;
    Ok(format!("data:image/png;base64,{}", BASE64.encode(&png)))
}

fn reduced(pixels: &[[f32; 3]], [width, height]: [u32; 2]) -> (Vec<[f32; 3]>, [u32; 2]) {
    let side = width.div_ceil(MAX_WIDTH).max(1);
    let (w, h) = (width.div_ceil(side), height.div_ceil(side));
    let mean = |(y, x): (u32, u32)| {
        let rows = y * side..height.min((y + 1) * side);
        let columns = x * side..width.min((x + 1) * side);
        let n = (rows.len() * columns.len()) as f32;
        let square = rows.flat_map(|row| columns.clone().map(move |column| (row * width + column) as usize));
        square.fold([0.0; 3], |sum: [f32; 3], at| std::array::from_fn(|c| sum[c] + pixels[at][c])).map(|c| c / n)
    };
    ((0..h).flat_map(|y| (0..w).map(move |x| (y, x))).map(mean).collect(), [w, h])
}

/// Side by side, truth above rendering.
pub fn strip(examples: &[Example]) -> Frame {
    let mut pairs = Vec::new();
    for Example { truth, render, .. } in examples {
        let size = [truth.width, truth.height];
        let real: Vec<[f32; 3]> = truth.pixels.iter().map(|word| levels(*word).map(|c| c / 255.0)).collect();
        let shown: Vec<[f32; 3]> = render.color.iter().map(|c| c.map(|x| x.clamp(0.0, 1.0))).collect();
        let (real, size) = reduced(&real, size);
        pairs.push((real, reduced(&shown, [truth.width, truth.height]).0, size));
    }
    let width = pairs.iter().map(|(.., [w, _])| w).sum::<u32>();
    let height = pairs.iter().map(|(.., [_, h])| *h).max().unwrap_or(0);
    let mut color = vec![[0.0; 3]; 2 * (width * height) as usize];
    let mut left = 0;
    for (real, shown, [w, h]) in &pairs {
        for (top, pixels) in [(0, real), (height, shown)] {
            for y in 0..*h {
                let (to, from) = (((top + y) * width + left) as usize, (y * w) as usize);
                color[to..to + *w as usize].copy_from_slice(&pixels[from..from + *w as usize]);
            }
        }
        left += w;
    }
    Frame { width, height: 2 * height, color, ..Frame::default() }
}

fn levels(word: u32) -> [f32; 3] {
    let [r, g, b, _] = word.to_le_bytes();
    [r, g, b].map(f32::from)
}
