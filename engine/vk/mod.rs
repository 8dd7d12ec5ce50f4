//! A thin owner of Vulkan: the only module with `ash` and the only one with unsafe code. It knows devices, buffers,
//! pipelines and command streams, and no word of the domain.
//!
//! Safety in one paragraph: every Vulkan object is created and destroyed by the struct that owns it, each such struct
//! holds an `Arc` of [`Device`], and a [`Device`] is destroyed last. Command streams keep the buffers and pipelines they
//! use alive until the timeline says that the device is done with them.
#![allow(unsafe_code)]

mod buffer;
mod caps;
mod command;
mod debug;
mod device;
mod pipeline;

pub use buffer::{Buffer, Location};
pub use caps::{Caps, DeviceKind};
pub use command::{Binding, Commands, Done, Submission};
pub use debug::Validation;
pub use device::{Device, DeviceChoice, list_devices};
pub use pipeline::{BindingKind, Pipeline, PipelineDesc};

use crate::error::Error;
use ash::vk;

/// Names a failed Vulkan call; out-of-memory and lost devices keep their meaning.
fn vk_error(call: &'static str) -> impl FnOnce(vk::Result) -> Error {
    move |result| match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::OutOfMemory {
            what: call.to_owned(),
            needed: 0,
            limit: 0,
            remedy: "choose a device with more memory or a smaller scene or picture".to_owned(),
        },
        vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { after_pass: String::new() },
        other => Error::Vulkan { call, reason: format!("{other:?}") },
    }
}
