//! Steps on several images: sums of gradients against the exact reference's, and a step along them against Adam's. Gradients of any
//! size: row N24 of `tests/conformance`.

use crate::adversary::rounds_otherwise;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::kernel::assert_same_scene;
use ivv::internals::gpu::generated::Status;
use ivv::internals::reference::{batch_gradient, batch_place, batch_pulls, batch_sum};
use ivv::internals::stage::{Batch, Cull, Planes, Rates, Rows, StepSettings, adam_params};
use ivv_conformance::fixtures::adam::{Step, cotangents, gradients, half_seen, numbers, rates};

tested! {
    "batch/batch_add.comp" by batch_sum in sums_of_three_images_have_the_references_bits;
    "batch/batch_pack.comp" by batch_place in sums_of_three_images_have_the_references_bits;
    "batch/batch_unpack.comp" by batch_place in rows_that_were_exchanged_come_back_where_they_belong;
    "batch/batch_step.comp" by Adam in a_step_along_a_sum_is_the_references;
}

/// Gradients of every size, with what is too large, and zeros of both signs.
fn any_gradients(seed: u64, like: &Splats) -> Splats {
    let mut random = Random::new(seed);
    let mut all = like.clone();
    let mut draw = || match random.uniform(0.0, 16.0) as u32 {
        0 => 0.0,
        1 => -0.0,
        2 => 17.0,
        3 => -3e38,
        4 => 1e-45,
        5 => 16.0,
        _ => (random.uniform(-1.0, 1.0) * random.uniform(-40.0, 3.0).exp()) as f32,
    };
    fill(&mut all, &mut draw);
    all
}

/// Draws every number of a scene.
pub fn fill(splats: &mut Splats, draw: &mut dyn FnMut() -> f32) {
    let Splats { position, rotation, scale, opacity, sh, motion, .. } = splats;
    let motion: &mut [f32] = bytemuck::cast_slice_mut(motion);
    let flat =
        [position.as_flattened_mut(), rotation.as_flattened_mut(), scale.as_flattened_mut(), opacity.as_mut_slice()];
    flat.into_iter().chain([sh.as_flattened_mut(), motion]).flatten().for_each(|x| *x = draw());
}

fn row_of(splats: &Splats, i: usize) -> Vec<f32> {
    let ([x, y, z], s, k) = (splats.position[i], splats.scale[i], splats.n_coefficients());
    let motion = i.checked_sub(splats.n_static).map(|at| splats.motion[at]);
    let mut row = vec![x, y, z, splats.opacity[i]];
    row.extend(splats.rotation[i]);
    row.extend([s[0], s[1], s[2], motion.map_or(0.0, |m| m.t_scale)]);
    row.extend(splats.sh[i * k]);
    row.push(f32::NAN);
    row.extend(motion.iter().flat_map(|m| [m.velocity[0], m.velocity[1], m.velocity[2], m.t_center]));
    for (band, planes) in [(1, 3), (2, 4), (3, 6)].into_iter().filter(|(band, _)| band * band < k) {
        let mut numbers = splats.sh[i * k + band * band..i * k + (band + 1) * (band + 1)].as_flattened().to_vec();
        numbers.resize(4 * planes, 0.0);
        row.extend(numbers);
    }
    row
}

/// How hard the centre of Gaussian `i` is pulled in image `image`: below 0 where that does not count.
fn pull_of(i: usize, image: usize) -> f32 {
    [-1.0, 0.0, 3e-4, 0.7, 31.0, 1e9][(i + 2 * image) % 6]
}

#[test]
fn sums_of_three_images_have_the_references_bits() {
    let gpu = gpu();
    for (n, degree) in [(1, 0), (2, 1), (31, 2), (33, 3), (130, 0), (300, 3)] {
        let mut params = scene(7, n, degree);
        // Some are behind the camera, and some live at another time.
        (0..n).step_by(5).for_each(|i| params.position[i][2] = -9.0);
        let buffers = SceneBuffers::upload(&gpu, &params, &Constants::default(), Purpose::Training).unwrap();
        let batch = Batch::new(&gpu, &buffers).unwrap();
        let status = gpu.upload("status", &[Status::default()]).unwrap();
        let all: Vec<Splats> = (0..3).map(|image| any_gradients(image, &params)).collect();
        let mut is_active = vec![vec![false; n]; 3];
        for (image, gradients) in all.iter().enumerate() {
            let view = View { time: 0.1 + 0.3 * image as f64, ..view() };
            let view = view_params(&view, &Constants::default(), buffers.origin, Strip::whole(&view));
            let view = gpu.upload("view", &[view]).unwrap();
            let planes: Vec<Planes> = buffers
                .groups
                .iter()
                .map(|group| {
                    let planes = Planes::upload(&gpu, gradients, group.start, group.n as usize, [0.0; 3]).unwrap();
                    let mut sh0 = gpu.read(&planes.sh0).unwrap();
                    sh0.iter_mut().enumerate().for_each(|(i, rows)| rows[3] = pull_of(group.start + i, image));
                    gpu.write(&planes.sh0, &sh0).unwrap();
                    planes
                })
                .collect();
            let cull = Cull::new(&gpu, &buffers, buffers.n, false).unwrap();
            let mut rec = Recording::new();
            cull.record(&mut rec, &buffers, &view, &status);
            batch.record_add(&mut rec, &buffers, &cull, &status, &planes);
            gpu.run(&rec).unwrap();
            let n_active = gpu.read(&cull.n_active).unwrap()[0] as usize;
            for id in &gpu.read(&cull.active_id).unwrap()[..n_active] {
                let group = buffers.groups.iter().find(|group| (group.first..group.first + group.n).contains(id));
                let group = group.unwrap();
                is_active[image][group.start + (id - group.first) as usize] = true;
            }
        }
        let touched = batch.touched(&gpu).unwrap();
        let Rows { ids, sums } = batch.rows(&gpu, &buffers, &touched).unwrap();
        let mut from = 0;
        for (group, ids) in buffers.groups.iter().zip(&ids) {
            let here: Vec<usize> = (group.start..group.start + group.n as usize)
                .filter(|i| is_active.iter().any(|active| active[*i]))
                .collect();
            assert!(ids.iter().map(|id| group.start + *id as usize).eq(here.iter().copied()), "{n}: in view");
            let n_elements = row_of(&params, group.start).len();
            for (row, &i) in here.iter().enumerate() {
                let seen: Vec<usize> = (0..3).filter(|image| is_active[*image][i]).collect();
                let rows: Vec<Vec<f32>> = seen.iter().map(|image| row_of(&all[*image], i)).collect();
                for element in 0..n_elements {
                    let found = sums[from + batch_place(element, row, ids.len())];
                    let own: Vec<f32> = rows.iter().map(|row| row[element]).collect();
                    let expected = if element == 15 {
                        batch_pulls(&seen.iter().map(|image| pull_of(i, *image)).collect::<Vec<_>>())
                    } else {
                        batch_sum(&own)
                    };
                    assert_eq!(found, expected, "element {element} of {i} among {n}, of {own:?}");
                }
            }
            from += ids.len() * n_elements;
        }
        assert_eq!(from, sums.len());
        assert!(n < 30 || is_active.iter().flatten().filter(|active| **active).count() > n / 2);
    }
}

#[test]
fn rows_that_were_exchanged_come_back_where_they_belong() {
    let gpu = gpu();
    for (n, degree) in [(1, 3), (2, 0), (33, 1), (300, 2)] {
        let params = scene(3, n, degree);
        let buffers = SceneBuffers::upload(&gpu, &params, &Constants::default(), Purpose::Training).unwrap();
        let batch = Batch::new(&gpu, &buffers).unwrap();
        // Every third Gaussian of a group.
        let mut touched = batch.touched(&gpu).unwrap();
        assert!(touched.iter().all(|word| *word == 0));
        assert!(batch.rows(&gpu, &buffers, &touched).unwrap().sums.is_empty());
        let mut first = 0;
        for group in &buffers.groups {
            (0..group.n as usize).step_by(3).for_each(|i| touched[first + i / 32] |= 1 << (i % 32));
            first += group.n.div_ceil(32).next_multiple_of(64) as usize;
        }
        let mut rows = batch.rows(&gpu, &buffers, &touched).unwrap();
        assert!(!rows.sums.is_empty() && rows.sums.iter().all(|sum| *sum == 0), "there was nothing");
        let mut random = Random::new(9);
        rows.sums.iter_mut().for_each(|sum| *sum = (random.uniform(-1.0, 1.0) * 9.2e18) as i64);
        batch.put(&gpu, &buffers, &rows, &touched).unwrap();
        assert_eq!(batch.touched(&gpu).unwrap(), touched);
        assert_eq!(batch.rows(&gpu, &buffers, &touched).unwrap(), rows);
        // The others have kept theirs.
        let others: Vec<u32> = touched.iter().map(|word| !word).collect();
        let all: Vec<u32> = buffers
            .groups
            .iter()
            .flat_map(|group| {
                let words = group.n.div_ceil(32).next_multiple_of(64);
                (0..words)
                    .map(|word| (0..32).filter(|bit| 32 * word + bit < group.n).fold(0, |bits, bit| bits | 1u32 << bit))
            })
            .collect();
        let others: Vec<u32> = others.iter().zip(all).map(|(a, b)| a & b).collect();
        assert!(batch.rows(&gpu, &buffers, &others).unwrap().sums.iter().all(|sum| *sum == 0));
    }
}

#[test]
fn rows_of_more_than_a_binding_holds_come_in_parts() {
    let gpu = gpu();
    // Three bands and no motion: 17 planes of four numbers.
    const ELEMENTS: usize = 68;
    let in_part = (1 << 27) / (8 * ELEMENTS);
    let n = in_part + 5;
    let params = Splats { n_static: n, motion: Vec::new(), ..scene(3, n, 3) };
    let buffers = SceneBuffers::upload(&gpu, &params, &Constants::default(), Purpose::Training).unwrap();
    assert_eq!(buffers.groups.len(), 1);
    let batch = Batch::new(&gpu, &buffers).unwrap();
    let mut touched = batch.touched(&gpu).unwrap();
    (0..n).for_each(|i| touched[i / 32] |= 1 << (i % 32));
    let sums = (0..n * ELEMENTS).map(|at| (at as i64).wrapping_mul(0x9E37_79B9_7F4A_7C15_u64 as i64)).collect();
    let rows = Rows { ids: vec![(0..n as u32).collect()], sums };
    batch.put(&gpu, &buffers, &rows, &touched).unwrap();
    assert!(batch.rows(&gpu, &buffers, &touched).unwrap() == rows);
    // Each by itself has its own sums, on both sides of the border.
    for i in [0, in_part - 1, in_part, n - 1] {
        let mut one = vec![0; touched.len()];
        one[i / 32] = 1 << (i % 32);
        let (first, n_part) = if i < in_part { (0, in_part) } else { (in_part, n - in_part) };
        let of_row = |e| rows.sums[first * ELEMENTS + batch_place(e, i - first, n_part)];
        let found = batch.rows(&gpu, &buffers, &one).unwrap();
        assert!(found.sums.iter().copied().eq((0..ELEMENTS).map(of_row)), "Gaussian {i}");
    }
}

/// Two images of one scene, and their cotangents.
pub fn two(size: f32) -> [(View, Vec<[f32; 3]>); 2] {
    let first = view();
    let mut second = View { time: 0.6, ..view() };
    second.pose.translation.x += 0.4;
    let colors = [cotangents(&first, 5, size), cotangents(&second, 6, size)];
    let [a, b] = colors;
    [(first, a), (second, b)]
}

pub fn borrowed(images: &[(View, Vec<[f32; 3]>); 2]) -> [(&View, &[[f32; 3]]); 2] {
    images.each_ref().map(|(view, d_color)| (view, d_color.as_slice()))
}

#[test]
fn a_step_along_a_sum_is_the_references() {
    let otherwise = rounds_otherwise("moments follow from another kernel's gradient");
    for degree in 0..=3 {
        let scene = half_seen(u64::from(degree), degree);
        let images = two(1e-3);
        let of = |(view, d_color): &(View, Vec<[f32; 3]>)| {
            numbers(&gradients(&gpu(), &scene.params, view, d_color).unwrap(), &scene.params.scale, &rates())
        };
        let [first, second] = images.each_ref().map(of);
        for step in [1, 2, 1000] {
            let (found, n_bad) = scene.batch_step(&gpu(), &borrowed(&images), &Step::dense(step)).unwrap();
            assert_eq!(n_bad, 0);
            let (found, mut n_moved) = (found.references(), 0);
            for ((reference, found), (a, b)) in scene.references().into_iter().zip(found).zip(first.iter().zip(&second))
            {
                let (rate, name, i) = (a.1, a.2, a.3);
                let truth = reference.step(batch_gradient(batch_sum(&[a.0, b.0])), rate, step);
                let allowed = 1e-6 * (truth.parameter - reference.parameter).abs().max(rate)
                    + 1.2e-7 * reference.parameter.abs().max(truth.parameter.abs());
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs() + 1.2e-38;
                let is_close = (found.parameter - truth.parameter).abs() <= allowed;
                assert!(is_close || otherwise, "{name} of {i}: {found:?} for {truth:?}");
                let are_close = close(found.first, truth.first) && close(found.second, truth.second);
                assert!(are_close || otherwise, "{name} of {i}: {found:?} for {truth:?}");
                n_moved += usize::from(found.parameter != reference.parameter);
            }
            assert!(n_moved > first.len() / 3, "{n_moved} of {} moved", first.len());
        }
    }
}

#[test]
fn a_batch_has_the_same_bits_in_any_order_and_statistics_as_single_steps_have() {
    let scene = half_seen(4, 2);
    let images = two(1e-3);
    let [a, b] = borrowed(&images);
    let (found, _) = scene.batch_step(&gpu(), &[a, b], &Step::dense(3)).unwrap();
    assert!(found != scene);
    assert_same_scene("another order", &scene.batch_step(&gpu(), &[b, a], &Step::dense(3)).unwrap().0, &found);
    // Pulls and counts are those of the two images alone.
    let of = |image: (&View, &[[f32; 3]])| scene.step(&gpu(), image.0, image.1, &Step::dense(3)).unwrap().0.state;
    let (mut n_seen, mut n_twice) = (0, 0);
    for ((both, first), second) in found.state.iter().zip(of(a)).zip(of(b)) {
        assert_eq!(both[1], first[1] + second[1]);
        let sum = first[0] + second[0];
        assert!((both[0] - sum).abs() <= 1e-6 * sum.abs() + 2f32.powi(-39), "{both:?}: {first:?}, {second:?}");
        assert_eq!(both[3], first[3].max(second[3]));
        n_seen += usize::from(both[1] > 0.0);
        n_twice += usize::from(both[1] == 2.0);
    }
    assert!(n_seen > 10 && n_twice > 5, "{n_seen}, {n_twice}");
}

#[test]
fn a_failed_batch_leaves_all() {
    let scene = half_seen(9, 1);
    let images = two(1e-3);
    for failed in [1, 2, 1 << 31] {
        let step = Step { failed, ..Step::dense(1) };
        let found = scene.batch_step(&gpu(), &borrowed(&images), &step).unwrap().0;
        assert_same_scene(format_args!("failed {failed}"), &found, &scene);
    }
}

#[test]
fn moments_of_a_step_on_four_images_decay_as_in_four_steps() {
    let of =
        |images, step| adam_params(&Rates::default(), &StepSettings { images, ..StepSettings::default() }, step, 1);
    let (one, four) = (of(1, 8), of(4, 2));
    assert!(
        (f64::from(four.beta1) - 0.9f64.powi(4)).abs() < 1e-7
            && (f64::from(four.beta2) - 0.999f64.powi(4)).abs() < 1e-7
    );
    assert_eq!((one.beta1, one.beta2), (0.9, 0.999));
    assert!((four.inverse_c2 / one.inverse_c2 - 1.0).abs() < 1e-5, "both have seen eight images");
}
