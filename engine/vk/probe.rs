//! Vulkan's description of a device, and the part that the engine needs.

use super::caps::{Caps, kind_of};
use super::choose;
use super::instance::Found;
use ash::{ext, khr, vk};
use std::ffi::{CStr, FromBytesUntilNulError};

/// `physical`, or the reason why it cannot run the engine, with subgroups of `wanted` lanes where they are asked for.
pub(super) fn probe(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    wanted: Option<u32>,
) -> Result<Found, String> {
    let answers = Answers::of(instance, physical)?;
    let (queue_family, caps) = (answers.usable_family(wanted)?, answers.caps(wanted)?);
    Ok(Found { physical, queue_family, caps, pipeline_cache_uuid: answers.core.pipeline_cache_uuid })
}

/// Answers of a device to all that the engine asks. What belongs to an extension that it lacks is zero.
#[derive(Default)]
struct Answers {
    name: String,
    extensions: Vec<vk::ExtensionProperties>,
    core: vk::PhysicalDeviceProperties,
    subgroup: vk::PhysicalDeviceSubgroupProperties<'static>,
    sizes: vk::PhysicalDeviceSubgroupSizeControlProperties<'static>,
    driver: vk::PhysicalDeviceDriverProperties<'static>,
    maintenance3: vk::PhysicalDeviceMaintenance3Properties<'static>,
    v12: vk::PhysicalDeviceVulkan12Features<'static>,
    size_control: vk::PhysicalDeviceSubgroupSizeControlFeatures<'static>,
    has_int64: bool,
    memory: vk::PhysicalDeviceMemoryProperties,
    budget: vk::PhysicalDeviceMemoryBudgetPropertiesEXT<'static>,
    queue_family: Option<usize>,
    timestamp_bits: u32,
}

impl Answers {
    /// Asks `physical`; the reason where it is too old to answer.
    fn of(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<Self, String> {
        // SAFETY: plain queries.
        let (extensions, core) = unsafe {
            (
                instance.enumerate_device_extension_properties(physical).map_err(|e| format!("{e:?}"))?,
                instance.get_physical_device_properties(physical),
            )
        };
        let name = text(core.device_name_as_c_str());
        if core.api_version < vk::API_VERSION_1_2 {
            return Err(format!("{name}: Vulkan 1.2 is needed"));
        }
        let mut answers = Answers { name, extensions, core, ..Answers::default() };
        let (has_size_control, has_budget) = (answers.has_size_control(), answers.has_budget());
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut answers.subgroup)
            .push_next(&mut answers.driver)
            .push_next(&mut answers.maintenance3);
        if has_size_control {
            properties = properties.push_next(&mut answers.sizes);
        }
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut answers.v12);
        if has_size_control {
            features = features.push_next(&mut answers.size_control);
        }
        let mut memory = vk::PhysicalDeviceMemoryProperties2::default();
        if has_budget {
            memory = memory.push_next(&mut answers.budget);
        }
        // SAFETY: plain queries into structs that live until the calls return; nobody follows their chains afterwards.
        let families = unsafe {
            instance.get_physical_device_properties2(physical, &mut properties);
            instance.get_physical_device_features2(physical, &mut features);
            instance.get_physical_device_memory_properties2(physical, &mut memory);
            instance.get_physical_device_queue_family_properties(physical)
        };
        let has_int64 = features.features.shader_int64 == vk::TRUE;
        answers.has_int64 = has_int64;
        answers.memory = memory.memory_properties;
        answers.queue_family = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
        answers.timestamp_bits =
            answers.queue_family.and_then(|family| families.get(family)).map_or(0, |f| f.timestamp_valid_bits);
        Ok(answers)
    }

    fn has(&self, extension: &CStr) -> bool {
        self.extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(extension))
    }

    fn has_size_control(&self) -> bool {
        self.has(ext::subgroup_size_control::NAME)
    }

    fn has_budget(&self) -> bool {
        self.has(ext::memory_budget::NAME)
    }

    fn sizes(&self) -> [u32; 2] {
        let own = self.subgroup.subgroup_size;
        if self.pins_subgroups() { [self.sizes.min_subgroup_size, self.sizes.max_subgroup_size] } else { [own; 2] }
    }

    fn subgroup_size(&self, wanted: Option<u32>) -> Result<u32, String> {
        let [least, most] = self.sizes();
        match wanted {
            Some(lanes) => {
                choose::check_size(lanes, least, most).map_err(|reason| format!("{}: {reason}", self.name))?;
                Ok(lanes)
            }
            None => Ok(choose::subgroup_size(self.core.vendor_id, least, most, self.subgroup.subgroup_size)),
        }
    }

    fn pins_subgroups(&self) -> bool {
        self.has_size_control()
            && self.size_control.subgroup_size_control == vk::TRUE
            && self.size_control.compute_full_subgroups == vk::TRUE
            && self.sizes.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE)
    }

    /// The family of queues that compute; the first reason why the engine cannot run, with subgroups of `wanted` lanes where they are
    /// asked for.
    fn usable_family(&self, wanted: Option<u32>) -> Result<u32, String> {
        let Answers { name, subgroup, sizes, v12, .. } = self;
        let family = self.queue_family.ok_or_else(|| format!("{name}: no compute queue"))?;
        use vk::SubgroupFeatureFlags as Feature;
        let operations = Feature::BASIC | Feature::VOTE | Feature::ARITHMETIC | Feature::BALLOT | Feature::SHUFFLE;
        if !subgroup.supported_operations.contains(operations)
            || !subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
        {
            return Err(format!("{name}: subgroup vote, arithmetic, ballot and shuffle are needed in compute"));
        }
        let lanes = self.subgroup_size(wanted)?;
        if !(4..=64).contains(&lanes) {
            return Err(format!("{name}: subgroups of {lanes} lanes; 4 to 64 are supported"));
        }
        choose::check_limits(&self.core.limits, lanes).map_err(|reason| format!("{name}: {reason}"))?;
        if v12.timeline_semaphore == vk::FALSE {
            return Err(format!("{name}: timeline semaphores are needed"));
        }
        if !self.pins_subgroups() && sizes.min_subgroup_size != sizes.max_subgroup_size {
            return Err(format!("{name}: its subgroup size varies and cannot be pinned"));
        }
        Ok(family as u32)
    }

    fn caps(&self, wanted: Option<u32>) -> Result<Caps, String> {
        let Answers { core, subgroup, sizes, driver, v12, .. } = self;
        let (limits, api) = (&core.limits, core.api_version);
        let (has_timestamps, has_size_control) = (self.timestamp_bits > 0, self.has_size_control());
        let budgets = self.has_budget().then_some(&self.budget.heap_budget[..]);
        let (heap_bytes, budget_bytes) = choose::device_memory(self.memory.memory_heaps_as_slice(), budgets);
        Ok(Caps {
            name: self.name.clone(),
            driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
            api: [vk::api_version_major(api), vk::api_version_minor(api), vk::api_version_patch(api)]
                .map(|part| part.to_string())
                .join("."),
            kind: kind_of(core.device_type),
            subgroup_size: self.subgroup_size(wanted)?,
            subgroup_min: if has_size_control { sizes.min_subgroup_size } else { subgroup.subgroup_size },
            subgroup_max: if has_size_control { sizes.max_subgroup_size } else { subgroup.subgroup_size },
            subgroup_pinned: self.pins_subgroups(),
            max_workgroup: limits.max_compute_work_group_invocations,
            max_groups: limits.max_compute_work_group_count[0],
            max_shared_bytes: limits.max_compute_shared_memory_size,
            // No binding is larger than a buffer can be.
            max_binding_bytes: u64::from(limits.max_storage_buffer_range)
                .min(self.maintenance3.max_memory_allocation_size)
                & !15,
            max_allocation_bytes: self.maintenance3.max_memory_allocation_size,
            heap_bytes,
            budget_bytes,
            storage_alignment: limits.min_storage_buffer_offset_alignment.max(16),
            timestamp_ns: if has_timestamps { limits.timestamp_period } else { 0.0 },
            timestamp_bits: self.timestamp_bits,
            push_descriptors: self.has(khr::push_descriptor::NAME),
            int64_atomics: self.has_int64 && v12.shader_buffer_int64_atomics == vk::TRUE,
            float16: v12.shader_float16 == vk::TRUE,
            is_portability_subset: self.has(khr::portability_subset::NAME),
        })
    }
}

pub(super) fn text(name: Result<&CStr, FromBytesUntilNulError>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}
