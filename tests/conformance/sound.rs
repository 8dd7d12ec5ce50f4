//! N29: what a head hears where places meet, of silence, and of files of a sample. All of it is worked out on the CPU.

use super::prelude::*;
use anyhow::Context;
use glam::{DQuat, DVec3};
use ivv::Error;
use ivv::internals::sound::geometry::{Mode, SoundPlane, bearing};
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::pose::{HeadPose, PoseTrack};
use ivv::internals::sound::render::{RenderConfig, Rendered, render_signals};
use ivv::internals::sound::scene_file::{Mic, SoundScene, Source};
use ivv::internals::sound::source_track::{Flag, SourceSample, SourceTrack};
use ivv::internals::sound::sphere::Sphere;
use ivv::internals::sound::wav::{self, Channel, Depth};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

const MODES: [Mode; 3] = [Mode::Paper2d, Mode::Paper3d, Mode::Physical];

/// A source that stays at `p`; z is up, the microphone is at the origin and looks along y.
fn scene(p: DVec3) -> SoundScene {
    let sample = SourceSample { t: 0.0, p, cov: [0.0; 6], views: 4, reproj_px: 0.5, flag: Flag::Seen };
    let track = SourceTrack { id: "a".into(), samples: vec![sample], fps: 30.0 };
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
        sources: vec![Source { track, wav: None, gain_db: 0.0, gates: Vec::new() }],
    }
}

fn head(p: DVec3) -> PoseTrack {
    PoseTrack::still(p, DQuat::from_rotation_z(PI / 2.0))
}

/// The head as a sphere, coarse: 92 directions.
fn sphere() -> Result<HrtfSet> {
    Ok(HrtfSet::new(Sphere::default().measured(3), Path::new("sphere"))?)
}

fn tone(n: usize) -> Vec<f32> {
    (0..n).map(|i| 0.25 * (2.0 * PI * 1000.0 * i as f64 / 48_000.0).sin() as f32).collect()
}

fn check_finite(heard: &Rendered) -> Result<()> {
    let n_bad = heard.samples.as_flattened().iter().filter(|x| !x.is_finite()).count();
    ensure!(n_bad == 0, "{n_bad} samples that are not finite");
    Ok(())
}

pub(super) fn places_and_signals(_: &Bench, tally: &mut Tally) -> Result<()> {
    let sphere = sphere()?;
    let source = DVec3::new(0.0, 4.0, 0.0);
    for mode in MODES {
        let config = RenderConfig { mode, ..RenderConfig::default() };
        let hear = |source: DVec3, at: DVec3, signal: Vec<f32>| {
            render_signals(&scene(source), &[signal], &head(at), &sphere, &config)
        };
        let places = [
            ("the listener at the source", source, source),
            ("the listener 1 nm from the source", source, source + DVec3::X * 1e-9),
            ("source and listener at the microphone", DVec3::ZERO, DVec3::ZERO),
            ("the source at the microphone", DVec3::ZERO, DVec3::X),
            ("the source straight above", DVec3::Z, DVec3::ZERO),
            ("the source straight behind", -source, DVec3::ZERO),
            ("the source straight ahead", source, DVec3::ZERO),
        ];
        for (name, source, at) in places {
            tally.case(format!("{mode:?}: {name}"), |_| {
                let heard = hear(source, at, tone(6000))?;
                check_finite(&heard)?;
                ensure!(heard.samples.iter().any(|frame| frame[0] != 0.0), "nothing is heard");
                // The floor of 0.2 m bounds the gain.
                let highest = heard.cues[0].iter().map(|cue| cue.gain).fold(0.0, f64::max);
                ensure!(highest <= source.length().max(0.2) / 0.2 + 1e-9, "a gain of {highest}");
                Ok(())
            });
        }
        tally.case(format!("{mode:?}: silence"), |_| {
            let heard = hear(source, DVec3::X, vec![0.0; 6000])?;
            ensure!(heard.samples.as_flattened().iter().all(|x| *x == 0.0), "something is heard");
            Ok(())
        });
        tally.case(format!("{mode:?}: a recording of one sample"), |_| {
            let heard = hear(source, DVec3::X, vec![0.25])?;
            check_finite(&heard)?;
            ensure!(heard.samples.len() == 1, "{} samples", heard.samples.len());
            Ok(())
        });
    }
    angles(tally);
    tally.case("a recording with a sample that is not finite", |_| refused());
    // -60 dBFS.
    tally.case("the edges of blocks while turning at 180 degrees a second", |tally| {
        tally.within("the amplitude of a click", edge(180.0)?, 1e-3)
    });
    Ok(())
}

/// Where the paper's arc cosine has no derivative, and rounds past 1: straight ahead and straight behind.
fn angles(tally: &mut Tally) {
    for degrees in [0.0, 1e-12, 1e-6, 90.0, 180.0 - 1e-6, 180.0 - 1e-12, 180.0f64] {
        tally.case(format!("an azimuth of {degrees} degrees"), |tally| {
            let plane = SoundPlane::new(DVec3::Z, DVec3::Y).context("no plane")?;
            let (azimuth, head) = (degrees.to_radians(), head(DVec3::ZERO).at(0.0));
            let source = 3.0 * DVec3::new(-azimuth.sin(), azimuth.cos(), 0.0);
            for mode in MODES {
                let found = bearing(mode, &plane, &head, DVec3::ZERO, source).az;
                // pi and -pi are one direction.
                let off = (found - azimuth + PI).rem_euclid(2.0 * PI) - PI;
                tally.within("the azimuth", off.abs(), 1e-6)?;
            }
            Ok(())
        });
    }
}

fn refused() -> Result<()> {
    let path = std::env::temp_dir().join(format!("ivv-extremes-{}.wav", std::process::id()));
    match wav::write(&path, &[[0.1f32], [f32::NAN], [0.1]], Depth::Int24) {
        Err(Error::NonFinite { count: 1, .. }) => {}
        other => bail!("writing it gives {other:?}"),
    }
    ensure!(!path.exists(), "a file was left behind");
    Ok(())
}

/// The largest difference at the edges of blocks between blocks of 256 and of 16 samples, of a full-scale tone.
fn edge(speed: f64) -> Result<f64> {
    let ring: Vec<DVec3> = (0..360)
        .step_by(5)
        .map(|degrees| f64::from(degrees).to_radians())
        .map(|azimuth| DVec3::new(azimuth.cos(), azimuth.sin(), 0.0))
        .chain([DVec3::Z, -DVec3::Z])
        .collect();
    let horizon = HrtfSet::new(Sphere::default().responses(&ring), Path::new("horizon"))?;
    let pose = |t: f64| HeadPose { t, p: DVec3::ZERO, q: DQuat::from_rotation_z((65.0 - speed * t).to_radians()) };
    let path = PoseTrack::new((0..=15).map(|k| pose(f64::from(k) / 60.0)).collect())?;
    let heard = |block: usize| {
        let config = RenderConfig { mode: Mode::Physical, block, ..RenderConfig::default() };
        render_signals(&scene(DVec3::new(0.0, 2.0, 0.0)), &[tone(12_000)], &path, &horizon, &config)
    };
    let (coarse, fine) = (heard(256)?.samples, heard(16)?.samples);
    ensure!(coarse.iter().any(|frame| frame[0].abs() > 0.1), "nothing is heard");
    let near_edges = (256..coarse.len().min(fine.len())).filter(|at| (at + 8) % 256 < 16);
    // The tone's amplitude is a quarter.
    let off = |at: usize| [0, 1].map(|ear| 4.0 * f64::from(coarse[at][ear] - fine[at][ear]).abs());
    Ok(near_edges.flat_map(off).fold(0.0, f64::max))
}
