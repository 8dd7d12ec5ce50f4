//! From a recording and places to what a head hears on its way.

use std::path::Path;
use std::rc::Rc;

use glam::DVec3;

use super::FS;
use super::align::LEAD;
use super::ambix;
use super::fir::{State, Voice};
use super::geometry::{Bearing, Mode, SoundPlane, bearing, gain};
use super::hrtf::{Filter, HrtfSet, Lookup, Meta};
use super::loudness::{self, Loudness};
use super::pose::PoseTrack;
use super::scene_file::{SoundScene, Source};
use super::sinc::DelayTable;
use super::source_track::{Flag, SourceTrack};
use super::wav;
use super::wola::Wola;
use crate::error::{Error, Result};

/// Speed of sound, metres per second (20 degrees).
pub const SPEED_OF_SOUND: f64 = 343.2;
/// Change of a delay per time above which the head is taken to have jumped: 34 m/s.
const JUMP: f64 = 0.1;
/// Length of a gate's rise and fall, centred on its time; seconds.
const GATE_FADE: f64 = 0.05;
/// Nearer than the first the two ears begin to hear the same, nearer than the second (the head's radius) they do; metres.
const NEAR: [f64; 2] = [0.25, 0.0875];
/// Decibels of gain from which the room of the recording is in a wrong proportion to the voice.
const FAR_FROM_RECORDING_DB: f64 = 6.0;

/// How a scene is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderConfig {
    /// How directions, gains and delays are made.
    pub mode: Mode,
    /// How responses are looked up.
    pub lookup: Lookup,
    /// Samples of a frame of the paper's modes.
    pub frame: usize,
    /// Samples between its frames; divides the frame at least twice.
    pub hop: usize,
    /// Samples of a block of the physical mode.
    pub block: usize,
    /// Smallest distance, metres; without a metric scale 2 % of the microphone's median distance.
    pub r_min_m: f64,
    /// Length of the crossfade where the head jumps, physical mode; seconds.
    pub jump_fade: f64,
    /// Whether the way's delay is heard, physical mode.
    pub propagation: bool,
    /// Whether the direction is heard; else both ears get the recording (for the paper's ablation).
    pub direction: bool,
    /// Whether the distance is; else the recording's level stays (for the paper's ablation).
    pub distance: bool,
    /// Loudness of the result; `None` to leave it. In any case peaks stay below -1 dBTP.
    pub lufs: Option<f64>,
}

impl Default for RenderConfig {
    fn default() -> Self {
        RenderConfig {
            mode: Mode::Paper2d,
            lookup: Lookup::Aligned,
            frame: 1024,
            hop: 512,
            block: 256,
            r_min_m: 0.2,
            jump_fade: 0.02,
            propagation: true,
            direction: true,
            distance: true,
            lufs: None,
        }
    }
}

/// What a source sends to a head at a time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cue {
    /// Seconds.
    pub t: f64,
    /// Azimuth, radians, left positive.
    pub az: f64,
    /// Elevation, radians.
    pub el: f64,
    /// Amplitude relative to the recording, gates and the source's own gain included.
    pub gain: f64,
    /// Distance of the head, scene units.
    pub distance: f64,
    /// Delay relative to the recording, seconds; 0 in the paper's modes.
    pub delay: f64,
}

/// What is to be known of a rendering.
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

/// What is to be known of a source in a rendering.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SourceReport {
    /// Its name.
    pub id: String,
    /// Lowest and highest gain relative to the recording, decibels.
    pub gain_db: [f64; 2],
    /// Part of the time in which a distance was kept at its floor.
    pub clamped: f64,
    /// Part of the time in which the gain is beyond 6 dB to either side. There the recorded room is audibly too loud or
    /// too quiet beside the voice, since one gain moves both.
    pub beyond_6_db: f64,
    /// Part of the track's samples that were not seen.
    pub unseen: f64,
    /// Jumps of the head that were crossfaded.
    pub jumps: u32,
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
    /// What is to be known.
    pub report: Report,
}

/// Renders a scene's recordings along a head's path; as long as the longest of them.
///
/// # Errors
/// [`Error::Data`] where a recording cannot be read, the settings make no sense, or the physical mode lacks a scale.
pub fn render(scene: &SoundScene, head: &PoseTrack, hrtf: &HrtfSet, config: &RenderConfig) -> Result<Rendered> {
    render_signals(scene, &signals(scene)?, head, hrtf, config)
}

/// By source, what the microphone recorded of it, at [`FS`] from the time 0 on.
///
/// # Errors
/// [`Error::Data`] where a recording cannot be read.
pub fn signals(scene: &SoundScene) -> Result<Vec<Vec<f32>>> {
    let read = |source: &Source| {
        wav::read_channel(source.wav.as_ref().unwrap_or(&scene.mic.wav), scene.mic.channel, scene.mic.offset_s)
    };
    scene.sources.iter().map(read).collect()
}

/// Renders given signals in place of the scene's recordings: one for each source, at [`FS`].
///
/// # Errors
/// As [`render`].
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
    let scale = 10f64.powf(gain_db / 20.0) as f32;
    samples.as_flattened_mut().iter_mut().for_each(|value| *value *= scale);
    let report = Report {
        seconds: n as f64 / f64::from(FS),
        mode: config.mode,
        lookup: config.lookup,
        hrtf: hrtf.meta.clone(),
        hrtf_latency: hrtf.latency(),
        r_min,
        sources,
        loudness,
        gain_db,
    };
    Ok(Rendered { samples, fs: FS, cues, report })
}

/// Renders given signals as first-order ambisonics at the head's place: channels W, Y, Z, X (AmbiX). The world stays as it
/// is, so that a player can turn the head; x is the sound plane's forward.
///
/// # Errors
/// As [`render`].
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
        let gains = |at: usize| {
            let t = at as f64 / f64::from(FS);
            let mut to = ambix::of_world(&course.plane, course.place(t) - head.at(t).p);
            if config.mode == Mode::Paper2d {
                to.z = 0.0;
            }
            ambix::encode(to).map(|value| (value * course.cue(t).gain) as f32)
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

/// The smallest distance, scene units.
fn r_min(scene: &SoundScene, config: &RenderConfig) -> f64 {
    if let Some(metres) = scene.metres_per_unit {
        return config.r_min_m / metres;
    }
    let samples = scene.sources.iter().flat_map(|source| &source.track.samples);
    let mut distances: Vec<f64> = samples.map(|sample| sample.p.distance(scene.mic.pose.at(sample.t).p)).collect();
    distances.sort_by(f64::total_cmp);
    0.02 * distances.get(distances.len() / 2).copied().unwrap_or(1.0)
}

/// A source beside a head: all that depends on time.
pub(super) struct Course<'a> {
    mode: Mode,
    propagation: bool,
    direction: bool,
    distance: bool,
    plane: SoundPlane,
    head: &'a PoseTrack,
    scene: &'a SoundScene,
    track: &'a SourceTrack,
    gain: f64,
    gates: Vec<(f64, f64)>,
    pub(super) r_min: f64,
    /// Metres of a scene unit; 1 where that is unknown and not asked for.
    metres: f64,
}

impl<'a> Course<'a> {
    pub(super) fn new(
        scene: &'a SoundScene,
        source: &'a Source,
        head: &'a PoseTrack,
        config: &RenderConfig,
    ) -> Result<Self> {
        let fault =
            |place: &str, reason: &str, remedy: &str| Error::data(Path::new("sound scene"), place, reason, remedy);
        if config.mode == Mode::Physical && scene.metres_per_unit.is_none() {
            let reason = "the physical mode needs to know how long a scene unit is";
            return Err(fault("metres_per_unit", reason, "set it, or render in a paper mode"));
        }
        let forward = scene.mic.pose.poses()[0].forward();
        let plane = SoundPlane::new(scene.up, forward).ok_or_else(|| {
            fault("up", "the microphone's camera looks along it", "give the direction that is up in the scene")
        })?;
        Ok(Course {
            mode: config.mode,
            propagation: config.propagation && config.mode == Mode::Physical,
            direction: config.direction,
            distance: config.distance,
            plane,
            head,
            scene,
            track: &source.track,
            gain: 10f64.powf(source.gain_db / 20.0),
            gates: gates(source),
            r_min: r_min(scene, config),
            metres: scene.metres_per_unit.unwrap_or(1.0),
        })
    }

    /// Where the source is; where it is not known, where it was known last or next.
    pub(super) fn place(&self, t: f64) -> DVec3 {
        self.track.at(t).unwrap_or_else(|| {
            let known = self.track.samples.iter().filter(|sample| sample.flag != Flag::Inactive);
            let near = known.min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
            near.map_or(DVec3::ZERO, |sample| sample.p)
        })
    }

    fn bearing(&self, t: f64) -> Bearing {
        bearing(self.mode, &self.plane, &self.head.at(t), self.scene.mic.pose.at(t).p, self.place(t))
    }

    pub(super) fn cue(&self, t: f64) -> Cue {
        let bearing = self.bearing(t);
        let way = (bearing.r_l - bearing.r_m) * self.metres / SPEED_OF_SOUND;
        Cue {
            t,
            az: bearing.az,
            el: bearing.el,
            gain: self.gain * self.gate(t) * self.relative_gain(&bearing),
            distance: bearing.r_l,
            delay: if self.propagation { way } else { 0.0 },
        }
    }

    fn relative_gain(&self, bearing: &Bearing) -> f64 {
        if self.distance { gain(self.mode, bearing, self.r_min) } else { 1.0 }
    }

    fn gate(&self, t: f64) -> f64 {
        let rise = |from_edge: f64| {
            let s = (from_edge / GATE_FADE + 0.5).clamp(0.0, 1.0);
            0.5 - 0.5 * (std::f64::consts::PI * s).cos()
        };
        self.gates.iter().map(|(from, to)| rise(t - from).min(rise(to - t))).fold(0.0, f64::max)
    }

    fn report(&self, cues: &[Cue], jumps: u32) -> SourceReport {
        let part = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let (mut range, mut clamped, mut beyond, mut heard) = ([f64::INFINITY, f64::NEG_INFINITY], 0, 0, 0);
        for cue in cues.iter().filter(|cue| self.gate(cue.t) > 0.0) {
            let bearing = self.bearing(cue.t);
            let db = 20.0 * self.relative_gain(&bearing).log10();
            range = [range[0].min(db), range[1].max(db)];
            clamped += usize::from(bearing.r_l.min(bearing.r_m) < self.r_min);
            beyond += usize::from(db.abs() > FAR_FROM_RECORDING_DB);
            heard += 1;
        }
        let is_seen = |flag: Flag| matches!(flag, Flag::Seen | Flag::Approx);
        let unseen = self.track.samples.iter().filter(|sample| !is_seen(sample.flag)).count();
        SourceReport {
            id: self.track.id.clone(),
            gain_db: if heard == 0 { [0.0; 2] } else { range },
            clamped: part(clamped, heard),
            beyond_6_db: part(beyond, heard),
            unseen: part(unseen, self.track.samples.len()),
            jumps,
        }
    }

    /// What the ears hear of a cue. Close to the head both come to hear the same, since no response is measured there.
    fn filter(&self, cue: &Cue, hrtf: &HrtfSet, lookup: Lookup) -> Filter {
        if !self.direction {
            let mut response = vec![0.0; hrtf.taps(lookup)];
            response[LEAD] = 1.0;
            return Filter { responses: [response.clone(), response], delays: [0.0; 2] };
        }
        let mut filter = hrtf.filter(super::geometry::direction(cue.az, cue.el), lookup);
        let inside = (NEAR[0] - cue.distance * self.metres) / (NEAR[0] - NEAR[1]);
        let both = if self.mode == Mode::Physical { inside.clamp(0.0, 1.0) } else { 0.0 };
        if both > 0.0 {
            let middle = 0.5 * (filter.delays[0] + filter.delays[1]);
            filter.delays = filter.delays.map(|delay| delay + both * (middle - delay));
            for response in &mut filter.responses {
                response.iter_mut().for_each(|value| *value *= 1.0 - both as f32);
                response[hrtf.onset(lookup)] += both as f32;
            }
        }
        filter
    }
}

/// When a source is heard: in its gates, where its track is not inactive.
fn gates(source: &Source) -> Vec<(f64, f64)> {
    let samples = &source.track.samples;
    let mut active: Vec<(f64, f64)> = Vec::new();
    let mut is_open = false;
    for (i, sample) in samples.iter().enumerate() {
        match (sample.flag != Flag::Inactive, is_open) {
            (true, false) => active.push((if i == 0 { f64::NEG_INFINITY } else { sample.t }, f64::INFINITY)),
            (false, true) => active.last_mut().into_iter().for_each(|last| last.1 = samples[i - 1].t),
            _ => (),
        }
        is_open = sample.flag != Flag::Inactive;
    }
    if source.gates.is_empty() {
        return active;
    }
    let both = |(a, b): &(f64, f64)| {
        active.iter().map(|(c, d)| (a.max(*c), b.min(*d))).filter(|(from, to)| from < to).collect::<Vec<_>>()
    };
    source.gates.iter().flat_map(both).collect()
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
    let n_fade = ((config.jump_fade * f64::from(FS) / block as f64).ceil() as usize).max(1);
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
        let (held, arrived) = (voice.state().clone(), state(k + n_fade));
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

/// What a source sends at the edge of a block, and by how many samples each ear hears it late.
struct Edge {
    cue: Cue,
    delays: [f64; 2],
}
