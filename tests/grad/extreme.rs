//! Numerical extremes of the backward pass (research: numerics_reliability.md A.3): gradients are finite everywhere, and
//! those of the truth wherever it can be compared.

use super::check::{GROUPS, bits, check_adjoint, cotangents, dot, flat, group_error, is_finite, vjp};
use crate::common::one::{One, at_pixel, camera, logit, round, scene_of};
use crate::common::random::{Random, scene, view};
use ivv::Constants;
use ivv::scene::{Frame, Motion, Splats, View};
use ivv::twin::{Camera, Params, Rules, project, render_f64};

/// An ordinary Gaussian behind all others.
fn backdrop() -> One {
    round([0.3, 0.1, 6.0], 0.6, 0.7, [0.9, 0.3, 0.1])
}

/// A needle of that quaternion before the backdrop.
fn turned(rotation: [f32; 4]) -> Splats {
    let mut one = round([0.1, -0.1, 4.0], 0.05, 0.9, [0.1, 0.6, 0.9]);
    one.scale[1] = -1.0;
    scene_of(&[One { rotation, ..one }, backdrop()])
}

/// Cotangents of `alpha` alone, all `value`.
fn of_alpha(view: &View, value: f32) -> Frame {
    let zero = cotangents(0, view, |_| true);
    Frame { alpha: vec![value; zero.alpha.len()], ..zero }
}

#[test]
fn n04_the_gradient_of_a_quaternion_of_any_length_is_across_it() {
    let view = camera(48, 32);
    let cotangents = cotangents(1, &view, |_| false);
    let q = [0.8f32, 0.0, -0.48, 0.36];
    let (unit, _) = vjp(&turned(q), &view, &cotangents);
    let unit = unit.params.rotation[0].map(f64::from);
    assert!(dot(&unit, &unit).sqrt() > 1e-2, "no gradient");
    for length in [1e-20f32, 1e-10, 1e-3, 1.0, 1e3, 1e10, 1e19, 1e20] {
        let splats = turned(q.map(|x| x * length));
        let (found, _) = vjp(&splats, &view, &cotangents);
        assert!(found.n_bad == 0 && is_finite(&found), "length {length:e}");
        let (q, g) = (splats.rotation[0].map(f64::from), found.params.rotation[0].map(f64::from));
        let norms = dot(&q, &q).sqrt() * dot(&g, &g).sqrt();
        let along = dot(&q, &g).abs() / norms;
        let scaled = g.map(|x| x * f64::from(length));
        let difference: Vec<f64> = scaled.iter().zip(&unit).map(|(a, b)| a - b).collect();
        let error = dot(&difference, &difference).sqrt() / dot(&unit, &unit).sqrt();
        assert!(along <= 1e-5 && error <= 1e-5, "length {length:e}: {along:e} along q, {error:e} from length 1");
    }
}

#[test]
fn n05_gradients_hold_from_just_before_the_near_plane_to_a_million_units() {
    let view = camera(33, 25);
    let near = 0.01f32;
    let mut faults = Vec::new();
    for z in [near.next_up(), 0.010_01, 0.011, 0.2, 1.0, 1e2, 1e4, 1e6] {
        // Three pixels wide wherever it is, and not quite on the axis.
        let [x, y, _] = at_pixel(&view, 18.3, 11.6, f64::from(z));
        let mut one = round([x, y, z], 3.0 / 64.0 * f64::from(z), 0.7, [0.1, 0.6, 0.9]);
        one.scale[0] += 0.7;
        one.rotation = [0.7, -0.2, 0.4, 0.1];
        let motion = Motion { velocity: [0.3 * z, -0.2 * z, 0.0], t_center: 0.45, t_scale: -1.0 };
        let splats = scene_of(&[One { motion: Some(motion), ..one }]);
        let truth = render_f64(&splats, &view, &Constants::default());
        assert!(truth.alpha.iter().any(|alpha| *alpha > 0.1), "nothing at {z}");
        // Next to the near plane every pixel is in the band, but the depth of a camera at the origin is exact.
        let by_alpha = |i: usize| (truth.alpha[i] * 255.0 - 1.0).abs() < 0.05 || truth.alpha[i] == 0.0;
        if let Err(fault) = check_adjoint(&splats, &view, &cotangents(2, &view, by_alpha), 1e-5, 9) {
            faults.push(format!("z = {z:e}: {fault}"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn n07_an_alpha_held_at_its_clamp_has_no_gradient_and_one_below_has() {
    let view = camera(5, 3);
    let cotangents = cotangents(3, &view, |_| false);
    let most = logit(0.99);
    let mut seen = [0, 0];
    for opacity in [-90.0, -20.0, -6.0, -5.0, 0.0, 4.0, most - 1e-4, most, most + 1e-4, 5.0, 20.0, 90.0] {
        // Flat over the picture, so that all pixels are on one side of the clamp.
        let one = One { opacity, ..round([0.0, 0.0, 4.0], 1e3, 0.5, [0.1, 0.6, 0.9]) };
        let splats = scene_of(&[one, round([0.0, 0.0, 6.0], 1e3, 0.5, [0.9, 0.3, 0.1])]);
        let (found, _) = vjp(&splats, &view, &cotangents);
        assert!(found.n_bad == 0 && is_finite(&found) && found.params.opacity[1] != 0.0);
        let held = opacity >= most + 1e-4 || opacity <= -6.0;
        let free = opacity <= most - 1e-4 && opacity >= -5.0;
        assert!(
            !held || found.params.opacity[0] == 0.0,
            "opacity {opacity} has the gradient {}",
            found.params.opacity[0]
        );
        assert!(
            !held || (found.params.scale[0], found.params.rotation[0]) == ([0.0; 3], [0.0; 4]),
            "opacity {opacity}: {found:?}"
        );
        assert!(!free || found.params.opacity[0] != 0.0, "opacity {opacity} has no gradient");
        // What is held at its clamp still has a colour.
        assert!(opacity < -5.5 || found.params.sh[0] != [0.0; 3], "opacity {opacity}: no gradient of the colour");
        seen = [seen[0] + usize::from(held), seen[1] + usize::from(free)];
        if free {
            check_adjoint(&splats, &view, &cotangents, 1e-4, 2).unwrap();
        }
    }
    assert_eq!(seen, [7, 4]);
}

#[test]
fn n08_the_backward_pass_recovers_the_transmittance_of_long_chains() {
    let view = camera(3, 3);
    let mut faults = Vec::new();
    for (n, alpha) in [(2300, 0.0041), (9, 0.6), (2, 0.98), (40, 0.2), (700, 0.0125), (1500, 1.02 / 255.0)] {
        let all: Vec<One> = (0..n)
            .map(|i| {
                let z = 2.0 + i as f32 / 65_536.0;
                round([0.0, 0.0, z], 100.0, alpha, [0.2, 0.9, i as f64 / f64::from(n)])
            })
            .collect();
        let splats = scene_of(&all);
        let truth = render_f64(&splats, &view, &Constants::default());
        assert!(truth.near_discontinuity.iter().all(|near| !near), "{n} x {alpha}: in the band");
        let cotangents = cotangents(4, &view, |_| false);
        let (found, _) = vjp(&splats, &view, &cotangents);
        for name in ["opacity", "sh"] {
            let error = group_error(&found, name, &splats, &view, &cotangents).unwrap();
            if error > 1e-4 || found.n_bad > 0 {
                faults.push(format!("{n} x {alpha}: {name} is off by {error:e}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A Gaussian before the backdrop, over the whole picture, that fades, and while it does moves by 0.1 units at most.
fn fading(t_center: f32, t_scale: f32) -> Splats {
    let speed = (-f64::from(t_scale)).exp().min(1.0) as f32;
    let motion = Motion { velocity: [0.1 * speed, 0.0, 0.0], t_center, t_scale };
    let one = round([0.0, 0.0, 4.0], 3.0, 0.95, [0.1, 0.6, 0.9]);
    let [mut one, mut backdrop] = [One { motion: Some(motion), ..one }, backdrop()];
    (one.scale[0], backdrop.scale[1]) = (0.3, -1.0);
    scene_of(&[backdrop, one])
}

#[test]
fn n11_gradients_at_any_distance_in_time_are_the_truths_and_zero_past_the_cut() {
    let mut faults = Vec::new();
    let mut n_gone = 0;
    for t_scale in [-18.42f32, 0.0, 9.21] {
        for u in [0.0, 1e-20, 0.707, 1.0, 2.3, 2.36, 9.3, 9.4, 16.0, 1e10, 1e19, 1e30] {
            let view = View { time: u * f64::from(t_scale).exp(), ..camera(24, 16) };
            let splats = fading(0.0, t_scale);
            let cotangents = cotangents(5, &view, |_| false);
            let (found, report) = vjp(&splats, &view, &cotangents);
            let case = format!("u = {u:e}, log tau = {t_scale}");
            if found.n_bad > 0 || report.intersections == 0 || !is_finite(&found) {
                faults.push(format!("{case}: {} bad", found.n_bad));
            }
            if u > 2.355 {
                let zero = found.params.position[1] == [0.0; 3]
                    && found.motion(1).velocity == [0.0; 3]
                    && found.motion(1).t_center == 0.0;
                if !zero || found.motion(1).t_scale != 0.0 || found.time_offset != 0.0 {
                    faults.push(format!("{case}: a gradient past the cut"));
                }
                n_gone += 1;
            } else {
                // The gradient of log tau goes with u^2: for u = 1e-20 it is denormal, which drivers may flush to zero. The
                // rest is then that of u = 0.
                if u > 0.0 && u < 1e-15 && flat(&found, "t_scale").iter().all(|x| *x == 0.0) {
                    continue;
                }
                // exp is good to 3 + 2|x| ULP (A.1): of log tau, and of u^2, which doubles the error of u.
                if let Err(fault) = check_adjoint(&splats, &view, &cotangents, 1e-4, if u == 0.0 { 8 } else { 9 }) {
                    faults.push(format!("{case}: {fault}"));
                }
            }
        }
    }
    assert!(faults.is_empty() && n_gone > 15, "{}", faults.join("\n"));
}

#[test]
fn n12_the_gradient_of_log_tau_is_bounded_for_any_tau() {
    let view = camera(24, 16);
    let half_frame = (0.5f64 / 300.0).ln() as f32;
    let mut largest = 0.0f64;
    for t_scale in [half_frame, -18.42, -60.0, -80.0, -1.0, 0.0, 9.21, 60.0, 88.0, 100.0, 1e38, f32::INFINITY] {
        for u in [0.0, 0.5, 1.0, 1.5, 2.2] {
            let t_center = (0.5 - u * f64::from(t_scale.min(9.0)).exp()) as f32;
            let splats = fading(t_center, t_scale);
            let (found, _) = vjp(&splats, &view, &of_alpha(&view, 1.0));
            assert!(found.n_bad == 0 && is_finite(&found), "log tau = {t_scale:e}, u = {u}");
            // The backdrop hides nothing before it: of opacity o and weight e^-u^2 each pixel has at most the share o.
            let bound = 0.736 * 0.95 * f64::from(view.width * view.height);
            let slope = f64::from(found.motion(1).t_scale.abs());
            assert!(slope <= bound, "log tau = {t_scale:e}, u = {u}: {slope}");
            largest = largest.max(slope / bound);
            if t_scale > 90.0 {
                assert_eq!(
                    [found.motion(1).t_scale, found.motion(1).t_center, found.motion(1).velocity[0]]
                        .map(f32::is_finite),
                    [true; 3]
                );
                assert_eq!(found.motion(1).t_scale, 0.0, "infinite tau has no gradient");
            }
        }
    }
    assert!(largest > 0.3, "the bound is never near: {largest}");
}

#[test]
fn n13_gradients_of_a_clip_far_from_time_zero_have_the_bits_of_one_at_zero() {
    // Times on a grid of 1/128, which f32 holds up to 1e5 and beyond.
    let clip = |origin: f64| -> (Splats, View) {
        let mut random = Random::new(13);
        let one = |_| {
            let grid = (random.bits() % 128) as f64 / 128.0;
            let motion = Motion {
                velocity: random.vector(-1.0, 1.0),
                t_center: (origin + grid) as f32,
                t_scale: random.uniform(-2.0, 1.0) as f32,
            };
            let [x, y] = random.vector(-1.0, 1.0);
            One { motion: Some(motion), ..round([x, y, 4.0], 0.15, 0.8, [0.3, 0.6, 0.1]) }
        };
        (scene_of(&(0..30).map(one).collect::<Vec<_>>()), View { time: origin + 0.5, ..camera(48, 32) })
    };
    let gradients = |origin: f64| {
        let (splats, view) = clip(origin);
        bits(&vjp(&splats, &view, &cotangents(6, &view, |_| false)).0)
    };
    let first = gradients(0.0);
    assert!(first.iter().filter(|x| f64::from_bits(**x) != 0.0).count() > 300);
    for origin in [300.0, 18_000.0, 1e5] {
        assert!(gradients(origin) == first, "time {origin}");
    }
}

/// Which Gaussians the truth can show.
fn drawable(splats: &Splats, view: &View) -> Vec<bool> {
    let (params, camera) = (Params::<f64>::new(splats, view), Camera::<f64>::new(view));
    let rules = Rules::<f64>::new(&Constants::default());
    let time = camera.shifted_time(params.time_offset);
    (0..params.len()).map(|i| project(&params.gaussian(i), &camera, time, &rules).is_some()).collect()
}

#[test]
fn n28_scenes_with_some_poisoned_numbers_have_finite_gradients() {
    const VALUES: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-45, 1e38, f32::MIN / 2.0];
    let (mut n_poisoned, mut n_gradients, mut n_undrawn) = (0, 0, 0);
    for seed in 0..40 {
        let mut random = Random::new(1000 + seed);
        let mut splats = scene(seed, 120, (seed % 4) as u32);
        let rate = random.uniform(0.0, 0.05);
        let motion = splats.motion.iter_mut().flat_map(|m| {
            let Motion { velocity: [x, y, z], t_center, t_scale } = m;
            [x, y, z, t_center, t_scale]
        });
        let all = splats.position.as_flattened_mut().iter_mut().chain(splats.rotation.as_flattened_mut());
        let all = all.chain(splats.scale.as_flattened_mut()).chain(&mut splats.opacity);
        for slot in all.chain(splats.sh.as_flattened_mut()).chain(motion) {
            if random.uniform(0.0, 1.0) < rate {
                *slot = VALUES[random.bits() as usize % VALUES.len()];
                n_poisoned += 1;
            }
        }
        let (found, report) = vjp(&splats, &view(), &cotangents(seed, &view(), |_| false));
        assert!(is_finite(&found), "seed {seed}");
        for (i, drawable) in drawable(&splats, &view()).into_iter().enumerate() {
            if !drawable {
                let zero = found.params.position[i] == [0.0; 3]
                    && found.params.opacity[i] == 0.0
                    && found.params.rotation[i] == [0.0; 4];
                assert!(zero, "seed {seed}: Gaussian {i} is not drawn and has a gradient");
                n_undrawn += 1;
            }
        }
        n_gradients += found.params.opacity.iter().filter(|x| **x != 0.0).count();
        assert!(report.bad_gaussians > 0 || rate < 0.01, "seed {seed}: {report:?}");
    }
    assert!(n_poisoned > 1000 && n_gradients > 500 && n_undrawn > 100);
}

#[test]
fn a_cotangent_that_is_not_finite_zeroes_the_gradients_it_reaches_and_they_are_counted() {
    let (splats, view) = (scene(70, 60, 2), view());
    let clean = cotangents(8, &view, |_| false);
    let (before, _) = vjp(&splats, &view, &clean);
    assert_eq!(before.n_bad, 0);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut cotangents = clean.clone();
        cotangents.color[(view.width * view.height / 2 + view.width / 2) as usize][1] = value;
        let (found, _) = vjp(&splats, &view, &cotangents);
        assert!(is_finite(&found) && found.n_bad > 0, "{value}: {} bad", found.n_bad);
        let changed: Vec<usize> =
            (0..splats.len()).filter(|i| found.params.opacity[*i] != before.params.opacity[*i]).collect();
        assert!(changed.len() < splats.len() / 2, "{changed:?}");
        let zeroed = changed
            .iter()
            .filter(|i| found.params.opacity[**i] == 0.0 && found.params.position[**i] == [0.0; 3])
            .count();
        assert_eq!(zeroed, found.n_bad as usize, "{value}: {changed:?}");
    }
    assert!(GROUPS.iter().all(|name| flat(&before, name).iter().any(|x| *x != 0.0)));
}
