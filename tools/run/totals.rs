//! `train.json`: the totals of a run.

use crate::run::scoring::Scorer;
use ivv::internals::scene::Splats;
use ivv::internals::stage::PassReport;
use ivv::internals::train::{Kind, Log};
use serde_json::{Value, json};

/// All passes with the same label.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct TimedPass {
    /// Section and kernel.
    pub label: String,
    pub dispatches: f64,
    /// Units of work in all.
    pub units: f64,
    /// Milliseconds in all.
    pub ms: f64,
}

impl From<&PassReport> for TimedPass {
    fn from(report: &PassReport) -> Self {
        let (dispatches, ms) = (report.dispatches as f64, report.ns / 1e6);
        TimedPass { label: report.label.clone(), dispatches, units: report.units, ms }
    }
}

/// The mean of `n` profiles, by label in order of appearance.
fn mean(passes: impl IntoIterator<Item = TimedPass>, n: usize) -> Vec<TimedPass> {
    let mut sum: Vec<TimedPass> = Vec::new();
    for pass in passes {
        match sum.iter_mut().find(|line| line.label == pass.label) {
            Some(line) => {
                line.dispatches += pass.dispatches;
                line.units += pass.units;
                line.ms += pass.ms;
            }
            None => sum.push(pass),
        }
    }
    let part = 1.0 / n.max(1) as f64;
    let mean = |TimedPass { label, dispatches, units, ms }| TimedPass {
        label,
        dispatches: part * dispatches,
        units: part * units,
        ms: part * ms,
    };
    sum.into_iter().map(mean).collect()
}

/// A profiled step in train.jsonl.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct ProfiledStep {
    pub step: u64,
    pub passes: Vec<TimedPass>,
    pub bytes_by_buffer: std::collections::BTreeMap<String, u64>,
}

/// The totals of a run of `steps_done` steps, but for times and scores.
pub fn totals(scorer: &Scorer, steps_done: u64, splats: &Splats, log: &Log) -> anyhow::Result<Value> {
    let Scorer { gpu, run, config, .. } = scorer;
    let summary = splats.summary();
    let lines = log.lines(Kind::Profile).map(|line| serde_json::from_value::<ProfiledStep>(line.clone()));
    let mut profiled: Vec<ProfiledStep> = lines.collect::<Result<_, _>>()?;
    let steps: Vec<u64> = profiled.iter().map(|p| p.step).collect();
    let bytes_by_buffer = profiled.last_mut().map(|p| std::mem::take(&mut p.bytes_by_buffer));
    let passes = mean(profiled.into_iter().flat_map(|p| p.passes), steps.len());
    let ms = passes.iter().map(|pass| pass.ms).reduce(|sum, ms| sum + ms);
    Ok(json!({
        "version": env!("CARGO_PKG_VERSION"),
        // Set by the project's scripts when they build.
        "revision": option_env!("IVV_REVISION").filter(|revision| !revision.is_empty()),
        "device": gpu.caps(),
        "capture": { "path": run.capture, "held": run.held },
        "preset": config.preset,
        "steps": steps_done,
        "gaussians": summary.n,
        "dynamic_gaussians": summary.n_dynamic,
        "sh_degree": summary.sh_degree,
        "scene_bytes": summary.parameter_bytes,
        "peak_bytes": gpu.device().memory().1,
        "host_peak_bytes": host_peak_bytes(),
        "bytes_by_buffer": bytes_by_buffer,
        "profile": { "steps": steps, "ms": ms, "passes": passes },
    }))
}

/// Peak memory of this process, including a software driver; `None` except on Linux.
fn host_peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?)
}

/// CPU time of this process over all threads, with a software driver; `None` except on Linux. Depends less on load than wall time.
pub fn cpu_seconds() -> Option<f64> {
    // Linux counts in hundredths of a second here, whatever its clock rate.
    const TICKS: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The program's name is in brackets and may contain anything; user and system time are the 12th and 13th fields after it.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |index: usize| fields.get(index)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS)
}
