//! The device of a verb, as options.

use crate::ui::screen::say;
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::vk::DeviceChoice;
use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(clap::Args, Clone, Default)]
pub struct DeviceArgs {
    /// The device: an index or part of a name from `ivv devices`.
    #[arg(long)]
    device: Option<String>,
    /// Subgroup size of the kernels, if the device supports several. By default what suits the hardware.
    #[arg(long, value_name = "LANES")]
    subgroup_size: Option<u32>,
    /// Records each pass as it begins, so that the error of a lost device names the pass. Slower on a GPU.
    #[arg(long)]
    breadcrumbs: bool,
}

impl DeviceArgs {
    /// Opens the device, and prints its name and why it was chosen.
    pub fn open(&self) -> ivv::Result<Arc<Gpu>> {
        self.open_with(Vec::new(), false)
    }

    /// The choice alone, without the cache of pipelines.
    pub fn choice(&self) -> DeviceChoice {
        DeviceChoice {
            device: self.device.clone(),
            subgroup_size: self.subgroup_size,
            breadcrumbs: self.breadcrumbs,
            ..DeviceChoice::default()
        }
    }

    /// As [`DeviceArgs::open`]; if the options name none, the `nth` of several equal ones.
    pub fn open_nth(&self, nth: usize) -> ivv::Result<Arc<Gpu>> {
        self.open_choice(DeviceChoice { pipeline_cache: cache_folder(), nth, ..self.choice() })
    }

    /// As [`DeviceArgs::open`], with the extensions `surface` for windows, and with the validation layer, which writes to the log.
    pub fn open_with(&self, surface: Vec<&'static CStr>, validation: bool) -> ivv::Result<Arc<Gpu>> {
        self.open_choice(DeviceChoice { pipeline_cache: cache_folder(), surface, validation, ..self.choice() })
    }

    fn open_choice(&self, choice: DeviceChoice) -> ivv::Result<Arc<Gpu>> {
        let gpu = Arc::new(Gpu::open(&Options { device: choice, ..Options::default() })?);
        say!("device: {} ({})", gpu.caps().name, gpu.chosen_because());
        Ok(gpu)
    }
}

/// `$XDG_CACHE_HOME/ivv` or `~/.cache/ivv`.
pub fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"))).map(|c| c.join("ivv"))
}
