//! Pictures into a window: a surface, and a swapchain that is made anew whenever the window asks for it.

use super::command::{Binding, Commands};
use super::device::Device;
use super::vk_error;
use crate::error::{Error, Result};
use ash::{khr, vk};
use raw_window_handle::{HandleError, HasDisplayHandle, HasWindowHandle};
use std::ffi::CStr;
use std::sync::Arc;

/// The longest that a picture waits for a place, nanoseconds. A window that nobody sees may give none.
const PATIENCE_NS: u64 = 200_000_000;

pub trait WindowHandle: HasDisplayHandle + HasWindowHandle {}
impl<T: HasDisplayHandle + HasWindowHandle> WindowHandle for T {}

/// The instance extensions that surfaces of windows on `display` need; for [`DeviceChoice::surface`](super::DeviceChoice).
pub fn surface_extensions(display: &dyn HasDisplayHandle) -> Result<Vec<&'static CStr>> {
    let handle = display.display_handle().map_err(no_handle)?;
    let names = ash_window::enumerate_required_extensions(handle.as_raw())
        .map_err(|fault| no_window(format!("Vulkan has no surfaces for this display ({fault:?})")))?;
    // SAFETY: ash-window gives names of extensions, which are static and end with 0.
    Ok(names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect())
}

fn no_window(reason: String) -> Error {
    Error::no_device(reason, "choose another with --device, or use `ivv serve`")
}

fn no_handle(fault: HandleError) -> Error {
    no_window(format!("the window has no handle: {fault}"))
}

pub struct Swapchain {
    device: Arc<Device>,
    surfaces: khr::surface::Instance,
    chains: khr::swapchain::Device,
    surface: vk::SurfaceKHR,
    chain: Option<Chain>,
    acquired: vk::Fence,
    is_synced: bool,
    // Last: the surface must be gone before its window.
    window: Arc<dyn WindowHandle>,
}

/// For one size of the window.
struct Chain {
    raw: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    /// By image: that the copy to it is done.
    copied: Vec<vk::Semaphore>,
    format: vk::Format,
    extent: vk::Extent2D,
    asked: [u32; 2],
}

impl Swapchain {
    /// With `is_synced` pictures wait for the display.
    pub fn new(device: &Arc<Device>, window: Arc<dyn WindowHandle>, is_synced: bool) -> Result<Self> {
        let surfaces = khr::surface::Instance::new(&device.instance.entry, &device.instance.raw);
        let chains = khr::swapchain::Device::new(&device.instance.raw, &device.raw);
        // SAFETY: plain creation; destroyed in `drop`.
        let acquired = unsafe { device.raw.create_fence(&vk::FenceCreateInfo::default(), None) };
        let acquired = acquired.map_err(vk_error("vkCreateFence"))?;
        let device = device.clone();
        let surface = vk::SurfaceKHR::null();
        let mut swapchain = Swapchain { device, surfaces, chains, surface, chain: None, acquired, is_synced, window };
        swapchain.connect()?;
        Ok(swapchain)
    }

    /// Makes the surface of the window, which has none yet.
    fn connect(&mut self) -> Result<()> {
        let Device { instance, physical, queue_family, .. } = &*self.device;
        let display = self.window.display_handle().map_err(no_handle)?.as_raw();
        let window = self.window.window_handle().map_err(no_handle)?.as_raw();
        // SAFETY: both handles are of the window that this struct holds, and the surface is destroyed before it.
        unsafe {
            self.surface = ash_window::create_surface(&instance.entry, &instance.raw, display, window, None)
                .map_err(|fault| no_window(format!("the window takes no surface ({fault:?})")))?;
            let shows = self.surfaces.get_physical_device_surface_support(*physical, *queue_family, self.surface);
            if !shows.map_err(vk_error("vkGetPhysicalDeviceSurfaceSupportKHR"))? {
                return Err(no_window(format!("{} cannot show pictures in this window", self.device.caps().name)));
            }
        }
        Ok(())
    }

    /// Fits a window of `size` pixels, and gives the size that pictures must have; `None` while it has no area, as when minimised.
    pub fn fit(&mut self, size: [u32; 2]) -> Result<Option<[u32; 2]>> {
        let is_fit = |chain: &Chain| chain.asked == size;
        if !self.chain.as_ref().is_some_and(is_fit) {
            self.retire();
            if self.surface == vk::SurfaceKHR::null() {
                self.connect()?;
            }
            self.chain = match self.chain_of(size) {
                Ok(chain) => chain,
                Err(vk::Result::ERROR_SURFACE_LOST_KHR) => {
                    self.disconnect();
                    None
                }
                // The window changed while the swapchain was made: again with the next picture.
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR | vk::Result::ERROR_NATIVE_WINDOW_IN_USE_KHR) => None,
                Err(vk::Result::ERROR_FORMAT_NOT_SUPPORTED) => {
                    return Err(no_window("the window takes no pictures of 8 bits a channel".to_owned()));
                }
                Err(fault) => return Err(vk_error("vkCreateSwapchainKHR")(fault)),
            };
        }
        Ok(self.chain.as_ref().map(|chain| [chain.extent.width, chain.extent.height]))
    }

    /// True if pixels are blue, green, red, alpha; else red, green, blue, alpha.
    pub fn is_bgra(&self) -> bool {
        self.chain.as_ref().is_some_and(|chain| is_bgra(chain.format))
    }

    fn chain_of(&self, asked: [u32; 2]) -> std::result::Result<Option<Chain>, vk::Result> {
        let (physical, surface) = (self.device.physical, self.surface);
        // SAFETY: plain queries of a live surface.
        let (caps, formats, modes) = unsafe {
            (
                self.surfaces.get_physical_device_surface_capabilities(physical, surface)?,
                self.surfaces.get_physical_device_surface_formats(physical, surface)?,
                self.surfaces.get_physical_device_surface_present_modes(physical, surface)?,
            )
        };
        let extent = match caps.current_extent {
            // The surface is as large as its pictures.
            vk::Extent2D { width: u32::MAX, .. } => vk::Extent2D {
                width: asked[0].min(caps.max_image_extent.width),
                height: asked[1].min(caps.max_image_extent.height),
            },
            extent => extent,
        };
        if extent.width == 0 || extent.height == 0 || asked.contains(&0) {
            return Ok(None);
        }
        // Copies carry bytes as they are, so it does not matter whether the format says that they are sRGB.
        let is_usable = |f: &&vk::SurfaceFormatKHR| {
            f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR && (is_bgra(f.format) || is_rgba(f.format))
        };
        let format = formats.iter().find(is_usable).ok_or(vk::Result::ERROR_FORMAT_NOT_SUPPORTED)?;
        if !caps.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST) {
            return Err(vk::Result::ERROR_FORMAT_NOT_SUPPORTED);
        }
        let unsynced = [vk::PresentModeKHR::MAILBOX, vk::PresentModeKHR::IMMEDIATE];
        let free = unsynced.into_iter().find(|mode| !self.is_synced && modes.contains(mode));
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let is_opaque = caps.supported_composite_alpha.contains(opaque);
        let most = if caps.max_image_count == 0 { u32::MAX } else { caps.max_image_count };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface)
            .min_image_count((caps.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .pre_transform(caps.current_transform)
            .composite_alpha(if is_opaque { opaque } else { vk::CompositeAlphaFlagsKHR::INHERIT })
            .present_mode(free.unwrap_or(vk::PresentModeKHR::FIFO))
            .clipped(true);
        // SAFETY: the surface is live and has no other swapchain; what is made is destroyed in `retire`.
        unsafe {
            let raw = self.chains.create_swapchain(&info, None)?;
            let mut chain = Chain { raw, images: Vec::new(), copied: Vec::new(), format: format.format, extent, asked };
            match self.fill(&mut chain) {
                Ok(()) => Ok(Some(chain)),
                Err(fault) => {
                    self.destroy(chain);
                    Err(fault)
                }
            }
        }
    }

    fn fill(&self, chain: &mut Chain) -> std::result::Result<(), vk::Result> {
        // SAFETY: plain queries and creation on a live swapchain.
        unsafe {
            chain.images = self.chains.get_swapchain_images(chain.raw)?;
            for _ in &chain.images {
                let semaphore = self.device.raw.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?;
                chain.copied.push(semaphore);
            }
        }
        Ok(())
    }

    /// Shows `pixels`, row by row in the size that [`Swapchain::fit`] gave last; `false` where the window did not take them: it has
    /// changed, or nobody sees it.
    pub fn present(&mut self, pixels: &Binding) -> Result<bool> {
        let Some(chain) = &self.chain else { return Ok(false) };
        let device = self.device.clone();
        // SAFETY: the fence is not in use: each present waits for it and resets it.
        let acquired =
            unsafe { self.chains.acquire_next_image(chain.raw, PATIENCE_NS, vk::Semaphore::null(), self.acquired) };
        let (index, is_stale) = match acquired {
            Ok((index, is_suboptimal)) => (index as usize, is_suboptimal),
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(false),
            Err(fault) => return self.recover("vkAcquireNextImageKHR", fault),
        };
        // SAFETY: the fence was given to the acquisition above, which signals it.
        unsafe {
            let fences = [self.acquired];
            device.raw.wait_for_fences(&fences, true, u64::MAX).map_err(vk_error("vkWaitForFences"))?;
            device.raw.reset_fences(&fences).map_err(vk_error("vkResetFences"))?;
        }
        let copied = chain.copied[index];
        let mut commands = Commands::new(&device, 1, 0, false)?;
        commands.barrier();
        commands.begin_pass("present");
        commands.copy_to_image(pixels, chain.images[index], chain.extent);
        commands.end_pass();
        commands.signal = Some(copied);
        let copy = commands.submit()?;
        let (chains, indices, semaphores) = ([chain.raw], [index as u32], [copied]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&semaphores).swapchains(&chains).image_indices(&indices);
        let shown = {
            let queue = device.queue.lock().map_err(|_| Error::DeviceLost { after_pass: "present".to_owned() })?;
            // SAFETY: the image was acquired, the copy to it signals the semaphore, and the queue is locked.
            unsafe { self.chains.queue_present(*queue, &info) }
        };
        copy.wait()?;
        match shown {
            Ok(is_suboptimal) => {
                if is_stale || is_suboptimal {
                    self.retire();
                }
                Ok(true)
            }
            Err(fault) => self.recover("vkQueuePresentKHR", fault),
        }
    }

    /// Prepares for making anew what was lost by a `fault` of the window; any other is an error.
    fn recover(&mut self, call: &'static str, fault: vk::Result) -> Result<bool> {
        match fault {
            vk::Result::ERROR_OUT_OF_DATE_KHR => self.retire(),
            vk::Result::ERROR_SURFACE_LOST_KHR => self.disconnect(),
            fault => return Err(vk_error(call)(fault)),
        }
        Ok(false)
    }

    fn disconnect(&mut self) {
        self.retire();
        // SAFETY: its swapchain is gone.
        unsafe { self.surfaces.destroy_surface(self.surface, None) };
        self.surface = vk::SurfaceKHR::null();
    }

    fn retire(&mut self) {
        if let Some(chain) = self.chain.take() {
            if let Ok(queue) = self.device.queue.lock() {
                // SAFETY: the queue is locked. Presentations have then taken their semaphores. A lost device does nothing more.
                let _ = unsafe { self.device.raw.queue_wait_idle(*queue) };
            }
            self.destroy(chain);
        }
    }

    fn destroy(&self, chain: Chain) {
        // SAFETY: nothing on the queue uses them any more, or ever did.
        unsafe {
            for semaphore in chain.copied {
                self.device.raw.destroy_semaphore(semaphore, None);
            }
            self.chains.destroy_swapchain(chain.raw, None);
        }
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        self.disconnect();
        // SAFETY: no acquisition is under way.
        unsafe { self.device.raw.destroy_fence(self.acquired, None) };
    }
}

impl Commands {
    /// Copies words, row by row, over all of an image that is to be shown then.
    fn copy_to_image(&mut self, from: &Binding, image: vk::Image, extent: vk::Extent2D) {
        debug_assert!(from.size >= 4 * u64::from(extent.width) * u64::from(extent.height));
        let all =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = [vk::BufferImageCopy::default()
            .buffer_offset(from.offset)
            .image_subresource(layers)
            .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })];
        let change = vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(all);
        let (empty, copied) = (vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let before = [change.old_layout(empty).new_layout(copied).dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)];
        let after = [change
            .old_layout(copied)
            .new_layout(vk::ImageLayout::PRESENT_SRC_KHR)
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)];
        let [top, transfer, bottom] = [
            vk::PipelineStageFlags::TOP_OF_PIPE,
            vk::PipelineStageFlags::TRANSFER,
            vk::PipelineStageFlags::BOTTOM_OF_PIPE,
        ];
        let none = vk::DependencyFlags::empty();
        self.buffers.push(from.buffer.clone());
        let device = &self.device.raw;
        // SAFETY: recording; the image was acquired, and the words are kept alive until the copy has ended.
        unsafe {
            device.cmd_pipeline_barrier(self.raw, top, transfer, none, &[], &[], &before);
            device.cmd_copy_buffer_to_image(self.raw, from.buffer.raw, image, copied, &region);
            device.cmd_pipeline_barrier(self.raw, transfer, bottom, none, &[], &[], &after);
        }
    }
}

fn is_bgra(format: vk::Format) -> bool {
    [vk::Format::B8G8R8A8_UNORM, vk::Format::B8G8R8A8_SRGB].contains(&format)
}

fn is_rgba(format: vk::Format) -> bool {
    [vk::Format::R8G8B8A8_UNORM, vk::Format::R8G8B8A8_SRGB].contains(&format)
}
