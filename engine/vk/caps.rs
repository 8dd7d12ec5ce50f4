//! The capabilities of a device, as plain data: printed by `ivv devices`, stored beside every measured number.

use ash::vk;

/// The kind of a device, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[cfg_attr(test, derive(Default))]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// A graphics card.
    DiscreteGpu,
    /// A GPU that shares the host's memory.
    IntegratedGpu,
    /// A GPU behind a hypervisor.
    VirtualGpu,
    /// A software driver such as lavapipe.
    Cpu,
    /// Anything else.
    #[cfg_attr(test, default)]
    Other,
}

/// Limits and features of one device, as far as the engine cares.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(test, derive(Default))]
pub struct Caps {
    /// The device's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// Vulkan version, `major.minor.patch`.
    pub api: String,
    /// Graphics card, integrated, software.
    pub kind: DeviceKind,
    /// Lanes that the engine's kernels run with: what suits the hardware, or what was asked for.
    pub subgroup_size: u32,
    /// Smallest subgroup the device may choose on its own.
    pub subgroup_min: u32,
    /// Largest subgroup the device may choose on its own.
    pub subgroup_max: u32,
    /// True if the subgroup size is pinned (`VK_EXT_subgroup_size_control`).
    pub subgroup_pinned: bool,
    /// Largest workgroup, invocations.
    pub max_workgroup: u32,
    /// Largest number of workgroups in one dimension of a dispatch.
    pub max_groups: u32,
    /// Shared memory of a workgroup, bytes.
    pub max_shared_bytes: u32,
    /// Longest range that one storage binding can see, bytes.
    pub max_binding_bytes: u64,
    /// Largest single allocation, bytes.
    pub max_allocation_bytes: u64,
    /// The largest memory heap on the device itself, bytes.
    pub heap_bytes: u64,
    /// The part of it that this process may use when the device is opened (`VK_EXT_memory_budget`), bytes; all where the device does
    /// not say.
    pub budget_bytes: u64,
    /// Alignment of a storage binding's offset, bytes.
    pub storage_alignment: u64,
    /// Nanoseconds per timestamp tick; 0 where the device has no timestamps.
    pub timestamp_ns: f32,
    /// Bits of a timestamp; it begins again at 0 after these.
    pub timestamp_bits: u32,
    /// Push descriptors (`VK_KHR_push_descriptor`); descriptor pools serve where they are absent.
    pub push_descriptors: bool,
    /// 64-bit integers, and atomics of them on buffers.
    pub int64_atomics: bool,
    /// Arithmetic in half precision.
    pub float16: bool,
    /// True if the driver is a layer over another interface than Vulkan (`VK_KHR_portability_subset`), as MoltenVK is.
    pub is_portability_subset: bool,
}

pub(super) fn kind_of(kind: vk::PhysicalDeviceType) -> DeviceKind {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::DiscreteGpu,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::IntegratedGpu,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::VirtualGpu,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}
