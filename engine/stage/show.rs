//! From the images of a strip to the pixels of a window.

use crate::error::Result;
use crate::gpu::generated::show;
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::scene::Frame;

/// The output of a picture that is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Layer {
    /// As `Frame::write_png` writes it.
    #[default]
    Color,
    Alpha,
    /// Inverse depth, from dark at 0 to bright at `high` and above, 1 / scene units.
    Depth {
        high: f32,
    },
    /// Flow: its direction as hue, its length as saturation, full at `high` pixels.
    Flow {
        high: f32,
    },
}

impl Layer {
    fn code(self) -> (u32, f32) {
        match self {
            Layer::Color => (0, 1.0),
            Layer::Alpha => (1, 1.0),
            Layer::Depth { high } => (2, high),
            Layer::Flow { high } => (3, high),
        }
    }
}

/// The pixels of a window on the device, with an overlay over its last rows.
pub struct Screen {
    pub width: u32,
    pub height: u32,
    /// Row by row, bytes red, green, blue and 255, or blue, green, red and 255.
    pub pixels: Buf<u32>,
    pub is_bgra: bool,
    overlay: Buf<u32>,
    top: u32,
}

impl Screen {
    /// With `is_bgra` pixels begin with blue.
    pub fn new(gpu: &Gpu, width: u32, height: u32, is_bgra: bool) -> Result<Self> {
        let n = width as usize * height as usize;
        let pixels = gpu.alloc("screen", n)?;
        Ok(Screen { width, height, pixels, is_bgra, overlay: gpu.alloc("overlay", 1)?, top: n as u32 })
    }

    /// Lays `words` over the last rows from now on: whole rows, bytes red, green, blue, alpha.
    pub fn lay(&mut self, gpu: &Gpu, words: &[u32]) -> Result<()> {
        assert!(words.len() <= self.pixels.len(), "an overlay of {} pixels over a smaller screen", words.len());
        if self.overlay.len() < words.len() {
            self.overlay = gpu.alloc("overlay", words.len())?;
        }
        self.top = (self.pixels.len() - words.len()) as u32;
        gpu.write(&self.overlay, words)
    }

    pub fn read(&self, gpu: &Gpu) -> Result<Frame> {
        let color = gpu.read(&self.pixels)?.into_iter().map(|word| {
            let [r, g, b, _] = word.to_le_bytes().map(|level| f32::from(level) / 255.0);
            if self.is_bgra { [b, g, r] } else { [r, g, b] }
        });
        Ok(Frame { width: self.width, height: self.height, color: color.collect(), ..Frame::default() })
    }

    /// Appends the `n` pixels from `first` on, of a strip's images.
    pub fn record(
        &self,
        rec: &mut Recording,
        image0: &Buf<[f32; 4]>,
        image1: Option<&Buf<[f32; 4]>>,
        layer: Layer,
        [first, n]: [u32; 2],
    ) {
        assert!((first + n) as usize <= self.pixels.len(), "{first}+{n} of {} pixels", self.pixels.len());
        rec.section("screen");
        let (layer, high) = layer.code();
        let (overlay, pixels, is_bgra) = (&self.overlay, &self.pixels, u32::from(self.is_bgra));
        rec.pass(
            show::Args { image0, image1: image1.unwrap_or(image0), overlay, pixels },
            show::Push { first, n, top: self.top, layer, is_bgra, high },
            Grid::Threads(n),
        );
    }
}
