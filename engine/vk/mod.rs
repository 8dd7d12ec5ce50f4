//! A thin owner of Vulkan: the only module with `ash` and the only one with unsafe code. It knows devices, buffers,
//! pipelines and command streams, and no word of the domain.
//!
//! Safety in one paragraph: every Vulkan object is created and destroyed by the struct that owns it, each such struct
//! holds an `Arc` of [`Device`], and a [`Device`] is destroyed last. Command streams keep the buffers and pipelines they
//! use alive until the timeline says that the device is done with them.
#![allow(unsafe_code)]

mod buffer;
mod cache;
mod caps;
mod choose;
mod command;
mod debug;
mod device;
mod instance;
mod pipeline;
mod probe;
mod statistics;
#[cfg(feature = "window")]
mod swapchain;

pub use buffer::{Buffer, Location};
pub use caps::{Caps, DeviceKind};
pub(crate) use command::Submission;
pub use command::{Binding, Commands, Groups};
pub use device::Device;
pub use instance::{DeviceChoice, list_devices};
pub use pipeline::{BindingKind, Pipeline, PipelineDesc};
pub use statistics::{Compiler, Executable};
#[cfg(feature = "window")]
pub use swapchain::{Swapchain, WindowHandle, surface_extensions};

use crate::error::Error;
use ash::vk;

/// Names a failed Vulkan call; out-of-memory and lost devices keep their meaning.
fn vk_error(call: &'static str) -> impl FnOnce(vk::Result) -> Error {
    move |result| match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::DriverOutOfMemory { call, of: "the device" },
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::DriverOutOfMemory { call, of: "the host" },
        vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { after_pass: String::new() },
        other => Error::Vulkan { call, reason: format!("{other:?}") },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A call that is no allocation knows neither a need nor a limit.
    #[test]
    fn memory_that_runs_out_in_a_call_is_told_without_numbers() {
        for (result, of) in [
            (vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, "the device is out of memory"),
            (vk::Result::ERROR_OUT_OF_HOST_MEMORY, "the host is out of memory"),
        ] {
            let error = vk_error("vkCreateBuffer")(result);
            let told = error.to_string();
            assert_eq!(error.exit_code(), 5);
            assert!(told.contains("vkCreateBuffer") && told.contains(of), "{told}");
            assert!(!told.contains("limit is 0"), "{told}");
        }
    }
}
