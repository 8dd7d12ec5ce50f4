//! Compute pipelines.

use super::caps::Caps;
use super::debug::name_object;
use super::device::Device;
use super::vk_error;
use crate::error::Result;
use ash::vk;
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    Storage,
    Uniform,
}

pub struct PipelineDesc<'a> {
    pub name: &'a str,
    /// SPIR-V, little endian.
    pub spirv: &'a [u8],
    /// The bindings of set 0, in order.
    pub bindings: &'a [BindingKind],
    pub push_bytes: u32,
    /// True if the kernel uses subgroup operations and needs whole subgroups of the pinned size.
    pub subgroups: bool,
}

pub struct Pipeline {
    device: Arc<Device>,
    pub(super) parts: Parts,
    pub(super) kinds: Vec<BindingKind>,
    pub(super) push_bytes: u32,
}

/// The handles of a pipeline; null where there is none.
#[derive(Default)]
pub(super) struct Parts {
    pub set_layout: vk::DescriptorSetLayout,
    pub layout: vk::PipelineLayout,
    pub pipeline: vk::Pipeline,
}

impl BindingKind {
    pub(super) fn descriptor_type(self) -> vk::DescriptorType {
        match self {
            BindingKind::Storage => vk::DescriptorType::STORAGE_BUFFER,
            BindingKind::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        }
    }
}

impl Parts {
    /// [`Parts::destroy`] frees what exists when a call fails.
    pub fn compile(
        &mut self,
        raw: &ash::Device,
        caps: &Caps,
        cache: vk::PipelineCache,
        desc: &PipelineDesc<'_>,
        flags: vk::PipelineCreateFlags,
    ) -> Result<()> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(desc.spirv))
            .map_err(|e| crate::Error::Vulkan { call: "reading SPIR-V", reason: format!("{}: {e}", desc.name) })?;
        let bindings: Vec<_> = desc
            .bindings
            .iter()
            .zip(0..)
            .map(|(kind, binding)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind.descriptor_type())
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let set_flags = if caps.push_descriptors {
            vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR
        } else {
            vk::DescriptorSetLayoutCreateFlags::empty()
        };
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().flags(set_flags).bindings(&bindings);
        // SAFETY: each call gets live handles of this device.
        unsafe {
            self.set_layout =
                raw.create_descriptor_set_layout(&set_info, None).map_err(vk_error("vkCreateDescriptorSetLayout"))?;
            let sets = [self.set_layout];
            let ranges =
                [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(desc.push_bytes)];
            let n_ranges = usize::from(desc.push_bytes > 0);
            let layout_info =
                vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&ranges[..n_ranges]);
            self.layout = raw.create_pipeline_layout(&layout_info, None).map_err(vk_error("vkCreatePipelineLayout"))?;
            let module = raw
                .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)
                .map_err(vk_error("vkCreateShaderModule"))?;
            let mut size = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
                .required_subgroup_size(caps.subgroup_size);
            let mut stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            if desc.subgroups && caps.subgroup_pinned {
                stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS).push_next(&mut size);
            }
            let info = [vk::ComputePipelineCreateInfo::default().flags(flags).stage(stage).layout(self.layout)];
            let created = raw.create_compute_pipelines(cache, &info, None);
            raw.destroy_shader_module(module, None);
            let created = created.map_err(|(_, e)| vk_error("vkCreateComputePipelines")(e))?;
            self.pipeline = created.first().copied().unwrap_or_default();
        }
        Ok(())
    }

    /// # Safety
    /// They are of `raw`, and nothing uses them any more.
    pub unsafe fn destroy(&self, raw: &ash::Device) {
        // SAFETY: the caller's promise; destroying null handles is allowed.
        unsafe {
            raw.destroy_pipeline(self.pipeline, None);
            raw.destroy_pipeline_layout(self.layout, None);
            raw.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

impl Pipeline {
    pub fn new(device: &Arc<Device>, desc: &PipelineDesc<'_>) -> Result<Self> {
        let kinds = desc.bindings.to_vec();
        let mut pipeline =
            Pipeline { device: device.clone(), parts: Parts::default(), kinds, push_bytes: desc.push_bytes };
        let flags = vk::PipelineCreateFlags::empty();
        pipeline.parts.compile(&device.raw, device.caps(), device.pipeline_cache, desc, flags)?;
        name_object(device.debug.as_ref(), pipeline.parts.pipeline, desc.name);
        Ok(pipeline)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: submissions keep the pipelines they use alive.
        unsafe { self.parts.destroy(&self.device.raw) }
    }
}
