//! A source beside a head: where it is heard from, how loud and how late, at any time.

use std::path::Path;

use glam::DVec3;

use super::geometry::{Bearing, Mode, SoundPlane, bearing, direction, gain};
use super::hrtf::{Filter, HrtfSet, Lookup};
use super::pose::PoseTrack;
use super::scene_file::{SoundScene, Source};
use super::source_track::{Flag, SourceTrack};
use crate::error::{Error, Result};

/// Speed of sound, metres per second (20 degrees).
pub const SPEED_OF_SOUND: f64 = 343.2;
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
    /// True if the way's delay is heard, physical mode.
    pub propagation: bool,
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
            lufs: None,
        }
    }
}

/// The sound that a head receives from a source at a time.
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

/// Numbers of a source in a rendering.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SourceReport {
    /// Its name.
    pub id: String,
    /// Lowest and highest gain relative to the recording, decibels.
    pub gain_db: [f64; 2],
    /// Part of the time in which a distance was kept at its floor.
    pub clamped: f64,
    /// Part of the time in which the gain is beyond 6 dB, where the recorded room is too loud or too quiet beside the voice.
    pub beyond_6_db: f64,
    /// Part of the track's samples that were not seen.
    pub unseen: f64,
    /// Jumps of the head that were crossfaded.
    pub jumps: u32,
}

pub(super) fn r_min(scene: &SoundScene, config: &RenderConfig) -> f64 {
    if let Some(metres) = scene.metres_per_unit {
        return config.r_min_m / metres;
    }
    let samples = scene.sources.iter().flat_map(|source| &source.track.samples);
    let mut distances: Vec<f64> = samples.map(|sample| sample.p.distance(scene.mic.pose.at(sample.t).p)).collect();
    distances.sort_by(f64::total_cmp);
    0.02 * distances.get(distances.len() / 2).copied().unwrap_or(1.0)
}

pub(super) struct Course<'a> {
    mode: Mode,
    propagation: bool,
    pub(super) plane: SoundPlane,
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

    pub(super) fn is_late(&self) -> bool {
        self.propagation
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
            gain: self.gain * self.gate(t) * gain(self.mode, &bearing, self.r_min),
            distance: bearing.r_l,
            delay: if self.propagation { way } else { 0.0 },
        }
    }

    fn gate(&self, t: f64) -> f64 {
        let rise = |from_edge: f64| {
            let s = (from_edge / GATE_FADE + 0.5).clamp(0.0, 1.0);
            0.5 - 0.5 * (std::f64::consts::PI * s).cos()
        };
        // There may be hundreds, and it is asked at every sample.
        let is_near = |(from, to): &&(f64, f64)| t > from - GATE_FADE && t < to + GATE_FADE;
        self.gates.iter().filter(is_near).map(|(from, to)| rise(t - from).min(rise(to - t))).fold(0.0, f64::max)
    }

    /// The gain at a time, as that of [`Course::cue`]; where a gate is closed nothing else is asked.
    pub(super) fn gain(&self, t: f64) -> f64 {
        let gate = self.gate(t);
        if gate > 0.0 { self.gain * gate * gain(self.mode, &self.bearing(t), self.r_min) } else { 0.0 }
    }

    pub(super) fn report(&self, cues: &[Cue], jumps: u32) -> SourceReport {
        let part = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let (mut range, mut clamped, mut beyond, mut heard) = ([f64::INFINITY, f64::NEG_INFINITY], 0, 0, 0);
        for cue in cues.iter().filter(|cue| self.gate(cue.t) > 0.0) {
            let bearing = self.bearing(cue.t);
            let db = 20.0 * gain(self.mode, &bearing, self.r_min).log10();
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

    /// The filter of a cue. Close to the head both ears hear the same, since no response is measured there.
    pub(super) fn filter(&self, cue: &Cue, hrtf: &HrtfSet, lookup: Lookup) -> Filter {
        let mut filter = hrtf.filter(direction(cue.az, cue.el), lookup);
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
