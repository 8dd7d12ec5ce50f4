//! Sound scenes whose truth is known.

use super::{scene, track};
use crate::common::prelude::*;
use ivv::internals::sound::FS;
use ivv::internals::sound::emitter::Emitter;
use ivv::internals::sound::render::SPEED_OF_SOUND;
use std::f64::consts::TAU;

/// A voice that is known at any time: tones from 150 Hz to 7 kHz, whose loudness comes and goes as syllables do.
pub struct Speech {
    /// (angular frequency, phase).
    tones: Vec<(f64, f64)>,
}

impl Speech {
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

pub fn recording(emitter: &Emitter, microphone: &PoseTrack, n: usize) -> Vec<f32> {
    let sample = |i: usize| {
        let t = i as f64 / f64::from(FS);
        emitter.arriving(microphone.at(t).p, t).0 as f32
    };
    (0..n).map(sample).collect()
}

pub struct Simulated {
    pub scene: SoundScene,
    pub recording: Vec<f32>,
    pub head: PoseTrack,
    pub truth: Vec<[f32; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
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
    let head = PoseTrack::new((0..=n_poses).map(|k| pose(f64::from(k) / 60.0)).collect()).unwrap();
    let way: Vec<(f64, DVec3)> = (0..=n_poses).map(|k| f64::from(k) / 60.0).map(|t| (t, place(t))).collect();
    let scene = scene(track("speaker", &way));
    let speech = Speech::new(seed);
    let voice = |t: f64| speech.at(t);
    let emitter = Emitter { voice: &voice, place: &place, speed_of_sound: SPEED_OF_SOUND };
    let n = (seconds * f64::from(FS)) as usize;
    let recording = recording(&emitter, &scene.mic.pose, n);
    let truth = emitter.binaural(&head, hrtf, n);
    Simulated { scene, recording, head, truth }
}
