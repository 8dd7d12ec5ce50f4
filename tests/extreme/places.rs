//! N5, N6, N17, N18: where Gaussians are, and the picture they are on.

use super::table::Case;
use crate::common::frames::Tolerance;
use crate::common::one::{One, at_pixel, camera, round, scene_of};
use crate::common::random::Random;
use ivv::Constants;
use ivv::scene::View;

pub fn depths() -> Vec<Case> {
    let near = Constants::default().near;
    let kept = [near.next_up(), 0.011, 0.2, 1.0, 1e2, 1e4, 1e6].map(|z| (z, true));
    let dropped = [near.next_down(), near, 0.0, -1.0, -1e6].map(|z| (z, false));
    kept.into_iter()
        .chain(dropped)
        .map(|(z, kept)| {
            let size = f64::from(z.abs().max(near));
            let one = round([0.05 * size as f32, 0.0, z], 0.05 * size, 0.8, [0.1, 0.6, 0.9]);
            let other = round([-0.3, 0.1, 3.0], 0.2, 0.7, [0.9, 0.3, 0.1]);
            Case {
                // The predicate is exact for a camera at the origin, so the band is as exact as the rest.
                tolerance: Tolerance { band: 1e-5, n_band: 1.0, ..Tolerance::default() },
                check: Box::new(move |_, report| match report.visible {
                    n if n == 1 + u64::from(kept) => Ok(()),
                    n => Err(format!("{n} visible Gaussians")),
                }),
                ..Case::new(format!("z = {z:e}"), scene_of(&[one, other]), camera(48, 32))
            }
        })
        .collect()
}

pub fn centres() -> Vec<Case> {
    let view = camera(48, 32);
    // Depth 4 and focal length 64: every pixel position on a grid of 2^-20 is exact.
    let ulp = f64::from(f32::EPSILON) * 2.0;
    let mut cases = Vec::new();
    for (name, shift) in [("on borders", 0.0), ("1 ulp above", ulp), ("1 ulp below", -ulp), ("half a pixel on", 0.25)] {
        let mut all = Vec::new();
        for x in [0.0, 0.5, 15.5, 16.0, 16.5, 31.5, 32.0, 47.5, 48.0] {
            for y in [0.0, 0.5, 15.5, 16.0, 16.5, 31.5, 32.0] {
                let z = 4.0 + all.len() as f64 / 64.0;
                let [px, py, _] = at_pixel(&view, x + shift * 16.0, y - shift * 16.0, 4.0);
                let turned = [px * (z / 4.0) as f32, py * (z / 4.0) as f32, z as f32];
                all.push(round(turned, 1e-3, 0.5, [0.2, 0.9, 0.5]));
            }
        }
        cases.push(Case::new(name, scene_of(&all), view.clone()));
    }
    for distance in [1e3, 1e4, 1e5, 1e6] {
        for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.7, 0.7)] {
            // A radius that reaches into the picture at about half of the opacity.
            let position = at_pixel(&view, 24.0 + dx * distance, 16.0 + dy * distance, 4.0);
            let one = round(position, 0.8 * distance / 16.0, 0.8, [0.2, 0.9, 0.5]);
            let name = format!("{distance:e} px away, ({dx}, {dy})");
            let tolerance = Tolerance { away: 2e-5, ..Tolerance::default() };
            cases.push(Case { tolerance, ..Case::new(name, scene_of(&[one]), view.clone()) });
        }
    }
    cases
}

/// Gaussians of 0.7 to 5 px all over the picture of `view`, a camera at the origin.
fn spread(view: &View, n: usize) -> Vec<One> {
    let mut random = Random::new(u64::from(view.width));
    (0..n)
        .map(|_| {
            let [x, y] = [view.width, view.height].map(|side| random.uniform(0.0, f64::from(side)));
            let z = random.uniform(2.0, 6.0);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            let mut one = round(at_pixel(view, x, y, z), 1.0, random.uniform(0.2, 0.95), color);
            one.scale = std::array::from_fn(|_| (random.uniform(0.7, 5.0) * z / view.fx).ln() as f32);
            one.rotation = random.vector(-1.0, 1.0);
            one
        })
        .collect()
}

pub fn fields_of_view() -> Vec<Case> {
    let mut views = Vec::new();
    for degrees in [1.0, 60.0, 120.0, 179.0f64] {
        let focal = 24.0 / (degrees.to_radians() / 2.0).tan();
        let square = View { fx: focal, fy: focal, ..camera(48, 32) };
        views.push((format!("{degrees} degrees"), square.clone()));
        views.push((format!("{degrees} degrees, narrow in y"), View { fy: 2.5 * focal, ..square.clone() }));
        views.push((format!("{degrees} degrees, principal point outside"), View { cx: -40.0, cy: 90.0, ..square }));
    }
    views
        .into_iter()
        .map(|(name, view)| Case {
            tolerance: Tolerance { away: 3e-5, ..Tolerance::default() },
            ..Case::new(name, scene_of(&spread(&view, 30)), view)
        })
        .collect()
}

pub fn image_sizes() -> Vec<Case> {
    let sizes = [(1, 1), (1, 2048), (4080, 1), (4096, 1), (2, 3), (15, 17), (16, 16), (17, 15), (31, 33), (65_536, 1)];
    sizes
        .into_iter()
        .map(|(width, height)| {
            let view = camera(width, height);
            let all = spread(&view, 40);
            Case {
                // The pixel positions of long pictures have few bits left for their fractions.
                tolerance: Tolerance { away: 2e-5, n_band: 0.3, ..Tolerance::default() },
                ..Case::new(format!("{width} x {height}"), scene_of(&all), view)
            }
        })
        .collect()
}
