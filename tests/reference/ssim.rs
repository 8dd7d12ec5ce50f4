//! The reference's photometric loss against a published SSIM, the formula at one place, and finite differences.

use crate::common::prelude::*;
use ivv::internals::reference::{Dual, photometric, ssim_map};

fn grey(path: &str) -> (Vec<f64>, [usize; 2]) {
    let picture = image::open(path).unwrap().to_luma8();
    let size = [picture.width() as usize, picture.height() as usize];
    (picture.into_raw().into_iter().map(|byte| f64::from(byte) / 255.0).collect(), size)
}

#[test]
fn ssim_of_a_noisy_photograph_is_the_published_value() {
    let Some(folder) = crate::common::notes::shared("data/ssim_reference") else { return };
    let folder = folder.display();
    let (x, size) = grey(&format!("{folder}/camera.png"));
    let (y, other) = grey(&format!("{folder}/derived/cam_noisy.png"));
    assert_eq!((size, other), ([512, 512], size));
    let map = ssim_map(&x, &y, size);
    // Where the window lies within the picture: the published value has no padding.
    let inside = |i: &usize| [i % 512, i / 512].iter().all(|at| (5..507).contains(at));
    let valid: Vec<f64> = (0..map.len()).filter(inside).map(|i| map[i]).collect();
    assert_eq!(valid.len(), 502 * 502);
    let mean = valid.iter().sum::<f64>() / valid.len() as f64;
    // NOTE.md has 0.357959 from the publisher's program and 0.357964 from scipy.
    assert!((mean - 0.357_959_091_663_361).abs() < 1e-5, "{mean}");
    assert!((mean - 0.357_964).abs() < 1e-6, "{mean}");
}

#[test]
fn a_single_pixel_has_the_ssim_of_the_formula() {
    // The window's middle tap is all that lies within: E[x] = w x, E[x x] = w x x.
    let taps: Vec<f64> = (-5..=5).map(|d| (-f64::from(d * d) / 4.5).exp()).collect();
    let w = (taps[5] / taps.iter().sum::<f64>()).powi(2);
    let (x, y) = (0.3, 0.8);
    let (mx, my) = (w * x, w * y);
    let (sxx, syy, sxy) = (w * x * x - mx * mx, w * y * y - my * my, w * x * y - mx * my);
    let expected = (2.0 * mx * my + 1e-4) * (2.0 * sxy + 9e-4) / ((mx * mx + my * my + 1e-4) * (sxx + syy + 9e-4));
    let found = ssim_map(&[x], &[y], [1, 1])[0];
    assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
    assert!(found > 0.1 && found < 0.9);
}

#[test]
fn equal_pictures_have_ssim_1_no_loss_and_no_derivative() {
    let mut random = Random::new(2);
    let truth: Vec<u32> = (0..12 * 9).map(|_| random.bits() as u32 | 0xff00_0000).collect();
    let color = |word: &u32| word.to_le_bytes().map(|b| f64::from(b) / 255.0);
    let image: Vec<[Dual; 3]> =
        truth.iter().map(|word| [0, 1, 2].map(|k| Dual::new(color(word)[k], random.uniform(-1.0, 1.0)))).collect();
    let found = photometric(&image, &truth, [12, 9], truth.len(), 1);
    assert!((found.ssim.value - 1.0).abs() < 1e-12 && found.l1.value == 0.0, "{found:?}");
    assert!(found.loss().value.abs() < 1e-12 && found.loss().tangent.abs() < 1e-12, "{found:?}");
}

#[test]
fn the_derivative_of_the_loss_matches_finite_differences_with_and_without_a_mask() {
    let (size, step) = ([13, 9], 1e-6);
    for mask in [0xff, 0x00, 0x80] {
        let mut random = Random::new(4);
        let n = size[0] * size[1];
        let hidden = |i: usize| i % 4 == 1;
        let word = |i| random.bits() as u32 & 0xff_ffff | if hidden(i) { mask } else { 0xff } << 24;
        let truth: Vec<u32> = (0..n).map(word).collect();
        let n_visible = truth.iter().filter(|word| **word >> 24 != 0).count();
        let image: Vec<[f64; 3]> = (0..n).map(|_| random.vector(0.0, 1.0).map(f64::from)).collect();
        let w: Vec<[f64; 3]> = (0..n).map(|_| random.vector(-1.0, 1.0).map(f64::from)).collect();
        let moved = |h: f64| -> f64 {
            let pixel = |(x, w): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| x[k] + h * w[k]);
            let image: Vec<[f64; 3]> = image.iter().zip(&w).map(pixel).collect();
            photometric(&image, &truth, size, n_visible, 1).loss()
        };
        let dual = |(x, w): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| Dual::new(x[k], w[k]));
        let duals: Vec<[Dual; 3]> = image.iter().zip(&w).map(dual).collect();
        let found = photometric(&duals, &truth, size, n_visible, 1).loss();
        let expected = (moved(step) - moved(-step)) / (2.0 * step);
        assert_eq!(found.value, moved(0.0));
        assert!(expected.abs() > 1e-4 && (found.tangent - expected).abs() < 1e-8, "{found:?} for {expected}");
    }
}
