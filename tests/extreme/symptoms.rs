//! Faults that were: each test is named after its symptom.

use crate::common::frames::{Tolerance, compare, render};
use crate::common::one::{One, camera, round, scene_of};
use ivv::Constants;
use ivv::scene::Motion;
use ivv::twin::render_f64;

/// Renders `all` and compares with the truth, which must show it.
fn check(name: &str, all: &[One]) {
    let (splats, view) = (scene_of(all), camera(24, 16));
    let truth = render_f64(&splats, &view, &Constants::default());
    assert!(truth.alpha.iter().any(|alpha| *alpha > 0.1), "{name}: the truth shows nothing");
    let (frame, _) = render(&splats, &view);
    let tolerance = Tolerance { n_band: 0.5, ..Tolerance::default() };
    compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{name}: {fault}"));
}

#[test]
fn the_colour_of_a_gaussian_at_any_distance_follows_its_direction() {
    // |mu - centre|^2 overflows past 1.8e19: every band but the first vanishes.
    // Further out 1 / z is denormal, which drivers may flush.
    for z in [1e10, 1e18, 1e19, 3e19, 1e25, 1e30f32] {
        let mut one = round([0.0, 0.0, z], f64::from(z) * 0.1, 0.9, [0.5; 3]);
        one.sh = vec![[0.2; 3], [0.1; 3], [0.4, -0.3, 0.2], [0.1; 3]];
        check(&format!("z = {z:e}"), &[one]);
    }
}

#[test]
fn a_gaussian_shows_at_its_own_time_however_short_it_lasts() {
    // exp(-t_scale) overflows below -88.7, and 0 * infinity is no number.
    for t_scale in [-80.0, -87.0, -89.0, -100.0, -600.0f32] {
        let motion = Motion { velocity: [0.0; 3], t_center: 0.5, t_scale };
        check(
            &format!("log tau = {t_scale}"),
            &[One { motion: Some(motion), ..round([0.0, 0.0, 4.0], 0.3, 0.9, [0.5; 3]) }],
        );
    }
}
