//! Levels: T8, T9, T10.

use super::measure::level_db;
use super::{head, noise, scene, sphere, track};
use crate::common::prelude::*;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::render::Rendered;

const MODES: [Mode; 3] = [Mode::Paper2d, Mode::Paper3d, Mode::Physical];

/// A source at `source` as a head at `at` that looks along y hears it, quiet enough that no peak is held back.
fn heard(mode: Mode, source: DVec3, at: DVec3) -> Rendered {
    let signal: Vec<f32> = noise(6000, 5).iter().map(|x| 0.01 * x).collect();
    let config = RenderConfig { mode, ..RenderConfig::default() };
    render_signals(&scene(track("a", &[(0.0, source)])), &[signal], &head(at, 0.0), sphere(), &config).unwrap()
}

/// Tones of whole periods in 3000 samples, below 16 kHz: their mean energy over so many is the same from any sample on, and
/// after any delay, so that a level is that of the gain alone. Of noise a delay would bring another stretch under the meter.
fn periodic(n: usize) -> Vec<f32> {
    let tones = |i: usize| {
        let tone = |k: usize| (std::f64::consts::TAU * (80 * k + 7) as f64 * i as f64 / 3000.0 + (k * k) as f64).sin();
        (0..12).map(tone).sum::<f64>()
    };
    (0..n).map(|i| (1e-3 * tones(i)) as f32).collect()
}

/// By how much the sound at `at` is louder than the recording, decibels, of a source straight ahead.
fn louder(mode: Mode, source: DVec3, at: DVec3, propagation: bool) -> f64 {
    let config = RenderConfig { mode, propagation, ..RenderConfig::default() };
    let far = scene(track("a", &[(0.0, source)]));
    let level = |scene: &SoundScene, config: &RenderConfig| {
        let rendered = render_signals(scene, &[periodic(6000)], &head(at, 0.0), sphere(), config).unwrap();
        level_db(&rendered.samples[2000..5000])
    };
    // The frontal responses colour the sound; at the microphone's place they do alone.
    let mut beside = far.clone();
    beside.mic.pose = PoseTrack::still(at, far.mic.pose.poses()[0].q);
    level(&far, &config) - level(&beside, &RenderConfig { mode: Mode::Paper3d, ..RenderConfig::default() })
}

#[test]
fn t8_twice_as_far_is_6_db_less() {
    let source = DVec3::new(0.0, 4.0, 0.0);
    for mode in MODES {
        for propagation in [true, false] {
            let at = |y: f64| louder(mode, source, DVec3::new(0.0, y, 0.0), propagation);
            let (recorded, near) = (at(0.0), at(2.0));
            // The rounded floor of the physical gain, r^2 + 0.2^2, takes 0.032 dB at 2 m and 0.011 dB at 4 m.
            let floor = |r: f64| if mode == Mode::Physical { 10.0 * (1.0 + (0.2 / r).powi(2)).log10() } else { 0.0 };
            assert!((near + floor(2.0) - recorded - floor(4.0) - 6.0206).abs() < 0.01, "{mode:?}: {near} {recorded}");
            // At the microphone the recording keeps its level.
            assert!((recorded + floor(4.0)).abs() < 0.01, "{mode:?}: {recorded} dB");
        }
    }
}

#[test]
fn t8_at_the_microphone_the_recording_keeps_its_level() {
    // From 4.2 m on the floor takes less than 0.01 dB.
    for mode in MODES {
        let source = DVec3::new(0.0, 5.0, 0.0);
        let level = louder(mode, source, DVec3::ZERO, true);
        assert!(level.abs() < 0.01, "{mode:?}: {level} dB");
        let [from, to] = heard(mode, source, DVec3::ZERO).report.sources[0].gain_db;
        assert!(from.abs() < 0.01 && to.abs() < 0.01, "{mode:?}: {from} to {to} dB");
    }
}

#[test]
fn t9_places_that_meet_are_finite() {
    let source = DVec3::new(0.0, 4.0, 0.0);
    for mode in MODES {
        for (source, at) in
            [(source, source), (source, source + DVec3::X * 1e-9), (DVec3::ZERO, DVec3::ZERO), (DVec3::ZERO, DVec3::X)]
        {
            let rendered = heard(mode, source, at);
            assert!(rendered.samples.iter().flatten().all(|value| value.is_finite()));
            let highest = rendered.cues[0].iter().map(|cue| cue.gain).fold(0.0, f64::max);
            assert!(highest <= source.length().max(0.2) / 0.2 + 1e-9, "{mode:?}: {highest}");
            assert!(level_db(&rendered.samples) > -120.0);
        }
    }
}

#[test]
fn t10_a_step_of_20_db_does_not_click() {
    // The source steps from 0.4 m to 4 m within a tenth of a millisecond: a gain of 1/10.
    let (near, far) = (DVec3::new(0.0, 0.4, 0.0), DVec3::new(0.0, 4.0, 0.0));
    for mode in MODES {
        let config = RenderConfig { mode, propagation: false, r_min_m: 1e-3, ..RenderConfig::default() };
        let step = [(0.0, near), (0.0499, near), (0.05, near), (0.0501, far), (0.0502, far), (0.1, far)];
        let mut way = scene(track("a", &step));
        way.mic.pose = PoseTrack::still(DVec3::new(0.0, -40.0, 0.0), glam::DQuat::from_rotation_z(1.6));
        let rendered = render_signals(&way, &[vec![1e-3; 4800]], &head(DVec3::ZERO, 0.0), sphere(), &config).unwrap();
        // A constant in front stays one, so that all that changes is the gain.
        let steady = |at: usize| f64::from(rendered.samples[at][0]);
        let step = (steady(1500) - steady(4000)).abs();
        assert!((steady(1500) / steady(4000)).abs() > 5.0, "{mode:?}: {} {}", steady(1500), steady(4000));
        let jump = (1500..4000).map(|at| (steady(at + 1) - steady(at)).abs()).fold(0.0, f64::max);
        assert!(jump < step / 64.0, "{mode:?}: {jump} of {step}");
    }
}
