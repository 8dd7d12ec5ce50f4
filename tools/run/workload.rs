//! The memory that a training needs.

use ivv::internals::gpu::Gpu;
use ivv::internals::scene::capture::Capture;
use ivv::internals::train::{Config, ImageMemory, Limits, Setup, Workload};
use ivv::internals::vk::DeviceKind;

/// A training with the most Gaussians that `config` allows, all dynamic in a clip, and `cache_bytes` of decoded images; and the
/// device's limits.
pub fn work(capture: &Capture, config: &Config, gpu: &Gpu, cache_bytes: u64) -> ivv::Result<(Workload, Limits)> {
    let n = config.max_gaussians as u64;
    let n_dynamic = if capture.n_frames > 1 { n } else { 0 };
    let memory = ImageMemory { cache_bytes, device_bytes: None };
    let work = Workload::of(capture, config, &Setup::new(capture, config), n, n_dynamic, gpu, memory)?;
    let caps = gpu.caps();
    let is_host = caps.kind == DeviceKind::Cpu;
    Ok((work, Limits { binding_bytes: caps.max_binding_bytes, memory_bytes: caps.budget_bytes, is_host }))
}
