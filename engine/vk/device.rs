//! Instance, choice of the device, and the one compute queue.

use super::caps::{Caps, DeviceKind, kind_of};
use super::debug::{Validation, messenger_info};
use super::vk_error;
use crate::error::{Error, Result};
use ash::{Entry, ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use std::collections::BTreeMap;
use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Which device to take and how to watch it.
#[derive(Clone, Debug, Default)]
pub struct DeviceChoice {
    /// Index in [`list_devices`]'s order or part of a name; empty prefers a GPU and takes a CPU device as the last.
    pub device: Option<String>,
    /// Turn the validation layer on; an error if it is not installed.
    pub validation: bool,
    /// Let it check synchronisation as well.
    pub sync_validation: bool,
    /// Do without push descriptors even where they exist, to test the other path.
    pub no_push_descriptors: bool,
    /// Where compiled pipelines are kept between runs.
    pub pipeline_cache: Option<PathBuf>,
    /// Instance extensions for the surfaces of windows; where there are any, the device can show pictures in them.
    pub surface: Vec<&'static CStr>,
}

/// A Vulkan device with its queue and its allocator.
pub struct Device {
    pub(super) raw: ash::Device,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    pub(super) push_descriptor: Option<khr::push_descriptor::Device>,
    pub(super) debug: Option<ext::debug_utils::Device>,
    pub(super) allocator: Mutex<Option<Allocator>>,
    pub(super) live_bytes: Mutex<BTreeMap<String, u64>>,
    pub(super) peak_bytes: Mutex<u64>,
    pub(super) pipeline_cache: vk::PipelineCache,
    pub(super) timeline: vk::Semaphore,
    pub(super) submitted: Mutex<u64>,
    pub(super) retired: Mutex<Vec<(vk::CommandPool, vk::CommandBuffer)>>,
    #[cfg(feature = "play")]
    pub(super) physical: vk::PhysicalDevice,
    cache_file: Option<PathBuf>,
    caps: Caps,
    pub(super) instance: Arc<Instance>,
}

pub(super) struct Instance {
    pub(super) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Boxed: the messenger holds its address.
    validation: Arc<Validation>,
    has_debug_utils: bool,
    // Last: the loader's library must outlive everything made from it.
    #[cfg_attr(not(feature = "play"), expect(dead_code, reason = "it is held; surfaces are made from it too"))]
    pub(super) entry: Entry,
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold an `Arc` of this instance, so none is left.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

impl Instance {
    pub(super) fn new(choice: &DeviceChoice) -> Result<Arc<Self>> {
        let no_loader = |reason: String| Error::NoDevice {
            reason,
            remedy: "install the Vulkan loader and a driver (Debian: libvulkan1 mesa-vulkan-drivers)".to_owned(),
        };
        // The loader says that memory is short, too, when it cannot parse the file of a driver.
        let no_driver = |what: &str, fault: vk::Result| Error::NoDevice {
            reason: format!(
                "the Vulkan loader cannot list its {what} ({fault:?}): the file of a driver may be damaged"
            ),
            remedy: "check that the files named by VK_DRIVER_FILES or VK_ICD_FILENAMES, or those in \
                     /usr/share/vulkan/icd.d, are the JSON that came with the drivers"
                .to_owned(),
        };
        // SAFETY: loading the system's Vulkan library runs its initialisers, which are trusted.
        let entry = unsafe { Entry::load() }.map_err(|e| no_loader(e.to_string()))?;
        // SAFETY: plain queries.
        let (layers, extensions) = unsafe {
            (
                entry.enumerate_instance_layer_properties().map_err(|e| no_driver("layers", e))?,
                entry.enumerate_instance_extension_properties(None).map_err(|e| no_driver("extensions", e))?,
            )
        };
        let named = |name: &vk::ExtensionProperties, wanted: &CStr| name.extension_name_as_c_str() == Ok(wanted);
        let mut has_debug_utils = extensions.iter().any(|e| named(e, ext::debug_utils::NAME));
        let wants_validation = choice.validation || choice.sync_validation;
        if wants_validation {
            if !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                return Err(Error::NoDevice {
                    reason: "the validation layer was asked for and is not installed".to_owned(),
                    remedy: "install it (Debian: vulkan-validationlayers) or run without it".to_owned(),
                });
            }
            has_debug_utils = true;
        }
        let layer_names: Vec<_> = wants_validation.then_some(VALIDATION_LAYER.as_ptr()).into_iter().collect();
        let debug_utils = has_debug_utils.then_some(&ext::debug_utils::NAME);
        let extension_names: Vec<_> =
            debug_utils.into_iter().chain(&choice.surface).map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default()
            .application_name(c"ivv")
            .engine_name(c"ivv")
            .api_version(vk::API_VERSION_1_2);
        let validation = Arc::new(Validation::default());
        let mut messenger_create = messenger_info(&validation);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if wants_validation {
            info = info.push_next(&mut messenger_create);
        }
        if choice.sync_validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: every pointer in `info` outlives the call; `validation` outlives the instance (it is dropped after).
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|e| match e {
            vk::Result::ERROR_OUT_OF_HOST_MEMORY => no_driver("drivers", e),
            e => no_loader(format!("{e:?}")),
        })?;
        let messenger = if wants_validation {
            let debug = ext::debug_utils::Instance::new(&entry, &raw);
            // SAFETY: as above.
            let messenger = unsafe { debug.create_debug_utils_messenger(&messenger_info(&validation), None) }
                .map_err(vk_error("vkCreateDebugUtilsMessengerEXT"))?;
            Some((debug, messenger))
        } else {
            None
        };
        Ok(Arc::new(Instance { raw, messenger, validation, has_debug_utils, entry }))
    }

    /// Usable devices with their capabilities, and the reasons against the others, in the loader's order.
    pub(super) fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, std::result::Result<Found, String>)>> {
        // SAFETY: plain query.
        let all = unsafe { self.raw.enumerate_physical_devices() }.map_err(|e| Error::NoDevice {
            reason: format!("vkEnumeratePhysicalDevices: {e:?}"),
            remedy: "install a Vulkan driver (Debian: mesa-vulkan-drivers)".to_owned(),
        })?;
        Ok(all.into_iter().map(|physical| (physical, self.probe(physical))).collect())
    }

    fn probe(&self, physical: vk::PhysicalDevice) -> std::result::Result<Found, String> {
        // SAFETY: plain queries into structs that live in this function.
        unsafe {
            let extensions = self.raw.enumerate_device_extension_properties(physical).map_err(|e| format!("{e:?}"))?;
            let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
            let core = self.raw.get_physical_device_properties(physical);
            let name = core.device_name_as_c_str().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            if core.api_version < vk::API_VERSION_1_2 {
                return Err(format!("{name}: Vulkan 1.2 is needed"));
            }
            let has_size_control = has(ext::subgroup_size_control::NAME);
            let has_float_atomics = has(ext::shader_atomic_float::NAME);
            let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
            let mut sizes = vk::PhysicalDeviceSubgroupSizeControlProperties::default();
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default()
                .push_next(&mut subgroup)
                .push_next(&mut driver)
                .push_next(&mut maintenance3);
            if has_size_control {
                properties = properties.push_next(&mut sizes);
            }
            self.raw.get_physical_device_properties2(physical, &mut properties);
            let limits = properties.properties.limits;

            let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
            let mut size_control = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
            let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12);
            if has_size_control {
                features = features.push_next(&mut size_control);
            }
            if has_float_atomics {
                features = features.push_next(&mut atomics);
            }
            self.raw.get_physical_device_features2(physical, &mut features);

            let queue_family = self
                .raw
                .get_physical_device_queue_family_properties(physical)
                .iter()
                .position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))
                .ok_or_else(|| format!("{name}: no compute queue"))?;
            let needed = vk::SubgroupFeatureFlags::BASIC
                | vk::SubgroupFeatureFlags::VOTE
                | vk::SubgroupFeatureFlags::ARITHMETIC
                | vk::SubgroupFeatureFlags::BALLOT
                | vk::SubgroupFeatureFlags::SHUFFLE;
            if !subgroup.supported_operations.contains(needed)
                || !subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
            {
                return Err(format!("{name}: subgroup vote, arithmetic, ballot and shuffle are needed in compute"));
            }
            if !(4..=64).contains(&subgroup.subgroup_size) {
                return Err(format!("{name}: subgroups of {} lanes; 4 to 64 are supported", subgroup.subgroup_size));
            }
            if v12.timeline_semaphore == vk::FALSE {
                return Err(format!("{name}: timeline semaphores are needed"));
            }
            let pinned = has_size_control
                && size_control.subgroup_size_control == vk::TRUE
                && size_control.compute_full_subgroups == vk::TRUE
                && sizes.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE);
            if !pinned && sizes.min_subgroup_size != sizes.max_subgroup_size {
                return Err(format!("{name}: its subgroup size varies and cannot be pinned"));
            }
            let memory = self.raw.get_physical_device_memory_properties(physical);
            let heap_bytes = memory.memory_heaps_as_slice().iter().map(|h| h.size).max().unwrap_or(0);
            let text = |name: std::result::Result<&CStr, std::ffi::FromBytesUntilNulError>| {
                name.map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
            };
            let api = core.api_version;
            let caps = Caps {
                name,
                driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
                api: format!(
                    "{}.{}.{}",
                    vk::api_version_major(api),
                    vk::api_version_minor(api),
                    vk::api_version_patch(api)
                ),
                kind: kind_of(core.device_type),
                subgroup_size: subgroup.subgroup_size,
                subgroup_min: if has_size_control { sizes.min_subgroup_size } else { subgroup.subgroup_size },
                subgroup_max: if has_size_control { sizes.max_subgroup_size } else { subgroup.subgroup_size },
                subgroup_pinned: pinned,
                max_workgroup: limits.max_compute_work_group_invocations,
                max_groups: limits.max_compute_work_group_count[0],
                max_shared_bytes: limits.max_compute_shared_memory_size,
                max_binding_bytes: u64::from(limits.max_storage_buffer_range),
                max_allocation_bytes: maintenance3.max_memory_allocation_size,
                heap_bytes,
                storage_alignment: limits.min_storage_buffer_offset_alignment.max(16),
                timestamp_ns: if limits.timestamp_compute_and_graphics == vk::TRUE {
                    limits.timestamp_period
                } else {
                    0.0
                },
                push_descriptors: has(khr::push_descriptor::NAME),
                float_atomics: has_float_atomics && atomics.shader_buffer_float32_atomic_add == vk::TRUE,
                int64_atomics: v12.shader_buffer_int64_atomics == vk::TRUE,
                float16: v12.shader_float16 == vk::TRUE,
            };
            Ok(Found { queue_family: queue_family as u32, caps })
        }
    }
}

pub(super) struct Found {
    pub(super) queue_family: u32,
    pub(super) caps: Caps,
}

/// The devices of this machine: capabilities, or the reason why one cannot run the engine.
pub fn list_devices() -> Result<Vec<std::result::Result<Caps, String>>> {
    let instance = Instance::new(&DeviceChoice::default())?;
    Ok(instance.devices()?.into_iter().map(|(_, found)| found.map(|f| f.caps)).collect())
}

/// Index and reason of the device that `wanted` picks among `devices`.
pub(super) fn pick(devices: &[std::result::Result<&Caps, &String>], wanted: Option<&str>) -> Result<(usize, String)> {
    let listed = || {
        devices
            .iter()
            .enumerate()
            .map(|(i, d)| match d {
                Ok(caps) => format!("{i}: {}", caps.name),
                Err(why) => format!("{i}: unusable ({why})"),
            })
            .collect::<Vec<_>>()
            .join("; ")
    };
    let usable = devices.iter().enumerate().filter_map(|(i, d)| d.ok().map(|caps| (i, caps)));
    if let Some(wanted) = wanted {
        let found = match wanted.parse::<usize>() {
            Ok(index) => usable.clone().find(|(i, _)| *i == index),
            Err(_) => {
                let lower = wanted.to_lowercase();
                usable.clone().find(|(_, caps)| caps.name.to_lowercase().contains(&lower))
            }
        };
        return found.map(|(i, _)| (i, "asked for".to_owned())).ok_or_else(|| Error::NoDevice {
            reason: format!("`{wanted}` matches none of: {}", listed()),
            remedy: "give an index or part of a name from `ivv devices`".to_owned(),
        });
    }
    usable
        .min_by_key(|(i, caps)| (caps.kind, *i))
        .map(|(i, caps)| {
            let why = if caps.kind == DeviceKind::Cpu { "no GPU was found" } else { "a GPU is preferred" };
            (i, why.to_owned())
        })
        .ok_or_else(|| Error::NoDevice {
            reason: if devices.is_empty() { "the loader lists none".to_owned() } else { listed() },
            remedy: "install a Vulkan 1.2 driver (Debian: mesa-vulkan-drivers)".to_owned(),
        })
}

impl Device {
    /// Opens the device that `choice` picks. Returns it with the reason of the choice.
    ///
    /// # Errors
    /// [`Error::NoDevice`] when there is no loader, no usable device or none that matches.
    pub fn open(choice: &DeviceChoice) -> Result<(Arc<Self>, String)> {
        let instance = Instance::new(choice)?;
        let mut devices = instance.devices()?;
        let borrowed: Vec<_> = devices.iter().map(|(_, d)| d.as_ref().map(|f| &f.caps)).collect();
        let (index, why) = pick(&borrowed, choice.device.as_deref())?;
        let (physical, found) = devices.swap_remove(index);
        let Ok(Found { queue_family, mut caps }) = found else { unreachable!("pick returns usable devices") };
        caps.push_descriptors &= !choice.no_push_descriptors;

        let mut extensions = Vec::new();
        if caps.push_descriptors {
            extensions.push(khr::push_descriptor::NAME.as_ptr());
        }
        if caps.subgroup_pinned {
            extensions.push(ext::subgroup_size_control::NAME.as_ptr());
        }
        if !choice.surface.is_empty() {
            extensions.push(khr::swapchain::NAME.as_ptr());
        }
        let mut atomics =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        if caps.float_atomics {
            extensions.push(ext::shader_atomic_float::NAME.as_ptr());
        }
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let mut size_control = vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
            .subgroup_size_control(true)
            .compute_full_subgroups(true);
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut v12);
        if caps.subgroup_pinned {
            info = info.push_next(&mut size_control);
        }
        if caps.float_atomics {
            info = info.push_next(&mut atomics);
        }
        // SAFETY: `physical` comes from this instance, and all that `info` points to lives until the call returns.
        let raw = unsafe { instance.raw.create_device(physical, &info, None) }.map_err(|e| Error::NoDevice {
            reason: format!("{}: vkCreateDevice: {e:?}", caps.name),
            remedy: "choose another with --device".to_owned(),
        })?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        })
        .map_err(|e| Error::Vulkan { call: "the allocator's set-up", reason: e.to_string() })?;
        // A cache that the driver does not recognise is ignored by the driver; one that cannot be read is no cache.
        let cached = choice.pipeline_cache.as_ref().filter(|file| file.is_file());
        let cached = cached.and_then(|file| std::fs::read(file).ok()).unwrap_or_default();
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
            live_bytes: Mutex::default(),
            peak_bytes: Mutex::default(),
            pipeline_cache,
            timeline,
            submitted: Mutex::new(0),
            retired: Mutex::default(),
            #[cfg(feature = "play")]
            physical,
            cache_file: choice.pipeline_cache.clone(),
            caps,
            raw,
            instance,
        };
        Ok((Arc::new(device), why))
    }

    /// Limits and features.
    pub fn caps(&self) -> &Caps {
        &self.caps
    }

    /// What the validation layer has said; silent where it is off.
    pub fn validation(&self) -> &Validation {
        &self.instance.validation
    }

    /// Bytes in buffers now, by buffer name, and the peak since the device was opened.
    pub fn memory(&self) -> (BTreeMap<String, u64>, u64) {
        let live = self.live_bytes.lock().map(|m| m.clone()).unwrap_or_default();
        let peak = self.peak_bytes.lock().map(|p| *p).unwrap_or_default();
        (live, peak)
    }

    /// Writes the pipeline cache to the file given at opening; a failure costs time, not results, and is logged.
    pub fn save_pipeline_cache(&self) {
        let Some(file) = &self.cache_file else { return };
        // SAFETY: the cache belongs to this device.
        let data = match unsafe { self.raw.get_pipeline_cache_data(self.pipeline_cache) } {
            Ok(data) => data,
            Err(e) => return tracing::debug!("the pipeline cache could not be read: {e:?}"),
        };
        let temporary = file.with_extension(format!("tmp{}", std::process::id()));
        let written = file
            .parent()
            .map_or(Ok(()), std::fs::create_dir_all)
            .and_then(|()| std::fs::write(&temporary, &data))
            .and_then(|()| std::fs::rename(&temporary, file));
        if let Err(e) = written {
            tracing::debug!("the pipeline cache could not be written to {}: {e}", file.display());
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

#[cfg(test)]
mod tests {
    use super::*;

    fn caps(name: &str, kind: DeviceKind) -> Caps {
        Caps {
            name: name.to_owned(),
            driver: String::new(),
            api: "1.2.0".to_owned(),
            kind,
            subgroup_size: 8,
            subgroup_min: 8,
            subgroup_max: 8,
            subgroup_pinned: true,
            max_workgroup: 256,
            max_groups: 65535,
            max_shared_bytes: 32768,
            max_binding_bytes: 1 << 27,
            max_allocation_bytes: 1 << 31,
            heap_bytes: 1 << 31,
            storage_alignment: 16,
            timestamp_ns: 1.0,
            push_descriptors: true,
            float_atomics: false,
            int64_atomics: false,
            float16: false,
        }
    }

    #[test]
    fn a_gpu_is_preferred_and_a_cpu_taken_when_named_or_alone() {
        let (cpu, gpu) = (caps("llvmpipe", DeviceKind::Cpu), caps("Radeon", DeviceKind::DiscreteGpu));
        let bad = "old".to_owned();
        let devices = [Ok(&cpu), Err(&bad), Ok(&gpu)];
        assert_eq!(pick(&devices, None).unwrap().0, 2);
        assert_eq!(pick(&devices, Some("llvm")).unwrap().0, 0);
        assert_eq!(pick(&devices, Some("0")).unwrap().0, 0);
        assert_eq!(pick(&devices[..2], None).unwrap(), (0, "no GPU was found".to_owned()));
        for (devices, wanted) in [(&devices[..], Some("1")), (&devices[..], Some("arc")), (&devices[1..2], None)] {
            let error = pick(devices, wanted).unwrap_err();
            assert_eq!(error.exit_code(), 4, "{error}");
        }
    }
}
