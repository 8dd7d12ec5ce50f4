//! A rendered view on the host (SPEC 3, outputs), and the files it goes to.

use std::io::{self, Cursor};
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::error::{Error, Result};
use crate::files::{write_atomic, write_tensors};

/// Writes an OpenEXR image of f32 channels, losslessly compressed.
pub(crate) fn write_exr(path: &Path, channels: Vec<(&str, Vec<f32>)>, width: u32, height: u32) -> Result<()> {
    let channels = channels.into_iter().map(|(name, values)| AnyChannel::new(name, FlatSamples::F32(values)));
    let channels = AnyChannels::sort(channels.collect());
    let size = (width as usize, height as usize);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    write_atomic(path, |to| {
        // The encoder seeks back to fill in its offset table, which the destination cannot.
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(io::Error::other)?;
        to.write_all(bytes.get_ref())
    })
}

/// A rendered picture, row-major, top row first. None of the sums is normalised by alpha.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Blended colour with the background, `[H][W][3]`.
    pub color: Vec<[f32; 3]>,
    /// 1 - final transmittance, `[H][W]`.
    pub alpha: Vec<f32>,
    /// Sum of weight times camera depth, scene units, `[H][W]`.
    pub depth: Vec<f32>,
    /// Sum of weight over camera depth, 1 / scene units, `[H][W]`.
    pub inverse_depth: Vec<f32>,
    /// Sum of weight times projected velocity, pixels per `flow_dt`, `[H][W][2]`.
    pub flow: Vec<[f32; 2]>,
}

impl Frame {
    /// Writes `color` as an 8-bit RGB PNG: clamped to [0, 1], rounded to the nearest of 256 levels, NaN as 0.
    ///
    /// # Errors
    /// [`Error::Data`] when the frame is empty, its arrays disagree with its size, or the file cannot be written.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        self.check(path, &[self.color.len()])?;
        let level = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        let bytes: Vec<u8> = self.color.as_flattened().iter().map(|&c| level(c)).collect();
        write_atomic(path, |to| {
            let encoder = PngEncoder::new(to);
            encoder.write_image(&bytes, self.width, self.height, ExtendedColorType::Rgb8).map_err(io::Error::other)
        })
    }

    /// Writes everything as one OpenEXR image of f32 channels: `R`, `G`, `B` (blended with the background, not premultiplied again), `A`,
    /// `depth.Z`, `inverse_depth`, `flow.X` and `flow.Y`.
    /// Fails as [`Frame::write_png`].
    ///
    /// # Errors
    /// As [`Frame::write_png`].
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        self.check_all(path)?;
        let color = |channel: usize| self.color.iter().map(|c| c[channel]).collect();
        let flow = |axis: usize| self.flow.iter().map(|f| f[axis]).collect();
        let channels = vec![
            ("R", color(0)),
            ("G", color(1)),
            ("B", color(2)),
            ("A", self.alpha.clone()),
            ("depth.Z", self.depth.clone()),
            ("inverse_depth", self.inverse_depth.clone()),
            ("flow.X", flow(0)),
            ("flow.Y", flow(1)),
        ];
        write_exr(path, channels, self.width, self.height)
    }

    /// Writes everything as f32 tensors (SPEC 9): `color` [H, W, 3], `alpha`, `depth`, `inverse_depth` [H, W] and
    /// `flow` [H, W, 2].
    /// Fails as [`Frame::write_png`].
    ///
    /// # Errors
    /// As [`Frame::write_png`].
    pub fn write_safetensors(&self, path: &Path) -> Result<()> {
        self.check_all(path)?;
        let (h, w) = (self.height as usize, self.width as usize);
        write_tensors(
            path,
            &[
                ("color", &[h, w, 3], self.color.as_flattened()),
                ("alpha", &[h, w], &self.alpha),
                ("depth", &[h, w], &self.depth),
                ("inverse_depth", &[h, w], &self.inverse_depth),
                ("flow", &[h, w, 2], self.flow.as_flattened()),
            ],
        )
    }

    fn check_all(&self, path: &Path) -> Result<()> {
        let lengths = [self.color.len(), self.alpha.len(), self.depth.len(), self.inverse_depth.len(), self.flow.len()];
        self.check(path, &lengths)
    }

    fn check(&self, path: &Path, lengths: &[usize]) -> Result<()> {
        let n = self.width as usize * self.height as usize;
        if n == 0 || lengths.iter().any(|length| *length != n) {
            let reason = format!("a frame of {} x {} pixels with arrays of {lengths:?}", self.width, self.height);
            return Err(Error::data(path, "", reason, "this is a fault of the program that made the frame"));
        }
        Ok(())
    }
}
