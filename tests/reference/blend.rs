//! Blending against a direct sum, and its predicates at their exact thresholds.

use super::single;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::render;
use ivv::internals::reference::{Outputs, project};

fn together(splats: &[Splats]) -> Splats {
    let mut all = Splats { n_static: splats.len(), ..Splats::default() };
    for s in splats {
        all.position.extend(&s.position);
        all.rotation.extend(&s.rotation);
        all.scale.extend(&s.scale);
        all.opacity.extend(&s.opacity);
        all.sh.extend(&s.sh);
        all.source_row.extend(&s.source_row);
    }
    all
}

/// A Gaussian so large that it covers every pixel with its whole opacity.
fn wall(z: f32, opacity: f32, color: [f32; 3]) -> Splats {
    let logit = (opacity / (1.0 - opacity)).ln();
    let sh = color.map(|c| (c - 0.5) / 0.282_094_8);
    Splats { scale: vec![[25.0; 3]], opacity: vec![logit], sh: vec![sh], ..single([0.0, 0.0, z]) }
}

const MIDDLE: usize = 28 * 80 + 40;

fn draw(splats: &Splats) -> Outputs<f64> {
    render_f64(splats, &view(), &Constants::default())
}

#[test]
fn culling_by_extent_changes_no_pixel() {
    for seed in 0..4 {
        let (splats, view) = (scene(seed, 60, 1), view());
        let rules = Rules::<f64>::new(&Constants::default());
        let params = Params::new(&splats, &view);
        let camera = Camera::new(&view);
        let time = camera.shifted_time(params.time_offset);
        let mut all: Vec<_> =
            (0..params.len()).filter_map(|i| project(&params.gaussian(i), &camera, time, &rules)).collect();
        all.sort_by(|a, b| a.z.total_cmp(&b.z));

        let found = render(&params, &view, &rules);
        assert!(found.n_contributing.iter().any(|n| *n > 5), "seed {seed}: the image is empty");
        for i in 0..found.alpha.len() {
            let at = [(i % 80) as f64 + 0.5, (i / 80) as f64 + 0.5];
            let (mut left, mut n, mut depth, mut flow) = (1.0, 0, 0.0, [0.0; 2]);
            for p in &all {
                let alpha = p.alpha_at(at, &rules);
                if alpha < rules.alpha_min {
                    continue;
                }
                if left * (1.0 - alpha) < rules.t_min {
                    break;
                }
                depth += alpha * left * p.z;
                flow = [0, 1].map(|k| flow[k] + alpha * left * p.flow[k]);
                left *= 1.0 - alpha;
                n += 1;
            }
            assert_eq!(found.n_contributing[i], n, "seed {seed}, pixel {i}");
            assert_eq!((found.alpha[i], found.depth[i], found.flow[i]), (1.0 - left, depth, flow));
        }
    }
}

#[test]
fn a_gaussian_contributes_exactly_when_alpha_reaches_alpha_min() {
    let (view, splats) = (view(), single([0.0; 3]));
    let params = Params::<f64>::new(&splats, &view);
    let rules = Rules::new(&Constants::default());
    let p = project(&params.gaussian(0), &Camera::new(&view), 0.0, &rules).expect("visible");
    let alpha = p.alpha_at([40.5, 28.5], &rules);
    assert!(alpha > rules.alpha_min);
    for (alpha_min, n) in [(alpha, 1), (alpha.next_up(), 0), (alpha.next_down(), 1)] {
        let outputs = render(&params, &view, &Rules { alpha_min, ..rules });
        assert_eq!(outputs.n_contributing[MIDDLE], n);
        assert!(outputs.near_discontinuity[MIDDLE], "the threshold is not marked");
    }
    let outputs = render(&params, &view, &rules);
    assert!(!outputs.near_discontinuity[MIDDLE], "a pixel far from every threshold is marked");
}

#[test]
fn a_gaussian_just_below_alpha_min_at_its_centre_marks_its_pixels_though_it_is_dropped() {
    let alpha_min = Constants::default().alpha_min * (1.0 - 2e-6);
    let outputs = draw(&wall(0.0, alpha_min, [1.0; 3]));
    assert_eq!(outputs.n_contributing[MIDDLE], 0);
    assert!(outputs.near_discontinuity[MIDDLE]);
}

#[test]
fn alpha_is_clamped_and_the_transmittance_never_falls_below_t_min() {
    let walls = together(&[0.0, 1.0, 2.0].map(|z| wall(z, 0.9999, [1.0, 0.5, 0.0])));
    // (1 - 0.99)^2 is t_min: in decimals a hair above, so two Gaussians fit, in the constants' f32 a hair below.
    let decimal = Rules { alpha_min: 1.0 / 255.0, alpha_max: 0.99, t_min: 1e-4, blur: 0.3, near: 0.01 };
    for (rules, n) in [(decimal, 2), (Rules::new(&Constants::default()), 1)] {
        let outputs = render(&Params::<f64>::new(&walls, &view()), &view(), &rules);
        assert_eq!(outputs.n_contributing[MIDDLE], n);
        let left = (1.0 - rules.alpha_max).powi(n as i32);
        assert!((1.0 - outputs.alpha[MIDDLE] - left).abs() < 1e-15);
        assert!(outputs.near_discontinuity[MIDDLE], "the threshold is not marked");
    }
}

#[test]
fn a_gaussian_that_is_not_added_ends_the_pixel() {
    // After 0.99 and 0.98 the next 0.9 would leave 2e-5 < t_min; the faint one behind would fit but must not show.
    let scene =
        [wall(0.0, 0.99, [0.0; 3]), wall(1.0, 0.98, [0.0; 3]), wall(2.0, 0.9, [1.0; 3]), wall(3.0, 0.1, [1.0; 3])];
    let outputs = draw(&together(&scene));
    assert_eq!(outputs.n_contributing[MIDDLE], 2);
}

#[test]
fn equal_depths_blend_in_index_order() {
    let (red, blue) = (wall(0.0, 0.6, [1.0, 0.0, 0.0]), wall(0.0, 0.6, [0.0, 0.0, 1.0]));
    let first = draw(&together(&[red.clone(), blue.clone()])).color[MIDDLE];
    let second = draw(&together(&[blue, red])).color[MIDDLE];
    assert!((first[0] - 0.6 - 0.16 * 0.1).abs() < 1e-6 && (first[2] - 0.24 - 0.16 * 0.6).abs() < 1e-6, "{first:?}");
    assert!((second[2] - 0.6 - 0.16 * 0.6).abs() < 1e-6 && (second[0] - 0.24 - 0.16 * 0.1).abs() < 1e-6, "{second:?}");
}

#[test]
fn depths_closer_than_f32_can_tell_are_marked_and_exact_ties_are_not() {
    for (gap, marked) in [(0.0, false), (2e-7, true), (1e-3, false)] {
        let mut params = Params::<f64>::new(&together(&[wall(1.0, 0.3, [1.0; 3]), wall(1.0, 0.3, [0.0; 3])]), &view());
        params.position[1][2] += gap;
        let outputs = render(&params, &view(), &Rules::new(&Constants::default()));
        assert_eq!(outputs.near_discontinuity[MIDDLE], marked, "gap {gap}");
    }
}

#[test]
fn an_empty_scene_shows_the_background() {
    let outputs = draw(&Splats::default());
    assert_eq!(outputs.color.len(), 80 * 56);
    assert!(outputs.color.iter().all(|c| *c == view().background.map(f64::from)));
    assert!(outputs.alpha.iter().all(|a| *a == 0.0));
}
