//! N11 to N14: time, fading and motion.

use super::table::Case;
use crate::common::frames::{Tolerance, bits, render};
use crate::common::one::{One, camera, round, scene_of};
use crate::common::random::Random;
use ivv::scene::{Motion, View};

/// A static Gaussian behind all others.
fn backdrop() -> One {
    round([0.3, 0.1, 6.0], 0.6, 0.7, [0.9, 0.3, 0.1])
}

/// A Gaussian of base opacity 0.99, visible for u = |t - t_center| / tau up to 2.352.
fn fading(t_center: f32, t_scale: f32) -> One {
    let motion = Motion { velocity: [0.0; 3], t_center, t_scale };
    One { motion: Some(motion), ..round([0.0, 0.0, 4.0], 3.0, 0.99, [0.1, 0.6, 0.9]) }
}

pub fn distances() -> Vec<Case> {
    let mut cases = Vec::new();
    for t_scale in [-18.42f32, 0.0, 9.21] {
        for u in [0.0, 1e-20, 0.707, 1.0, 2.35, 2.36, 9.3, 9.4, 16.0, 1e10, 1e19, 1e30] {
            let view = View { time: u * f64::from(t_scale).exp(), ..camera(48, 32) };
            let gone = u > 2.355;
            let shown = view.clone();
            cases.push(Case {
                // exp is good to 3 + 2|x| ULP (A.1): of log tau, and of u^2, which doubles the error of u.
                tolerance: Tolerance { away: 3e-5, ..Tolerance::default() },
                check: Box::new(move |frame, _| {
                    let same = bits(frame) == bits(&render(&scene_of(&[backdrop()]), &shown).0);
                    if same == gone { Ok(()) } else { Err(format!("gone: {same}, but {gone} is right")) }
                }),
                ..Case::new(
                    format!("u = {u:e}, log tau = {t_scale}"),
                    scene_of(&[fading(0.0, t_scale), backdrop()]),
                    view,
                )
            });
        }
    }
    cases
}

pub fn time_scales() -> Vec<Case> {
    let half_frame = (0.5f64 / 300.0).ln() as f32;
    let mut cases = Vec::new();
    for t_scale in [half_frame, -18.42, -60.0, -80.0, 0.0, 9.21, 60.0, 88.0, 100.0, 1e38, f32::INFINITY] {
        // At its centre, and 0.25 away, where only tau above 0.1 still shows it.
        for t_center in [0.5, 0.25] {
            let all = [fading(t_center, t_scale), backdrop()];
            cases.push(Case::new(format!("log tau = {t_scale:e}, centre {t_center}"), scene_of(&all), camera(48, 32)));
        }
    }
    cases
}

/// Gaussians whose times lie on a grid of 1/128, which f32 holds up to 1e5 and beyond.
fn clip(origin: f64) -> Vec<One> {
    let mut random = Random::new(13);
    (0..30)
        .map(|_| {
            let grid = (random.bits() % 128) as f64 / 128.0;
            let motion = Motion {
                velocity: random.vector(-1.0, 1.0),
                t_center: (origin + grid) as f32,
                t_scale: random.uniform(-2.0, 1.0) as f32,
            };
            let [x, y] = random.vector(-1.0, 1.0);
            One { motion: Some(motion), ..round([x, y, 4.0], 0.15, 0.8, [0.3, 0.6, 0.1]) }
        })
        .collect()
}

pub fn origins() -> Vec<Case> {
    [0.0, 300.0, 18_000.0, 1e5]
        .into_iter()
        .map(|origin| {
            let at = |origin: f64| View { time: origin + 0.5, ..camera(48, 32) };
            Case {
                tolerance: Tolerance { n_band: 0.2, ..Tolerance::default() },
                check: Box::new(move |frame, _| {
                    let same = bits(frame) == bits(&render(&scene_of(&clip(0.0)), &at(0.0)).0);
                    if same { Ok(()) } else { Err("not the bits of the clip at time 0".to_owned()) }
                }),
                ..Case::new(format!("time {origin}"), scene_of(&clip(origin)), at(origin))
            }
        })
        .collect()
}

pub fn velocities() -> Vec<Case> {
    let case = |velocity: [f32; 3]| {
        let motion = Motion { velocity, t_center: 0.5, t_scale: 0.0 };
        let all = [One { motion: Some(motion), ..round([0.1, 0.0, 4.0], 0.3, 0.8, [0.1, 0.6, 0.9]) }, backdrop()];
        Case::new(format!("velocity {velocity:?}"), scene_of(&all), camera(48, 32))
    };
    let finite =
        [[0.0; 3], [-0.0; 3], [1e-12, -1e-12, 0.0], [1e-30, 0.0, 0.0], [1e3, -5e2, 2e2], [0.0, 0.0, 1e3], [1e30; 3]];
    let mut cases: Vec<Case> = finite.into_iter().map(case).collect();
    for velocity in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY]] {
        cases.push(Case { n_bad: 1, ..case(velocity) });
    }
    cases
}
