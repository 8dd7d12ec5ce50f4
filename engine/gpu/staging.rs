//! Memory of the host on the way to the device and back, used again and again.

use super::kernel::{Pod, Slice};
use super::run::{Gpu, unmapped};
use crate::error::Result;
use crate::vk::{Buffer, Device, Location};
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers that the host sees, by name. A lent one comes back once neither a recording nor its submission holds it, so steps that
/// follow each other make none.
pub struct Staging {
    device: Arc<Device>,
    kept: Mutex<Vec<(Location, Arc<Buffer>)>>,
}

impl Staging {
    pub fn new(gpu: &Gpu) -> Self {
        Staging { device: gpu.device.clone(), kept: Mutex::default() }
    }

    /// As [`Gpu::staged`]: `words` words with `parts` from these words on; what lies between keeps its value.
    pub fn staged_words(&self, name: &str, words: usize, parts: &[(usize, &[u8])]) -> Result<Slice> {
        let size = 4 * words as u64;
        let mut buffer = self.take(name, Location::Upload, size)?;
        let mapped = Arc::get_mut(&mut buffer).and_then(Buffer::bytes_mut).ok_or_else(|| unmapped(name))?;
        for (first, bytes) in parts {
            mapped[4 * first..][..bytes.len()].copy_from_slice(bytes);
        }
        Ok(self.lend(Location::Upload, buffer, size))
    }

    /// As [`Gpu::readback`].
    pub fn readback<T: Pod>(&self, name: &str, len: usize) -> Result<Slice> {
        let size = (len * size_of::<T>()) as u64;
        Ok(self.lend(Location::Readback, self.take(name, Location::Readback, size)?, size))
    }

    /// A buffer of at least `size` bytes that nobody else holds; replaces one that is too small.
    fn take(&self, name: &str, location: Location, size: u64) -> Result<Arc<Buffer>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let is_free = |(of, buffer): &(Location, Arc<Buffer>)| {
            *of == location && buffer.name() == name && Arc::strong_count(buffer) == 1
        };
        if let Some(at) = kept.iter().position(is_free) {
            let (_, buffer) = kept.swap_remove(at);
            if buffer.size() >= size {
                return Ok(buffer);
            }
        }
        Ok(Arc::new(Buffer::new(&self.device, name, size, location)?))
    }

    fn lend(&self, location: Location, buffer: Arc<Buffer>, size: u64) -> Slice {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).push((location, buffer.clone()));
        Slice { buffer, offset: 0, size }
    }
}
