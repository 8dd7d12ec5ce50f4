//! From a recording and places to what a head hears on its way.

use std::borrow::Cow;
use std::path::Path;
use std::rc::Rc;

use glam::DVec3;

use super::FS;
use super::align::LEAD;
use super::course::{Course, r_min};
use super::fir::{State, Voice};
use super::geometry::{Mode, SoundPlane};
use super::hrtf::{Filter, HrtfSet, Lookup, Meta};
use super::loudness::{self, Loudness};
use super::pose::PoseTrack;
use super::scene_file::{SoundScene, Source};
use super::sinc::DelayTable;
use super::wav;
use super::wola::Wola;
use crate::error::{Error, Result};

pub use super::course::{Cue, RenderConfig, SPEED_OF_SOUND, SourceReport};

/// Change of a delay per time above which the head is taken to have jumped: 34 m/s.
const JUMP: f64 = 0.1;

/// Numbers of a rendering.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Length, seconds.
    pub seconds: f64,
    /// As in the settings.
    pub mode: Mode,
    /// As in the settings.
    pub lookup: Lookup,
    /// The set of responses.
    pub hrtf: Meta,
    /// Samples by which the set's responses were late, which were taken away.
    pub hrtf_latency: usize,
    /// Smallest distance, scene units.
    pub r_min: f64,
    /// By source.
    pub sources: Vec<SourceReport>,
    /// Before the gain.
    pub loudness: Loudness,
    /// The one gain that everything got, decibels.
    pub gain_db: f64,
}

/// A rendering.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Left and right, at [`FS`].
    pub samples: Vec<[f32; 2]>,
    /// Samples per second.
    pub fs: u32,
    /// By source, what was rendered, at the edges of blocks or the centres of frames.
    pub cues: Vec<Vec<Cue>>,
    /// Its numbers.
    pub report: Report,
}

/// Renders a scene's recordings along a head's path; as long as the longest of them.
///
/// # Errors
/// [`crate::Error::Data`] naming a recording that cannot be read, or what of `config` cannot be.
pub fn render(scene: &SoundScene, head: &PoseTrack, hrtf: &HrtfSet, config: &RenderConfig) -> Result<Rendered> {
    render_signals(scene, &signals(scene)?, head, hrtf, config)
}

/// By source, what the microphone recorded of it, at [`FS`] from the time 0 on.
pub fn signals(scene: &SoundScene) -> Result<Vec<Vec<f32>>> {
    let read = |source: &Source| {
        wav::read_channel(source.wav.as_ref().unwrap_or(&scene.mic.wav), scene.mic.channel, scene.mic.offset_s)
    };
    scene.sources.iter().map(read).collect()
}

/// Renders given signals in place of the scene's recordings: one for each source, at [`FS`].
pub fn render_signals(
    scene: &SoundScene,
    signals: &[Vec<f32>],
    head: &PoseTrack,
    hrtf: &HrtfSet,
    config: &RenderConfig,
) -> Result<Rendered> {
    let n = signals.iter().map(Vec::len).max().unwrap_or(0);
    let mut samples = vec![[0.0; 2]; n];
    let (mut cues, mut sources) = (Vec::new(), Vec::new());
    let r_min = r_min(scene, config);
    for (source, signal) in scene.sources.iter().zip(signals) {
        let course = Course::new(scene, source, head, config)?;
        let mut heard = vec![[0.0; 2]; signal.len()];
        let (path, jumps) = match config.mode {
            Mode::Paper2d | Mode::Paper3d => (paper(&course, signal, hrtf, config, &mut heard)?, 0),
            Mode::Physical => physical(&course, signal, hrtf, config, &mut heard)?,
        };
        samples.iter_mut().zip(heard).for_each(|(to, [left, right])| *to = [to[0] + left, to[1] + right]);
        sources.push(course.report(&path, jumps));
        cues.push(path);
    }
    let loudness = loudness::measure(&samples)?;
    let gain_db = loudness::gain_db(&loudness, config.lufs);
    loudness::amplify(&mut samples, gain_db);
    let report = Report {
        seconds: n as f64 / f64::from(FS),
        mode: config.mode,
        lookup: config.lookup,
        hrtf: hrtf.meta.clone(),
        hrtf_latency: hrtf.latency,
        r_min,
        sources,
        loudness,
        gain_db,
    };
    Ok(Rendered { samples, fs: FS, cues, report })
}

/// Renders given signals as first-order ambisonics at the head's place: channels W, Y, Z, X (AmbiX: ACN, SN3D), as late as for the ears.
/// The world stays as it is, so that a player can turn the head; x is the sound plane's forward.
pub fn render_ambix(
    scene: &SoundScene,
    signals: &[Vec<f32>],
    head: &PoseTrack,
    config: &RenderConfig,
) -> Result<Vec<[f32; 4]>> {
    let n = signals.iter().map(Vec::len).max().unwrap_or(0);
    let mut out = vec![[0.0; 4]; n];
    for (source, signal) in scene.sources.iter().zip(signals) {
        let course = Course::new(scene, source, head, config)?;
        let signal =
            if course.is_late() { Cow::Owned(arrived(&course, signal, config)) } else { Cow::Borrowed(signal) };
        let gains = |at: usize| {
            let t = at as f64 / f64::from(FS);
            let mut to = for_players(&course.plane, course.place(t) - head.at(t).p);
            if config.mode == Mode::Paper2d {
                to.z = 0.0;
            }
            let to = to.normalize_or(DVec3::X);
            [1.0, to.y, to.z, to.x].map(|value| (value * course.cue(t).gain) as f32)
        };
        let mut from = gains(0);
        for start in (0..signal.len()).step_by(config.block.max(1)) {
            let to = gains(start + config.block.max(1));
            let end = (start + config.block.max(1)).min(signal.len());
            for (i, (frame, x)) in out[start..end].iter_mut().zip(&signal[start..end]).enumerate() {
                let a = i as f32 / config.block.max(1) as f32;
                for channel in 0..4 {
                    frame[channel] += x * ((1.0 - a) * from[channel] + a * to[channel]);
                }
            }
            from = to;
        }
    }
    Ok(out)
}

/// A vector of the world in the frame that players turn: x along the sound plane's forward, y left, z up.
fn for_players(plane: &SoundPlane, v: DVec3) -> DVec3 {
    DVec3::new(v.dot(plane.y), -v.dot(plane.x), v.dot(plane.up))
}

/// A signal as it arrives at the head: late by its way, which glides over each block, with a crossfade where the head jumps.
fn arrived(course: &Course, signal: &[f32], config: &RenderConfig) -> Vec<f32> {
    let (table, block) = (DelayTable::new(), config.block.max(1));
    let n_fade = fade_blocks(config, block);
    let n_blocks = signal.len().div_ceil(block);
    let late = |k: usize| course.cue((k * block) as f64 / f64::from(FS)).delay * f64::from(FS);
    let late: Vec<f64> = (0..=n_blocks + n_fade).map(late).collect();
    let at = |i: usize, late: f64| table.at(signal, i as f64 - late);
    let mut out = Vec::with_capacity(signal.len());
    let mut k = 0;
    while k < n_blocks {
        let start = k * block;
        let is_jump = (late[k + 1] - late[k]).abs() > JUMP * block as f64;
        let (length, to) = if is_jump { (n_fade * block, late[k + n_fade]) } else { (block, late[k + 1]) };
        out.extend((start..(start + length).min(signal.len())).map(|i| {
            let a = (i - start) as f64 / length as f64;
            let glide = || at(i, late[k] + a * (to - late[k]));
            if is_jump { (1.0 - a as f32) * at(i, late[k]) + a as f32 * at(i, to) } else { glide() }
        }));
        k += length / block;
    }
    out
}

/// Blocks of the crossfade where the head jumps.
fn fade_blocks(config: &RenderConfig, block: usize) -> usize {
    ((config.jump_fade * f64::from(FS) / block as f64).ceil() as usize).max(1)
}

/// The paper's modes: one filter and one gain for each frame, at the time of its centre.
fn paper(
    course: &Course,
    signal: &[f32],
    hrtf: &HrtfSet,
    config: &RenderConfig,
    out: &mut [[f32; 2]],
) -> Result<Vec<Cue>> {
    let wola = Wola::new(config.frame, config.hop, hrtf.taps(config.lookup), hrtf.max_delay());
    let mut wola = wola.ok_or_else(|| {
        let reason = format!("frames of {} samples every {} do not add up to 1", config.frame, config.hop);
        Error::data(Path::new("settings"), "hop", reason, "choose a hop that divides the frame at least twice")
    })?;
    let mut cues: Vec<Cue> = Vec::new();
    wola.process(signal, out, |wola, at| {
        let cue = course.cue(at / f64::from(FS));
        let is_same = cues.last().is_some_and(|last| (last.az, last.el) == (cue.az, cue.el));
        cues.push(cue);
        let spectra = (!is_same).then(|| wola.spectra(&course.filter(&cue, hrtf, config.lookup)));
        (spectra, cue.gain as f32)
    });
    Ok(cues)
}

/// The physical mode: filters, delays and gains at the edges of blocks, gliding between.
fn physical(
    course: &Course,
    signal: &[f32],
    hrtf: &HrtfSet,
    config: &RenderConfig,
    out: &mut [[f32; 2]],
) -> Result<(Vec<Cue>, u32)> {
    let block = config.block;
    if block == 0 {
        return Err(Error::data(Path::new("settings"), "block", "it is 0", "choose 64 to 1024 samples"));
    }
    let table = DelayTable::new();
    let n_fade = fade_blocks(config, block);
    let n_blocks = signal.len().div_ceil(block);
    let edges: Vec<Edge> = (0..=n_blocks + n_fade + LEAD.div_ceil(block))
        .map(|k| {
            let cue = course.cue((k * block) as f64 / f64::from(FS));
            let onsets = course.filter(&cue, hrtf, config.lookup).delays;
            Edge { cue, delays: onsets.map(|onset| onset + cue.delay * f64::from(FS)) }
        })
        .collect();
    // A glide through a jump would be a chirp.
    let is_jump = |k: usize| (edges[k + 1].cue.delay - edges[k].cue.delay).abs() * f64::from(FS) > JUMP * block as f64;
    let delays = |at: usize| {
        let (k, part) = (at / block, (at % block) as f64 / block as f64);
        let (from, to) = (edges[k].delays, edges[k + 1].delays);
        if is_jump(k) { from } else { [0, 1].map(|ear| from[ear] + part * (to[ear] - from[ear])) }
    };
    let mut last: Option<(Cue, Rc<Filter>)> = None;
    let mut state = |k: usize| {
        let cue = edges[k].cue;
        let filter = match &last {
            Some((before, filter)) if (before.az, before.el, before.distance) == (cue.az, cue.el, cue.distance) => {
                filter.clone()
            }
            _ => Rc::new(course.filter(&cue, hrtf, config.lookup)),
        };
        last = Some((cue, filter.clone()));
        State { filter, gain: cue.gain }
    };
    let mut voice = Voice::new(&table, signal, 0, state(0), edges[0].delays);
    let mut jumps = 0;
    let mut k = 0;
    while k < n_blocks {
        let start = k * block;
        if !is_jump(k) {
            let end = (start + block).min(signal.len());
            voice.block(start, state(k + 1), block, delays, &mut out[start..end], |_| 1.0);
            k += 1;
            continue;
        }
        // The old place fades out as it was, the new one fades in as it will be.
        jumps += 1;
        let (was, will) = (edges[k].delays, edges[k + n_fade].delays);
        let (held, arrived) = (voice.state.clone(), state(k + n_fade));
        let mut old = std::mem::replace(&mut voice, Voice::new(&table, signal, start, arrived.clone(), will));
        let fade = n_fade * block;
        for from in (start..(start + fade).min(signal.len())).step_by(block) {
            let part = &mut out[from..(from + block).min(signal.len())];
            let a = |i: usize| (from + i - start) as f32 / fade as f32;
            let there = |at: usize| if at < start + fade { will } else { delays(at) };
            old.block(from, held.clone(), block, |_| was, part, |i| 1.0 - a(i));
            voice.block(from, arrived.clone(), block, there, part, a);
        }
        k += n_fade;
    }
    Ok((edges.iter().take(n_blocks + 1).map(|edge| edge.cue).collect(), jumps))
}

/// Cue at the edge of a block, and by how many samples each ear hears it late.
struct Edge {
    cue: Cue,
    delays: [f64; 2],
}
