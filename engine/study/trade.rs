//! Speed against accuracy: what settings buy, from runs that were timed in turn, and how sure that is.

use crate::error::Result;
use crate::report::statistics::{Estimate, Spread, is_equivalent, mean, quantile};
use crate::train::Preset;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Mean PSNR, dB, within which two settings are taken for equivalent.
pub const MARGIN_DB: f64 = 0.05;
/// The same for the worst frame.
pub const WORST_MARGIN_DB: f64 = 0.3;
/// A run has reached the quality of another when its PSNR is at most this below the other's at its end, dB.
pub const QUALITY_GAP_DB: f64 = 0.5;

/// Single settings that are measured from `exact` by default: `key=value`, as `--set` takes them.
pub const KNOB_SETTINGS: [&str; 13] = [
    "frame.depth_bits=24",
    "frame.depth_bits=16",
    "frame.alpha_cut=0.0078",
    "frame.t_cut=0.001",
    "frame.t_cut=0.01",
    "frame.temporal_cut=0.0156",
    "loss.ssim_stride=2",
    "resolution.reduction=2",
    "adam=lazy",
    "moment_bits=16",
    "accumulation=fixed_point",
    "sh_degree=1",
    "sh_degree=0",
];

/// How settings come about that are compared with those of `exact`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A preset as a whole.
    Preset,
    /// One setting changed.
    Single,
    /// A preset but for one setting, which is the default's.
    Without,
}

/// Settings that are compared with others.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TradeArm {
    /// For tables, and to tell it from others.
    pub name: String,
    /// How it came about.
    pub kind: Kind,
    /// What it changes of the settings that all arms share.
    pub settings: Value,
}

/// Which arms there are.
///
/// # Errors
/// Those of [`Preset::find`].
pub fn trade_arms(presets: &[String], singles: &[(String, Value)], without: Option<&str>) -> Result<Vec<TradeArm>> {
    let mut arms = Vec::new();
    // The measure of all others comes first.
    let names =
        BTreeSet::from(["exact"]).into_iter().chain(presets.iter().map(String::as_str).filter(|n| *n != "exact"));
    for name in names {
        let Preset { id, settings, .. } = Preset::find(name)?;
        arms.push(TradeArm { name: id.name, kind: Kind::Preset, settings });
    }
    let single = |(name, settings): &(String, Value)| TradeArm {
        name: name.clone(),
        kind: Kind::Single,
        settings: settings.clone(),
    };
    arms.extend(singles.iter().map(single));
    if let Some(name) = without {
        let preset = Preset::find(name)?;
        for path in parts(&preset.settings) {
            let mut settings = preset.settings.clone();
            remove(&mut settings, &path);
            let name = format!("{} without {}", preset.id.name, path.join("."));
            arms.push(TradeArm { name, kind: Kind::Without, settings });
        }
    }
    Ok(arms)
}

/// The settings of a preset that can be taken away: each, but those of `resolution` as one.
fn parts(settings: &Value) -> Vec<Vec<String>> {
    let top = settings.as_object().into_iter().flatten();
    top.flat_map(|(key, value)| match value.as_object() {
        Some(inner) if key != "resolution" => inner.keys().map(|k| vec![key.clone(), k.clone()]).collect(),
        _ => vec![vec![key.clone()]],
    })
    .collect()
}

fn remove(settings: &mut Value, path: &[String]) {
    if let ([key, rest @ ..], Some(object)) = (path, settings.as_object_mut()) {
        match object.get_mut(key) {
            Some(inner) if !rest.is_empty() => remove(inner, rest),
            _ => drop(object.remove(key)),
        }
    }
}

/// What one run of one arm came to.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TradeRun {
    /// Seconds of each block of steps; the blocks of all arms were run in turn.
    pub block_seconds: Vec<f64>,
    /// (seconds of stepping, mean PSNR of some test views), in order.
    pub curve: Vec<[f64; 2]>,
    /// Bytes of the trainer's buffers at the end.
    pub device_bytes: u64,
    /// Gaussians at the end.
    pub gaussians: usize,
    /// Hash of all bits of the scene.
    pub scene_hash: String,
    /// Mean PSNR of the test views, dB.
    pub psnr: f64,
    /// Mean SSIM of the test views.
    pub ssim: f64,
    /// PSNR of the worst test view, dB.
    pub worst_psnr: f64,
    /// Mean over the pixels that nothing moves over of the standard deviation in time of what is wrong with them, levels of
    /// 255; where the capture tells what moves.
    pub flicker: Option<f64>,
    /// Mean end-point error of the test views' flow, pixels per frame; where the capture knows it.
    pub flow_error: Option<f64>,
    /// Root mean square error of the learnt time offsets, frames; where the capture knows them.
    pub offset_error: Option<f64>,
}

impl TradeRun {
    fn seconds(&self) -> f64 {
        self.block_seconds.iter().sum()
    }

    /// Seconds until the curve first reaches `psnr`, between its points by proportion; none when it never does.
    pub fn seconds_to(&self, psnr: f64) -> Option<f64> {
        let mut before = [0.0, f64::NEG_INFINITY];
        for point in &self.curve {
            if point[1] >= psnr {
                let part = if before[1].is_finite() { (psnr - before[1]) / (point[1] - before[1]) } else { 1.0 };
                return Some(before[0] + part * (point[0] - before[0]));
            }
            before = *point;
        }
        None
    }
}

/// What can be said of a difference to `exact`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// The scenes have the same bits.
    SameBits,
    /// Two one-sided tests at 5 % put it within the margins, mean and worst frame.
    Equivalent,
    /// Its interval of 95 % holds 0: it may be noise.
    NotDistinguishable,
    /// Lower PSNR.
    Worse,
    /// Higher PSNR.
    Better,
}

impl Effect {
    /// For tables.
    pub fn words(self) -> &'static str {
        match self {
            Effect::SameBits => "same bits",
            Effect::Equivalent => "equivalent",
            Effect::NotDistinguishable => "not distinguishable",
            Effect::Worse => "worse",
            Effect::Better => "better",
        }
    }
}

/// The largest error of a rendering, in levels of 255, the one that 0.1 % exceed, and its PSNR, dB.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct KernelError {
    /// The arm.
    pub name: String,
    /// Levels of 255.
    pub max: f64,
    /// Levels of 255.
    pub p999: f64,
    /// dB; 120 for no error.
    pub psnr: f64,
}

impl KernelError {
    /// That of the colours `found` against `truth`.
    pub fn new(name: &str, found: &[[f32; 3]], truth: &[[f64; 3]]) -> Self {
        let pairs = found.as_flattened().iter().zip(truth.as_flattened());
        let errors: Vec<f64> = pairs.map(|(found, truth)| (f64::from(*found) - truth).abs()).collect();
        let mse = mean(errors.iter().map(|e| e * e)).unwrap_or(0.0);
        let at = |q: f64| if errors.is_empty() { 0.0 } else { 255.0 * quantile(&errors, q) };
        KernelError { name: name.to_owned(), max: at(1.0), p999: at(0.999), psnr: crate::train::psnr(mse) }
    }

    /// What its PSNR is at least.
    pub(super) fn class(&self) -> &'static str {
        match self.psnr {
            p if p >= 60.0 => "60 dB",
            p if p >= 50.0 => "50 dB",
            p if p >= 40.0 => "40 dB",
            _ => "below 40 dB",
        }
    }
}

/// Where and when something was measured.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Circumstances {
    /// The device's name.
    pub device: String,
    /// Its driver with its version.
    pub driver: String,
    /// Year-month-day, UTC.
    pub date: String,
    /// [`crate::gpu::shaders_hash`].
    pub shaders: String,
    /// [`crate::gpu::spirv_hashes`].
    pub kernels: BTreeMap<String, String>,
    /// What was trained on.
    pub capture: String,
    /// Steps of each run.
    pub steps: u64,
    /// Seeds of the runs.
    pub seeds: Vec<u64>,
}

/// Everything that was measured.
pub struct Trade {
    /// Where and when.
    pub at: Circumstances,
    /// The first is what all others are compared with.
    pub arms: Vec<TradeArm>,
    /// By seed, by arm.
    pub runs: Vec<Vec<TradeRun>>,
    /// Of the arms that render in another way than SPEC 3.
    pub kernel_errors: Vec<KernelError>,
}

/// An arm against the first.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// How many times as fast a step is, over whole runs.
    pub speed: Option<Spread>,
    /// How many times sooner the quality is reached that the first arm ends with, less `QUALITY_GAP_DB`; of the seeds
    /// with which it is reached.
    pub quality_speed: Option<Spread>,
    /// Seeds with which it is reached.
    pub n_reached: usize,
    /// Mean PSNR, dB.
    pub psnr: Option<Estimate>,
    /// PSNR more than the first, dB, paired by seed.
    pub psnr_gain: Option<Estimate>,
    /// The same of the worst frame.
    pub worst_gain: Option<Estimate>,
    /// Mean SSIM.
    pub ssim: Option<Estimate>,
    /// Mean flicker.
    pub flicker: Option<Estimate>,
    /// Mean end-point error.
    pub flow_error: Option<Estimate>,
    /// Mean error of the offsets.
    pub offset_error: Option<Estimate>,
    /// Mean bytes on the device.
    pub device_bytes: Option<Estimate>,
    /// What can be said of it.
    #[serde(rename = "verdict")]
    pub effect: Option<Effect>,
}

impl Trade {
    /// Arm `index` against the first.
    pub fn comparison(&self, index: usize) -> Comparison {
        let pairs: Vec<(&TradeRun, &TradeRun)> =
            self.runs.iter().filter_map(|arms| Some((arms.get(index)?, arms.first()?))).collect();
        let mean = |value: fn(&TradeRun) -> Option<f64>| {
            Estimate::new(&pairs.iter().filter_map(|(own, _)| value(own)).collect::<Vec<_>>())
        };
        let gain = |value: fn(&TradeRun) -> f64| -> Vec<f64> {
            pairs.iter().map(|(own, first)| value(own) - value(first)).collect()
        };
        let (gains, worst_gains) = (gain(|run| run.psnr), gain(|run| run.worst_psnr));
        let to_quality = |(own, first): &(&TradeRun, &TradeRun)| {
            let target = first.curve.last()?[1] - QUALITY_GAP_DB;
            Some(first.seconds_to(target)? / own.seconds_to(target)?)
        };
        let reached: Vec<f64> = pairs.iter().filter_map(to_quality).collect();
        let psnr_gain = Estimate::new(&gains);
        let is_same = !pairs.is_empty() && pairs.iter().all(|(own, first)| own.scene_hash == first.scene_hash);
        let effect = psnr_gain.map(|gain| {
            let noise = gain.half_width.unwrap_or(f64::INFINITY);
            match gain.mean {
                _ if is_same => Effect::SameBits,
                _ if is_equivalent(&gains, MARGIN_DB) && is_equivalent(&worst_gains, WORST_MARGIN_DB) => {
                    Effect::Equivalent
                }
                mean if mean.abs() <= noise => Effect::NotDistinguishable,
                mean if mean < 0.0 => Effect::Worse,
                _ => Effect::Better,
            }
        });
        Comparison {
            speed: Spread::new(&pairs.iter().map(|(own, first)| first.seconds() / own.seconds()).collect::<Vec<_>>()),
            n_reached: reached.len(),
            quality_speed: Spread::new(&reached),
            psnr: mean(|run| Some(run.psnr)),
            psnr_gain,
            worst_gain: Estimate::new(&worst_gains),
            ssim: mean(|run| Some(run.ssim)),
            flicker: mean(|run| run.flicker),
            flow_error: mean(|run| run.flow_error),
            offset_error: mean(|run| run.offset_error),
            device_bytes: mean(|run| Some(run.device_bytes as f64)),
            effect,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use serde_json::json;

    fn run(seconds: f64, psnr: f64) -> TradeRun {
        TradeRun {
            block_seconds: vec![seconds, seconds],
            curve: vec![[0.5 * seconds, psnr - 2.0], [2.0 * seconds, psnr]],
            device_bytes: 3 << 20,
            gaussians: 10,
            scene_hash: format!("{seconds} {psnr}"),
            psnr,
            ssim: 0.9,
            worst_psnr: psnr - 3.0,
            flicker: Some(1.5),
            flow_error: None,
            offset_error: None,
        }
    }

    pub(in crate::study) fn trade(others: [[f64; 3]; 2]) -> Trade {
        let arm = |name: &str, kind| TradeArm { name: name.to_owned(), kind, settings: json!({}) };
        let seeds = [20.0, 25.0, 30.0].into_iter().enumerate();
        Trade {
            at: Circumstances {
                device: "a device".into(),
                driver: "a driver 1.2".into(),
                date: "2026-11-21".into(),
                shaders: "0123".into(),
                kernels: BTreeMap::new(),
                capture: "small".into(),
                steps: 20,
                seeds: vec![1, 2, 3],
            },
            arms: vec![arm("exact", Kind::Preset), arm("fast", Kind::Preset), arm("loss.ssim_stride=2", Kind::Single)],
            runs: seeds
                .map(|(s, psnr)| vec![run(2.0, psnr), run(0.5, psnr + others[0][s]), run(1.6, psnr + others[1][s])])
                .collect(),
            kernel_errors: vec![KernelError::new("fast", &[[0.5, 0.5, 0.75]], &[[0.5, 0.5, 0.5]])],
        }
    }

    #[test]
    fn differences_are_paired_and_told_apart_from_noise() {
        let found = trade([[-1.0, -1.1, -0.9], [0.3, -0.4, 0.2]]);
        let fast = found.comparison(1);
        assert_eq!(fast.speed, Some(Spread { median: 4.0, low: 4.0, high: 4.0 }));
        assert_eq!(fast.effect, Some(Effect::Worse));
        assert_eq!(found.comparison(2).effect, Some(Effect::NotDistinguishable));
        assert_eq!(found.comparison(0).effect, Some(Effect::SameBits));
        // It ends 1 dB below and never comes within half a dB.
        assert_eq!((fast.quality_speed, fast.n_reached), (None, 0));
        let close = trade([[0.01, 0.0, 0.02], [0.5, 0.6, 0.55]]);
        assert_eq!(close.comparison(1).effect, Some(Effect::Equivalent));
        assert_eq!(close.comparison(2).effect, Some(Effect::Better));
        assert_eq!(close.comparison(1).n_reached, 3);
        assert!((close.comparison(1).quality_speed.unwrap().median - 4.0).abs() < 0.2);
    }

    #[test]
    fn the_quality_is_reached_between_two_points() {
        let curve = vec![[1.0, 10.0], [2.0, 20.0], [3.0, 19.0]];
        let found = TradeRun { curve, ..run(1.0, 20.0) };
        assert_eq!(found.seconds_to(15.0), Some(1.5));
        assert_eq!((found.seconds_to(9.0), found.seconds_to(21.0)), (Some(1.0), None));
    }

    #[test]
    fn arms_are_the_presets_the_settings_and_what_a_preset_consists_of() {
        let presets = ["fast".to_owned(), "exact".to_owned()];
        let arms = trade_arms(&presets, &[("adam=lazy".into(), json!({ "adam": "lazy" }))], Some("fast")).unwrap();
        let names: Vec<&str> = arms.iter().map(|arm| arm.name.as_str()).collect();
        assert_eq!(names[..3], ["exact", "fast", "adam=lazy"]);
        let fast = &arms[1].settings;
        assert_eq!(names[3..].len(), parts(fast).len());
        let without = arms.iter().find(|arm| arm.name == "fast without resolution").unwrap();
        assert!(fast.get("resolution").is_some() && without.settings.get("resolution").is_none());
        let part = arms.iter().find(|arm| arm.name.ends_with("frame.t_cut")).unwrap();
        assert!(part.settings["frame"].get("t_cut").is_none() && part.settings["frame"].get("alpha_cut").is_some());
    }
}
