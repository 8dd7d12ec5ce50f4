//! N2 to N4: sizes, needles and quaternions.

use super::table::Case;
use crate::common::frames::Tolerance;
use crate::common::one::{One, at_pixel, camera, round, scene_of};
use crate::common::random::Random;

/// Pixels per scene unit at depth 4 of `one::camera`.
const PIXELS: f64 = 16.0;

/// An ordinary Gaussian behind all others.
fn backdrop() -> One {
    round([0.3, 0.1, 6.0], 0.6, 0.7, [0.9, 0.3, 0.1])
}

pub fn scales() -> Vec<Case> {
    let mut cases = Vec::new();
    for scale in [-30.0f32, -15.0, -5.0, 0.0, 5.0, 10.0, 20.0, 40.0] {
        for n_axes in 1..=3 {
            let mut one = round([0.2, 0.1, 4.0], 0.1, 0.88, [0.1, 0.6, 0.9]);
            one.rotation = [0.7, -0.2, 0.4, 0.1];
            one.scale[..n_axes].fill(scale);
            let name = format!("{n_axes} axes of e^{scale}");
            cases.push(Case::new(name, scene_of(&[one, backdrop()]), camera(48, 32)));
        }
    }
    cases
}

pub fn needles() -> Vec<Case> {
    let view = camera(64, 48);
    let mut cases = Vec::new();
    for major in [0.01, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5] {
        let mut random = Random::new(major as u64);
        let mut all = vec![backdrop()];
        for i in 0..8 {
            let [x, y] = [random.uniform(8.0, 56.0), random.uniform(8.0, 40.0)];
            let mut one = round(at_pixel(&view, x, y, 4.0 + f64::from(i) / 8.0), 1e-4, 0.8, [0.2, 0.9, 0.5]);
            one.scale[(random.bits() % 3) as usize] = (major / PIXELS).ln() as f32;
            one.rotation = random.vector(-1.0, 1.0);
            all.push(one);
        }
        // Along a needle of any length its line is as straight as f32 angles: 1e-7 of the distance from the centre.
        let away = if major < 1e3 { 1e-5 } else { 5e-5 };
        let tolerance = Tolerance { away, ..Tolerance::default() };
        cases.push(Case { tolerance, ..Case::new(format!("{major} px"), scene_of(&all), view.clone()) });
    }
    cases
}

pub fn quaternions() -> Vec<Case> {
    let view = camera(48, 32);
    let scene = |length: f32| {
        let mut one = round([0.1, -0.1, 4.0], 0.02, 0.9, [0.1, 0.6, 0.9]);
        one.scale[1] = -0.5;
        one.rotation = [0.8, 0.0, -0.48, 0.36].map(|x: f32| x * length);
        scene_of(&[one, backdrop()])
    };
    let mut cases: Vec<Case> = [1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e19, 1e20, 3e38]
        .into_iter()
        .map(|length| Case {
            truth: Some(scene(1.0)),
            ..Case::new(format!("length {length:e}"), scene(length), view.clone())
        })
        .collect();
    let tolerance = Tolerance { band: 1e-5, ..Tolerance::default() };
    cases.push(Case { n_bad: 1, tolerance, ..Case::new("length 0", scene(0.0), view) });
    cases
}
