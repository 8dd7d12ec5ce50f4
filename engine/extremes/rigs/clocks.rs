//! Steps of the cameras' clocks, on the device.

use crate::error::Result;
use crate::gpu::generated::Status;
use crate::gpu::{Gpu, Recording};
use crate::stage::{ClockStep, Clocks};
use crate::twin::{Clock, ClockRule};

/// Some steps of `clocks` with the given gradients by normalised time; the offsets after each.
///
/// # Errors
/// Those of the device.
pub fn on_device(
    gpu: &Gpu,
    start: &[Clock],
    steps: &[(usize, f32)],
    rule: &ClockRule,
    dt: f64,
    fails: impl Fn(usize) -> bool,
) -> Result<Vec<Vec<f64>>> {
    let state: Vec<[f32; 4]> = start.iter().map(|c| [c.offset as f32, c.first as f32, c.second as f32, 0.0]).collect();
    let free: Vec<bool> = start.iter().map(|c| c.is_free).collect();
    let clocks = Clocks::new(gpu, &state, &free)?;
    let mut found = Vec::new();
    for (i, (camera, gradient)) in steps.iter().enumerate() {
        let status = Status { failed: u32::from(fails(i)) * 2, ..Status::default() };
        let status = gpu.upload("status", &[status])?;
        let total = gpu.upload("total", &[[7.0, 7.0, 7.0, *gradient], [7.0; 4], [7.0; 4]])?;
        let mut rec = Recording::new();
        let &ClockRule { rate, regulariser, .. } = rule;
        let at = ClockStep { camera: *camera as u32, dt, rate, regulariser, step: i as u64 + 1 };
        clocks.record_step(&mut rec, &total, &status, &at);
        gpu.run(&rec)?;
        found.push(gpu.read(&clocks.state)?.iter().map(|c| f64::from(c[0])).collect());
    }
    Ok(found)
}
