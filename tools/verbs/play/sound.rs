//! Sound: a thread mixes blocks ahead by the engine's own responses and delays, and the system's callback takes them. Neither ever
//! waits for the picture, nor the picture for them.

use super::controls::Clock;
use crate::screen::alert;
use anyhow::Context;
use cpal::SampleFormat;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use fourdgs::AudioSource;
use glam::{DQuat, DVec3};
use ivv::formats::Sounds;
use ivv::sound::FS;
use ivv::sound::fir::{State, Voice};
use ivv::sound::hrtf::{HrtfSet, Lookup};
use ivv::sound::sinc::{DelayTable, Resampler};
use ivv::sound::wav;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Samples that are mixed at once, and blocks that wait for the system.
const BLOCK: usize = 512;
const AHEAD: usize = 3;
/// How far sound may be from the picture on average before it jumps, seconds.
const DRIFT: f64 = 0.02;

type Block = Vec<[f32; 2]>;

/// What the picture tells the sound.
#[derive(Clone, Copy)]
pub struct Heard {
    pub clock: Clock,
    /// Of the head: where it is, and the turn of its axes (forward, left, up) into the world.
    pub place: DVec3,
    pub turn: DQuat,
    pub is_muted: bool,
}

/// Sound that plays until it is dropped.
pub struct Sound {
    heard: Arc<Mutex<Heard>>,
    _stream: cpal::Stream,
}

impl Sound {
    /// Plays `sounds` as `hrtf` has them.
    ///
    /// # Errors
    /// Where there is no device for 48 kHz in stereo.
    pub fn new(sounds: &Sounds, hrtf: HrtfSet, heard: Heard) -> anyhow::Result<Self> {
        let heard = Arc::new(Mutex::new(heard));
        let (sender, receiver) = sync_channel(AHEAD);
        let latency = Arc::new(AtomicU64::new(0));
        let stream = open(receiver, latency.clone())?;
        let mixer = Mixer {
            signals: sounds.sources().iter().map(signal).collect(),
            sources: sounds.sources().to_vec(),
            law: sounds.law(),
            hrtf,
            table: DelayTable::new(),
        };
        let told = heard.clone();
        std::thread::Builder::new().name("sound".to_owned()).spawn(move || mixer.run(&told, &latency, &sender))?;
        stream.play().context("the sound device does not begin")?;
        Ok(Sound { heard, _stream: stream })
    }

    /// Where the picture is now.
    pub fn tell(&self, heard: Heard) {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = heard;
    }
}

/// The samples of a source at 48 kHz; none, with a message, of what is no WAV.
fn signal(source: &AudioSource) -> Vec<f32> {
    let name = format!("sound \"{}\"", source.name);
    if source.codec != "wav" {
        alert!("{name}: expected WAV, found {}; it stays silent here, a browser may play it", source.codec);
        return Vec::new();
    }
    match wav::decode(Path::new(&name), source.data.as_slice()) {
        Ok(recording) => {
            let n = recording.channels.len() as f32;
            let mean = |k: usize| recording.channels.iter().map(|channel| channel[k]).sum::<f32>() / n;
            let samples: Vec<f32> = (0..recording.channels[0].len()).map(mean).collect();
            Resampler::new(recording.fs, FS, 0.0).apply(&samples)
        }
        Err(fault) => {
            alert!("{fault}; it stays silent");
            Vec::new()
        }
    }
}

/// A stream that takes blocks from `receiver`; `latency` is how long what it takes needs to be heard, nanoseconds.
fn open(receiver: Receiver<Block>, latency: Arc<AtomicU64>) -> anyhow::Result<cpal::Stream> {
    let device = cpal::default_host().default_output_device().context("there is no sound device")?;
    let configs = device.supported_output_configs().context("the sound device does not say what it plays")?;
    let is_fit = |config: &cpal::SupportedStreamConfigRange| {
        config.channels() >= 2 && config.contains_rate(FS) && config.sample_format() == SampleFormat::F32
    };
    let config = configs.filter(is_fit).min_by_key(cpal::SupportedStreamConfigRange::channels);
    let config = config.context("the sound device does not play 48 kHz in stereo")?.with_sample_rate(FS).config();
    let n_channels = usize::from(config.channels);
    let mut waiting: std::vec::IntoIter<[f32; 2]> = Vec::new().into_iter();
    let fill = move |out: &mut [f32], info: &cpal::OutputCallbackInfo| {
        let at = info.timestamp();
        let late = at.playback.checked_duration_since(at.callback).unwrap_or_default();
        latency.store(late.as_nanos() as u64, Ordering::Relaxed);
        for frame in out.chunks_exact_mut(n_channels) {
            let heard = waiting.next().or_else(|| {
                waiting = receiver.try_recv().ok()?.into_iter();
                waiting.next()
            });
            let heard = heard.unwrap_or_default();
            for (k, to) in frame.iter_mut().enumerate() {
                *to = heard.get(k).map_or(0.0, |x| x.clamp(-1.0, 1.0));
            }
        }
    };
    let tell = |fault: cpal::Error| tracing::warn!("sound: {fault}");
    device.build_output_stream(config, fill, tell, None).context("the sound device cannot be opened")
}

/// What is mixed.
struct Mixer {
    sources: Vec<AudioSource>,
    signals: Vec<Vec<f32>>,
    law: (Option<[f64; 3]>, f64),
    hrtf: HrtfSet,
    table: DelayTable,
}

/// A source on its way to the ears, the sample that it has got to, and by how many samples each ear heard that late.
struct Course<'a> {
    voice: Voice<'a>,
    next: usize,
    delays: [f64; 2],
}

impl Mixer {
    /// Mixes until nobody takes blocks any more.
    fn run(&self, told: &Mutex<Heard>, latency: &AtomicU64, sender: &SyncSender<Block>) {
        let mut courses: Vec<Option<Course>> = self.sources.iter().map(|_| None).collect();
        let (mut at, mut drift, mut version) = (None, 0.0, 0);
        let queued = Duration::from_secs_f64((AHEAD * BLOCK) as f64 / f64::from(FS));
        loop {
            let heard = *told.lock().unwrap_or_else(PoisonError::into_inner);
            let clock = heard.clock;
            let mut block = vec![[0.0; 2]; BLOCK];
            if clock.is_playing && clock.speed == 1.0 {
                let due = clock.at(Instant::now() + queued + Duration::from_nanos(latency.load(Ordering::Relaxed)));
                let mut t: f64 = at.filter(|_| version == clock.version).unwrap_or(due);
                // The shorter way around the clip.
                let off = (due - t + clock.length / 2.0).rem_euclid(clock.length) - clock.length / 2.0;
                drift += 0.05 * (off - drift);
                if version != clock.version || drift.abs() > DRIFT {
                    (t, drift, version) = (due, 0.0, clock.version);
                }
                for ((source, signal), course) in self.sources.iter().zip(&self.signals).zip(&mut courses) {
                    self.add(source, signal, course, t, &heard, &mut block);
                }
                let next = t + BLOCK as f64 / f64::from(FS);
                at = Some(if next < clock.length { next } else { next - clock.length });
            } else {
                at = None;
                courses.fill_with(|| None);
            }
            if heard.is_muted {
                block.fill([0.0; 2]);
            }
            if sender.send(block).is_err() {
                return;
            }
        }
    }

    /// Adds the block of a source that begins at the time `t` of the clip.
    fn add<'a>(
        &'a self,
        source: &AudioSource,
        signal: &'a [f32],
        course: &mut Option<Course<'a>>,
        t: f64,
        heard: &Heard,
        out: &mut [[f32; 2]],
    ) {
        let state = source.state_at(t);
        if !state.active || signal.is_empty() {
            *course = None;
            return;
        }
        let start = (state.local_time * f64::from(FS)).round() as usize;
        if !source.spatial {
            for (frame, x) in out.iter_mut().zip(signal.iter().skip(start)) {
                *frame = frame.map(|ear| ear + state.gain as f32 * x);
            }
            return;
        }
        let place = DVec3::from(state.position);
        let to = heard.turn.inverse() * (place - heard.place);
        let filter = self.hrtf.filter(to.try_normalize().unwrap_or(DVec3::X), Lookup::Aligned);
        let (new, gain) = (filter.delays, state.gain * distance_gain(place, heard.place, self.law));
        let state = State { filter: Rc::new(filter), gain };
        let mut now = course.take().filter(|course| course.next.abs_diff(start) <= 1).unwrap_or_else(|| Course {
            voice: Voice::new(&self.table, signal, start, state.clone(), new),
            next: start,
            delays: new,
        });
        let (old, first) = (now.delays, now.next + ivv::sound::align::LEAD);
        let glide = |at: usize| {
            let part = at.saturating_sub(first) as f64 / BLOCK as f64;
            [0, 1].map(|ear| old[ear] + part * (new[ear] - old[ear]))
        };
        now.voice.block(now.next, state, BLOCK, glide, out, |_| 1.0);
        *course = Some(Course { voice: now.voice, next: now.next + BLOCK, delays: new });
    }
}

/// How loud a source is, by the law of distance: as recorded where the microphone was, if that is known.
fn distance_gain(source: DVec3, listener: DVec3, (mic, r_min): (Option<[f64; 3]>, f64)) -> f64 {
    let reach = source.distance(listener);
    mic.map_or(1.0 / reach.max(1.0), |mic| source.distance(mic.into()).max(r_min) / reach.max(r_min))
}
