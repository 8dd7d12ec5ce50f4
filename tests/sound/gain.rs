//! Levels: T8, T9, T10.

use glam::DVec3;
use ivv::sound::geometry::Mode;
use ivv::sound::metrics::level_db;
use ivv::sound::render::{RenderConfig, Rendered, render_signals};

use super::{head, noise, scene, sphere, track};

const MODES: [Mode; 3] = [Mode::Paper2d, Mode::Paper3d, Mode::Physical];

/// A source at `source` as a head at `at` that looks along y hears it, quiet enough that no peak is held back.
fn heard(mode: Mode, source: DVec3, at: DVec3) -> Rendered {
    let signal: Vec<f32> = noise(6000, 5).iter().map(|x| 0.01 * x).collect();
    let config = RenderConfig { mode, ..RenderConfig::default() };
    render_signals(&scene(track("a", &[(0.0, source)])), &[signal], &head(at, 0.0), sphere(), &config).unwrap()
}

#[test]
fn t8_twice_as_far_is_6_db_less() {
    let source = DVec3::new(0.0, 4.0, 0.0);
    for mode in MODES {
        // Straight ahead at both distances; the ends of the clip are left out, since the delay moves them.
        let level = |y: f64| level_db(&heard(mode, source, DVec3::new(0.0, y, 0.0)).samples[2000..5000]);
        let (recorded, near) = (level(0.0), level(2.0));
        // The floor of 0.2 m rounds the physical gain by 0.04 dB at 2 m.
        let floor = if mode == Mode::Physical { 10.0 * ((1.0 + 0.01) / (1.0 + 0.0025f64)).log10() } else { 0.0 };
        let delay_free = mode != Mode::Physical;
        let off = (near - recorded - 6.0206 + floor).abs();
        assert!(off < if delay_free { 0.01 } else { 0.3 }, "{mode:?}: {near} {recorded}");
        let config = RenderConfig { mode, propagation: false, ..RenderConfig::default() };
        let signal = [noise(6000, 5).iter().map(|x| 0.01 * x).collect::<Vec<f32>>()];
        let level = |y: f64| {
            let head = head(DVec3::new(0.0, y, 0.0), 0.0);
            let scene = scene(track("a", &[(0.0, source)]));
            level_db(&render_signals(&scene, &signal, &head, sphere(), &config).unwrap().samples[2000..5000])
        };
        assert!((level(2.0) - level(0.0) - 6.0206 + floor).abs() < 0.01);
    }
}

#[test]
fn t8_at_the_microphone_the_recording_keeps_its_level() {
    for mode in MODES {
        let [from, to] = heard(mode, DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO).report.sources[0].gain_db;
        let floor = if mode == Mode::Physical { 0.011 } else { 0.0 };
        assert!(from.abs() < 0.01 + floor && to.abs() < 0.01 + floor, "{mode:?}: {from} to {to} dB");
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
        way.mic.pose =
            ivv::sound::pose::PoseTrack::still(DVec3::new(0.0, -40.0, 0.0), glam::DQuat::from_rotation_z(1.6));
        let rendered = render_signals(&way, &[vec![1e-3; 4800]], &head(DVec3::ZERO, 0.0), sphere(), &config).unwrap();
        // A constant in front stays one, so that all that changes is the gain.
        let steady = |at: usize| f64::from(rendered.samples[at][0]);
        let step = (steady(1500) - steady(4000)).abs();
        assert!((steady(1500) / steady(4000)).abs() > 5.0, "{mode:?}: {} {}", steady(1500), steady(4000));
        let jump = (1500..4000).map(|at| (steady(at + 1) - steady(at)).abs()).fold(0.0, f64::max);
        assert!(jump < step / 64.0, "{mode:?}: {jump} of {step}");
    }
}
