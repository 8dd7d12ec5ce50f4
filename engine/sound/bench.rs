//! Renderings against what is true: errors of direction and level, the paper's ablation, and speed against accuracy.

use std::path::Path;
use std::time::Instant;

use glam::{DQuat, DVec3};

use super::FS;
use super::geometry::Mode;
use super::hrtf::{HrtfSet, Lookup};
use super::metrics::{Localiser, level_db, lsd_db, splatter_db, wrap_degrees};
use super::pose::{HeadPose, PoseTrack};
use super::render::{RenderConfig, SPEED_OF_SOUND, render_signals};
use super::scene_file::SoundScene;
use super::simulate::{Motion, Simulated, simulate};
use crate::error::{Error, Result};
use crate::report::statistics::{mean, quantile};

/// Samples over which direction and level are judged.
const FRAME: usize = 4096;

/// How far a rendering is from the truth.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Mean error of azimuth, degrees.
    pub azimuth: f64,
    /// 95th percentile of it.
    pub azimuth_95: f64,
    /// Mean error of level, decibels.
    pub level: f64,
    /// Frames that were judged.
    pub frames: usize,
}

/// Compares what a template localiser hears in a rendering and in the truth, frame by frame.
///
/// `late` is by how many seconds the truth is later than the rendering at a time; the paper's modes leave that out.
///
/// # Errors
/// [`Error::Data`] where no frame of both holds sound.
pub fn compare(
    rendered: &[[f32; 2]],
    truth: &[[f32; 2]],
    hrtf: &HrtfSet,
    late: impl Fn(f64) -> f64,
) -> Result<Difference> {
    let mut localiser = Localiser::new(hrtf, FRAME);
    let (mut azimuths, mut levels) = (Vec::new(), Vec::new());
    // Nothing was said before the recording began, so its first moments are no matter.
    for start in (FRAME / 2..rendered.len().saturating_sub(FRAME)).step_by(FRAME / 2) {
        let middle = (start + FRAME / 2) as f64 / f64::from(FS);
        let there = start as f64 + late(middle) * f64::from(FS);
        if there < 0.0 || there as usize + FRAME > truth.len() {
            continue;
        }
        let (heard, meant) = (
            &rendered[start..start + FRAME],
            &truth[there.round() as usize..][..FRAME.min(truth.len() - there.round() as usize)],
        );
        if let (Some(a), Some(b)) = (localiser.azimuth(heard), localiser.azimuth(meant)) {
            azimuths.push(wrap_degrees(a - b).abs());
            levels.push((level_db(heard) - level_db(meant)).abs());
        }
    }
    if azimuths.is_empty() {
        return Err(Error::data(
            Path::new("rendered sound"),
            "",
            "it has no frame to compare",
            "give a longer sound, 0.2 s and more",
        ));
    }
    let mean = |values: &[f64]| mean(values.iter().copied()).unwrap_or(0.0);
    let azimuth_95 = quantile(&azimuths, 0.95);
    Ok(Difference { azimuth: mean(&azimuths), azimuth_95, level: mean(&levels), frames: azimuths.len() })
}

/// By how much later a scene's first source is heard by a head than in the recording, seconds.
pub fn lateness(scene: &SoundScene, head: &PoseTrack, t: f64) -> f64 {
    let source = scene.sources.first().and_then(|source| source.track.at(t)).unwrap_or_default();
    let way = source.distance(head.at(t).p) - source.distance(scene.mic.pose.at(t).p);
    way * scene.metres_per_unit.unwrap_or(0.0) / SPEED_OF_SOUND
}

/// A row of the paper's ablation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ablation {
    /// Whether the direction was rendered.
    pub direction: bool,
    /// Whether the distance was.
    pub distance: bool,
    /// Against the truth.
    pub error: Difference,
}

/// The paper's ablation on a simulated scene, its listeners replaced by measures: neither, distance, direction, both.
///
/// # Errors
/// As [`render_signals`] and [`compare`].
pub fn ablation(simulated: &Simulated, hrtf: &HrtfSet) -> Result<Vec<Ablation>> {
    let rows = [(false, false), (false, true), (true, false), (true, true)];
    let row = |(direction, distance)| {
        let config = RenderConfig { direction, distance, ..RenderConfig::default() };
        let error = score(simulated, hrtf, &config)?;
        Ok(Ablation { direction, distance, error })
    };
    rows.into_iter().map(row).collect()
}

fn score(simulated: &Simulated, hrtf: &HrtfSet, config: &RenderConfig) -> Result<Difference> {
    let Simulated { scene, recording, head, truth } = simulated;
    let rendered = render_signals(scene, std::slice::from_ref(recording), head, hrtf, config)?;
    let late = |t: f64| if config.mode == Mode::Physical { 0.0 } else { lateness(scene, head, t) };
    compare(&rendered.samples, truth, hrtf, late)
}

/// A row of the table of speed and accuracy.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Trade {
    /// What was set.
    pub setting: String,
    /// Against the truth, while the source walks.
    pub error: Difference,
    /// What turning by 180 degrees a second adds to a tone of 1 kHz, decibels.
    pub splatter: f64,
    /// Log-spectral distance of the filters from the full ones, mean over directions and ears, decibels.
    pub spectrum: f64,
    /// Seconds of sound per second of one core, for one source, the best of three.
    pub real_time: f64,
}

/// Speed and accuracy of settings on the built-in scene; `open` opens the set of responses.
///
/// # Errors
/// As [`render_signals`] and [`compare`], and those of `open`.
pub fn trade(open: impl Fn() -> Result<HrtfSet>) -> Result<Vec<Trade>> {
    const SECONDS: f64 = 3.0;
    let full = open()?;
    let simulated = simulate(Motion::Walk, SECONDS, 1, &full);
    let config = |mode, lookup| RenderConfig { mode, lookup, ..RenderConfig::default() };
    let (paper, physical) = (config(Mode::Paper3d, Lookup::Aligned), config(Mode::Physical, Lookup::Aligned));
    let mut rows: Vec<(String, RenderConfig, usize)> = Vec::new();
    for frame in [256, 512, 1024, 2048] {
        let settings = RenderConfig { frame, hop: frame / 2, ..paper.clone() };
        rows.push((format!("paper, frames of {frame}"), settings, usize::MAX));
    }
    rows.push(("paper, nearest".into(), RenderConfig { lookup: Lookup::Nearest, ..paper.clone() }, usize::MAX));
    rows.push(("paper, 192 taps".into(), paper, 192));
    for block in [64, 128, 256, 512] {
        rows.push((format!("physical, blocks of {block}"), RenderConfig { block, ..physical.clone() }, usize::MAX));
    }
    rows.push(("physical, nearest".into(), RenderConfig { lookup: Lookup::Nearest, ..physical.clone() }, usize::MAX));
    for taps in [256, 192, 128] {
        rows.push((format!("physical, {taps} taps"), physical.clone(), taps));
    }
    let row = |(setting, config, taps): (String, RenderConfig, usize)| {
        let hrtf = open()?.with_taps(taps);
        let mut seconds = f64::INFINITY;
        for _ in 0..3 {
            let from = Instant::now();
            let signals = std::slice::from_ref(&simulated.recording);
            render_signals(&simulated.scene, signals, &simulated.head, &hrtf, &config)?;
            seconds = seconds.min(from.elapsed().as_secs_f64());
        }
        Ok(Trade {
            error: score(&simulated, &hrtf, &config)?,
            splatter: turning_splatter(&simulated.scene, &hrtf, &config)?,
            spectrum: spectral_error(&full, &hrtf, config.lookup),
            real_time: SECONDS / seconds,
            setting,
        })
    };
    rows.into_iter().map(row).collect()
}

/// What a head that turns by 180 degrees a second past a tone of 1 kHz on its left hears beside it.
fn turning_splatter(scene: &SoundScene, hrtf: &HrtfSet, config: &RenderConfig) -> Result<f64> {
    let center = scene.mic.pose.at(0.0).p;
    let pose = |t: f64| HeadPose { t, p: center, q: DQuat::from_rotation_z((90.0 - 25.0 - 180.0 * t).to_radians()) };
    let head = PoseTrack::new((0..=30).map(|k| pose(f64::from(k) / 60.0)).collect())?;
    let mut scene = scene.clone();
    scene.sources[0].track.samples.iter_mut().for_each(|sample| sample.p = center + DVec3::new(0.0, 2.0, 0.0));
    let tone = (0..24_000).map(|i| 0.25 * (std::f64::consts::TAU * 1000.0 * f64::from(i) / f64::from(FS)).sin() as f32);
    let heard = render_signals(&scene, &[tone.collect()], &head, hrtf, config)?.samples;
    Ok(splatter_db(&heard[2400..].iter().map(|frame| frame[0]).collect::<Vec<f32>>(), 1000.0))
}

/// The mean spectral distance of what a set gives between the measured directions from what the full set gives.
fn spectral_error(full: &HrtfSet, hrtf: &HrtfSet, lookup: Lookup) -> f64 {
    let triangles = full.hull().triangles();
    let middles = triangles.iter().step_by((triangles.len() / 100).max(1));
    let mut distances = Vec::new();
    for corners in middles {
        let to: DVec3 = corners.iter().map(|at| full.directions()[*at]).sum();
        let (wanted, given) = (full.filter(to, Lookup::Aligned), hrtf.filter(to, lookup));
        distances.extend([0, 1].map(|ear| lsd_db(&given.responses[ear], &wanted.responses[ear])));
    }
    mean(distances).unwrap_or(0.0)
}
