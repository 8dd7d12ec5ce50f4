//! The validation layer's voice: every message is counted and logged, so that a test can fail on any.

use ash::{ext, vk};
use std::ffi::{CStr, c_void};
use std::sync::Mutex;

#[derive(Debug, Default)]
pub struct Validation {
    messages: Mutex<Vec<String>>,
}

impl Validation {
    /// Warnings and errors so far, in order; empty means silence.
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().map(|messages| messages.clone()).unwrap_or_default()
    }

    fn push(&self, message: String) {
        tracing::error!(target: "vulkan", "{message}");
        if let Ok(mut messages) = self.messages.lock() {
            messages.push(message);
        }
    }
}

/// The messenger that feeds `validation`; the caller keeps `validation` alive as long as the instance.
pub(super) fn messenger_info(validation: &Validation) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(validation).cast_mut().cast())
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the loader passes a valid callback record, and `user` is the `Validation` that outlives the instance.
    let (text, validation) = unsafe {
        let message = (*data).p_message;
        let text = if message.is_null() { "".into() } else { CStr::from_ptr(message).to_string_lossy() };
        (text, &*user.cast::<Validation>())
    };
    validation.push(format!("{severity:?}: {text}"));
    vk::FALSE
}

pub(super) fn name_object<T: vk::Handle>(debug: Option<&ext::debug_utils::Device>, object: T, name: &str) {
    let Some(debug) = debug else { return };
    let Ok(name) = std::ffi::CString::new(name) else { return };
    let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
    // SAFETY: `object` is a live handle of the device that `debug` belongs to. A failure loses a name, nothing else.
    let _ = unsafe { debug.set_debug_utils_object_name(&info) };
}
