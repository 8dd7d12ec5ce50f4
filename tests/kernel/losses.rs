//! The photometric loss and its cotangent on the device, against dual numbers. Equal and flat pictures: the rows N20 and
//! N21 of `tests/conformance`.

use crate::common::prelude::*;
use ivv::internals::gpu::generated::Status;
use ivv::internals::stage::{MOST_TERMS, Report, SSIM_WEIGHT, record_report};
use ivv_conformance::fixtures::photometric::Pair;

tested! {
    "loss/ssim.comp" by photometric in loss_and_cotangent_of_noise_are_those_of_dual_numbers_at_any_size_and_mask;
    "loss/ssim_bwd.comp" by photometric in loss_and_cotangent_of_noise_are_those_of_dual_numbers_at_any_size_and_mask;
    "loss/loss_sum.comp" by photometric in loss_and_cotangent_of_noise_are_those_of_dual_numbers_at_any_size_and_mask;
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

/// A name and what the mask holds at a pixel.
type Mask = (&'static str, Box<dyn Fn(usize) -> u8>);

/// Masks by pixel: all visible, all but one, bands of hidden pixels, and one visible pixel.
fn masks(n: usize) -> Vec<Mask> {
    let mut masks: Vec<Mask> = vec![("no mask", Box::new(|_| 255))];
    if n > 1 {
        masks.push(("all but one", Box::new(move |i| if i == n / 2 { 0 } else { 255 })));
        masks.push(("bands", Box::new(|i| if i % 7 < 3 { 0 } else { 255 })));
        masks.push(("only one", Box::new(move |i| if i == n / 2 { 255 } else { 0 })));
    }
    masks
}

/// Thinner than the window and than a tile, tiles' multiples, and more by one.
const SIZES: [[u32; 2]; 9] = [[1, 1], [1, 17], [17, 1], [5, 5], [16, 16], [33, 47], [64, 48], [32, 8], [65, 17]];

#[test]
fn loss_and_cotangent_of_noise_are_those_of_dual_numbers_at_any_size_and_mask() {
    for size in SIZES {
        for (name, mask) in masks((size[0] * size[1]) as usize) {
            let pair = Pair::random(7, size, mask);
            let found = pair.on_device(&gpu()).unwrap();
            let d_image = found.d_image();
            let norm = dot(&d_image, &d_image).sqrt();
            assert!(norm > 0.0, "{size:?}, {name}: no cotangent");
            let mut random = Random::new(9);
            for _ in 0..3 {
                let w: Vec<[f32; 3]> = pair.image.iter().map(|_| random.vector(-1.0, 1.0)).collect();
                let truth = pair.dual(&w);
                // The hidden pixels' SSIM of 1 is summed and taken off again.
                let allowed = 1e-6 * pair.image.len() as f64 / pair.n_visible() as f64;
                assert!((found.ssim - truth.ssim.value).abs() <= allowed, "{size:?}, {name}: {} {truth:?}", found.ssim);
                assert!((found.l1 - truth.l1.value).abs() <= 1e-6 * truth.l1.value, "{size:?}, {name}: {truth:?}");
                let w: Vec<[f64; 3]> = w.iter().map(|w| w.map(f64::from)).collect();
                let difference = (truth.loss().tangent - dot(&d_image, &w)).abs();
                let error = difference / (norm * dot(&w, &w).sqrt());
                assert!(error <= 1e-6, "{size:?}, {name}: {error:.1e}");
            }
        }
    }
}

#[test]
fn ssim_at_every_second_place_is_that_of_dual_numbers() {
    for size in SIZES {
        for (name, mask) in masks((size[0] * size[1]) as usize) {
            let pair = Pair::random(8, size, mask);
            let mut random = Random::new(5);
            let w: Vec<[f32; 3]> = pair.image.iter().map(|_| random.vector(-1.0, 1.0)).collect();
            let along: Vec<[f64; 3]> = w.iter().map(|w| w.map(f64::from)).collect();
            let found = pair.on_device_with(&gpu(), 2).unwrap();
            let truth = pair.dual_at(&w, 2);
            let (lambda, case) = (f64::from(SSIM_WEIGHT), format!("{size:?}, {name}"));
            let allowed = 4e-6 * pair.image.len() as f64 / pair.n_visible() as f64;
            assert!((found.ssim - truth.ssim.value).abs() <= allowed, "{case}: {} {truth:?}", found.ssim);
            assert!((found.l1 - truth.l1.value).abs() <= 1e-6 * truth.l1.value, "{case}: {truth:?}");
            let d_image = found.d_image();
            let expected = (1.0 - lambda) * truth.l1.tangent - lambda * truth.ssim.tangent;
            let norm = dot(&d_image, &d_image).sqrt() * dot(&along, &along).sqrt();
            let error = (expected - dot(&d_image, &along)).abs() / norm;
            assert!(norm > 0.0 && error <= 1e-6, "{case}: {error:.1e}");
        }
    }
}

#[test]
fn every_number_of_a_small_pictures_cotangent_is_the_dual_numbers() {
    for (size, mask) in [([5, 5], 255), ([1, 17], 255), ([9, 7], 0)] {
        let pair = Pair::random(3, size, |i| if i % 3 == 1 { mask } else { 255 });
        let found = pair.on_device(&gpu()).unwrap().d_image();
        let largest = found.as_flattened().iter().fold(0.0, |m, x| f64::max(m, x.abs()));
        assert!(largest > 0.0);
        let mut w = vec![[0.0f32; 3]; pair.image.len()];
        for (i, found) in found.iter().enumerate() {
            for channel in 0..3 {
                w[i][channel] = 1.0;
                let truth = pair.dual(&w).loss().tangent;
                w[i][channel] = 0.0;
                let error = (found[channel] - truth).abs() / largest;
                assert!(error <= 1e-5, "{size:?}: pixel {i}, channel {channel}: {} for {truth}", found[channel]);
                assert!(pair.truth[i] >> 24 != 0 || found[channel] == 0.0, "a hidden pixel has a cotangent");
            }
        }
    }
}

#[test]
fn the_loss_has_the_same_bits_in_every_run() {
    let pair = Pair::random(12, [64, 48], |i| if i % 11 == 0 { 0 } else { 255 });
    let first = pair.on_device(&gpu()).unwrap();
    assert!(first.d_image().as_flattened().iter().any(|x| *x != 0.0));
    for _ in 0..3 {
        assert!(pair.on_device(&gpu()).unwrap() == first);
    }
}

#[test]
fn a_report_has_the_sums_of_any_number_of_terms_the_status_and_the_bad_gradients() {
    let gpu = gpu();
    let mut random = Random::new(21);
    // No sums, one, as many as threads, more.
    for lengths in
        [vec![], vec![1], vec![128, 1], vec![1025, 3, 127], vec![2, 1024, 129, 5000], vec![3, 1, 4, 1, 5, 926]]
    {
        let sums: Vec<Vec<[f32; 4]>> = lengths
            .iter()
            .map(|n| (0..*n).map(|_| std::array::from_fn(|_| random.uniform(0.5, 1.0) as f32)).collect())
            .collect();
        let terms: Vec<_> = sums.iter().map(|sums| gpu.upload("sums", sums).unwrap()).collect();
        let (n_active, n_visible) = (random.bits() as u32, random.bits() as u32);
        let status = Status { failed: 2, n_active, n_visible, n_intersections: 7, ..Status::default() };
        let n_bad = gpu.upload("bad", &[random.bits() as u32]).unwrap();
        let of_status = gpu.upload("status", &[status]).unwrap();
        let n_totals = lengths.len().div_ceil(MOST_TERMS).max(1);
        let totals: Vec<_> =
            (0..n_totals).map(|_| gpu.readback::<[f32; 4]>("totals", MOST_TERMS).unwrap().of()).collect();
        let (left, bad) = (gpu.readback::<Status>("left", 1).unwrap(), gpu.readback::<u32>("left", 1).unwrap());
        let to = Report { totals: &totals, status: &left.of(), n_bad: &bad.of() };
        let mut rec = Recording::new();
        record_report(&mut rec, &terms, &of_status, &n_bad, &to);
        gpu.run(&rec).unwrap();
        assert_eq!(gpu.peek::<Status>(&left).unwrap(), [status], "{lengths:?}");
        assert_eq!(gpu.peek::<u32>(&bad).unwrap(), gpu.read(&n_bad).unwrap(), "{lengths:?}");
        let found = totals.iter().flat_map(|totals| gpu.peek::<[f32; 4]>(&totals.slice()).unwrap());
        for (sums, found) in sums.iter().zip(found) {
            for (k, found) in found.into_iter().enumerate() {
                let truth: f64 = sums.iter().map(|sum| f64::from(sum[k])).sum();
                assert!((f64::from(found) - truth).abs() <= 1e-6 * truth, "{lengths:?}: {found} for {truth}");
            }
        }
    }
}
