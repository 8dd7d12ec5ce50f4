//! A sound scene as sources that a player moves and mixes, and the ears that it may hear them with.

use super::FS;
use super::align::LEAD;
use super::course::Course;
use super::geometry::{Mode, degrees};
use super::hrtf::{HrtfSet, Lookup};
use super::pose::PoseTrack;
use super::render::{RenderConfig, signals};
use super::scene_file::SoundScene;
use super::source_track::SourceSample;
use super::wav::{Depth, encode};
use super::wola::Baker;
use crate::error::{Error, Result};
use crate::formats::{Ears, Sound, Sounds};

/// Silence that is left around a source, samples.
const MARGIN: usize = FS as usize / 100;
/// Rows of a grid of ears, 6 degrees apart, and directions of the one on the horizon, 3 degrees apart.
const ROWS: usize = 31;
const ON_HORIZON: f64 = 120.0;
/// Samples that a stored response keeps before the earliest onset of all, taps that it has at most, and those of its end that fade.
const BEFORE: usize = 32;
const TAPS: usize = 256;
const FADE: usize = 16;
/// Part of a response's energy that may be beyond its taps.
const SPARED: f64 = 1e-6;

/// The sources of a clip of `seconds` that begins `start` seconds into the recordings, each as a listener at the microphone's first
/// place hears it, with its path. Sources that are never heard are left out.
///
/// # Errors
/// [`crate::Error::Data`] naming a recording that cannot be read, or a place that is not finite.
pub fn sounds(scene: &SoundScene, start: f64, seconds: f64) -> Result<Sounds> {
    let config = RenderConfig { mode: Mode::Paper3d, ..RenderConfig::default() };
    let mic = scene.mic.pose.poses()[0];
    let listener = PoseTrack::new(vec![mic])?;
    let [before, most] = [start, seconds].map(|time| (time * f64::from(FS)).round() as usize);
    let (mut found, mut r_min) = (Vec::new(), 0.0);
    for (source, signal) in scene.sources.iter().zip(signals(scene)?) {
        let course = Course::new(scene, source, &listener, &config)?;
        r_min = course.r_min;
        let heard = |(at, x): (usize, &f32)| (f64::from(*x) * course.gain(at as f64 / f64::from(FS))) as f32;
        let samples: Vec<f32> = signal.iter().enumerate().skip(before).take(most).map(heard).collect();
        let is_heard = |x: &f32| *x != 0.0;
        let Some((first, last)) = samples.iter().position(is_heard).zip(samples.iter().rposition(is_heard)) else {
            continue;
        };
        let (from, to) = (first.saturating_sub(MARGIN), (last + 1 + MARGIN).min(samples.len()));
        // Whole numbers of a WAV file end at 1.
        let gain = samples.iter().fold(1.0_f32, |most, x| most.max(x.abs()));
        let frames: Vec<[f32; 1]> = samples[from..to].iter().map(|x| [x / gain]).collect();
        let wav = encode(&frames, Depth::Int16).map_err(|fault| {
            let reason = format!("source {}: cannot be encoded: {fault}", source.track.id);
            Error::data(&scene.mic.wav, "", reason, "a WAV file holds at most 4 GiB: give a shorter clip")
        })?;
        let at = |sample: usize| sample as f64 / f64::from(FS);
        // Files hold no time beyond the clip: where it is at an end stands for that.
        let of_clip = |sample: &SourceSample| (sample.t - start).min(seconds).max(0.0);
        let mut times: Vec<f64> = source.track.samples.iter().map(of_clip).collect();
        times.dedup();
        let places = times.into_iter().map(|time| (time, course.place(start + time).to_array()));
        found.push(Sound {
            name: source.track.id.clone(),
            wav,
            gain: gain.into(),
            start: at(from),
            seconds: at(to - from),
            places: places.collect(),
        });
    }
    Ok(Sounds::new(mic.p.to_array(), r_min, found))
}

/// Ears for a player that takes the nearest of some directions: 32 samples (0.7 ms) late and at most 5.3 ms long.
pub fn ears(set: &HrtfSet) -> Ears {
    let elevation = |row: usize| std::f64::consts::PI * (row as f64 / (ROWS - 1) as f64 - 0.5);
    let rows: Vec<u32> = (0..ROWS).map(|row| (ON_HORIZON * elevation(row).cos()).round().max(1.0) as u32).collect();
    let mut baker = Baker::new(set.taps(Lookup::Aligned), set.max_delay());
    let mut baked = |[az, el]: &[f64; 2]| {
        let ears = baker.bake(&set.filter(degrees(*az, *el), Lookup::Aligned));
        ears.map(|response| response.into_iter().skip(LEAD - BEFORE).collect::<Vec<f32>>())
    };
    let mut responses: Vec<[Vec<f32>; 2]> = Ears::grid(&rows).iter().map(&mut baked).collect();
    let taps = responses.iter().flatten().map(|response| taps_of(response)).max().unwrap_or(TAPS);
    for response in responses.iter_mut().flatten() {
        response.truncate(taps);
        let n = response.len();
        response.iter_mut().enumerate().for_each(|(k, x)| *x *= ((n - k) as f32 / FADE as f32).min(1.0));
    }
    let meta = &set.meta;
    let digest = if meta.sha256.is_empty() { String::new() } else { format!("; sha256 {}", meta.sha256) };
    Ears::new(format!("{}; licence: {}{digest}", meta.title, meta.licence), rows, &responses)
}

/// Taps that hold all but what is spared of a response, in front of those that fade: whole multiples of 16.
fn taps_of(response: &[f32]) -> usize {
    let energy = |x: &f32| f64::from(*x).powi(2);
    let spared = SPARED * response.iter().map(energy).sum::<f64>();
    let mut beyond = 0.0;
    let is_needed = |x: &f32| {
        beyond += energy(x);
        beyond > spared
    };
    let last = response.iter().rposition(is_needed).unwrap_or(0);
    (last + 1 + FADE).next_multiple_of(16).min(TAPS)
}
