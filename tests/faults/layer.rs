//! A Vulkan layer for tests: makes one call of one entry point fail, or counts the calls.
//!
//! Environment:
//! - `IVV_FAULT=CALL:N:CODE` makes the N-th call (from 1) of CALL return the number CODE (-1 out of host memory, -2 out of
//!   device memory, -4 device lost, or any other VkResult); with `N+` this and all later ones. Two words of CODE are for
//!   tests of the tests: `abort` kills the process there, `skip` tells success and does nothing.
//! - `IVV_FAULT_COUNTS=FILE`: a line `CALL N` for each entry point when the instance is destroyed, and `fault 1` if the
//!   fault was given.
//!
//! A wait that is to lose the device waits first: drivers on the CPU still work on what is then destroyed. A device that is
//! lost stays lost, as the specification has it: later submissions and waits fail too.
//!
//! The one file outside of engine/vk that has unsafe code: a layer is a C interface. It is no part of the program.
#![allow(unsafe_code, non_snake_case)]

use ash::vk;
use std::collections::BTreeMap;
use std::ffi::{CStr, c_char, c_void};
use std::sync::{LazyLock, Mutex, PoisonError};

/// `VkNegotiateLayerInterface` of the loader's vk_layer.h.
#[repr(C)]
pub struct Negotiation {
    kind: i32,
    next: *const c_void,
    version: u32,
    get_instance: vk::PFN_vkGetInstanceProcAddr,
    get_device: vk::PFN_vkGetDeviceProcAddr,
    get_physical_device: Option<unsafe extern "system" fn()>,
}

/// `VkLayerInstanceCreateInfo` and `VkLayerDeviceCreateInfo`, which are of one shape.
#[repr(C)]
struct LayerCreateInfo {
    kind: vk::StructureType,
    next: *mut c_void,
    function: i32,
    link: *mut Link,
}

/// `VkLayerInstanceLink` and `VkLayerDeviceLink`: the second has the device's function where the first has the physical
/// device's.
#[repr(C)]
struct Link {
    next: *mut Link,
    get_instance: vk::PFN_vkGetInstanceProcAddr,
    get_device: Option<vk::PFN_vkGetDeviceProcAddr>,
}

/// What to do to the call.
#[derive(Clone, Copy, PartialEq)]
enum Deed {
    Return(vk::Result),
    Abort,
    Skip,
}

struct Fault {
    call: String,
    n: u64,
    and_later: bool,
    deed: Deed,
}

#[derive(Default)]
struct Layer {
    get_instance: Option<vk::PFN_vkGetInstanceProcAddr>,
    get_device: Option<vk::PFN_vkGetDeviceProcAddr>,
    /// What is below this layer, by name.
    below: BTreeMap<&'static str, unsafe extern "system" fn()>,
    fault: Option<Fault>,
    is_given: bool,
    is_lost: bool,
    counts: BTreeMap<&'static str, u64>,
}

/// One instance and one device at a time, as the program has.
static LAYER: LazyLock<Mutex<Layer>> =
    LazyLock::new(|| Mutex::new(Layer { fault: fault_of_environment(), ..Layer::default() }));

fn layer<T>(run: impl FnOnce(&mut Layer) -> T) -> T {
    run(&mut LAYER.lock().unwrap_or_else(PoisonError::into_inner))
}

fn fault_of_environment() -> Option<Fault> {
    let text = std::env::var("IVV_FAULT").ok()?;
    let [call, n, code]: [&str; 3] = text.split(':').collect::<Vec<_>>().try_into().ok()?;
    let deed = match code {
        "abort" => Deed::Abort,
        "skip" => Deed::Skip,
        code => Deed::Return(vk::Result::from_raw(code.parse().ok()?)),
    };
    let (n, and_later) = n.strip_suffix('+').map_or((n, false), |n| (n, true));
    Some(Fault { call: call.to_owned(), n: n.parse().ok()?, and_later, deed })
}

/// Calls that fail on a device that is lost.
fn fails_when_lost(name: &str) -> bool {
    ["vkQueueSubmit", "vkWaitSemaphores", "vkGetQueryPoolResults"].contains(&name)
}

/// Counts a call of `name` and says what is to be done to it.
fn deed(name: &'static str) -> Option<Deed> {
    layer(|layer| {
        let count = layer.counts.entry(name).or_default();
        *count += 1;
        let count = *count;
        let is_due = |f: &&Fault| f.call == name && (count == f.n || f.and_later && count > f.n);
        let deed = layer.fault.as_ref().filter(is_due).map(|fault| fault.deed);
        layer.is_given |= deed.is_some();
        layer.is_lost |= deed == Some(Deed::Return(vk::Result::ERROR_DEVICE_LOST));
        let lost = (layer.is_lost && fails_when_lost(name)).then_some(Deed::Return(vk::Result::ERROR_DEVICE_LOST));
        deed.or(lost)
    })
}

/// Does to a call of `name` what is due, or performs it.
fn call(name: &'static str, perform: impl FnOnce() -> vk::Result) -> vk::Result {
    match deed(name) {
        None => perform(),
        Some(Deed::Abort) => std::process::abort(),
        Some(Deed::Skip) => vk::Result::SUCCESS,
        Some(Deed::Return(result)) => {
            if name == "vkWaitSemaphores" && result == vk::Result::ERROR_DEVICE_LOST {
                let _ = perform();
            }
            result
        }
    }
}

/// The function `name` of what is below this layer.
///
/// # Safety
/// `F` is the type of a pointer to the function of this name.
unsafe fn below<F: Copy>(name: &str) -> Option<F> {
    debug_assert_eq!(size_of::<F>(), size_of::<unsafe extern "system" fn()>());
    let found = layer(|layer| layer.below.get(name).copied())?;
    // SAFETY: a pointer to a function, which the caller promises to be of type F.
    Some(unsafe { std::mem::transmute_copy(&found) })
}

/// Looks up `names` by `get`. At once: after vkCreateInstance the loader gives the functions of the topmost layer.
fn look_up(names: impl Iterator<Item = &'static str>, get: impl Fn(*const c_char) -> vk::PFN_vkVoidFunction) {
    for name in names {
        let terminated: Vec<u8> = name.bytes().chain([0]).collect();
        if let Some(found) = get(terminated.as_ptr().cast()) {
            layer(|layer| layer.below.insert(name, found));
        }
    }
}

/// Wraps entry points: each counts its calls and fails when it is told to. Later `table` finds the wrapper of a name.
macro_rules! wrapped {
    ($($name:ident($($argument:ident: $kind:ty),+) as $pointer:ty;)+) => {
        $(
            /// As the entry point of this name.
            ///
            /// # Safety
            /// The specification's rules for it.
            unsafe extern "system" fn $name($($argument: $kind),+) -> vk::Result {
                call(stringify!($name), || {
                    // SAFETY: the type is that of this entry point, and the caller's promises are passed on.
                    match unsafe { below::<$pointer>(stringify!($name)) } {
                        // SAFETY: as above.
                        Some(next) => unsafe { next($($argument),+) },
                        None => vk::Result::ERROR_INITIALIZATION_FAILED,
                    }
                })
            }
        )+

        /// The entry points that have a wrapper.
        const WRAPPED: &[&str] = &[$(stringify!($name)),+];

        /// The wrapper of an entry point, if there is one.
        fn table(name: &str) -> vk::PFN_vkVoidFunction {
            match name {
                $(
                    stringify!($name) => {
                        let pointer: $pointer = $name;
                        // SAFETY: the caller of vkGet...ProcAddr casts it back to its own type.
                        Some(unsafe { std::mem::transmute::<$pointer, unsafe extern "system" fn()>(pointer) })
                    }
                )+
                _ => None,
            }
        }
    };
}

wrapped! {
    vkEnumeratePhysicalDevices(instance: vk::Instance, n: *mut u32, out: *mut vk::PhysicalDevice)
        as vk::PFN_vkEnumeratePhysicalDevices;
    vkCreateBuffer(device: vk::Device, info: *const vk::BufferCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::Buffer)
        as vk::PFN_vkCreateBuffer;
    vkAllocateMemory(
        device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::DeviceMemory
    ) as vk::PFN_vkAllocateMemory;
    vkMapMemory(
        device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize,
        flags: vk::MemoryMapFlags, out: *mut *mut c_void
    ) as vk::PFN_vkMapMemory;
    vkBindBufferMemory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize)
        as vk::PFN_vkBindBufferMemory;
    vkCreateCommandPool(
        device: vk::Device, info: *const vk::CommandPoolCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::CommandPool
    ) as vk::PFN_vkCreateCommandPool;
    vkResetCommandPool(device: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags)
        as vk::PFN_vkResetCommandPool;
    vkAllocateCommandBuffers(
        device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, out: *mut vk::CommandBuffer
    ) as vk::PFN_vkAllocateCommandBuffers;
    vkBeginCommandBuffer(buffer: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>)
        as vk::PFN_vkBeginCommandBuffer;
    vkEndCommandBuffer(buffer: vk::CommandBuffer) as vk::PFN_vkEndCommandBuffer;
    vkQueueSubmit(queue: vk::Queue, n: u32, infos: *const vk::SubmitInfo<'_>, fence: vk::Fence)
        as vk::PFN_vkQueueSubmit;
    vkAcquireNextImageKHR(
        device: vk::Device, chain: vk::SwapchainKHR, timeout: u64, semaphore: vk::Semaphore, fence: vk::Fence, out: *mut u32
    ) as vk::PFN_vkAcquireNextImageKHR;
    vkQueuePresentKHR(queue: vk::Queue, info: *const vk::PresentInfoKHR<'_>) as vk::PFN_vkQueuePresentKHR;
    vkWaitSemaphores(device: vk::Device, info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64)
        as vk::PFN_vkWaitSemaphores;
    vkCreateSemaphore(
        device: vk::Device, info: *const vk::SemaphoreCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::Semaphore
    ) as vk::PFN_vkCreateSemaphore;
    vkCreateQueryPool(
        device: vk::Device, info: *const vk::QueryPoolCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::QueryPool
    ) as vk::PFN_vkCreateQueryPool;
    vkGetQueryPoolResults(
        device: vk::Device, pool: vk::QueryPool, first: u32, n: u32, size: usize, data: *mut c_void,
        stride: vk::DeviceSize, flags: vk::QueryResultFlags
    ) as vk::PFN_vkGetQueryPoolResults;
    vkCreateDescriptorPool(
        device: vk::Device, info: *const vk::DescriptorPoolCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::DescriptorPool
    ) as vk::PFN_vkCreateDescriptorPool;
    vkAllocateDescriptorSets(
        device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, out: *mut vk::DescriptorSet
    ) as vk::PFN_vkAllocateDescriptorSets;
    vkCreateDescriptorSetLayout(
        device: vk::Device, info: *const vk::DescriptorSetLayoutCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>,
        out: *mut vk::DescriptorSetLayout
    ) as vk::PFN_vkCreateDescriptorSetLayout;
    vkCreatePipelineLayout(
        device: vk::Device, info: *const vk::PipelineLayoutCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineLayout
    ) as vk::PFN_vkCreatePipelineLayout;
    vkCreateShaderModule(
        device: vk::Device, info: *const vk::ShaderModuleCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::ShaderModule
    ) as vk::PFN_vkCreateShaderModule;
    vkCreatePipelineCache(
        device: vk::Device, info: *const vk::PipelineCacheCreateInfo<'_>, with: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineCache
    ) as vk::PFN_vkCreatePipelineCache;
    vkGetPipelineCacheData(device: vk::Device, cache: vk::PipelineCache, size: *mut usize, data: *mut c_void)
        as vk::PFN_vkGetPipelineCacheData;
    vkCreateComputePipelines(
        device: vk::Device, cache: vk::PipelineCache, n: u32, infos: *const vk::ComputePipelineCreateInfo<'_>,
        with: *const vk::AllocationCallbacks<'_>, out: *mut vk::Pipeline
    ) as vk::PFN_vkCreateComputePipelines;
}

/// The link that the loader left in `chain` for this layer, which is then the next layer's.
///
/// # Safety
/// `chain` is the `pNext` of an info that the loader gave.
unsafe fn take_link(chain: *const c_void, kind: vk::StructureType) -> Option<*mut Link> {
    let mut at = chain.cast_mut().cast::<LayerCreateInfo>();
    // SAFETY: every struct of a chain begins with its kind and the next one; those of this kind are the loader's, which
    // lets layers move the link on.
    unsafe {
        while let Some(info) = at.as_mut() {
            // VK_LAYER_LINK_INFO
            if info.kind == kind && info.function == 0 {
                let link = info.link;
                info.link = link.as_ref()?.next;
                return Some(link);
            }
            at = info.next.cast();
        }
    }
    None
}

unsafe extern "system" fn vkCreateInstance(
    info: *const vk::InstanceCreateInfo<'_>,
    with: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Instance,
) -> vk::Result {
    call("vkCreateInstance", || {
        // SAFETY: the loader's own info and handles; the pointer is read as the function that it was asked for.
        unsafe {
            let Some(link) = take_link((*info).p_next, vk::StructureType::LOADER_INSTANCE_CREATE_INFO) else {
                return vk::Result::ERROR_INITIALIZATION_FAILED;
            };
            let get = (*link).get_instance;
            layer(|layer| layer.get_instance = Some(get));
            look_up(["vkCreateInstance"].into_iter(), |name| get(vk::Instance::null(), name));
            let Some(create) = below::<vk::PFN_vkCreateInstance>("vkCreateInstance") else {
                return vk::Result::ERROR_INITIALIZATION_FAILED;
            };
            let result = create(info, with, out);
            if result == vk::Result::SUCCESS {
                let names = WRAPPED.iter().copied().chain(["vkCreateDevice", "vkDestroyInstance"]);
                look_up(names, |name| get(*out, name));
            }
            result
        }
    })
}

unsafe extern "system" fn vkCreateDevice(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    with: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Device,
) -> vk::Result {
    call("vkCreateDevice", || {
        // SAFETY: as in vkCreateInstance.
        unsafe {
            let Some(link) = take_link((*info).p_next, vk::StructureType::LOADER_DEVICE_CREATE_INFO) else {
                return vk::Result::ERROR_INITIALIZATION_FAILED;
            };
            let Some(get) = (*link).get_device else { return vk::Result::ERROR_INITIALIZATION_FAILED };
            layer(|layer| layer.get_device = Some(get));
            let Some(create) = below::<vk::PFN_vkCreateDevice>("vkCreateDevice") else {
                return vk::Result::ERROR_INITIALIZATION_FAILED;
            };
            let result = create(physical, info, with, out);
            if result == vk::Result::SUCCESS {
                look_up(WRAPPED.iter().copied().chain(["vkDestroyDevice"]), |name| get(*out, name));
            }
            result
        }
    })
}

unsafe extern "system" fn vkDestroyDevice(device: vk::Device, with: *const vk::AllocationCallbacks<'_>) {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        if let Some(destroy) = below::<vk::PFN_vkDestroyDevice>("vkDestroyDevice") {
            destroy(device, with);
        }
    }
}

unsafe extern "system" fn vkDestroyInstance(instance: vk::Instance, with: *const vk::AllocationCallbacks<'_>) {
    if let Some(file) = std::env::var_os("IVV_FAULT_COUNTS") {
        let mut text = layer(|layer| format!("fault {}\n", u8::from(layer.is_given)));
        layer(|layer| layer.counts.iter().for_each(|(name, n)| text.push_str(&format!("{name} {n}\n"))));
        let _ = std::fs::write(file, text);
    }
    // SAFETY: the caller's promises are passed on.
    unsafe {
        if let Some(destroy) = below::<vk::PFN_vkDestroyInstance>("vkDestroyInstance") {
            destroy(instance, with);
        }
    }
}

/// The wrapper of `name`, if this layer has one.
///
/// # Safety
/// `name` is a string that ends with 0.
unsafe fn own(name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: the caller's promise; whoever asked casts the pointer back to the type of the name.
    unsafe {
        match CStr::from_ptr(name).to_str().ok()? {
            "vkGetInstanceProcAddr" => Some(std::mem::transmute::<
                vk::PFN_vkGetInstanceProcAddr,
                unsafe extern "system" fn(),
            >(get_instance_function)),
            "vkGetDeviceProcAddr" => Some(std::mem::transmute::<
                vk::PFN_vkGetDeviceProcAddr,
                unsafe extern "system" fn(),
            >(get_device_function)),
            "vkCreateInstance" => {
                Some(std::mem::transmute::<vk::PFN_vkCreateInstance, unsafe extern "system" fn()>(vkCreateInstance))
            }
            "vkDestroyInstance" => {
                Some(std::mem::transmute::<vk::PFN_vkDestroyInstance, unsafe extern "system" fn()>(vkDestroyInstance))
            }
            "vkCreateDevice" => {
                Some(std::mem::transmute::<vk::PFN_vkCreateDevice, unsafe extern "system" fn()>(vkCreateDevice))
            }
            "vkDestroyDevice" => {
                Some(std::mem::transmute::<vk::PFN_vkDestroyDevice, unsafe extern "system" fn()>(vkDestroyDevice))
            }
            name => table(name),
        }
    }
}

unsafe extern "system" fn get_instance_function(instance: vk::Instance, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: as the specification has it for this function.
    unsafe { own(name).or_else(|| layer(|layer| layer.get_instance).and_then(|next| next(instance, name))) }
}

unsafe extern "system" fn get_device_function(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: as the specification has it for this function.
    unsafe {
        // What the device does not have, it does not have here either.
        let next = layer(|layer| layer.get_device).and_then(|next| next(device, name))?;
        own(name).or(Some(next))
    }
}

/// Where the loader begins.
///
/// # Safety
/// The loader calls it with its own struct.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn vkNegotiateLoaderLayerInterfaceVersion(negotiation: *mut Negotiation) -> vk::Result {
    // SAFETY: the loader's promise.
    let Some(negotiation) = (unsafe { negotiation.as_mut() }) else { return vk::Result::ERROR_INITIALIZATION_FAILED };
    negotiation.version = negotiation.version.min(2);
    negotiation.get_instance = get_instance_function;
    negotiation.get_device = get_device_function;
    negotiation.get_physical_device = None;
    vk::Result::SUCCESS
}
