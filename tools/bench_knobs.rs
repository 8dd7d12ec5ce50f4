//! `ivv render --bench --each-knob`: what each knob of a frame buys on a scene, and what it changes in the pictures.

use crate::interrupt::Stop;
use crate::progress::Progress;
use crate::screen::out;
use crate::settings::patch;
use anyhow::Context;
use ivv::gpu::Gpu;
use ivv::report::Table;
use ivv::report::statistics::median;
use ivv::scene::{Splats, View};
use ivv::settings::{Constants, Knobs};
use ivv::stage::{Outputs, Renderer};
use ivv::study::{KNOB_SETTINGS, KernelError};
use ivv::train::{PRESETS, Preset, merge};
use serde_json::json;
use std::sync::Arc;
use std::time::Instant;

/// What one way to compute frames takes and changes.
#[derive(serde::Serialize)]
pub struct KnobRow {
    /// Median of a frame that stays on the device, milliseconds.
    median_ms: f64,
    /// How many times as fast as with the constants that were given, whose frames were rendered in turn with these.
    speed: f64,
    /// Bytes of device buffers.
    device_bytes: u64,
    /// Whether all numbers of all pictures are the same.
    is_same: bool,
    /// The setting, or the preset whose frames these are, and the error of the worst picture.
    #[serde(flatten)]
    error: KernelError,
}

/// The knobs of every setting that `ivv trade` measures, and of every preset.
fn ways(given: Knobs) -> anyhow::Result<Vec<(String, Knobs)>> {
    let with = |name: &str, settings: &serde_json::Value| -> anyhow::Result<Option<(String, Knobs)>> {
        let mut value = json!({ "frame": given });
        merge(&mut value, &json!({ "frame": settings["frame"] }));
        let knobs: Knobs = serde_json::from_value(value["frame"].clone()).with_context(|| name.to_owned())?;
        Ok((knobs != given).then(|| (name.to_owned(), knobs)))
    };
    let single = KNOB_SETTINGS.iter().filter(|set| set.starts_with("frame.")).map(|set| with(set, &patch(set)?));
    let presets = PRESETS.iter().map(|(name, _)| {
        let preset = Preset::find(name)?;
        if preset.settings["frame"].is_object() {
            with(&format!("frames of {name}"), &preset.settings)
        } else {
            Ok(None)
        }
    });
    single.chain(presets).filter_map(Result::transpose).collect()
}

/// Measures each of them for so many seconds against `constants`, the frames of both in turn.
pub fn run(
    gpu: &Arc<Gpu>,
    splats: &Arc<Splats>,
    constants: Constants,
    views: &[View],
    seconds: f64,
    stop: &Stop,
) -> anyhow::Result<Vec<KnobRow>> {
    let bytes = || gpu.device().memory().0.values().sum::<u64>();
    let before = bytes();
    let mut exact = Renderer::of_clip(gpu.clone(), splats.clone(), constants)?;
    let colors = |renderer: &mut Renderer| -> ivv::Result<Vec<Vec<[f32; 3]>>> {
        views.iter().map(|view| Ok(renderer.render(view, Outputs::Color)?.0.color)).collect()
    };
    let truth = colors(&mut exact)?;
    let own_bytes = bytes() - before;
    let mut own_times = Vec::new();
    let mut rows = Vec::new();
    let ways = ways(constants.knobs)?;
    let mut progress = Progress::new("frames", ways.len());
    for (name, knobs) in &ways {
        if stop.is_asked() {
            break;
        }
        let before = bytes();
        let mut other = Renderer::of_clip(gpu.clone(), splats.clone(), knobs.on(constants))?;
        let found = colors(&mut other)?;
        let device_bytes = bytes() - before;
        let errors = found.iter().zip(&truth).map(|(found, truth)| {
            let truth: Vec<[f64; 3]> = truth.iter().map(|color| color.map(f64::from)).collect();
            KernelError::new(name, found, &truth)
        });
        let error = errors.min_by(|a, b| a.psnr.total_cmp(&b.psnr)).context("no view to render")?;
        let mut times = [Vec::new(), Vec::new()];
        let begun = Instant::now();
        while times[0].is_empty() || (begun.elapsed().as_secs_f64() < seconds && !stop.is_asked()) {
            for view in views {
                for (renderer, times) in [&mut exact, &mut other].into_iter().zip(&mut times) {
                    let last = Instant::now();
                    renderer.draw(view, Outputs::Color)?;
                    times.push(1e3 * last.elapsed().as_secs_f64());
                }
            }
        }
        let [own, median_ms] = times.each_ref().map(|times| median(times));
        own_times.extend_from_slice(&times[0]);
        let is_same = found == truth;
        rows.push(KnobRow { median_ms, speed: own / median_ms, device_bytes, is_same, error });
        progress.reach(rows.len(), ways.len(), "settings");
    }
    let given = KnobRow {
        median_ms: median(&own_times),
        speed: 1.0,
        device_bytes: own_bytes,
        is_same: true,
        error: KernelError::new("as given", &[], &[]),
    };
    rows.insert(0, given);
    Ok(rows)
}

/// Prints them as a table.
pub fn print(rows: &[KnobRow]) {
    let cells = |row: &KnobRow| {
        let error = |text: String| if row.is_same { "same picture".to_owned() } else { text };
        vec![
            row.error.name.clone(),
            format!("{:.2}", row.median_ms),
            format!("{:.2}", row.speed),
            format!("{:.1}", row.device_bytes as f64 / f64::from(1 << 20)),
            error(format!("{:.1}", row.error.psnr)),
            if row.is_same { String::new() } else { format!("{:.2}", row.error.max) },
        ]
    };
    let heads = ["", "ms a frame", "speed", "MiB on the device", "PSNR, dB", "largest error, of 255"];
    out!("{}", Table::new(&heads, rows.iter().map(cells)).markdown());
}
