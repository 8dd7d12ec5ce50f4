//! A device with its allocator and the one compute queue.

use super::cache;
use super::caps::Caps;
use super::debug::Validation;
use super::instance::{DeviceChoice, Found, Instance};
use super::vk_error;
use crate::error::{Error, Result};
use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

pub struct Device {
    pub(super) raw: ash::Device,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    pub(super) push_descriptor: Option<khr::push_descriptor::Device>,
    pub(super) debug: Option<ext::debug_utils::Device>,
    pub(super) allocator: Mutex<Option<Allocator>>,
    /// Bytes in buffers by name, and the most that were in all.
    pub(super) memory: Mutex<(BTreeMap<String, u64>, u64)>,
    pub(super) n_buffers_made: AtomicU64,
    pub(super) pipeline_cache: vk::PipelineCache,
    pub(super) timeline: vk::Semaphore,
    pub(super) submitted: Mutex<u64>,
    pub(super) retired: Mutex<Vec<(vk::CommandPool, vk::CommandBuffer)>>,
    #[cfg(feature = "window")]
    pub(super) physical: vk::PhysicalDevice,
    cache_file: Option<PathBuf>,
    pub(super) breadcrumbs: bool,
    caps: Caps,
    pub(super) instance: Arc<Instance>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    Running,
    Showing,
    /// To compile kernels for statistics. Drivers without their hardware refuse timeline semaphores.
    Compiling,
}

/// The device itself, with one compute queue and what of `caps` has to be switched on.
pub(super) fn create_device(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    caps: &Caps,
    purpose: Purpose,
) -> Result<ash::Device> {
    let mut extensions = Vec::new();
    if caps.push_descriptors {
        extensions.push(khr::push_descriptor::NAME.as_ptr());
    }
    if caps.subgroup_pinned {
        extensions.push(ext::subgroup_size_control::NAME.as_ptr());
    }
    if caps.is_portability_subset {
        // Vulkan asks for it wherever it is there.
        extensions.push(khr::portability_subset::NAME.as_ptr());
    }
    match purpose {
        Purpose::Running => {}
        Purpose::Showing => extensions.push(khr::swapchain::NAME.as_ptr()),
        Purpose::Compiling => extensions.push(khr::pipeline_executable_properties::NAME.as_ptr()),
    }
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(purpose != Purpose::Compiling)
        .shader_buffer_int64_atomics(caps.int64_atomics);
    let core = vk::PhysicalDeviceFeatures::default().shader_int64(caps.int64_atomics);
    let mut executable =
        vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
    let mut size_control = vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
        .subgroup_size_control(true)
        .compute_full_subgroups(true);
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&core)
        .push_next(&mut v12);
    if purpose == Purpose::Compiling {
        info = info.push_next(&mut executable);
    }
    if caps.subgroup_pinned {
        info = info.push_next(&mut size_control);
    }
    // SAFETY: `physical` comes from this instance, and all that `info` points to lives until the call returns.
    unsafe { instance.raw.create_device(physical, &info, None) }
        .map_err(|e| Error::no_device(format!("{}: vkCreateDevice: {e:?}", caps.name), "choose another with --device"))
}

fn create_allocator(instance: &Instance, device: &ash::Device, physical: vk::PhysicalDevice) -> Result<Allocator> {
    Allocator::new(&AllocatorCreateDesc {
        instance: instance.raw.clone(),
        device: device.clone(),
        physical_device: physical,
        debug_settings: Default::default(),
        buffer_device_address: false,
        allocation_sizes: Default::default(),
    })
    .map_err(|e| Error::Vulkan { call: "the allocator's set-up", reason: e.to_string() })
}

impl Device {
    /// Opens the device that `choice` picks, and says why.
    pub fn open(choice: &DeviceChoice) -> Result<(Arc<Self>, String)> {
        let instance = Instance::new(choice)?;
        let (found, why) = instance.pick(choice)?;
        let Found { physical, queue_family, mut caps, pipeline_cache_uuid } = found;
        caps.push_descriptors &= !choice.no_push_descriptors;

        let purpose = if choice.surface.is_empty() { Purpose::Running } else { Purpose::Showing };
        let raw = create_device(&instance, physical, queue_family, &caps, purpose)?;
        let allocator = create_allocator(&instance, &raw, physical)?;
        // A cache that the driver does not recognise is ignored by the driver.
        let cache_file = choice.pipeline_cache.as_ref().map(|folder| folder.join(cache::name(pipeline_cache_uuid)));
        let cached = cache_file.as_deref().map(cache::read).unwrap_or_default();
        let cache_info = vk::PipelineCacheCreateInfo::default().initial_data(&cached);
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore_info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: plain creation calls on the new device.
        let (queue, pipeline_cache, timeline) = unsafe {
            (
                raw.get_device_queue(queue_family, 0),
                raw.create_pipeline_cache(&cache_info, None).map_err(vk_error("vkCreatePipelineCache"))?,
                raw.create_semaphore(&semaphore_info, None).map_err(vk_error("vkCreateSemaphore"))?,
            )
        };
        let push_descriptor = caps.push_descriptors.then(|| khr::push_descriptor::Device::new(&instance.raw, &raw));
        let debug = instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &raw));
        let device = Device {
            queue: Mutex::new(queue),
            queue_family,
            push_descriptor,
            debug,
            allocator: Mutex::new(Some(allocator)),
            memory: Mutex::default(),
            n_buffers_made: AtomicU64::new(0),
            pipeline_cache,
            timeline,
            submitted: Mutex::new(0),
            retired: Mutex::default(),
            #[cfg(feature = "window")]
            physical,
            cache_file,
            breadcrumbs: choice.breadcrumbs,
            caps,
            raw,
            instance,
        };
        Ok((Arc::new(device), why))
    }

    pub fn caps(&self) -> &Caps {
        &self.caps
    }

    /// The messages of the validation layer; silent where it is off.
    pub fn validation(&self) -> &Validation {
        &self.instance.validation
    }

    /// Bytes in buffers now by name, and the peak.
    pub fn memory(&self) -> (BTreeMap<String, u64>, u64) {
        self.memory.lock().map(|memory| memory.clone()).unwrap_or_default()
    }

    pub fn n_buffers_made(&self) -> u64 {
        self.n_buffers_made.load(Ordering::Relaxed)
    }

    /// A failure costs time, not results, and is logged.
    pub(crate) fn save_pipeline_cache(&self) {
        let Some(file) = &self.cache_file else { return };
        // SAFETY: the cache belongs to this device.
        let data = match unsafe { self.raw.get_pipeline_cache_data(self.pipeline_cache) } {
            Ok(data) => data,
            Err(e) => return tracing::debug!("the pipeline cache could not be read: {e:?}"),
        };
        if let Err(e) = cache::write(file, &data) {
            tracing::debug!("the pipeline cache could not be written: {e}");
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.save_pipeline_cache();
        // SAFETY: buffers, pipelines and submissions hold an `Arc` of this device, so none is left; the queue is idle
        // because a submission waits for its end before it is dropped.
        unsafe {
            for (pool, _) in self.retired.get_mut().map(std::mem::take).unwrap_or_default() {
                self.raw.destroy_command_pool(pool, None);
            }
            if let Ok(allocator) = self.allocator.get_mut() {
                drop(allocator.take());
            }
            self.raw.destroy_semaphore(self.timeline, None);
            self.raw.destroy_pipeline_cache(self.pipeline_cache, None);
            self.raw.destroy_device(None);
        }
    }
}
