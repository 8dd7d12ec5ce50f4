//! Before the first step of `ivv train` and after its last: the first Gaussians, the memory plan, the way back to the
//! capture's own frame.

use crate::progress::Progress;
use crate::screen::say;
use ivv::scene::capture::{Capture, PriorPlan};
use ivv::scene::{Similarity, Splats, write_ply};
use ivv::train::{
    Config, DepthSummary, INTERSECTIONS_PER_GAUSSIAN, Initial, Limits, Plan, Setup, Workload, fit_depths, initialise,
};
use ivv::vk::{Caps, DeviceKind};
use std::path::Path;

/// Threads that read depth priors.
const THREADS: usize = 2;

/// The first Gaussians of a run in the frame of training, and a line about where they come from.
pub fn first_gaussians(capture: &Capture, config: &Config) -> ivv::Result<Splats> {
    let initial = begin(capture, config)?;
    say!("initialised {initial}");
    Ok(initial.splats)
}

/// The first Gaussians in the frame of training, with a line of progress.
pub fn begin(capture: &Capture, config: &Config) -> ivv::Result<Initial> {
    let mut progress = Progress::new("initialisation", 0);
    initialise(capture, config, &mut |done, total| progress.reach(done, total, "frames, pictures or depths"))
}

/// Which priors a run uses, with a line about those of the depth and what it says.
pub fn priors(capture: &Capture, config: &Config, setup: &Setup) -> ivv::Result<(PriorPlan, Option<DepthSummary>)> {
    let mut plan = PriorPlan { flow: setup.has_priors && config.loss.flow > 0.0, ..PriorPlan::default() };
    let has_depth = capture.cameras.iter().flat_map(|camera| &camera.shots).any(|shot| shot.depth.is_some());
    if !(has_depth && config.loss.depth > 0.0) {
        return Ok((plan, None));
    }
    let mut progress = Progress::new("depth priors", 0);
    let space = config.loss.depth_space;
    let fits = fit_depths(capture, space, THREADS, &mut |done, total| progress.reach(done, total, "frames"))?;
    let usable = fits.iter().filter_map(|(image, fit)| Some((image, fit.ok()?)));
    plan.depth = usable.map(|(image, fit)| (image, [fit.scale, fit.shift])).collect();
    let summary = fits.summary();
    say!("{summary}");
    Ok((plan, Some(summary)))
}

/// What a run that begins with `splats` needs.
pub fn plan(capture: &Capture, config: &Config, setup: &Setup, splats: &Splats, caps: &Caps, cache_bytes: u64) -> Plan {
    let pixels = capture.cameras.iter().map(|camera| u64::from(camera.width) * u64::from(camera.height));
    let work = Workload {
        gaussians: splats.len() as u64,
        dynamic: splats.motion.len() as u64,
        max_gaussians: config.max_gaussians as u64,
        intersections_per_gaussian: INTERSECTIONS_PER_GAUSSIAN,
        pixels: pixels.max().unwrap_or(0),
        sh_degree: config.sh_degree,
        moment_bits: config.moment_bits,
        cache_bytes,
        priors: setup.has_priors,
        offsets: !setup.learns_offset.is_empty(),
        grids: setup.has_grid.iter().filter(|has| **has).count() as u64,
        height: capture.cameras.iter().map(|camera| camera.height).max().unwrap_or(0),
    };
    let is_host = caps.kind == DeviceKind::Cpu;
    Plan::new(&work, &Limits { binding_bytes: caps.max_binding_bytes, memory_bytes: caps.heap_bytes, is_host })
}

/// Writes the Gaussians of a run in the capture's own frame, and returns them; `world` led from there to the frame of
/// training.
pub fn write_scene(path: &Path, splats: &Splats, world: &Similarity) -> ivv::Result<Splats> {
    if !world.is_exact_in_f32() {
        tracing::warn!(
            "{}: the capture lies so far from its origin that single precision rounds positions there visibly; the \
             checkpoints and the renders are exact. Move the capture to its origin to get an exact file",
            path.display()
        );
    }
    let splats = world.inverse().splats(splats);
    write_ply(path, &splats)?;
    Ok(splats)
}
