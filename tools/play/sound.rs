//! Sound: a thread mixes blocks ahead by the engine's own responses and delays, and the system's callback takes them. Neither ever
//! waits for the picture, nor the picture for them.

use crate::ui::screen::alert;
use anyhow::Context;
use cpal::SampleFormat;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use ivv::internals::formats::Sounds;
use ivv::internals::scene::Playhead;
use ivv::internals::sound::FS;
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::live::{Chase, Live};
use ivv::internals::sound::pose::{HeadPose, PoseTrack};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Samples that are mixed at once, and blocks that wait for the system.
const BLOCK: usize = 512;
const AHEAD: usize = 3;

type Block = Vec<[f32; 2]>;

#[derive(Clone, Copy)]
pub struct Heard {
    pub clip: Playhead,
    pub head: HeadPose,
    pub is_muted: bool,
}

/// Sound that plays until it is dropped.
pub struct Sound {
    heard: Arc<Mutex<Heard>>,
    _stream: cpal::Stream,
}

impl Sound {
    /// An error where there is no device for 48 kHz in stereo.
    pub fn new(sounds: &Sounds, hrtf: HrtfSet, heard: Heard) -> anyhow::Result<Self> {
        let heard = Arc::new(Mutex::new(heard));
        let (sender, receiver) = sync_channel(AHEAD);
        let latency = Arc::new(AtomicU64::new(0));
        let stream = open(receiver, latency.clone())?;
        let live = Live::new(sounds, hrtf);
        live.faults.iter().for_each(|fault| alert!("{fault}; it stays silent"));
        let told = heard.clone();
        let run = move || mix(&live, &told, &latency, &sender);
        std::thread::Builder::new().name("sound".to_owned()).spawn(run)?;
        stream.play().context("the sound device does not begin")?;
        Ok(Sound { heard, _stream: stream })
    }

    pub fn tell(&self, heard: Heard) {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = heard;
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

/// Mixes until nobody takes blocks any more.
fn mix(live: &Live, told: &Mutex<Heard>, latency: &AtomicU64, sender: &SyncSender<Block>) {
    let mut listener = live.listener();
    let mut chase = Chase::default();
    let queued = Duration::from_secs_f64((AHEAD * BLOCK) as f64 / f64::from(FS));
    loop {
        let Heard { clip, head, is_muted } = *told.lock().unwrap_or_else(PoisonError::into_inner);
        let mut block = vec![[0.0; 2]; BLOCK];
        let moment = Instant::now() + queued + Duration::from_nanos(latency.load(Ordering::Relaxed));
        match chase.next(&clip, moment, BLOCK) {
            Some(t) => listener.block(t, &PoseTrack::still(head.p, head.q), &mut block),
            None => listener.rest(),
        }
        if is_muted {
            block.fill([0.0; 2]);
        }
        if sender.send(block).is_err() {
            return;
        }
    }
}
