//! Chrome's trace format, which Perfetto opens: what the host did, and the passes of the device below it.

use crate::gpu::PassTime;
use serde_json::{Value, json};

#[derive(Clone, Debug)]
pub struct Moment {
    pub name: String,
    /// Seconds since the trace began.
    pub begin: f64,
    pub seconds: f64,
    /// Passes of the device meanwhile, if it was waited for, by its own clock: the one that ends last is taken to end with the waiting.
    pub passes: Vec<PassTime>,
}

/// The trace of `moments` on a device called `device`.
pub fn trace(device: &str, moments: &[Moment]) -> Value {
    let named =
        |pid: u32, name: &str| json!({ "ph": "M", "name": "process_name", "pid": pid, "args": { "name": name } });
    let span = |pid: u32, category: &str, name: &str, begin: f64, seconds: f64| {
        json!({
            "ph": "X", "name": name, "cat": category, "pid": pid, "tid": 0, "ts": 1e6 * begin, "dur": 1e6 * seconds,
        })
    };
    let mut events = vec![named(0, "host"), named(1, device)];
    for moment in moments {
        events.push(span(0, "host", &moment.name, moment.begin, moment.seconds));
        // Passes that need not wait for each other end in any order.
        let end = moment.passes.iter().map(|pass| pass.begin_ns + pass.ns).fold(0.0, f64::max);
        let zero = moment.begin + moment.seconds - 1e-9 * end;
        for pass in &moment.passes {
            let (section, kernel) = pass.label.split_once('/').unwrap_or(("", &pass.label));
            events.push(span(1, section, kernel, zero + 1e-9 * pass.begin_ns, 1e-9 * pass.ns));
        }
    }
    json!({ "displayTimeUnit": "ms", "traceEvents": events })
}
