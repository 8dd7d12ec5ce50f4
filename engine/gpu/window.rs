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
    ///
    /// # Errors
    /// [`Error::NoDevice`](crate::Error::NoDevice) where the device cannot show pictures in it.
    pub fn new(gpu: &Gpu, window: Arc<dyn WindowHandle>, is_synced: bool) -> Result<Self> {
        Swapchain::new(&gpu.device, window, is_synced).map(Window)
    }

    /// Makes it ready for a picture while its system's window has `size` pixels, and says how large the picture must be: width,
    /// height. `None` while it has no area, as a minimised one.
    ///
    /// # Errors
    /// [`Error::NoDevice`](crate::Error::NoDevice) where it takes no pictures of 8 bits a channel.
    pub fn fit(&mut self, size: [u32; 2]) -> Result<Option<[u32; 2]>> {
        self.0.fit(size)
    }

    /// True if bytes of pixels are blue, green, red, alpha; else red, green, blue, alpha. Of the picture that [`Window::fit`]
    /// asked for.
    pub fn is_bgra(&self) -> bool {
        self.0.is_bgra()
    }

    /// Shows `pixels`, row by row, of the size that [`Window::fit`] gave; `false` where the window did not take them: it has changed
    /// since, or nobody sees it.
    ///
    /// # Errors
    /// [`Error::DeviceLost`](crate::Error::DeviceLost).
    pub fn present(&mut self, pixels: &Buf<u32>) -> Result<bool> {
        self.0.present(&pixels.slice().binding())
    }
}
