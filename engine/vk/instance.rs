//! The instance, the devices that it sees, and the choice among them.

use super::caps::{Caps, DeviceKind};
use super::debug::{Validation, messenger_info};
use super::probe::probe;
use super::vk_error;
use crate::error::{Error, Result};
use ash::{Entry, ext, khr, vk};
use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::Arc;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Which device to take and how to watch it.
#[derive(Clone, Debug, Default)]
pub struct DeviceChoice {
    /// Index in [`list_devices`]'s order or part of a name; a number past the last index is a whole word of a name. Empty prefers a
    /// GPU and takes a CPU device as the last.
    pub device: Option<String>,
    /// Where no device is named: which of those that are like the preferred one, from 0; past the last it begins again.
    pub nth: usize,
    /// Turn the validation layer on; an error if it is not installed.
    pub validation: bool,
    /// Let it check synchronisation as well.
    pub sync_validation: bool,
    /// Do without push descriptors even where they exist, to test the other path.
    #[doc(hidden)]
    pub no_push_descriptors: bool,
    /// Note each pass as it begins, so that [`Error::DeviceLost`](crate::Error::DeviceLost) names the last one. A GPU may wait
    /// between passes for it.
    pub breadcrumbs: bool,
    /// The folder in which compiled pipelines are kept between runs, in a file for each device and driver.
    pub pipeline_cache: Option<PathBuf>,
    /// Lanes of the subgroups that kernels run with; by default what suits the hardware.
    pub subgroup_size: Option<u32>,
    /// Instance extensions for the surfaces of windows; where there are any, the device can show pictures in them.
    #[doc(hidden)]
    pub surface: Vec<&'static CStr>,
}

pub(super) struct Instance {
    pub(super) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Boxed: the messenger holds its address.
    pub(super) validation: Arc<Validation>,
    pub(super) has_debug_utils: bool,
    // Last: the loader's library must outlive everything made from it.
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
        let install = "install the Vulkan loader and a driver (Debian: libvulkan1 mesa-vulkan-drivers)";
        let no_loader = |reason: String| Error::no_device(reason, install);
        let mend = "check that the files named by VK_DRIVER_FILES or VK_ICD_FILENAMES, or those in /usr/share/vulkan/icd.d, are \
                    the JSON that came with the drivers";
        // The loader says that memory is short, too, when it cannot parse the file of a driver.
        let no_driver = |what: &str, fault: vk::Result| {
            let reason =
                format!("the Vulkan loader cannot list its {what} ({fault:?}): the file of a driver may be damaged");
            Error::no_device(reason, mend)
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
        let wants_validation = choice.validation || choice.sync_validation;
        if wants_validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            let reason = "the validation layer was asked for and is not installed";
            return Err(Error::no_device(reason, "install it (Debian: vulkan-validationlayers) or run without it"));
        }
        let has_debug_utils = wants_validation || extensions.iter().any(|e| named(e, ext::debug_utils::NAME));
        let layer_names: Vec<_> = wants_validation.then_some(VALIDATION_LAYER.as_ptr()).into_iter().collect();
        // Without this, drivers over other interfaces (MoltenVK) are not listed.
        let lists_portability = extensions.iter().any(|e| named(e, khr::portability_enumeration::NAME));
        let portability = lists_portability.then_some(&khr::portability_enumeration::NAME);
        let flags = portability.map(|_| vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR).unwrap_or_default();
        let debug_utils = has_debug_utils.then_some(&ext::debug_utils::NAME);
        let extension_names: Vec<_> =
            debug_utils.into_iter().chain(portability).chain(&choice.surface).map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default()
            .application_name(c"ivv")
            .engine_name(c"ivv")
            .api_version(vk::API_VERSION_1_2);
        let validation = Arc::new(Validation::default());
        let mut messenger_create = messenger_info(&validation);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
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
        let mut instance = Instance { raw, messenger: None, validation, has_debug_utils, entry };
        if wants_validation {
            let debug = ext::debug_utils::Instance::new(&instance.entry, &instance.raw);
            // SAFETY: as above.
            let messenger = unsafe { debug.create_debug_utils_messenger(&messenger_info(&instance.validation), None) }
                .map_err(vk_error("vkCreateDebugUtilsMessengerEXT"))?;
            instance.messenger = Some((debug, messenger));
        }
        Ok(Arc::new(instance))
    }

    /// Usable devices with their capabilities, and the reasons against the others, in the loader's order.
    fn devices(&self, subgroup_size: Option<u32>) -> Result<Vec<std::result::Result<Found, String>>> {
        // SAFETY: plain query.
        let all = unsafe { self.raw.enumerate_physical_devices() }.map_err(|e| {
            let remedy = "install a Vulkan driver (Debian: mesa-vulkan-drivers)";
            Error::no_device(format!("vkEnumeratePhysicalDevices: {e:?}"), remedy)
        })?;
        Ok(all.into_iter().map(|physical| probe(&self.raw, physical, subgroup_size)).collect())
    }

    pub(super) fn pick(&self, choice: &DeviceChoice) -> Result<(Found, String)> {
        pick(self.devices(choice.subgroup_size)?, choice.device.as_deref(), choice.nth)
    }
}

pub(super) struct Found {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue_family: u32,
    pub(super) caps: Caps,
    pub(super) pipeline_cache_uuid: [u8; vk::UUID_SIZE],
}

/// The devices of this machine: capabilities, or the reason why one cannot run the engine.
pub fn list_devices() -> Result<Vec<std::result::Result<Caps, String>>> {
    let instance = Instance::new(&DeviceChoice::default())?;
    Ok(instance.devices(None)?.into_iter().map(|found| found.map(|f| f.caps)).collect())
}

/// The device that `wanted` names among `devices`, or else the `nth` of those like the best, and the reason.
fn pick(devices: Vec<std::result::Result<Found, String>>, wanted: Option<&str>, nth: usize) -> Result<(Found, String)> {
    let listed = devices.iter().enumerate().map(|(i, device)| match device {
        Ok(found) => format!("{i}: {}", found.caps.name),
        Err(why) => format!("{i}: unusable ({why})"),
    });
    let (n_devices, listed) = (devices.len(), listed.collect::<Vec<_>>().join("; "));
    let mut usable: Vec<(usize, Found)> =
        devices.into_iter().enumerate().filter_map(|(i, device)| Some((i, device.ok()?))).collect();
    if let Some(wanted) = wanted {
        let place = match wanted.parse::<usize>() {
            Ok(index) if index < n_devices => usable.iter().position(|(i, _)| *i == index),
            // Not an index but a word of a name, as in `RTX 4090`. It must be a whole word: else a 4 that asks for a fifth device
            // would find this one.
            Ok(_) => usable.iter().position(|(_, found)| found.caps.name.split_whitespace().any(|word| word == wanted)),
            Err(_) => {
                let lower = wanted.to_lowercase();
                usable.iter().position(|(_, found)| found.caps.name.to_lowercase().contains(&lower))
            }
        };
        let remedy = "give an index or part of a name from `ivv devices`";
        let at = place.ok_or_else(|| Error::no_device(format!("`{wanted}` matches none of: {listed}"), remedy))?;
        return Ok((usable.swap_remove(at).1, "asked for".to_owned()));
    }
    let Some((_, best)) = usable.iter().min_by_key(|(i, found)| (found.caps.kind, *i)) else {
        let reason = if n_devices == 0 { "the loader lists none".to_owned() } else { listed };
        return Err(Error::no_device(reason, "install a Vulkan 1.2 driver (Debian: mesa-vulkan-drivers)"));
    };
    let why = if best.caps.kind == DeviceKind::Cpu { "no GPU was found" } else { "a GPU is preferred" };
    let is_like = |at: &usize| usable[*at].1.caps.name == best.caps.name;
    let like: Vec<usize> = (0..usable.len()).filter(is_like).collect();
    let number = nth % like.len();
    let why = if like.len() == 1 { why.to_owned() } else { format!("{why}; number {number} of {}", like.len()) };
    Ok((usable.swap_remove(like[number]).1, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn caps(name: &str, kind: DeviceKind) -> Caps {
        Caps { name: name.to_owned(), kind, ..Caps::default() }
    }

    /// Devices with these capabilities, the second unusable.
    fn devices(caps: [&Caps; 2]) -> Vec<std::result::Result<Found, String>> {
        let (physical, queue_family, pipeline_cache_uuid) = (vk::PhysicalDevice::null(), 0, [0; vk::UUID_SIZE]);
        let found = |caps: &Caps| Found { physical, queue_family, caps: caps.clone(), pipeline_cache_uuid };
        vec![Ok(found(caps[0])), Err("old".to_owned()), Ok(found(caps[1]))]
    }

    fn name_of(devices: Vec<std::result::Result<Found, String>>, wanted: Option<&str>) -> String {
        pick(devices, wanted, 0).map(|(found, _)| found.caps.name).unwrap()
    }

    #[test]
    fn a_gpu_is_preferred_and_a_cpu_taken_when_named_or_alone() {
        let (cpu, gpu) = (caps("llvmpipe", DeviceKind::Cpu), caps("Radeon", DeviceKind::DiscreteGpu));
        let all = || devices([&cpu, &gpu]);
        let first = |n: usize| all().into_iter().take(n).collect::<Vec<_>>();
        assert_eq!(
            [None, Some("llvm"), Some("0")].map(|wanted| name_of(all(), wanted)),
            ["Radeon", "llvmpipe", "llvmpipe"]
        );
        let (alone, why) = pick(first(2), None, 3).unwrap();
        assert_eq!((&*alone.caps.name, &*why), ("llvmpipe", "no GPU was found"));
        let unusable = || first(2).split_off(1);
        for (devices, wanted) in [(all(), Some("1")), (all(), Some("arc")), (unusable(), None)] {
            assert_eq!(pick(devices, wanted, 0).err().map(|error| error.exit_code()), Some(4), "{wanted:?}");
        }
    }

    #[test]
    fn a_number_past_the_last_device_is_a_word_of_a_name() {
        let (cpu, gpu) = (caps("llvmpipe", DeviceKind::Cpu), caps("NVIDIA GeForce RTX 4090", DeviceKind::DiscreteGpu));
        let all = || devices([&cpu, &gpu]);
        assert_eq!(name_of(all(), Some("4090")), gpu.name);
        assert_eq!(name_of(all(), Some("0")), cpu.name, "an index comes first, though it is in a name too");
        // An index of a device that cannot be used, and one of none: not what has that digit in its name.
        for wanted in ["1", "4", "90"] {
            assert_eq!(pick(all(), Some(wanted), 0).err().map(|error| error.exit_code()), Some(4), "{wanted}");
        }
    }
}
