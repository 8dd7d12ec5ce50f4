//! What a driver's compiler tells of a pipeline (`VK_KHR_pipeline_executable_properties`).

use super::instance::{DeviceChoice, Found, Instance, pick};
use super::{Caps, PipelineDesc, vk_error};
use crate::error::{Error, Result};
use ash::{ext, khr, vk};
use std::ffi::CStr;
use std::sync::Arc;

/// One program that the driver made of a pipeline.
#[derive(Clone, Debug, PartialEq)]
pub struct Executable {
    /// Lanes of its subgroups; 0 where the driver does not say.
    pub subgroup_size: u32,
    /// Names and values, as the driver gives them.
    pub statistics: Vec<(String, f64)>,
}

/// A device that only compiles. It needs no queue and no memory, so a driver without its hardware will do.
pub struct Compiler {
    raw: ash::Device,
    told: khr::pipeline_executable_properties::Device,
    caps: Caps,
    // Last: the device is destroyed before it.
    _instance: Arc<Instance>,
}

impl Compiler {
    /// Opens the device that `choice` picks.
    ///
    /// # Errors
    /// [`Error::NoDevice`] when there is no such device, or its driver has no statistics.
    pub fn open(choice: &DeviceChoice) -> Result<Self> {
        let instance = Instance::new(choice)?;
        let mut devices = instance.devices(choice.subgroup_size)?;
        let borrowed: Vec<_> = devices.iter().map(|(_, d)| d.as_ref().map(|f| &f.caps)).collect();
        let (index, _) = pick(&borrowed, choice.device.as_deref())?;
        let (physical, found) = devices.swap_remove(index);
        let Ok(Found { queue_family, caps, .. }) = found else { unreachable!("pick returns usable devices") };
        let fault = |reason: String, remedy: &str| Error::NoDevice { reason, remedy: remedy.to_owned() };
        // SAFETY: plain queries into structs that live in this function.
        let tells = unsafe {
            let all = instance.raw.enumerate_device_extension_properties(physical);
            let all = all.map_err(vk_error("vkEnumerateDeviceExtensionProperties"))?;
            let name = khr::pipeline_executable_properties::NAME;
            let mut feature = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
            let is_there = all.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
            if is_there {
                let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut feature);
                instance.raw.get_physical_device_features2(physical, &mut features);
            }
            is_there && feature.pipeline_executable_info == vk::TRUE
        };
        if !tells {
            let reason = format!("the driver of {} has no VK_KHR_pipeline_executable_properties", caps.name);
            let remedy = "choose another with --device, or a driver that `tools/gpu/drivers.sh` unpacks";
            return Err(fault(reason, remedy));
        }
        let mut extensions = vec![khr::pipeline_executable_properties::NAME.as_ptr()];
        let wanted = [
            (caps.push_descriptors, khr::push_descriptor::NAME),
            (caps.subgroup_pinned, ext::subgroup_size_control::NAME),
            (caps.float_atomics, ext::shader_atomic_float::NAME),
        ];
        extensions.extend(wanted.iter().filter(|(has, _)| *has).map(|(_, name)| name.as_ptr()));
        let mut atomics =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        let mut size_control = vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
            .subgroup_size_control(true)
            .compute_full_subgroups(true);
        let mut executable =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut executable);
        if caps.subgroup_pinned {
            info = info.push_next(&mut size_control);
        }
        if caps.float_atomics {
            info = info.push_next(&mut atomics);
        }
        // SAFETY: `physical` comes from this instance, and all that `info` points to lives until the call returns.
        let raw = unsafe { instance.raw.create_device(physical, &info, None) }
            .map_err(|e| fault(format!("{}: vkCreateDevice: {e:?}", caps.name), "choose another with --device"))?;
        let told = khr::pipeline_executable_properties::Device::new(&instance.raw, &raw);
        Ok(Compiler { raw, told, caps, _instance: instance })
    }

    /// Limits and features; its subgroup size is the width that was asked for.
    pub fn caps(&self) -> &Caps {
        &self.caps
    }

    /// Compiles `desc` and reads what the driver tells of each program in it.
    ///
    /// # Errors
    /// [`Error::Vulkan`] or [`Error::DriverOutOfMemory`] when the driver refuses.
    pub fn statistics(&self, desc: &PipelineDesc<'_>) -> Result<Vec<Executable>> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(desc.spirv))
            .map_err(|e| Error::Vulkan { call: "reading SPIR-V", reason: format!("{}: {e}", desc.name) })?;
        let binding = |(kind, at): (&super::BindingKind, u32)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(at)
                .descriptor_type(kind.descriptor_type())
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = desc.bindings.iter().zip(0..).map(binding).collect();
        let flags = match self.caps.push_descriptors {
            true => vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR,
            false => vk::DescriptorSetLayoutCreateFlags::empty(),
        };
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().flags(flags).bindings(&bindings);
        let ranges =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(desc.push_bytes)];
        let n_ranges = usize::from(desc.push_bytes > 0);
        let mut made = Made::of(&self.raw);
        // SAFETY: each call gets live handles of this device; `made` destroys what exists when a later call fails.
        unsafe {
            made.set = self
                .raw
                .create_descriptor_set_layout(&set_info, None)
                .map_err(vk_error("vkCreateDescriptorSetLayout"))?;
            let sets = [made.set];
            let layout =
                vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&ranges[..n_ranges]);
            made.layout = self.raw.create_pipeline_layout(&layout, None).map_err(vk_error("vkCreatePipelineLayout"))?;
            let module = vk::ShaderModuleCreateInfo::default().code(&words);
            made.module = self.raw.create_shader_module(&module, None).map_err(vk_error("vkCreateShaderModule"))?;
            let mut size = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
                .required_subgroup_size(self.caps.subgroup_size);
            let mut stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(made.module)
                .name(c"main");
            if desc.subgroups && self.caps.subgroup_pinned {
                stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS).push_next(&mut size);
            }
            let info = [vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(made.layout)];
            let created = self.raw.create_compute_pipelines(vk::PipelineCache::null(), &info, None);
            let created = created.map_err(|(_, e)| vk_error("vkCreateComputePipelines")(e))?;
            made.pipeline = created.first().copied().unwrap_or_default();
            self.read(made.pipeline)
        }
    }

    /// # Safety
    /// `pipeline` belongs to this device and captured its statistics.
    unsafe fn read(&self, pipeline: vk::Pipeline) -> Result<Vec<Executable>> {
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the caller's promise.
        let programs = unsafe { self.told.get_pipeline_executable_properties(&info) }
            .map_err(vk_error("vkGetPipelineExecutablePropertiesKHR"))?;
        let mut found = Vec::with_capacity(programs.len());
        for (program, index) in programs.iter().zip(0..) {
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index);
            // SAFETY: the caller's promise, and an index below the number of programs.
            let statistics = unsafe { self.told.get_pipeline_executable_statistics(&info) }
                .map_err(vk_error("vkGetPipelineExecutableStatisticsKHR"))?;
            let statistics = statistics.iter().map(|one| (text(one.name_as_c_str()), value(one))).collect();
            found.push(Executable { subgroup_size: program.subgroup_size, statistics });
        }
        Ok(found)
    }
}

fn text(name: std::result::Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn value(one: &vk::PipelineExecutableStatisticKHR<'_>) -> f64 {
    // SAFETY: the format says which part of the union the driver wrote.
    unsafe {
        match one.format {
            vk::PipelineExecutableStatisticFormatKHR::BOOL32 => f64::from(one.value.b32),
            vk::PipelineExecutableStatisticFormatKHR::INT64 => one.value.i64 as f64,
            vk::PipelineExecutableStatisticFormatKHR::UINT64 => one.value.u64 as f64,
            _ => one.value.f64,
        }
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        // SAFETY: what is made of it is destroyed where it is made.
        unsafe { self.raw.destroy_device(None) }
    }
}

/// What a compilation makes; destroyed with it.
struct Made<'a> {
    raw: &'a ash::Device,
    set: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    module: vk::ShaderModule,
    pipeline: vk::Pipeline,
}

impl<'a> Made<'a> {
    fn of(raw: &'a ash::Device) -> Self {
        Made {
            raw,
            set: Default::default(),
            layout: Default::default(),
            module: Default::default(),
            pipeline: Default::default(),
        }
    }
}

impl Drop for Made<'_> {
    fn drop(&mut self) {
        // SAFETY: they belong to `raw`, nothing uses them any more, and destroying null handles is allowed.
        unsafe {
            self.raw.destroy_pipeline(self.pipeline, None);
            self.raw.destroy_shader_module(self.module, None);
            self.raw.destroy_pipeline_layout(self.layout, None);
            self.raw.destroy_descriptor_set_layout(self.set, None);
        }
    }
}
