//! The device of a verb, as options.

use crate::ui::screen::say;
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::vk::DeviceChoice;
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
    pub fn open(&self) -> ivv::Result<Arc<Gpu>> {
        self.open_as(self.choice())
    }

    pub fn choice(&self) -> DeviceChoice {
        DeviceChoice {
            device: self.device.clone(),
            subgroup_size: self.subgroup_size,
            breadcrumbs: self.breadcrumbs,
            ..DeviceChoice::default()
        }
    }

    pub fn open_as(&self, choice: DeviceChoice) -> ivv::Result<Arc<Gpu>> {
        let device = DeviceChoice { pipeline_cache: cache_folder(), ..choice };
        let gpu = Arc::new(Gpu::open(&Options { device, ..Options::default() })?);
        say!("device: {} ({})", gpu.caps().name, gpu.chosen_because());
        Ok(gpu)
    }
}

/// `$XDG_CACHE_HOME/ivv` or `~/.cache/ivv`.
fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"))).map(|c| c.join("ivv"))
}
