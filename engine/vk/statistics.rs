//! The statistics that a driver's compiler has of a pipeline (`VK_KHR_pipeline_executable_properties`).

use super::device::{Purpose, create_device};
use super::instance::{DeviceChoice, Found, Instance};
use super::pipeline::{Parts, PipelineDesc};
use super::probe::text;
use super::{Caps, vk_error};
use crate::error::{Error, Result};
use ash::{khr, vk};
use std::sync::Arc;

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
    pub fn open(choice: &DeviceChoice) -> Result<Self> {
        let instance = Instance::new(choice)?;
        let (Found { physical, queue_family, caps, .. }, _) = instance.pick(choice)?;
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
            return Err(Error::no_device(reason, remedy));
        }
        let raw = create_device(&instance, physical, queue_family, &caps, Purpose::Compiling)?;
        let told = khr::pipeline_executable_properties::Device::new(&instance.raw, &raw);
        Ok(Compiler { raw, told, caps, _instance: instance })
    }

    /// Limits and features; its subgroup size is the width that was asked for.
    pub fn caps(&self) -> &Caps {
        &self.caps
    }

    pub fn statistics(&self, desc: &PipelineDesc<'_>) -> Result<Vec<Executable>> {
        let mut parts = Parts::default();
        let flags = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR;
        let made = parts.compile(&self.raw, &self.caps, vk::PipelineCache::null(), desc, flags);
        // SAFETY: the pipeline is of this device and was compiled with the flag.
        let found = made.and_then(|()| unsafe { self.read(parts.pipeline) });
        // SAFETY: nothing uses them any more.
        unsafe { parts.destroy(&self.raw) };
        found
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
