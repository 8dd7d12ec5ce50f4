//! A window that shows buffers of pixels.

use super::kernel::Buf;
use super::run::Gpu;
use crate::error::Result;
use crate::vk::{Swapchain, WindowHandle};
use std::sync::Arc;

/// A window of the system, as pictures see it. Open the device with
/// [`surface_extensions`](crate::vk::surface_extensions) of its display.
pub struct Window(Swapchain);

impl Window {
    /// For pictures of `gpu` in `window`; with `is_synced` they wait for the display.
    pub fn new(gpu: &Gpu, window: Arc<dyn WindowHandle>, is_synced: bool) -> Result<Self> {
        Swapchain::new(&gpu.device, window, is_synced).map(Window)
    }

    /// Fits it to a window of `size` pixels, and gives the size that the picture must have; `None` while it has no area.
    pub fn fit(&mut self, size: [u32; 2]) -> Result<Option<[u32; 2]>> {
        self.0.fit(size)
    }

    /// True if pixels are blue, green, red, alpha; else red, green, blue, alpha.
    pub fn is_bgra(&self) -> bool {
        self.0.is_bgra()
    }

    /// Shows `pixels` row by row; `false` where the window did not take them.
    pub fn present(&mut self, pixels: &Buf<u32>) -> Result<bool> {
        self.0.present(&pixels.slice().binding())
    }
}
