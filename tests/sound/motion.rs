//! What moves: T22, T23, T25, T26, and clicks at the edges of blocks.

use super::measure::splatter_db;
use super::{ear, head, horizon, horizon_of, scene, sphere, tone, track};
use crate::common::prelude::*;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::render::Rendered;

/// A tone in front of a head that turns `speed` degrees a second.
fn turning(speed: f64, seconds: f64, config: &RenderConfig) -> Rendered {
    turning_with(horizon(), speed, seconds, config)
}

fn turning_with(set: &HrtfSet, speed: f64, seconds: f64, config: &RenderConfig) -> Rendered {
    let pose = |t: f64| {
        let yaw = (90.0 - 25.0 - speed * t).to_radians();
        HeadPose { t, p: DVec3::ZERO, q: DQuat::from_rotation_z(yaw) }
    };
    let steps = (seconds * 60.0).ceil() as u32;
    let path = PoseTrack::new((0..=steps).map(|k| pose(f64::from(k) / 60.0)).collect()).unwrap();
    let way = scene(track("a", &[(0.0, DVec3::new(0.0, 2.0, 0.0))]));
    let signal: Vec<f32> = tone(1000.0, (seconds * 48_000.0) as usize).iter().map(|x| 0.25 * x).collect();
    render_signals(&way, &[signal], &path, set, config).unwrap()
}

fn physical() -> RenderConfig {
    RenderConfig { mode: Mode::Physical, ..RenderConfig::default() }
}

#[test]
fn t22_t23_turning_adds_nothing_to_a_tone() {
    for (speed, bound) in [(30.0, -90.0), (180.0, -70.0)] {
        let heard = |lookup: Lookup| turning(speed, 0.5, &RenderConfig { lookup, ..physical() }).samples;
        let (aligned, nearest) = (heard(Lookup::Aligned), heard(Lookup::Nearest));
        // The near ear, and the one in the head's shadow, behind which the two ways around the head change places.
        for side in 0..2 {
            let splatter = |frames: &[[f32; 2]]| splatter_db(&ear(frames, side)[2400..], 1000.0);
            let (aligned, nearest) = (splatter(&aligned), splatter(&nearest));
            println!("{speed} degrees a second, ear {side}: aligned {aligned:.1} dB, nearest {nearest:.1} dB");
            assert!(aligned <= bound, "{speed}, ear {side}: {aligned} dB");
            // In the shadow the tone itself is lower by 5 dB and a set of every 5 degrees is the limit.
            let worse = if side == 0 || speed < 100.0 { 25.0 } else { 20.0 };
            assert!(nearest >= aligned + worse, "{speed}, ear {side}: {nearest} dB, aligned {aligned} dB");
        }
    }
}

/// What is left in the shadow is due to the distance of the measured directions.
#[test]
fn t22_a_denser_set_leaves_less_in_the_shadow() {
    let splatter =
        |set: &HrtfSet| splatter_db(&ear(&turning_with(set, 180.0, 0.5, &physical()).samples, 1)[2400..], 1000.0);
    let (dense, sparse) = (splatter(&horizon_of(144)), splatter(horizon()));
    println!("180 degrees a second, ear 1: {sparse:.1} dB every 5 degrees, {dense:.1} dB every 2.5");
    assert!(dense < sparse - 1.5, "{dense} dB, {sparse} dB");
}

#[test]
fn no_click_at_a_blocks_edge() {
    // Against blocks of 16 samples, full range, a head that turns 180 degrees a second.
    let heard = |block: usize| turning(180.0, 0.25, &RenderConfig { block, ..physical() }).samples;
    let (coarse, fine) = (heard(256), heard(16));
    let near_edges = (256..coarse.len()).filter(|at| (at + 8) % 256 < 16);
    // The tone's amplitude is a quarter.
    let worst =
        near_edges.flat_map(|at| [0, 1].map(|ear| 4.0 * (coarse[at][ear] - fine[at][ear]).abs())).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{} dBFS", 20.0 * worst.log10());
    assert!(coarse.iter().any(|frame| frame[0].abs() > 0.1));
}

/// The mean frequency between the first and the last rising zero of a signal.
fn frequency(signal: &[f32]) -> f64 {
    let rising: Vec<f64> = signal
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[0] < 0.0 && pair[1] >= 0.0)
        .map(|(at, pair)| at as f64 + f64::from(pair[0] / (pair[0] - pair[1])))
        .collect();
    (rising.len() - 1) as f64 / (rising[rising.len() - 1] - rising[0]) * 48_000.0
}

#[test]
fn t25_a_head_that_comes_nearer_hears_a_higher_tone() {
    let source = DVec3::new(0.0, 30.0, 0.0);
    let way = scene(track("a", &[(0.0, source)]));
    let pose = |t: f64| HeadPose { t, p: DVec3::new(0.0, 10.0 * t, 0.0), q: head(DVec3::ZERO, 0.0).at(0.0).q };
    let path = PoseTrack::new(vec![pose(0.0), pose(1.0)]).unwrap();
    let heard = |propagation: bool| {
        let config = RenderConfig { propagation, ..physical() };
        let rendered = render_signals(&way, &[tone(1000.0, 19_200)], &path, sphere(), &config).unwrap();
        frequency(&ear(&rendered.samples, 0)[2400..16_800])
    };
    let (with, without) = (heard(true), heard(false));
    assert!((with / (1000.0 * (1.0 + 10.0 / 343.2)) - 1.0).abs() < 1e-3, "{with}");
    assert!((without / 1000.0 - 1.0).abs() < 1e-4, "{without}");
}

#[test]
fn t26_a_jump_of_the_head_does_not_click() {
    // 3 m to the side, about the same distance from the source.
    let at = |x: f64| DVec3::new(x, 0.0, 0.0);
    let pose = |t: f64, x: f64| HeadPose { t, p: at(x), q: head(DVec3::ZERO, 0.0).at(0.0).q };
    let path = PoseTrack::new(vec![pose(0.0, -0.5), pose(0.2, -0.5), pose(0.2001, 2.5), pose(0.4, 2.5)]).unwrap();
    let way = scene(track("a", &[(0.0, DVec3::new(0.0, 4.0, 0.0))]));
    let signal: Vec<f32> = tone(500.0, 19_200).iter().map(|x| 0.2 * x).collect();
    let rendered = render_signals(&way, &[signal], &path, sphere(), &physical()).unwrap();
    assert_eq!(rendered.report.sources[0].jumps, 1);
    for side in 0..2 {
        let heard = ear(&rendered.samples, side);
        let peak = |from: usize, to: usize| heard[from..to].iter().map(|value| value.abs()).fold(0.0, f32::max);
        let steady = peak(3000, 9000).max(peak(12_000, 18_000));
        assert!(peak(9000, 12_000) <= 1.2 * steady && steady > 0.05, "{} of {steady}", peak(9000, 12_000));
        // Neighbouring samples differ by no more than those of the tone do.
        let step = heard[3000..18_000].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        assert!(step < 1.2 * steady * 0.0655, "{step}");
    }
}
