//! Bilateral grids on the device against their reference and dual numbers. No cotangent, and colours of any kind: the rows N20
//! and N23 of `tests/conformance`.

use crate::common::prelude::*;
use ivv::internals::reference::{Adam, BilateralGrid, Dual, centred, pooled};
use ivv::internals::stage::{GRID_NUMBERS, GRID_SIZE, GridState, GridStep, Grids};
use ivv_conformance::fixtures::grids::{Case, Found, random_grid, step};
use std::fmt::Display;

tested! {
    "bilateral/bilateral_slice.comp" by BilateralGrid in slices_are_the_references_to_1e_6_at_any_size;
    "bilateral/bilateral_grade.comp" by BilateralGrid in slices_are_the_references_to_1e_6_at_any_size;
    "bilateral/bilateral_bwd.comp" by BilateralGrid in the_backward_pass_is_the_adjoint_of_the_derivative;
    "bilateral/bilateral_sum.comp" by BilateralGrid in the_backward_pass_is_the_adjoint_of_the_derivative;
    "bilateral/bilateral_adam.comp" by Adam in a_step_is_the_references_and_a_gradient_that_is_not_finite_moves_nothing;
    "bilateral/bilateral_adam.comp" by pooled in an_affine_step_is_that_of_one_map_in_all_cells;
    "bilateral/bilateral_gauge.comp" by centred in the_gauge_takes_off_what_the_reference_does;
}

/// Edges: a pixel, lines, fewer pixels than cells, several parts of a panel, wider and higher.
const SIZES: [[u32; 2]; 9] = [[1, 1], [1, 33], [33, 1], [5, 4], [15, 15], [16, 16], [97, 20], [20, 151], [61, 47]];

fn dot(a: impl IntoIterator<Item = f64>, b: impl IntoIterator<Item = f64>) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}

fn wide(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|x| f64::from(*x)).collect()
}

fn by_both(case: &Case) -> [Found; 2] {
    [false, true].map(|for_gpus| case.on_device_by(&gpu(), Some(for_gpus), 0.0).unwrap())
}

/// |found - truth| / |truth|, of a truth that is not zero.
fn relative_l2(found: &[f32], truth: &[f64]) -> f64 {
    assert_eq!(found.len(), truth.len());
    let norm = dot(truth.to_vec(), truth.to_vec()).sqrt();
    assert!(norm > 0.0, "the truth is zero");
    let difference: f64 = found.iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
    difference.sqrt() / norm
}

#[track_caller]
fn assert_same_grid(label: impl Display, found: &GridState, truth: &GridState) {
    assert_same(format_args!("{label}: grid"), &found.grid, &truth.grid);
    assert_same(format_args!("{label}: first moments"), &found.first, &truth.first);
    assert_same(format_args!("{label}: second moments"), &found.second, &truth.second);
}

#[test]
fn slices_are_the_references_to_1e_6_at_any_size() {
    for size in SIZES {
        let case = Case::random(1, size);
        let truth = case.truth();
        let differs =
            truth.as_flattened().iter().zip(wide(case.image.as_flattened())).any(|(a, b)| (a - b).abs() > 0.01);
        assert!(differs, "the grid does nothing");
        for found in by_both(&case) {
            let both = found.graded.as_flattened().iter().zip(truth.as_flattened());
            let error = both.fold(0.0, |most, (a, b)| f64::max(most, (f64::from(*a) - b).abs()));
            assert!(error <= 1e-6, "{size:?}: {error:.1e}");
        }
    }
}

#[test]
fn the_identity_gives_every_colour_its_bits() {
    for size in SIZES {
        let case = Case { state: GridState::identity(), ..Case::random(2, size) };
        by_both(&case).iter().for_each(|found| assert_same(format_args!("{size:?}"), &found.graded, &case.image));
    }
}

#[test]
fn cotangents_of_colours_are_those_of_dual_numbers() {
    for size in SIZES {
        let case = Case::random(3, size);
        // A pixel's colour moves that pixel alone, so a direction a channel tells all.
        let mut truth = vec![[0.0; 3]; case.image.len()];
        for channel in 0..3 {
            let mut direction = [0.0; 3];
            direction[channel] = 1.0;
            let along = case.along(&[0.0; GRID_NUMBERS], &vec![direction; case.image.len()]);
            for ((truth, along), d) in truth.iter_mut().zip(along).zip(&case.d_graded) {
                truth[channel] = dot(along, d.map(f64::from));
            }
        }
        for found in by_both(&case) {
            let error = relative_l2(found.d_image.as_flattened(), truth.as_flattened());
            assert!(error <= 1e-6, "{size:?}: {error:.1e}");
        }
    }
}

#[test]
fn every_number_of_a_small_pictures_gradient_of_the_grid_is_the_dual_numbers() {
    for size in [[1, 1], [3, 4]] {
        let case = Case::random(4, size);
        for Found { d_grid: found, .. } in by_both(&case) {
            let none = vec![[0.0; 3]; case.image.len()];
            let mut direction = vec![0.0; GRID_NUMBERS];
            let touched: Vec<usize> = (0..GRID_NUMBERS).filter(|i| found[*i] != 0.0).collect();
            assert!(touched.len() >= 50, "{} of the grid's numbers have a gradient", touched.len());
            let truth = touched.iter().map(|i| {
                direction[*i] = 1.0;
                let along = case.along(&direction, &none);
                direction[*i] = 0.0;
                dot(along.into_iter().flatten(), wide(case.d_graded.as_flattened()))
            });
            let truth: Vec<f64> = truth.collect();
            let found: Vec<f32> = touched.iter().map(|i| found[*i]).collect();
            let error = relative_l2(&found, &truth);
            assert!(error <= 1e-6, "{size:?}: {error:.1e}");
            // And what has none on the device has none in truth.
            let rest: Vec<f64> = (0..GRID_NUMBERS).map(|i| f64::from(u8::from(!touched.contains(&i)))).collect();
            assert!(case.along(&rest, &none).as_flattened().iter().all(|x| *x == 0.0), "{size:?}");
        }
    }
}

#[test]
fn the_backward_pass_is_the_adjoint_of_the_derivative() {
    for size in SIZES {
        let case = Case::random(5, size);
        for found in by_both(&case) {
            let gradient = [wide(&found.d_grid), wide(found.d_image.as_flattened())].concat();
            let norm = dot(gradient.clone(), gradient.clone()).sqrt();
            assert!(norm > 0.0);
            let mut random = Random::new(6);
            for _ in 0..3 {
                let mut draw = || random.uniform(-1.0, 1.0);
                let of_grid: Vec<f64> = (0..GRID_NUMBERS).map(|_| draw()).collect();
                let of_image: Vec<[f64; 3]> = case.image.iter().map(|_| [draw(), draw(), draw()]).collect();
                let forward = case.along(&of_grid, &of_image);
                let forward = dot(forward.into_iter().flatten(), wide(case.d_graded.as_flattened()));
                let direction = [of_grid, of_image.as_flattened().to_vec()].concat();
                let backward = dot(gradient.clone(), direction.clone());
                // Along a direction that is mostly of the null space, the difference is one of many numbers that cancel.
                let error = (forward - backward).abs() / norm;
                assert!(forward != 0.0 && error <= 1e-6, "{size:?}: {forward} and {backward}, {error:.1e}");
            }
        }
    }
}

#[test]
fn a_pixel_whose_cotangent_is_not_finite_has_no_share_in_the_grids_gradient() {
    let plain = Case { d_graded: vec![[0.0; 3]; 19 * 17], ..Case::random(11, [19, 17]) };
    for value in [f32::NAN, f32::INFINITY] {
        let mut case = plain.clone();
        case.d_graded[100][1] = value;
        case.d_graded[200] = [1.0; 3];
        for found in by_both(&case) {
            assert!(found.d_grid.iter().all(|x| x.is_finite()) && found.d_grid.iter().any(|x| *x != 0.0));
            assert!(found.d_image[100].iter().any(|x| !x.is_finite()), "the colour's cotangent may not hide it");
        }
    }
}

#[test]
fn a_step_is_the_references_and_a_gradient_that_is_not_finite_moves_nothing() {
    let gpu = gpu();
    let mut random = Random::new(12);
    for camera_step in [1u64, 2, 500] {
        let mut state = random_grid(&mut random, 0.2);
        if camera_step > 1 {
            state.first.iter_mut().for_each(|m| *m = random.uniform(-1.0, 1.0) as f32);
            state.second.iter_mut().for_each(|v| *v = random.uniform(0.1, 1.0) as f32);
        }
        let mut d_grid: Vec<f32> = (0..GRID_NUMBERS).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
        let bad = [(5, f32::NAN), (70, f32::INFINITY), (24_575, f32::NEG_INFINITY)];
        bad.iter().for_each(|(i, x)| d_grid[*i] = *x);
        d_grid[6] = 0.0;
        d_grid[9] = 1e30;
        let other = random_grid(&mut random, 1.0);
        let states = [other.clone(), state.clone(), other];
        let grids = Grids::upload(&gpu, &states).unwrap();
        let rate = 2e-3;
        // No gauge: 7 is no multiple of 3.
        step(&gpu, &grids, 1, &d_grid, &GridStep { step: 7, is_free: true, is_affine: false, camera_step, rate }, 0)
            .unwrap();
        let found = grids.download(&gpu).unwrap();
        for camera in [0, 2] {
            assert_same_grid("another camera", &found[camera], &states[camera]);
        }
        let found = &found[1];
        for (i, g) in d_grid.iter().enumerate() {
            let before = [state.grid[i], state.first[i], state.second[i]];
            let after = [found.grid[i], found.first[i], found.second[i]];
            if !g.is_finite() {
                assert_eq!(after.map(f32::to_bits), before.map(f32::to_bits), "number {i}");
                continue;
            }
            let [parameter, first, second] = before.map(f64::from);
            let truth = Adam { parameter, first, second }.step(f64::from(*g), rate, camera_step);
            if f64::from(*g).powi(2) < f64::from(f32::MAX) {
                let allowed = 1e-6 * rate.max((truth.parameter - parameter).abs()) + 1.2e-7 * parameter.abs().max(1.0);
                assert!(
                    (f64::from(after[0]) - truth.parameter).abs() <= allowed,
                    "number {i}: {after:?} for {truth:?}"
                );
                assert!((f64::from(after[1]) - truth.first).abs() <= 1e-6 && after[1].is_finite());
                assert!((f64::from(after[2]) - truth.second).abs() <= 1e-6 * truth.second + 1e-38);
            } else {
                assert_eq!(after[0], before[0], "a step of infinite measure");
            }
        }
        let n_moved = found.grid.iter().zip(&state.grid).filter(|(a, b)| a != b).count();
        assert!(n_moved > GRID_NUMBERS - 10, "{n_moved} moved");
    }
}

#[test]
fn an_affine_step_is_that_of_one_map_in_all_cells() {
    let gpu = gpu();
    let mut random = Random::new(19);
    let map: [f32; 12] = std::array::from_fn(|_| random.uniform(-1.0, 1.0) as f32);
    let state = GridState { grid: map.repeat(GRID_NUMBERS / 12), ..GridState::identity() };
    let mut d_grid: Vec<f32> = (0..GRID_NUMBERS).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
    d_grid[12 * 77 + 5] = f32::NAN;
    let (rate, other) = (2e-3, random_grid(&mut random, 1.0));
    let states = [other.clone(), state, other];
    let grids = Grids::upload(&gpu, &states).unwrap();
    let numbers = GridStep { step: 7, is_free: true, is_affine: true, camera_step: 1, rate };
    step(&gpu, &grids, 1, &d_grid, &numbers, 0).unwrap();
    let found = grids.download(&gpu).unwrap();
    for camera in [0, 2] {
        assert_same_grid("another camera", &found[camera], &states[camera]);
    }
    let truth = pooled(&wide(&d_grid));
    for (i, (after, d)) in found[1].grid.iter().zip(&truth).enumerate() {
        assert_eq!(after.to_bits(), found[1].grid[i % 12].to_bits(), "number {i}: cells differ");
        if i % 12 == 5 {
            assert_eq!(*after, map[5], "a gradient that is no number moves nothing");
            continue;
        }
        assert!(d.abs() > 0.1, "a sum as small as {d} says nothing about its sign");
        let truth = Adam { parameter: map[i % 12].into(), first: 0.0, second: 0.0 }.step(*d, rate, 1);
        let (first, second) = (f64::from(found[1].first[i]), f64::from(found[1].second[i]));
        assert!((f64::from(*after) - truth.parameter).abs() <= 1.2e-7 + 1e-6 * rate, "number {i}");
        // 2,048 numbers of either sign are summed.
        assert!((first - truth.first).abs() <= 1e-5 && (second - truth.second).abs() <= 1e-5 * truth.second.max(1.0));
    }
}

#[test]
fn total_variation_and_its_gradient_are_the_references() {
    let gpu = gpu();
    let state = random_grid(&mut Random::new(13), 0.3);
    let tv_weight = 10.0;
    let case = Case { state, d_graded: vec![[0.0; 3]; 5 * 4], ..Case::random(13, [5, 4]) };
    let found = case.on_device_by(&gpu, None, tv_weight).unwrap();
    let truth = BilateralGrid::new(&wide(&case.state.grid)).total_variation();
    let value = f64::from(found.variation);
    assert!(truth > 0.0 && (value - truth).abs() <= 1e-6 * truth, "{value} for {truth}");
    let [nx, ny, nz] = GRID_SIZE;
    let corners = [0, nx - 1, nx * (ny - 1), nx * ny - 1, nx * ny * (nz - 1), nx * ny * nz - 1];
    let inside = [5 * nx * ny + 3 * nx + 9, 2 * nx * ny + 14 * nx + 1, nx * ny];
    for (cell, entry) in corners.into_iter().chain(inside).zip([0, 11, 5, 7, 3, 10, 2, 8, 6]) {
        let dual = |(i, x): (usize, &f32)| Dual::new((*x).into(), f64::from(u8::from(i == 12 * cell + entry)));
        let numbers: Vec<Dual> = case.state.grid.iter().enumerate().map(dual).collect();
        let truth = tv_weight * BilateralGrid::new(&numbers).total_variation().tangent;
        let found = f64::from(found.d_grid[12 * cell + entry]);
        assert!(truth != 0.0 && (found - truth).abs() <= 1e-6 * truth.abs() + 1e-9, "cell {cell}: {found} for {truth}");
    }
}

#[test]
fn the_gauge_takes_off_what_the_reference_does() {
    let gpu = gpu();
    let mut random = Random::new(18);
    // Without photographs, and with some behind those that film.
    for (n_cameras, n_photos) in [(2, 0), (3, 0), (7, 0), (7, 4), (3, 2)] {
        let states: Vec<GridState> = (0..n_cameras).map(|_| random_grid(&mut random, 0.5)).collect();
        let grids = Grids::upload(&gpu, &states).unwrap().with_photos(n_photos);
        // A rate of 0, so that the gauge alone moves numbers.
        let numbers = GridStep { step: n_cameras, is_free: true, is_affine: false, camera_step: 1, rate: 0.0 };
        step(&gpu, &grids, 0, &[0.0; GRID_NUMBERS], &numbers, 0).unwrap();
        let before: Vec<Vec<f64>> = states.iter().map(|state| wide(&state.grid)).collect();
        let truth = centred(&before, states.len() - n_photos);
        let moved = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.1);
        assert!(truth.iter().zip(&before).all(moved), "the gauge has nothing to do");
        for (found, truth) in grids.download(&gpu).unwrap().iter().zip(&truth) {
            let differences = found.grid.iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).abs());
            let error = differences.fold(0.0, f64::max);
            assert!(error <= 1e-6, "{n_cameras} cameras, {n_photos} of them photographs: {error:.1e}");
        }
    }
}

#[test]
fn the_gauge_keeps_the_mean_over_the_cameras_at_the_identity() {
    let gpu = gpu();
    let n_cameras = 5;
    let grids = Grids::new(&gpu, n_cameras).unwrap();
    let mut random = Random::new(14);
    // All cameras are pulled the same way, which the gauge takes off, and each its own way.
    let tint: Vec<f32> = (0..GRID_NUMBERS).map(|i| if i % 12 == 0 { 1.0 } else { 0.0 }).collect();
    let rate = 2e-3;
    let identity = GridState::identity().grid;
    let mean_strays = |states: &[GridState]| {
        let mean = |i: usize| states.iter().map(|s| f64::from(s.grid[i] - identity[i])).sum::<f64>() / n_cameras as f64;
        (0..GRID_NUMBERS).map(|i| mean(i).abs()).fold(0.0, f64::max)
    };
    let mut strayed = 0.0;
    for number in 1..=60u64 {
        let camera = (number as usize - 1) % n_cameras;
        let d_grid: Vec<f32> = tint.iter().map(|t| t + random.uniform(-0.5, 0.5) as f32).collect();
        let numbers = GridStep {
            step: number,
            is_free: true,
            is_affine: false,
            camera_step: (number - 1) / n_cameras as u64 + 1,
            rate,
        };
        step(&gpu, &grids, camera, &d_grid, &numbers, 0).unwrap();
        if number.is_multiple_of(n_cameras as u64) || number % n_cameras as u64 == 4 {
            let states = grids.download(&gpu).unwrap();
            let strays = mean_strays(&states);
            if number.is_multiple_of(n_cameras as u64) {
                assert!(strays <= 1e-7, "{strays:.1e} after step {number}");
            } else {
                strayed = f64::max(strayed, strays);
            }
        }
    }
    assert!(strayed > 1e-4 && strayed <= 1.1 * rate, "{strayed} between");
    let moved = grids.download(&gpu).unwrap();
    assert!(moved.iter().all(|state| state.identity_deviation() > 1e-4), "the grids have not moved");
}

#[test]
fn a_failed_frame_leaves_all_bits() {
    let gpu = gpu();
    let mut random = Random::new(15);
    let mut states = [random_grid(&mut random, 0.2), random_grid(&mut random, 0.2)];
    states[0].first.iter_mut().for_each(|m| *m = random.uniform(-1.0, 1.0) as f32);
    let d_grid: Vec<f32> = (0..GRID_NUMBERS).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
    // With the gauge, which is due after an even step.
    let numbers = GridStep { step: 4, is_free: true, is_affine: false, camera_step: 3, rate: 2e-3 };
    let grids = Grids::upload(&gpu, &states).unwrap();
    for failed in [1, 2, 1 << 31] {
        step(&gpu, &grids, 0, &d_grid, &numbers, failed).unwrap();
        let found = grids.download(&gpu).unwrap();
        found.iter().zip(&states).for_each(|(found, state)| assert_same_grid(failed, found, state));
    }
    step(&gpu, &grids, 0, &d_grid, &numbers, 0).unwrap();
    let after = grids.download(&gpu).unwrap();
    assert!(after[0] != states[0] && after[1] != states[1], "nor does one that did not fail");
}

#[test]
fn gradients_have_the_same_bits_in_every_run() {
    let case = Case::random(16, [97, 64]);
    let first = by_both(&case);
    assert!(first[0].d_grid.iter().any(|x| *x != 0.0));
    for _ in 0..3 {
        for (found, first) in by_both(&case).iter().zip(&first) {
            assert_same("gradient of the grid", &found.d_grid, &first.d_grid);
            assert_same("gradient of the picture", &found.d_image, &first.d_image);
            assert_same("picture", &found.graded, &first.graded);
        }
    }
}

#[test]
fn states_go_up_and_come_back_and_unsound_ones_are_known() {
    let gpu = gpu();
    let mut random = Random::new(17);
    let states: Vec<GridState> = (0..3).map(|_| random_grid(&mut random, 0.5)).collect();
    let grids = Grids::upload(&gpu, &states).unwrap();
    let found = grids.download(&gpu).unwrap();
    assert_eq!([grids.n_cameras(), found.len()], [3, 3]);
    found.iter().zip(&states).for_each(|(found, state)| assert_same_grid("read back", found, state));
    assert_eq!(GridState::identity().identity_deviation(), 0.0);
    let mut shifted = GridState::identity();
    shifted.grid.iter_mut().for_each(|x| *x += 0.25);
    assert_eq!(shifted.identity_deviation(), 0.25);
    assert!(states.iter().all(GridState::is_sound) && GridState::identity().is_sound());
    let unsound = |damage: fn(&mut GridState)| {
        let mut state = GridState::identity();
        damage(&mut state);
        !state.is_sound()
    };
    assert!(unsound(|s| s.grid[7] = f32::NAN) && unsound(|s| s.first[7] = f32::INFINITY));
    assert!(unsound(|s| s.second[7] = f32::NAN) && unsound(|s| s.second[7] = -1.0));
    assert!(unsound(|s| s.grid.truncate(12)) && unsound(|s| s.second.push(0.0)));
}
