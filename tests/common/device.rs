//! The one device of a test run, watched by the validation layer. Lanes choose it through the environment:
//! `IVV_TEST_DEVICE`, `IVV_TEST_NO_PUSH_DESCRIPTORS`, `IVV_TEST_SYNC_VALIDATION`, and the drivers' own variables.

use ivv::gpu::{Gpu, Options};
use ivv::vk::DeviceChoice;
use std::sync::{Arc, OnceLock};

/// The device for the length of a test; at its end the validation layer must have been silent.
pub struct Watched(Arc<Gpu>);

impl std::ops::Deref for Watched {
    type Target = Arc<Gpu>;
    fn deref(&self) -> &Arc<Gpu> {
        &self.0
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(self.0.device().validation().messages(), Vec::<String>::new(), "the validation layer spoke");
        }
    }
}

/// The device of this lane, with validation on and new buffers poisoned.
pub fn gpu() -> Watched {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| Arc::new(Gpu::open(&options()).expect("a Vulkan device and the validation layer")));
    Watched(gpu.clone())
}

/// How this lane opens its device.
pub fn options() -> Options {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| value != "0");
    Options {
        device: DeviceChoice {
            device: std::env::var("IVV_TEST_DEVICE").ok(),
            validation: true,
            sync_validation: set("IVV_TEST_SYNC_VALIDATION"),
            no_push_descriptors: set("IVV_TEST_NO_PUSH_DESCRIPTORS"),
            pipeline_cache: None,
        },
        poison: true,
    }
}
