//! The roofline: the least time that work takes on a device with measured peaks.

use super::probe::{Probe, dispatch_ns};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::table::Cost;
use serde::Serialize;

/// Measured peak rates of a device, per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Peaks {
    /// Bytes that kernels move: of a streaming copy, read and written, or of scattered rows, whichever are more.
    pub bytes: f64,
    /// Bytes of a copy command, read and written.
    pub copied: f64,
    pub filled: f64,
    /// Scattered rows of 64 bytes.
    pub rows: f64,
    /// Float additions and multiplications, as multiply-adds.
    pub flops: f64,
    pub exp2: f64,
    /// Shuffles, one per lane.
    pub shuffles: f64,
    /// Atomic additions to scattered rows.
    pub atomics: f64,
    /// Nanoseconds of a dispatch that does next to nothing, between its timestamps.
    pub dispatch_ns: f64,
    /// The same with its barrier and label.
    pub dispatch_and_barrier_ns: f64,
}

/// The resource that limits a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    Bytes,
    Rows,
    Flops,
    Exp2,
    Shuffles,
    Atomics,
    Dispatch,
}

impl Bound {
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

impl Peaks {
    pub fn measure(gpu: &Gpu) -> Result<Self> {
        let mut rates = [0.0; Probe::ALL.len()];
        for (rate, probe) in rates.iter_mut().zip(Probe::ALL) {
            *rate = probe.rate(gpu)?;
        }
        let [streamed, copied, filled, rows, flops, exp2, shuffles, atomics] = rates;
        // Reading may be faster than writing.
        let bytes = f64::max(streamed, 64.0 * rows);
        let [dispatch_ns, dispatch_and_barrier_ns] = dispatch_ns(gpu)?;
        Ok(Peaks { bytes, copied, filled, rows, flops, exp2, shuffles, atomics, dispatch_ns, dispatch_and_barrier_ns })
    }

    /// That of a copy is [`Peaks::bytes`].
    pub fn of(&self, probe: Probe) -> f64 {
        match probe {
            Probe::Copy => self.bytes,
            Probe::Transfer => self.copied,
            Probe::Fill => self.filled,
            Probe::Gather => self.rows,
            Probe::Fma => self.flops,
            Probe::Exp2 => self.exp2,
            Probe::Shuffle => self.shuffles,
            Probe::Atomic => self.atomics,
        }
    }

    /// The least nanoseconds that `cost` takes in so many dispatches, and what binds: the slowest resource, as if all
    /// worked at once, and the dispatches after one another.
    pub fn limit(&self, cost: &Cost, dispatches: f64) -> (f64, Bound) {
        let time = |amount: f64, peak: f64| if amount > 0.0 && peak > 0.0 { 1e9 * amount / peak } else { 0.0 };
        let moved = time(cost.bytes, self.bytes) + time(cost.copied, self.copied) + time(cost.filled, self.filled);
        let resources = [
            (moved, Bound::Bytes),
            (time(cost.rows, self.rows), Bound::Rows),
            (time(cost.flops, self.flops), Bound::Flops),
            (time(cost.exp2, self.exp2), Bound::Exp2),
            (time(cost.shuffles, self.shuffles), Bound::Shuffles),
            (time(cost.atomics, self.atomics), Bound::Atomics),
        ];
        let slowest = resources.into_iter().fold((0.0, Bound::Dispatch), |a, b| if b.0 > a.0 { b } else { a });
        let dispatch = dispatches * self.dispatch_ns;
        (slowest.0 + dispatch, if dispatch > slowest.0 { Bound::Dispatch } else { slowest.1 })
    }
}
