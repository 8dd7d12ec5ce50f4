//! The photometric loss and its cotangent on the device, against dual numbers.

use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::gpu::Recording;
use ivv::stage::{Photometric, SSIM_WEIGHT, Structure};
use ivv::twin::{Dual, Photometry, photometric};

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];

/// A rendered picture and the training image that it is compared with.
#[derive(Clone)]
struct Pair {
    size: [u32; 2],
    image: Vec<[f32; 3]>,
    truth: Vec<u32>,
}

/// What the device makes of a pair.
#[derive(Debug, PartialEq)]
struct Found {
    ssim: f64,
    l1: f64,
    /// As bits, so that -0 and 0 differ.
    d_image: Vec<[u32; 3]>,
}

/// A pixel of the training image.
fn word(rgb: [u8; 3], mask: u8) -> u32 {
    u32::from_le_bytes([rgb[0], rgb[1], rgb[2], mask])
}

impl Pair {
    fn new(size: [u32; 2], image: impl Fn(u32, u32) -> [f32; 3], truth: impl Fn(u32, u32) -> u32) -> Self {
        let places = || (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| (x, y)));
        Pair {
            size,
            image: places().map(|(x, y)| image(x, y)).collect(),
            truth: places().map(|(x, y)| truth(x, y)).collect(),
        }
    }

    /// Noise against noise; `mask` says what the mask holds at a pixel.
    fn random(seed: u64, size: [u32; 2], mask: impl Fn(usize) -> u8) -> Self {
        let mut random = Random::new(seed);
        let n = (size[0] * size[1]) as usize;
        let truth = |i| {
            let [r, g, b, _] = (random.bits() as u32).to_le_bytes();
            word([r, g, b], mask(i))
        };
        let truth = (0..n).map(truth).collect();
        Pair { size, image: (0..n).map(|_| random.vector(0.0, 1.0)).collect(), truth }
    }

    fn n_visible(&self) -> usize {
        self.truth.iter().filter(|word| **word >> 24 != 0).count()
    }

    /// The loss with a derivative along `w`.
    fn dual(&self, w: &[[f32; 3]]) -> Photometry<Dual> {
        self.dual_at(w, 1)
    }

    fn dual_at(&self, w: &[[f32; 3]], stride: usize) -> Photometry<Dual> {
        let dual = |(x, w): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| Dual::new(x[k].into(), w[k].into()));
        let image: Vec<[Dual; 3]> = self.image.iter().zip(w).map(dual).collect();
        photometric(&image, &self.truth, self.size.map(|n| n as usize), self.n_visible(), stride)
    }

    /// The device's, in a scratch for a larger picture, with a guard behind the last pixel.
    fn on_device(&self) -> Found {
        self.on_device_with(Some(Structure::WHOLE))
    }

    fn on_device_with(&self, structure: Option<Structure>) -> Found {
        let gpu = gpu();
        let n = self.image.len();
        let loss = Photometric::new(&gpu, n + 3).unwrap();
        let alpha = 0.25;
        let image: Vec<[f32; 4]> = self.image.iter().map(|[r, g, b]| [*r, *g, *b, alpha]).collect();
        let image = gpu.upload("image", &image).unwrap();
        let d_image = gpu.upload("d image", &vec![GUARD; n + 1]).unwrap();
        gpu.write(&loss.truth, &self.truth).unwrap();
        let mut rec = Recording::new();
        loss.record(&mut rec, &image, &d_image, self.size, self.n_visible() as u32, structure);
        gpu.run(&rec).unwrap();
        let mut found = gpu.read(&d_image).unwrap();
        assert_eq!(found.pop(), Some(GUARD), "the pixel past the end was overwritten");
        assert!(found.iter().all(|d| d[3] == 0.0), "alpha has no part in the loss");
        let sums = gpu.read(&loss.sums).unwrap()[0];
        let [ssim, l1, _] =
            Photometric::values(sums, self.n_visible() as u32, self.size, structure.unwrap_or(Structure::WHOLE));
        Found { ssim, l1, d_image: found.into_iter().map(|[r, g, b, _]| [r, g, b].map(f32::to_bits)).collect() }
    }
}

impl Found {
    fn d_image(&self) -> Vec<[f64; 3]> {
        self.d_image.iter().map(|d| d.map(|x| f64::from(f32::from_bits(x)))).collect()
    }
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

const SIZES: [[u32; 2]; 7] = [[1, 1], [1, 17], [17, 1], [5, 5], [16, 16], [33, 47], [64, 48]];

#[test]
fn loss_and_cotangent_of_noise_are_those_of_dual_numbers_at_any_size_and_mask() {
    for size in SIZES {
        for (name, mask) in masks((size[0] * size[1]) as usize) {
            let pair = Pair::random(7, size, mask);
            let found = pair.on_device();
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
fn ssim_at_every_second_place_and_no_ssim_at_all_are_those_of_dual_numbers() {
    for size in SIZES {
        for (name, mask) in masks((size[0] * size[1]) as usize) {
            let pair = Pair::random(8, size, mask);
            let mut random = Random::new(5);
            let w: Vec<[f32; 3]> = pair.image.iter().map(|_| random.vector(-1.0, 1.0)).collect();
            let along: Vec<[f64; 3]> = w.iter().map(|w| w.map(f64::from)).collect();
            let strided = Structure { stride: 2, times: 3.0 };
            for structure in [Some(strided), None] {
                let found = pair.on_device_with(structure);
                let truth = pair.dual_at(&w, 2);
                let (lambda, case) = (f64::from(SSIM_WEIGHT), format!("{size:?}, {name}, {structure:?}"));
                let times = structure.map_or(0.0, |structure| f64::from(structure.times));
                if structure.is_some() {
                    let allowed = 4e-6 * pair.image.len() as f64 / pair.n_visible() as f64;
                    assert!((found.ssim - truth.ssim.value).abs() <= allowed, "{case}: {} {truth:?}", found.ssim);
                }
                assert!((found.l1 - truth.l1.value).abs() <= 1e-6 * truth.l1.value, "{case}: {truth:?}");
                let d_image = found.d_image();
                let expected = (1.0 - lambda) * truth.l1.tangent - times * lambda * truth.ssim.tangent;
                let norm = dot(&d_image, &d_image).sqrt() * dot(&along, &along).sqrt();
                let error = (expected - dot(&d_image, &along)).abs() / norm;
                assert!(norm > 0.0 && error <= 1e-6, "{case}: {error:.1e}");
            }
        }
    }
}

#[test]
fn every_number_of_a_small_pictures_cotangent_is_the_dual_numbers() {
    for (size, mask) in [([5, 5], 255), ([1, 17], 255), ([9, 7], 0)] {
        let pair = Pair::random(3, size, |i| if i % 3 == 1 { mask } else { 255 });
        let found = pair.on_device().d_image();
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
fn n20_a_picture_equal_to_the_truth_has_loss_0_and_exactly_no_cotangent() {
    type Level = fn(u32, u32) -> u8;
    let levels: [Level; 4] =
        [|_, _| 51, |_, _| 255, |x, _| if x < 9 { 77 } else { 179 }, |x, y| (x * 71 + y * y * 37 + x * y * 13) as u8];
    let mut faults = Vec::new();
    for size in SIZES {
        for (kind, level) in levels.into_iter().enumerate() {
            let mask = |x, y| if kind == 3 && (x + y) % 5 == 2 { 0 } else { 255 };
            // As the device decodes it: a product is rounded alike everywhere, a division need not be.
            let image = |x, y| [f32::from(level(x, y)) * (1.0 / 255.0); 3];
            let pair = Pair::new(size, image, |x, y| word([level(x, y); 3], mask(x, y)));
            let found = pair.on_device();
            assert!((found.ssim - 1.0).abs() <= 2e-5 && found.l1 == 0.0, "{size:?}: {} {}", found.ssim, found.l1);
            let largest = found.d_image().as_flattened().iter().fold(0.0, |m, x| f64::max(m, x.abs()));
            // Adam makes a full step of a gradient of any size, so that rounding alone would move the parameters.
            if largest > 0.0 {
                let relative = largest * pair.n_visible() as f64;
                faults.push(format!("{size:?}, picture {kind}: {largest:e}, {relative:.1e} of a pixel's share"));
            }
        }
    }
    assert!(faults.is_empty(), "{} pictures have a cotangent\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn n21_ssim_of_flat_bright_and_chequered_pictures_stays_between_0_and_1() {
    type Picture = (&'static str, fn(u32, u32) -> f32);
    let pictures: [Picture; 7] = [
        ("black", |_, _| 0.0),
        ("grey", |_, _| 0.5),
        ("white", |_, _| 1.0),
        ("chequered", |x, y| ((x + y) % 2) as f32),
        ("bright", |_, _| 10.0),
        ("bright chequered", |x, y| 10.0 * ((x + y) % 2) as f32),
        ("bright ramp", |x, y| 10.0 * (x + y) as f32 / 78.0),
    ];
    for size in [[33, 47], [1, 1]] {
        for (name, picture) in pictures {
            let byte = |x, y| (255.0 * picture(x, y).min(1.0)).round() as u8;
            for (other, truth) in [("itself", picture), ("grey", pictures[1].1), ("black", pictures[0].1)] {
                let byte_of = |x, y| if other == "itself" { byte(x, y) } else { (255.0 * truth(x, y)).round() as u8 };
                let pair = Pair::new(size, |x, y| [picture(x, y); 3], |x, y| word([byte_of(x, y); 3], 255));
                let found = pair.on_device();
                let case = format!("{name} against {other}, {size:?}");
                assert!(found.ssim >= 0.0 && found.ssim <= 1.0 + 2e-6, "{case}: SSIM {}", found.ssim);
                assert!(found.l1.is_finite() && found.d_image().as_flattened().iter().all(|x| x.is_finite()), "{case}");
                // The variance of a bright flat picture is what its moments' cancellation leaves: 7 % of C2.
                let allowed = if name.starts_with("bright") { 5e-4 } else { 2e-6 };
                let truth = pair.dual(&pair.image).ssim.value;
                assert!((found.ssim - truth).abs() <= allowed, "{case}: SSIM {} for {truth}", found.ssim);
            }
        }
    }
}

#[test]
fn the_loss_has_the_same_bits_in_every_run() {
    let pair = Pair::random(12, [64, 48], |i| if i % 11 == 0 { 0 } else { 255 });
    let first = pair.on_device();
    assert!(first.d_image().as_flattened().iter().any(|x| *x != 0.0));
    for _ in 0..3 {
        assert!(pair.on_device() == first);
    }
}
