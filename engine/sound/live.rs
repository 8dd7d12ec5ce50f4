//! The sound of a clip block by block, for a listener whose way nobody knows beforehand: what a player hears.

use std::path::Path;
use std::rc::Rc;
use std::time::Instant;

use fourdgs::AudioSource;
use glam::DVec3;

use super::FS;
use super::align::LEAD;
use super::fir::{State, Voice};
use super::geometry::{Bearing, Mode, angles, direction, gain};
use super::hrtf::{HrtfSet, Lookup};
use super::pose::PoseTrack;
use super::sinc::{DelayTable, Resampler};
use super::wav;
use crate::error::{Error, Result};
use crate::formats::Sounds;
use crate::scene::Playhead;

/// The sources of a clip, decoded, and the ears that hear them.
pub struct Live {
    sources: Vec<AudioSource>,
    /// By source, samples at [`FS`]; none of one that stays silent.
    signals: Vec<Vec<f32>>,
    law: (Option<[f64; 3]>, f64),
    hrtf: HrtfSet,
    table: DelayTable,
    /// Why sources stay silent: one is said to be no WAV, or cannot be read.
    pub faults: Vec<Error>,
}

impl Live {
    /// Decodes `sounds`, which `hrtf` hears. Their several channels become their mean.
    pub fn new(sounds: &Sounds, hrtf: HrtfSet) -> Self {
        let mut faults = Vec::new();
        let signals = sounds.sources().iter().map(|source| {
            signal(source).unwrap_or_else(|fault| {
                faults.push(fault);
                Vec::new()
            })
        });
        let signals = signals.collect();
        Live { signals, sources: sounds.sources().to_vec(), law: sounds.law(), hrtf, table: DelayTable::new(), faults }
    }

    pub fn listener(&self) -> Listener<'_> {
        Listener { live: self, heard: self.sources.iter().map(|_| None).collect() }
    }

    fn state(&self, source: &AudioSource, t: f64, head: &PoseTrack) -> State {
        let (source, head) = (source.state_at(t), head.at(t));
        let place = DVec3::from(source.position);
        let (az, el) = angles(head.q.inverse() * (place - head.p));
        // A file that does not say where it was recorded: as loud as its payload at the distance 1 and below.
        let (r_m, r_min) = self.law.0.map_or((1.0, 1.0), |mic| (place.distance(mic.into()), self.law.1));
        let bearing = Bearing { az, el, r_l: place.distance(head.p), r_m };
        let filter = Rc::new(self.hrtf.filter(direction(az, el), Lookup::Aligned));
        State { filter, gain: source.gain * gain(Mode::Paper3d, &bearing, r_min) }
    }
}

fn signal(source: &AudioSource) -> Result<Vec<f32>> {
    let name = format!("sound \"{}\"", source.name);
    let name = Path::new(&name);
    if source.codec != "wav" {
        let reason = format!("is {}, expected wav", source.codec);
        return Err(Error::data(name, "codec", reason, "a browser may play it"));
    }
    let recording = wav::decode(name, source.data.as_slice())?;
    let n = recording.channels.len() as f32;
    let mean = |k: usize| recording.channels.iter().map(|channel| channel[k]).sum::<f32>() / n;
    let samples: Vec<f32> = (0..recording.channels[0].len()).map(mean).collect();
    Ok(Resampler::new(recording.fs, FS, 0.0).apply(&samples))
}

pub struct Listener<'a> {
    live: &'a Live,
    heard: Vec<Option<Playing<'a>>>,
}

struct Playing<'a> {
    voice: Voice<'a>,
    /// The sample of its signal that comes next.
    next: usize,
    /// By how many samples each ear will hear the last one late that is on its way: [`LEAD`] samples after `next`.
    delays: [f64; 2],
}

impl Listener<'_> {
    /// Adds to `out`, frames of left and right at [`FS`], the block that begins at `t` seconds of the clip, and glides to where `head` is at
    /// its end. A source begins anew where `t` does not continue the block before.
    pub fn block(&mut self, t: f64, head: &PoseTrack, out: &mut [[f32; 2]]) {
        let (live, rate, n) = (self.live, f64::from(FS), out.len());
        let sounds = live.sources.iter().zip(&live.signals).zip(&mut self.heard);
        for ((source, signal), heard) in sounds {
            let state = source.state_at(t);
            if !state.active || signal.is_empty() {
                *heard = None;
                continue;
            }
            let start = (state.local_time * rate).round() as usize;
            if !source.spatial {
                let samples = out.iter_mut().zip(signal.iter().skip(start));
                samples.for_each(|(frame, x)| *frame = frame.map(|ear| ear + state.gain as f32 * x));
                continue;
            }
            let at = |sample: usize| live.state(source, t + sample as f64 / rate, head);
            let mut now = heard.take().filter(|heard| heard.next.abs_diff(start) <= 1).unwrap_or_else(|| {
                let delays = at(LEAD).filter.delays;
                Playing { voice: Voice::new(&live.table, signal, start, at(0), delays), next: start, delays }
            });
            // What is on its way sounds later, and has the delays of then.
            let (old, new, first) = (now.delays, at(n + LEAD).filter.delays, now.next + LEAD);
            let delays = |sample: usize| {
                let part = (sample - first) as f64 / n as f64;
                [0, 1].map(|ear| old[ear] + part * (new[ear] - old[ear]))
            };
            now.voice.block(now.next, at(n), n, delays, out, |_| 1.0);
            *heard = Some(Playing { voice: now.voice, next: now.next + n, delays: new });
        }
    }

    /// Begins anew, as after a pause.
    pub fn rest(&mut self) {
        self.heard.fill_with(|| None);
    }
}

/// Chooses the part of a clip to mix next, so that it is heard with its picture: without a gap while it stays near.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chase {
    /// Seconds of the clip that the next block begins at, and the version of the playhead that it belongs to.
    next: Option<(f64, u64)>,
    /// How far sound is behind the picture on average, seconds.
    drift: f64,
}

impl Chase {
    /// How far sound may be from the picture on average before it jumps, seconds.
    pub const DRIFT: f64 = 0.02;

    /// Start in the clip, seconds, of a block of `n` frames that is heard at `moment`; none unless the clip plays at its own speed.
    pub fn next(&mut self, clip: &Playhead, moment: Instant, n: usize) -> Option<f64> {
        if !clip.is_playing() || clip.speed() != 1.0 {
            self.next = None;
            return None;
        }
        let (due, length) = (clip.at(moment), clip.length());
        let known = self.next.filter(|(_, version)| *version == clip.version());
        let mut t = known.map_or(due, |(t, _)| t);
        // The shorter way around the clip.
        let off = (due - t + length / 2.0).rem_euclid(length) - length / 2.0;
        self.drift += 0.05 * (off - self.drift);
        if known.is_none() || self.drift.abs() > Self::DRIFT {
            (t, self.drift) = (due, 0.0);
        }
        self.next = Some(((t + n as f64 / f64::from(FS)).rem_euclid(length), clip.version()));
        Some(t)
    }
}
