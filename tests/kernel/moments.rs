//! Adam's moments in 16 bits: what is stored against the reference's rounding of what 32 bits store. Extreme numbers: row N25 of
//! `tests/conformance`.

use crate::adversary::needs_roundings;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::kernel::adam::caught_up;
use crate::kernel::assert_same_scene;
use crate::kernel::batch::{borrowed, fill, two};
use ivv::internals::reference::{random_bits, rounded_moment};
use ivv::internals::stage::{Rates, StepSettings, adam_params, moment_word, moments_of};
use ivv_conformance::fixtures::adam::{Scene, Step, cotangents, half_seen, numbers, rates};
use std::fmt::Display;

tested! {
    "adam/adam_idle.comp" by rounded_moment in moments_fade_to_the_references_bits_in_groups_of_any_size;
    "adam/adam_catch_up.comp" by rounded_moment in lazy_steps_catch_up_and_round_once;
    "batch/batch_step.comp" by rounded_moment in a_step_along_a_sum_rounds_what_it_stores_as_the_reference_does;
    "project/project_bwd.comp" by rounded_moment in a_step_computes_in_32_bits_and_rounds_what_it_stores_as_the_reference_does;
}

/// The Gaussian, plane and component of each of [`numbers`], as `moments.glsl` counts them.
fn places(splats: &Splats) -> Vec<(usize, u32, u32)> {
    let mut all = Vec::new();
    for i in 0..splats.len() {
        let mut put = |plane: usize, components: std::ops::Range<usize>| {
            all.extend(components.map(|c| (i, (plane + c / 4) as u32, (c % 4) as u32)));
        };
        put(0, 0..3);
        put(1, 0..4);
        put(2, 0..3);
        put(0, 3..4);
        for c in 0..splats.n_coefficients() {
            // Band l begins at coefficient l^2; its buffer is number 2 + l, but for the constant one's, which is 1.
            let band = c.isqrt();
            let at = 3 * (c - band * band);
            put(if band == 0 { 6 } else { 6 * (2 + band) }, at..at + 3);
        }
        if i >= splats.n_static {
            put(12, 0..4);
            put(2, 3..4);
        }
    }
    all
}

fn flat(splats: &Splats) -> Vec<u32> {
    let scene = SceneBuffers::upload(&gpu(), splats, &Constants::default(), Purpose::Training).unwrap();
    scene.groups.iter().flat_map(|g| g.first..g.first + g.n).collect()
}

/// Demands that `packed`, stored at step `step`, are the reference's roundings of `plain`, and gives how many there are of numbers
/// other than 0.
fn assert_rounded(packed: &Scene, plain: &Scene, step: u32) -> usize {
    let (places, flat, mut n) = (places(&plain.params), flat(&plain.params), 0);
    let each = |splats: &Splats| numbers(splats, &splats.scale, &rates()).into_iter().map(|x| x.0).collect::<Vec<_>>();
    let all = [&packed.first, &packed.second, &plain.first, &plain.second].map(each);
    assert_eq!(places.len(), all[0].len());
    for (at, (i, plane, component)) in places.into_iter().enumerate() {
        let bits = random_bits(step, flat[i], 4 * plane + component);
        let draws = [f64::from(bits & 0xffff) / 65536.0, f64::from(bits >> 17) / 32768.0];
        for (which, mantissa) in [(0, 7), (1, 8)] {
            let (found, x) = (all[which][at], all[2 + which][at]);
            let expected = rounded_moment(f64::from(x), mantissa, draws[which]) as f32;
            // A device may flush what is below the normal numbers.
            let is_right = found.to_bits() == expected.to_bits() || (x.abs() < f32::MIN_POSITIVE && found == 0.0);
            assert!(is_right, "moment {which} of {i}, plane {plane}.{component}: {found:e}, {expected:e} of {x:e}");
            n += usize::from(x != 0.0);
        }
    }
    n
}

#[track_caller]
fn assert_moved_alike(label: impl Display, found: &Scene, truth: &Scene) {
    assert_same_splats(&label, &found.params, &truth.params);
    assert_same(format_args!("{label}: state"), &found.state, &truth.state);
}

/// `scene` with moments that 16 bits hold, on a device that has 16 and on one that has 32.
fn both(mut scene: Scene) -> [Scene; 2] {
    scene.moment_bits = 16;
    let (buffers, optimiser) = scene.upload(&gpu(), AdamMode::Dense, &[[0.0; 4]]).unwrap();
    let packed = Scene::download(&gpu(), &buffers, &optimiser).unwrap();
    let plain = Scene { moment_bits: 32, ..packed.clone() };
    [packed, plain]
}

fn warm(seed: u64, n: usize, degree: u32) -> Scene {
    let mut scene = Scene::new(&scene(seed, n, degree));
    let mut random = Random::new(seed);
    for (splats, low) in [(&mut scene.first, -1.0), (&mut scene.second, 0.0)] {
        fill(splats, &mut || (random.uniform(low, 1.0) * random.uniform(-60.0, 40.0).exp()) as f32);
    }
    scene
}

#[test]
fn a_step_computes_in_32_bits_and_rounds_what_it_stores_as_the_reference_does() {
    needs_roundings!("two kernels have the same bits");
    let _device = gpu();
    let view = view();
    for degree in 0..=3 {
        // Seen and unseen Gaussians of both populations, from the first step on and later.
        for (start, number, size) in [
            (Scene::new(&half_seen(3, degree).params), 1, 1e-3),
            (half_seen(u64::from(degree), degree), 1000, 1e-3),
            (warm(5, 70, degree), 7, 1e-10),
            (warm(6, 33, degree), 8, 1e15),
        ] {
            let [packed, plain] = both(start);
            let d_color = cotangents(&view, 5, size);
            let step = |scene: &Scene| scene.step(&gpu(), &view, &d_color, &Step::dense(number)).unwrap().0;
            let (found, exact) = (step(&packed), step(&plain));
            assert_moved_alike(format_args!("degree {degree}, {size:e}"), &found, &exact);
            assert!(exact.params != plain.params, "nothing moved");
            let n = assert_rounded(&found, &exact, number as u32);
            assert!(n > 300, "degree {degree}, {size:e}: {n} moments");
            assert_same_scene("another run", &step(&packed), &found);
        }
    }
}

#[test]
fn a_step_along_a_sum_rounds_what_it_stores_as_the_reference_does() {
    needs_roundings!("two kernels have the same bits");
    let _device = gpu();
    for degree in [0, 3] {
        let [packed, plain] = both(half_seen(u64::from(degree), degree));
        let images = two(1e-3);
        let step = |scene: &Scene| scene.batch_step(&gpu(), &borrowed(&images), &Step::dense(8)).unwrap().0;
        let (found, exact) = (step(&packed), step(&plain));
        assert_moved_alike(format_args!("degree {degree}"), &found, &exact);
        assert!(assert_rounded(&found, &exact, 8) > 300);
    }
}

#[test]
fn moments_fade_to_the_references_bits_in_groups_of_any_size() {
    needs_roundings!("two kernels have the same bits");
    let _device = gpu();
    for n in [1, 2, 31, 32, 33, 127, 129, 300] {
        let mut params = adam_params(&rates(), &StepSettings::default(), 3, 1);
        (params.beta1, params.beta2) = (1.0 - 1.0 / 512.0, 1.0 - 1.0 / 1024.0);
        let [packed, plain] = both(warm(n as u64, n, n as u32 % 4));
        let [found, exact] = [packed, plain].map(|scene| scene.unseen_step(&gpu(), &params).unwrap());
        assert_same_splats(format_args!("{n} Gaussians"), &found.params, &exact.params);
        assert!(assert_rounded(&found, &exact, 3) >= 28 * n);
        // Another step draws others.
        params.step += 1.0;
        let next = both(warm(n as u64, n, n as u32 % 4))[0].unseen_step(&gpu(), &params).unwrap();
        assert_same_splats("another step", &next.params, &found.params);
        assert!(next.first != found.first && next.second != found.second);
    }
}

#[test]
fn lazy_steps_catch_up_and_round_once() {
    needs_roundings!("two kernels have the same bits");
    let _device = gpu();
    let of = |_| Rates { sh: [8e-3, 9e-3, 10e-3, 11e-3], ..rates() };
    for k in [1, 40] {
        let (from, until) = (700, 700 + k);
        let [found, exact] = both(warm(k, 150, 2)).map(|mut scene| {
            scene.state.iter_mut().for_each(|s| s[3] = from as f32);
            caught_up(&scene, of, &StepSettings::default(), until)
        });
        assert_same_splats(format_args!("{k} steps"), &found.params, &exact.params);
        assert!(assert_rounded(&found, &exact, until as u32) > 5000);
    }
}

#[test]
fn the_mean_of_many_roundings_is_the_number() {
    let _device = gpu();
    // They fall by less than half a last bit: rounded to the nearest, they would stand still.
    let mut scene = Scene::new(&scene(3, 2000, 0));
    (scene.params.n_static, scene.params.motion) = (2000, Vec::new());
    scene = Scene::new(&scene.params);
    scene.first.rotation.fill([0.3; 4]);
    scene.second.rotation.fill([0.7; 4]);
    let mut params = adam_params(&rates(), &StepSettings::default(), 9, 1);
    (params.beta1, params.beta2) = (1.0 - 1.0 / 1024.0, 0.999);
    let [packed, plain] = both(scene);
    let [found, exact] = [packed.clone(), plain].map(|scene| scene.unseen_step(&gpu(), &params).unwrap());
    for (found, exact, before, mantissa) in
        [(&found.first, &exact.first, &packed.first, 7), (&found.second, &exact.second, &packed.second, 8)]
    {
        let (x, all) = (f64::from(exact.rotation[0][0]), found.rotation.as_flattened());
        let n = all.len() as f64;
        let bit = 2f64.powi(x.log2().floor() as i32 - mantissa);
        let mean = all.iter().map(|found| f64::from(*found)).sum::<f64>() / n;
        // Five standard deviations of the mean, of at most half a bit each.
        assert!((mean - x).abs() < 5.0 * 0.5 * bit / n.sqrt(), "{mean} for {x}");
        let n_moved = all.iter().filter(|found| **found != before.rotation[0][0]).count();
        assert!(n_moved > 500 && n_moved < all.len() - 500, "{n_moved} of {n} moved");
        assert!((x - f64::from(before.rotation[0][0])).abs() < 0.5 * bit, "it is nearer to another");
    }
}

#[test]
fn a_word_holds_both_moments_and_what_it_holds_it_keeps() {
    let mut random = Random::new(2);
    let mut sizes: Vec<f32> = (0..4000).map(|_| random.uniform(-103.0, 88.0).exp() as f32).collect();
    sizes.extend([0.0, 1e-45, 1e-38, 6e4, 65504.0, 65505.0, 1e38, f32::MAX, f32::INFINITY]);
    for x in sizes {
        for m in [x, -x] {
            let [first, second] = moments_of(moment_word(m, x));
            for (found, x, mantissa) in [(first, m, 7), (second, x, 8)] {
                let nearest = rounded_moment(f64::from(x), mantissa, 0.5) as f32;
                assert_eq!(found.to_bits(), nearest.to_bits(), "{x:e}");
                assert_eq!(found.is_finite(), x.is_finite());
            }
            assert_eq!(moments_of(moment_word(first, second)).map(f32::to_bits), [first, second].map(f32::to_bits));
        }
    }
}
