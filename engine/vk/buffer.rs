//! Buffers: memory with a name and a size.

use super::debug::name_object;
use super::device::Device;
use super::vk_error;
use crate::error::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use std::sync::Arc;
use std::sync::atomic::Ordering;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// Device memory; the host does not see it.
    Device,
    /// Host memory for data on its way to the device.
    Upload,
    /// Host memory for data on its way back.
    Readback,
}

pub struct Buffer {
    device: Arc<Device>,
    pub(super) raw: vk::Buffer,
    allocation: Option<Allocation>,
    size: u64,
    name: String,
}

impl Buffer {
    /// Allocates `size` bytes (at least 16), with undefined contents.
    pub fn new(device: &Arc<Device>, name: &str, size: u64, location: Location) -> Result<Self> {
        let size = size.max(16).next_multiple_of(16);
        let limit = device.caps().max_allocation_bytes;
        let too_large = |limit: u64| Error::OutOfMemory {
            what: format!("buffer `{name}` (bytes)"),
            needed: size,
            limit,
            remedy: "choose a device with more memory or a smaller scene or picture".to_owned(),
        };
        if size > limit {
            return Err(too_large(limit));
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::UNIFORM_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        );
        // SAFETY: the buffer is destroyed in `drop`, or below when its memory cannot be had.
        let raw = unsafe { device.raw.create_buffer(&info, None) }.map_err(vk_error("vkCreateBuffer"))?;
        // SAFETY: `raw` was just created.
        let requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        let mut buffer = Buffer { device: device.clone(), raw, allocation: None, size, name: name.to_owned() };
        let allocation = device
            .allocator
            .lock()
            .map_err(|_| too_large(limit))?
            .as_mut()
            .ok_or_else(|| too_large(limit))?
            .allocate(&AllocationCreateDesc {
                name,
                requirements,
                location: match location {
                    Location::Device => MemoryLocation::GpuOnly,
                    Location::Upload => MemoryLocation::CpuToGpu,
                    Location::Readback => MemoryLocation::GpuToCpu,
                },
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|_| too_large(device.caps().heap_bytes))?;
        // SAFETY: the memory is not bound to anything else at this offset.
        unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
            .map_err(vk_error("vkBindBufferMemory"))?;
        buffer.allocation = Some(allocation);
        name_object(device.debug.as_ref(), raw, name);
        buffer.account(true);
        device.n_buffers_made.fetch_add(1, Ordering::Relaxed);
        Ok(buffer)
    }

    fn account(&self, add: bool) {
        let Ok(mut memory) = self.device.memory.lock() else { return };
        let (live, peak) = &mut *memory;
        let entry = live.entry(self.name.clone()).or_default();
        *entry = if add { *entry + self.size } else { entry.saturating_sub(self.size) };
        if *entry == 0 {
            live.remove(&self.name);
        }
        *peak = (*peak).max(live.values().sum());
    }

    pub fn size(&self) -> u64 {
        self.size
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The bytes of a host-visible buffer. The caller has waited for the submissions that write them.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.allocation.as_ref()?.mapped_slice()?.get(..self.size as usize)
    }

    /// The bytes of a host-visible buffer, to be written before the submission that reads them.
    pub(crate) fn bytes_mut(&mut self) -> Option<&mut [u8]> {
        let size = self.size as usize;
        self.allocation.as_mut()?.mapped_slice_mut()?.get_mut(..size)
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(allocation) = self.allocation.take() {
            self.account(false);
            if let Ok(mut allocator) = self.device.allocator.lock()
                && let Some(allocator) = allocator.as_mut()
                && let Err(e) = allocator.free(allocation)
            {
                tracing::error!("memory of `{}` could not be freed: {e}", self.name);
            }
        }
        // SAFETY: submissions keep the buffers they use alive until the device is done with them.
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
    }
}
