//! The speaker: what its mouth says, what the microphones at the cameras record, and where detectors see its face.

use super::math::{self, Stream, sin_cos};
use super::options::{Noise, Options};
use super::rig::Camera;
use super::room::HEAD;
use super::texture::MOUTH_Y;
use super::world::World;
use glam::DVec3;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

pub(super) const RATE: u32 = 48_000;
pub(super) const SPEED_OF_SOUND: f64 = 343.0;
/// Amplitude at a distance of one scene unit, of the full range.
pub(super) const GAIN: f64 = 0.5;
const N_TONES: usize = 12;
/// Noise of a keypoint that is seen, and of one that is guessed; pixels.
pub(super) const KEYPOINT_NOISE: f64 = 0.3;
const GUESS_NOISE: f64 = 1.5;
/// Points of COCO-WholeBody; 71 to 82 are the outer lip, 83 to 90 the inner one.
const N_KEYPOINTS: usize = 133;

/// A voice as a function of time, so that it can be evaluated at any delay.
pub(super) struct Voice {
    tones: Vec<(f64, f64)>,
}

impl Voice {
    pub fn new(seed: u64) -> Self {
        let mut random = math::random(seed, Stream::Sound, 0, 0);
        Voice { tones: (0..N_TONES).map(|_| (TAU * random.uniform(150.0, 5000.0), random.uniform(0.0, TAU))).collect() }
    }

    pub fn at(&self, time: f64) -> f64 {
        let loudness = 0.65 + 0.35 * sin_cos(TAU * 4.0 * time).0;
        let sum: f64 = self.tones.iter().map(|(frequency, phase)| sin_cos(frequency * time + phase).0).sum();
        loudness * sum / N_TONES as f64
    }
}

pub(super) fn n_samples(options: &Options) -> u64 {
    u64::from(RATE) * u64::from(options.frames) / u64::from(options.fps)
}

pub(super) fn mouth(world: &World, frame: f64) -> DVec3 {
    let (to_world, position) = world.bodies[world.head].motion.pose(world.moving_time(frame));
    to_world * on_face(0.0, MOUTH_Y) + position
}

/// The voice at its source, as heard without delay at a distance of one.
pub(super) fn source(options: &Options) -> Vec<f64> {
    let voice = Voice::new(options.seed);
    (0..n_samples(options)).map(|i| GAIN * voice.at(i as f64 / f64::from(RATE))).collect()
}

/// The recording at a camera's lens, delayed and faint by the distance, by the camera's clock.
pub(super) fn recording(world: &World, options: &Options, camera: &Camera) -> Vec<f64> {
    let voice = Voice::new(options.seed);
    let fps = f64::from(options.fps);
    let sample = |i: u64| {
        let heard = i as f64 / f64::from(RATE) + camera.time_offset / fps;
        let mut said = heard;
        let mut distance = 0.0;
        // The mouth moves far slower than sound: each turn gains at least two digits.
        for _ in 0..5 {
            distance = (mouth(world, said * fps) - camera.center_at(heard * fps)).length();
            said = heard - distance / SPEED_OF_SOUND;
        }
        GAIN * voice.at(said) / distance
    };
    (0..n_samples(options)).map(sample).collect()
}

#[derive(Serialize)]
pub(super) struct Detections {
    frame_id: u32,
    instances: Vec<Instance>,
}

#[derive(Serialize)]
struct Instance {
    keypoints: Vec<[f64; 2]>,
    keypoint_scores: Vec<f64>,
    bbox: [[f64; 4]; 1],
    bbox_score: f64,
}

/// The detections in a camera's pictures: nose, eyes and lips with their visibility as scores; other points have the score 0.
pub(super) fn keypoints(world: &World, options: &Options, index: usize, camera: &Camera) -> Vec<Detections> {
    (0..options.frames)
        .map(|frame| Detections { frame_id: frame, instances: detect(world, options, index, camera, frame) })
        .collect()
}

fn detect(world: &World, options: &Options, index: usize, camera: &Camera, frame: u32) -> Vec<Instance> {
    let mut random = math::random(options.seed, Stream::Keypoints, index, frame);
    let now = world.at(f64::from(frame) + camera.time_offset);
    let camera = &camera.of_frame(frame);
    let head = &now.placed[world.head];
    if !camera.project(head.position).is_some_and(|(at, _)| camera.intrinsics.holds(at)) {
        return Vec::new();
    }
    let (mut keypoints, mut scores) = (vec![[0.0; 2]; N_KEYPOINTS], vec![0.0; N_KEYPOINTS]);
    let mut corners = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for (number, local) in face() {
        let world_point = head.world(local);
        let Some((at, _)) = camera.project(world_point) else { continue };
        let visible = camera.intrinsics.holds(at) && now.sees(camera.center, world_point);
        let spread = match (options.noise, visible) {
            (Noise::None, _) => 0.0,
            (_, true) => KEYPOINT_NOISE,
            (_, false) => GUESS_NOISE,
        };
        keypoints[number] = [at.x + spread * random.nearly_normal(), at.y + spread * random.nearly_normal()];
        scores[number] = if visible { 0.92 } else { 0.15 };
        for axis in 0..2 {
            corners[0][axis] = corners[0][axis].min(keypoints[number][axis]);
            corners[1][axis] = corners[1][axis].max(keypoints[number][axis]);
        }
    }
    let [[left, top], [right, bottom]] = corners;
    vec![Instance { keypoints, keypoint_scores: scores, bbox: [[left, top, right, bottom]], bbox_score: 0.9 }]
}

/// (number, place on the head) of nose, eyes, outer lip and inner lip; lips begin at the speaker's right corner, upper lip first.
fn face() -> impl Iterator<Item = (usize, DVec3)> {
    let single = [(0, 0.0, 0.1), (1, 0.33, -0.15), (2, -0.33, -0.15)];
    let ring = |first: usize, n: usize, half: [f64; 2]| {
        (0..n).map(move |i| {
            let (sin, cos) = sin_cos(2.0 * PI * i as f64 / n as f64);
            (first + i, -half[0] * cos, MOUTH_Y - half[1] * sin)
        })
    };
    let lips = ring(71, 12, [0.3, 0.09]).chain(ring(83, 8, [0.24, 0.05]));
    single.into_iter().chain(lips).map(|(number, x, y)| (number, on_face(x, y)))
}

/// The point of the head's surface in front of (x, y), in radii; the head looks along -z.
fn on_face(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, -(1.0 - x * x - y * y).sqrt()) * HEAD
}
