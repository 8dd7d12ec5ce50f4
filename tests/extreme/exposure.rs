//! N7 and N19: opacities and colours.

use super::table::Case;
use crate::common::frames::Tolerance;
use crate::common::one::{One, camera, logit, round, scene_of};
use crate::common::random::Random;

/// `x` moved by `n` units in the last place.
fn moved(x: f32, n: i32) -> f32 {
    (0..n.abs()).fold(x, |x, _| if n > 0 { x.next_up() } else { x.next_down() })
}

pub fn opacities() -> Vec<Case> {
    let ulps = [-100, -8, -3, -2, -1, 0, 1, 2, 3, 8, 100];
    let most = ulps.map(|n| moved(logit(0.99), n));
    let ordinary = [-90.0, -20.0, -6.0, -5.54, 0.0, 5.0, 20.0, 90.0].into_iter().chain(most);
    let mut cases: Vec<Case> = ordinary.map(|opacity| exposed(opacity, 1e-5)).collect();
    // At alpha_min either side is right, and nothing between: 1/255 of the light before the backdrop, or none.
    cases.extend(ulps.map(|n| Case {
        check: Box::new(|frame, _| {
            let right = |alpha: f32| [0.5, 0.5 + 0.5 / 255.0].iter().any(|x| (alpha - x).abs() < 1e-6);
            if frame.alpha.iter().all(|a| right(*a)) { Ok(()) } else { Err(format!("alpha {:?}", frame.alpha)) }
        }),
        ..exposed(moved(logit(1.0 / 255.0), n), 0.01)
    }));
    cases
}

/// A Gaussian of that logit, flat over the picture, before an ordinary one.
fn exposed(opacity: f32, band: f64) -> Case {
    let one = One { opacity, ..round([0.0, 0.0, 4.0], 1e3, 0.5, [0.1, 0.6, 0.9]) };
    let backdrop = round([0.0, 0.0, 6.0], 1e3, 0.5, [0.9, 0.3, 0.1]);
    Case {
        tolerance: Tolerance { band, n_band: 1.0, ..Tolerance::default() },
        ..Case::new(format!("opacity {opacity}"), scene_of(&[one, backdrop]), camera(5, 3))
    }
}

pub fn colors() -> Vec<Case> {
    let mut cases = Vec::new();
    for sh_degree in 0..=3usize {
        for size in [1.0, 1e3] {
            let mut random = Random::new(sh_degree as u64);
            let all: Vec<One> = (0..30)
                .map(|_| {
                    let [x, y] = random.vector(-1.0, 1.0);
                    let mut one = round([x, y, random.uniform(3.0, 5.0) as f32], 0.1, 0.6, [0.0; 3]);
                    one.sh = (0..(sh_degree + 1).pow(2)).map(|_| random.vector(-size, size)).collect();
                    one
                })
                .collect();
            cases.push(Case {
                check: Box::new(|frame, _| {
                    let negative = frame.color.as_flattened().iter().any(|c| *c < 0.0);
                    if negative { Err("a negative colour".to_owned()) } else { Ok(()) }
                }),
                ..Case::new(format!("degree {sh_degree}, coefficients to {size}"), scene_of(&all), camera(48, 32))
            });
        }
    }
    // Below 0 in every channel: black, whatever the amount.
    for value in [-1.8, -10.0, -1e3, -1e30] {
        let one = One { sh: vec![[value; 3]], ..round([0.0, 0.0, 4.0], 0.5, 0.9, [0.0; 3]) };
        let view = camera(48, 32);
        let background = view.background;
        cases.push(Case {
            check: Box::new(move |frame, _| {
                let black = frame
                    .color
                    .iter()
                    .zip(&frame.alpha)
                    .all(|(color, alpha)| (0..3).all(|k| (color[k] - (1.0 - alpha) * background[k]).abs() <= 1e-6));
                if black { Ok(()) } else { Err("not black".to_owned()) }
            }),
            ..Case::new(format!("coefficient {value:e}"), scene_of(&[one]), view)
        });
    }
    cases
}
