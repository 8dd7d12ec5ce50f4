//! The sound field; T-numbers are those of the table of tests in `engine/sound/README.md`.

pub mod clip;
mod command;
mod convolution;
mod gain;
mod geometry;
mod hrtf;
pub mod keypoints;
mod live;
mod localize;
mod measure;
mod motion;
mod output;
pub mod path;
mod real;
mod rigs;
mod sets;
mod simulate;
mod speaker;
mod step;
mod tracks;
mod triangulate;
mod truth;
mod whole;

use crate::common::prelude::*;
use ivv::internals::sound::hrtf::degrees;
use ivv::internals::sound::scene_file::{Mic, Source};
use ivv::internals::sound::source_track::Flag;
use ivv::internals::sound::wav::Channel;

/// The head as a sphere, coarse: 92 directions.
fn sphere() -> &'static HrtfSet {
    static SET: OnceLock<HrtfSet> = OnceLock::new();
    SET.get_or_init(|| HrtfSet::new(Sphere::default().measured(3), Path::new("sphere")).unwrap())
}

/// The same, measured every 5 degrees on the horizon, for what moves there.
fn horizon() -> &'static HrtfSet {
    static SET: OnceLock<HrtfSet> = OnceLock::new();
    SET.get_or_init(|| horizon_of(72))
}

/// The same, in `n` directions of the horizon.
fn horizon_of(n: u32) -> HrtfSet {
    let ring = |el: f64, n: u32| (0..n).map(move |k| degrees(360.0 * f64::from(k) / f64::from(n), el));
    let to: Vec<DVec3> = ring(0.0, n).chain(ring(40.0, 8)).chain(ring(-40.0, 8)).chain([DVec3::Z, -DVec3::Z]).collect();
    HrtfSet::new(Sphere::default().responses(&to), Path::new("horizon")).unwrap()
}

/// SADIE's subject 002, where it is there.
#[track_caller]
fn sadie() -> Option<&'static HrtfSet> {
    static SET: OnceLock<HrtfSet> = OnceLock::new();
    let folder = shared("data/hrtf_sadie_subject002/WAV/Subject_002/DFC/48K_24bit")?;
    Some(SET.get_or_init(|| HrtfSet::open(&folder).unwrap()))
}

fn sample(t: f64, p: DVec3) -> SourceSample {
    SourceSample { t, p, cov: [0.0; 6], views: 4, reproj_px: 0.5, flag: Flag::Seen }
}

/// A source through places at times.
pub fn track(id: &str, way: &[(f64, DVec3)]) -> SourceTrack {
    SourceTrack { id: id.into(), samples: way.iter().map(|(t, p)| sample(*t, *p)).collect(), fps: 30.0 }
}

/// z is up, the microphone is at the origin and looks along y; a unit is a metre.
pub fn scene(source: SourceTrack) -> SoundScene {
    SoundScene {
        metres_per_unit: Some(1.0),
        up: DVec3::Z,
        mic: Mic {
            camera: "a".into(),
            pose: PoseTrack::still(DVec3::ZERO, HeadPose::looking(DVec3::Y, DVec3::Z)),
            wav: PathBuf::new(),
            channel: Channel::Left,
            offset_s: 0.0,
        },
        sources: vec![Source { track: source, wav: None, gain_db: 0.0, gates: Vec::new() }],
    }
}

/// A head that stays at `p`, turned by `yaw` degrees to the left of y.
fn head(p: DVec3, yaw: f64) -> PoseTrack {
    PoseTrack::still(p, DQuat::from_rotation_z((90.0 + yaw).to_radians()))
}

fn tone(frequency: f64, n: usize) -> Vec<f32> {
    (0..n).map(|i| (std::f64::consts::TAU * frequency * i as f64 / 48_000.0).sin() as f32).collect()
}

fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u32 << 23) as f32 - 1.0
    };
    (0..n).map(|_| next()).collect()
}

fn ear(frames: &[[f32; 2]], ear: usize) -> Vec<f32> {
    frames.iter().map(|frame| frame[ear]).collect()
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.max(1e-40).log10()
}
