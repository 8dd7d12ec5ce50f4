//! Sound scenes whose truth is known: what microphones and ears hear of a voice in a free field, computed apart from the
//! renderer that is judged by it.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::FS;
use super::align::LEAD;
use super::hrtf::{HrtfSet, Lookup};
use super::pose::{HeadPose, PoseTrack};
use super::scene_file::{Mic, SoundScene, Source};
use super::source_track::{Flag, SourceSample, SourceTrack};
use super::wav::Channel;
use super::wola::Baker;

/// Samples for which the true response is held: a third of a millisecond.
const STEP: usize = 16;

/// A voice that is known at any time: tones from 150 Hz to 7 kHz, whose loudness comes and goes as syllables do.
pub struct Speech {
    /// (angular frequency, phase).
    tones: Vec<(f64, f64)>,
}

impl Speech {
    /// The voice of a seed.
    pub fn new(seed: u64) -> Self {
        const TONES: u32 = 36;
        let mut state = seed.wrapping_add(1);
        let mut next = || {
            // Knuth's MMIX generator; its high bits.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1u32 << 31)
        };
        let tone = |k: u32| {
            let place = (f64::from(k) + next()) / f64::from(TONES);
            (TAU * 150.0 * (7000.0f64 / 150.0).powf(place), TAU * next())
        };
        Speech { tones: (0..TONES).map(tone).collect() }
    }

    /// In [-0.5, 0.5], at a time in seconds, as heard without delay at a distance of 1.
    pub fn at(&self, t: f64) -> f64 {
        let loudness = 0.65 + 0.35 * (TAU * 4.0 * t).sin();
        let sum: f64 = self.tones.iter().map(|(frequency, phase)| (frequency * t + phase).sin()).sum();
        0.5 * loudness * sum / self.tones.len() as f64
    }
}

/// A source of sound in a free field: what it says and where it is, at any time in seconds.
pub struct Emitter<'a> {
    /// As heard at a distance of one scene unit.
    pub voice: &'a dyn Fn(f64) -> f64,
    /// World.
    pub place: &'a dyn Fn(f64) -> DVec3,
    /// Scene units per second.
    pub speed_of_sound: f64,
}

impl Emitter<'_> {
    /// What arrives at a place at a time: its amplitude, and where it came from.
    fn arriving(&self, at: DVec3, t: f64) -> (f64, DVec3) {
        let mut said = t;
        let mut from = (self.place)(t);
        // The source moves far slower than sound: each turn gains at least two digits.
        for _ in 0..5 {
            said = t - from.distance(at) / self.speed_of_sound;
            from = (self.place)(said);
        }
        ((self.voice)(said) / from.distance(at).max(1e-3), from)
    }

    /// What a microphone without a direction of its own records.
    pub fn recording(&self, microphone: &PoseTrack, n: usize) -> Vec<f32> {
        let sample = |i: usize| {
            let t = i as f64 / f64::from(FS);
            self.arriving(microphone.at(t).p, t).0 as f32
        };
        (0..n).map(sample).collect()
    }

    /// What the ears of a head hear, each sample the sum of products with the response of the moment.
    pub fn binaural(&self, head: &PoseTrack, hrtf: &HrtfSet, n: usize) -> Vec<[f32; 2]> {
        let mut baker = Baker::new(hrtf.taps(Lookup::Aligned), hrtf.max_delay());
        let past = baker.len();
        // What arrives from `past` samples before the beginning to `LEAD` after the end.
        let time = |i: usize| (i as f64 - past as f64) / f64::from(FS);
        let arriving: Vec<f32> =
            (0..n + past + LEAD).map(|i| self.arriving(head.at(time(i)).p, time(i)).0 as f32).collect();
        let mut out = Vec::with_capacity(n);
        while out.len() < n {
            let t = (out.len() + STEP / 2) as f64 / f64::from(FS);
            let pose = head.at(t);
            let (_, from) = self.arriving(pose.p, t);
            let responses = baker.bake(&hrtf.filter(pose.q.inverse() * (from - pose.p), Lookup::Aligned));
            for i in out.len()..(out.len() + STEP).min(n) {
                let newest = past + LEAD + i;
                let heard = &arriving[newest + 1 - past..=newest];
                let sum = |response: &Vec<f32>| heard.iter().rev().zip(response).map(|(x, h)| x * h).sum::<f32>();
                out.push([sum(&responses[0]), sum(&responses[1])]);
            }
        }
        out
    }
}

/// A scene with its truth.
pub struct Simulated {
    /// The recording's file is not named: see `recording`.
    pub scene: SoundScene,
    /// What the microphone recorded.
    pub recording: Vec<f32>,
    /// The way of the head.
    pub head: PoseTrack,
    /// What its ears hear.
    pub truth: Vec<[f32; 2]>,
}

/// How the built-in scene moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Nothing moves.
    Still,
    /// The source walks at 1 m/s around the head, which turns the other way by 30 degrees a second.
    Walk,
}

/// A speaker 1.5 m from a head and a microphone elsewhere; metres, z up, all at one height.
pub fn simulate(motion: Motion, seconds: f64, seed: u64, hrtf: &HrtfSet) -> Simulated {
    const RADIUS: f64 = 1.5;
    let center = DVec3::new(0.4, 1.0, 0.0);
    let speed = if motion == Motion::Walk { 1.0 } else { 0.0 };
    // From 50 degrees left of forward on, counter-clockwise.
    let place = move |t: f64| {
        let (sin, cos) = (50f64.to_radians() + speed / RADIUS * t).sin_cos();
        center + RADIUS * DVec3::new(-sin, cos, 0.0)
    };
    let yaw = |t: f64| (90.0 - 30.0 * speed * t).to_radians();
    let pose = |t: f64| HeadPose { t, p: center, q: DQuat::from_rotation_z(yaw(t)) };
    // Sixty poses a second, and twice as many places as a camera gives.
    let n_poses = (seconds * 60.0).ceil() as u32 + 1;
    let head = PoseTrack::new((0..=n_poses).map(|k| pose(f64::from(k) / 60.0)).collect())
        .unwrap_or_else(|_| PoseTrack::still(center, pose(0.0).q));
    let sample = |k: u32| {
        let t = f64::from(k) / 60.0;
        SourceSample { t, p: place(t), cov: [0.0; 6], views: 0, reproj_px: 0.0, flag: Flag::Seen }
    };
    let track = SourceTrack { id: "speaker".into(), samples: (0..=n_poses).map(sample).collect(), fps: 60.0 };
    let scene = SoundScene {
        metres_per_unit: Some(1.0),
        up: DVec3::Z,
        mic: Mic {
            camera: "microphone".into(),
            pose: PoseTrack::still(DVec3::ZERO, HeadPose::looking(DVec3::Y, DVec3::Z)),
            wav: "mic.wav".into(),
            channel: Channel::Left,
            offset_s: 0.0,
        },
        sources: vec![Source { track, wav: None, gain_db: 0.0, gates: Vec::new() }],
    };
    let speech = Speech::new(seed);
    let voice = |t: f64| speech.at(t);
    let emitter = Emitter { voice: &voice, place: &place, speed_of_sound: super::render::SPEED_OF_SOUND };
    let n = (seconds * f64::from(FS)) as usize;
    let recording = emitter.recording(&scene.mic.pose, n);
    let truth = emitter.binaural(&head, hrtf, n);
    Simulated { scene, recording, head, truth }
}
