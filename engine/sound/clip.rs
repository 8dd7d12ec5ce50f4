//! A sound scene as sources that a player moves and mixes.

use super::FS;
use super::geometry::Mode;
use super::pose::PoseTrack;
use super::render::{Course, RenderConfig, signals};
use super::scene_file::SoundScene;
use super::wav::{Depth, encode};
use crate::error::{Error, Result};
use crate::scene::{Sound, Sounds};

/// Silence that is left around a source, samples.
const MARGIN: usize = FS as usize / 100;

/// The sources of a clip of `seconds`: each as a listener hears it who stays where the microphone was at first, in its gates
/// alone, and the way that it goes. One that is never heard is left out.
///
/// A microphone that moves is louder near a source than the law of distance of a player, which knows one place of it, can tell;
/// that is in the recordings then.
///
/// # Errors
/// [`Error::Data`] where a recording cannot be read, or is too long for a WAV file.
pub fn sounds(scene: &SoundScene, seconds: f64) -> Result<Sounds> {
    let config = RenderConfig { mode: Mode::Paper3d, ..RenderConfig::default() };
    let mic = scene.mic.pose.poses()[0];
    let listener = PoseTrack::new(vec![mic])?;
    let most = (seconds * f64::from(FS)).round() as usize;
    let (mut found, mut r_min) = (Vec::new(), 0.0);
    for (source, signal) in scene.sources.iter().zip(signals(scene)?) {
        let course = Course::new(scene, source, &listener, &config)?;
        r_min = course.r_min;
        let heard = |(at, x): (usize, &f32)| (f64::from(*x) * course.cue(at as f64 / f64::from(FS)).gain) as f32;
        let samples: Vec<f32> = signal.iter().take(most).enumerate().map(heard).collect();
        let is_heard = |x: &f32| *x != 0.0;
        let Some((first, last)) = samples.iter().position(is_heard).zip(samples.iter().rposition(is_heard)) else {
            continue;
        };
        let (from, to) = (first.saturating_sub(MARGIN), (last + 1 + MARGIN).min(samples.len()));
        let frames: Vec<[f32; 1]> = samples[from..to].iter().map(|x| [*x]).collect();
        let wav = encode(&frames, Depth::Int16).map_err(|fault| {
            let reason = format!("source {}: cannot be encoded: {fault}", source.track.id);
            Error::data(&scene.mic.wav, "", reason, "a WAV file holds at most 4 GiB: give a shorter clip")
        })?;
        let at = |sample: usize| sample as f64 / f64::from(FS);
        let places = source.track.samples.iter().map(|sample| (sample.t, course.place(sample.t).to_array()));
        found.push(Sound {
            name: source.track.id.clone(),
            wav,
            start: at(from),
            seconds: at(to - from),
            places: places.collect(),
        });
    }
    Ok(Sounds::new(mic.p.to_array(), r_min, found))
}
