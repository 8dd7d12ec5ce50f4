//! Lists around the sizes at which something changes: a subgroup's width, a sort block, a round of blending (N8, N9).

use crate::common::frames::{Tolerance, compare, render};
use crate::common::one::{One, camera, round, scene_of};
use crate::common::random::Random;
use ivv::Constants;
use ivv::twin::render_f64;

/// Entries that one round of blending walks, `SEGMENT` of the engine.
const SEGMENT: u64 = 32_768;

/// `n` Gaussians in one tile, each on about one pixel with an alpha of a little over 1/255, so that none saturates.
fn dust(n: usize) -> Vec<One> {
    let mut random = Random::new(n as u64);
    (0..n)
        .map(|i| {
            // Depths on a grid of 2^-16, no two equal; pixels are 1/64 of the depth.
            let z = 2.0 + ((i * 7919) % n) as f32 / 65_536.0;
            let [x, y] = [0, 1].map(|_| random.uniform(-7.9, 7.9) as f32 / 64.0 * z);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            round([x, y, z], 1e-4, random.uniform(1.1, 1.5) / 255.0, color)
        })
        .collect()
}

#[test]
fn lists_of_one_tile_are_blended_whole_at_any_length() {
    let view = camera(16, 16);
    for n in [1, 3, 4, 5, 7, 8, 9, 31, 32, 33, 63, 64, 65, 255, 256, 257, 2049] {
        let splats = scene_of(&dust(n));
        let (frame, report) = render(&splats, &view);
        assert!(report.max_tile_list > 0 && report.max_tile_list <= n as u64 && report.replays == 0, "{report:?}");
        let truth = render_f64(&splats, &view, &Constants::default());
        // A position's rounding decides whether such faint Gaussians contribute: 1/255 of the frame each.
        let tolerance = Tolerance { band: 0.05, n_band: 0.3, ..Tolerance::default() };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{n}: {fault}"));
    }
}

#[test]
fn lists_longer_than_a_round_of_blending_take_several_and_lose_nothing() {
    let view = camera(16, 16);
    for n in [40_000, 100_000] {
        let splats = scene_of(&dust(n));
        let (frame, report) = render(&splats, &view);
        assert!(report.max_tile_list > n as u64 * 9 / 10 && report.max_tile_list > SEGMENT, "{report:?}");
        assert!(report.replays >= 1, "{report:?}");
        let truth = render_f64(&splats, &view, &Constants::default());
        let n_added: u32 = truth.n_contributing.iter().sum();
        assert!(n_added as usize > n / 4, "only {n_added} contributions");
        let full = truth.alpha.iter().filter(|alpha| **alpha > 0.999).count();
        assert_eq!(full, 0, "pixels that are finished before the last round");
        let tolerance = Tolerance { away: 1e-5, band: 0.05, n_band: 0.3 };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{n}: {fault}"));
    }
}

#[test]
fn transmittance_falls_to_its_floor_as_in_float64_however_long_the_chain() {
    let view = camera(3, 3);
    for (n, alpha) in
        [(2300, 0.004), (100_000, 1.02 / 255.0), (9, 0.6), (2, 0.98), (40, 0.2), (5, 0.999), (700, 0.0125)]
    {
        let all: Vec<One> = (0..n)
            .map(|i| {
                let z = 2.0 + i as f32 / 65_536.0;
                round([0.0, 0.0, z], 100.0, alpha, [0.2, 0.9, i as f64 / f64::from(n)])
            })
            .collect();
        let splats = scene_of(&all);
        let (frame, report) = render(&splats, &view);
        assert_eq!(report.max_tile_list, n as u64);
        let truth = render_f64(&splats, &view, &Constants::default());
        assert!(truth.n_contributing.iter().all(|n| *n > 0));
        let tolerance = Tolerance { away: 1e-4, band: 1e-4, n_band: 1.0 };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{n} x {alpha}: {fault}"));
    }
}
