//! Tiles by scan line against every pixel.

use crate::common::prelude::*;
use ivv::internals::reference::{Real, columns, footprint, row_span, tiles, tiles_truth};

/// Pixels; neither side is a multiple of 16.
const SIZE: [u32; 2] = [105, 75];
const SLACK: f64 = 1e-3;

/// A Gaussian at `xy` with the given standard deviations (pixels) and a random turn.
fn splat(random: &mut Random, xy: [f64; 2], axes: [f64; 2], opacity: f64) -> Projected<f64> {
    let (sin, cos) = random.uniform(0.0, 6.3).sin_cos();
    let shape = footprint([[cos, -sin, 0.0], [sin, cos, 0.0]], [axes[0], axes[1], 1e-6], 0.3);
    let reach = (2.0 * (opacity * 255.0).ln()).sqrt();
    let extent = shape.deviation.map(|x| x * reach);
    Projected { xy, m: shape.m, opacity, color: [0.5; 3], z: 1.0, flow: [0.0; 2], extent }
}

fn narrowed(p: &Projected<f64>) -> Projected<f32> {
    let n = |x: f64| x as f32;
    Projected {
        xy: p.xy.map(n),
        m: p.m.map(|row| row.map(n)),
        opacity: n(p.opacity),
        color: p.color.map(n),
        z: n(p.z),
        flow: p.flow.map(n),
        extent: p.extent.map(n),
    }
}

/// Asserts that no tile is missing; gives the numbers of tiles found and needed.
fn check<R: Real>(p: &Projected<R>) -> [usize; 2] {
    let rules = Rules::new(&Constants::default());
    let found = tiles(p, &rules, SIZE, R::from_f64(SLACK));
    let truth = tiles_truth(p, &rules, SIZE);
    assert!(found.is_sorted() && found.windows(2).all(|w| w[0] != w[1]));
    for tile in &truth {
        assert!(found.contains(tile), "tile {tile} is missing from {found:?}, needed {truth:?}: {p:?}");
    }
    [found.len(), truth.len()]
}

fn check_both(p: &Projected<f64>, totals: &mut [usize; 2]) {
    for counts in [check(p), check(&narrowed(p))] {
        totals[0] += counts[0];
        totals[1] += counts[1];
    }
}

#[test]
fn no_tile_is_missed_and_few_are_false_for_gaussians_of_ordinary_size() {
    let mut random = Random::new(1);
    let mut totals = [0; 2];
    for _ in 0..250 {
        let xy = [random.uniform(-30.0, 135.0), random.uniform(-30.0, 105.0)];
        let axes = [random.uniform(0.01, 20.0), random.uniform(0.01, 20.0)];
        let opacity = random.uniform(0.004, 1.0);
        check_both(&splat(&mut random, xy, axes, opacity), &mut totals);
    }
    assert!(totals[1] > 1000, "only {} tiles were needed", totals[1]);
    let excess = totals[0] as f64 / totals[1] as f64 - 1.0;
    assert!(excess < 0.02, "{} % of the tiles are false", 100.0 * excess);
}

#[test]
fn no_tile_of_a_needle_is_missed() {
    let mut random = Random::new(2);
    let mut totals = [0; 2];
    for major in [10.0, 1e2, 1e3, 1e4, 1e5] {
        for _ in 0..25 {
            // The centre may be far outside with only the tip reaching in.
            let reach = major.min(1e4);
            let xy = [random.uniform(-reach, reach + 105.0), random.uniform(-reach, reach + 75.0)];
            let near = [random.uniform(0.0, 105.0), random.uniform(0.0, 75.0)];
            check_both(&splat(&mut random, xy, [major, 0.01], 0.9), &mut totals);
            check_both(&splat(&mut random, near, [major, 0.01], 0.9), &mut totals);
        }
    }
    assert!(totals[1] > 500, "only {} tiles were needed", totals[1]);
}

#[test]
fn no_tile_is_missed_at_tile_and_pixel_borders() {
    let mut random = Random::new(3);
    let mut totals = [0; 2];
    let places = [0.0, 0.5, 15.5, 16.0, 16.5, 31.5, 32.0, 74.5, 75.0, 104.5, 105.0];
    for x in places {
        for y in places {
            for [dx, dy] in [[0.0, 0.0], [1e-6, -1e-6]] {
                check_both(&splat(&mut random, [x + dx, y + dy], [0.01, 0.01], 0.5), &mut totals);
            }
        }
    }
    assert!(totals[1] > 300, "only {} tiles were needed", totals[1]);
}

#[test]
fn a_gaussian_that_is_nowhere_bright_enough_has_no_tile_and_a_huge_one_has_all() {
    let mut random = Random::new(4);
    let rules = Rules::<f64>::new(&Constants::default());
    let faint = splat(&mut random, [50.0, 40.0], [5.0, 5.0], 0.0039);
    assert!(tiles(&faint, &rules, SIZE, SLACK).is_empty());
    for axis in [1e4, 1e12, 1e18] {
        let huge = splat(&mut random, [50.0, 40.0], [axis, axis], 0.9);
        assert_eq!(check(&huge), [35, 35], "axis {axis}");
        assert_eq!(check(&narrowed(&huge)), [35, 35], "axis {axis}");
    }
}

#[test]
fn the_span_of_a_circle_is_its_chord() {
    // |d| <= 5: m = 1 / 2, level = (5 / 2)^2 / 2.
    let span = |band| row_span([20.0, 30.0], [[0.5, 0.0], [0.0, 0.5]], 3.125, band, 0.0);
    let assert_close = |found: Option<[f64; 2]>, expected: [f64; 2]| {
        let found = found.expect("a span");
        assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-4), "{found:?} but {expected:?}");
    };
    assert_close(span([28.0, 32.0]), [15.0, 25.0]);
    assert_close(span([33.0, 40.0]), [16.0, 24.0]);
    assert_close(span([20.0, 26.0]), [17.0, 23.0]);
    assert_eq!(span([35.1, 40.0]), None);
    assert_eq!(row_span([20.0, 30.0], [[0.5, 0.0], [0.0, 0.5]], -0.1, [28.0, 32.0], 0.0), None::<[f64; 2]>);
}

#[test]
fn columns_are_those_whose_pixel_centres_the_span_meets() {
    assert_eq!(columns([0.0, 0.4], 105), None, "left of the first centre");
    assert_eq!(columns([0.0, 0.5], 105), Some([0, 0]));
    assert_eq!(columns([15.6, 16.4], 105), None, "between two tiles' centres");
    assert_eq!(columns([15.5, 16.5], 105), Some([0, 1]));
    assert_eq!(columns([104.6, 200.0], 105), None, "right of the last centre");
    assert_eq!(columns([-1e30, 1e30], 105), Some([0, 6]));
    assert_eq!(columns([f64::NAN, 3.0], 105), None);
}
