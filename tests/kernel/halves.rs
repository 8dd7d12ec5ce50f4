//! N25: coefficients of spherical harmonics as halves.

use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::gpu::generated::sh_half;
use ivv::gpu::{Grid, Recording};

const GUARD: [u32; 2] = [0xdead_beef, 0x1234_5678];

/// The value of a half.
fn value(bits: u32) -> f64 {
    let (exponent, fraction) = ((bits >> 10 & 31) as i32, f64::from(bits & 1023) / 1024.0);
    let size = match exponent {
        0 => fraction * 2f64.powi(-14),
        31 => f64::INFINITY,
        _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
    };
    if bits & 0x8000 != 0 { -size } else { size }
}

/// The halves of `values` by the device, as bits.
fn halves(values: &[[f32; 4]]) -> Vec<[u32; 4]> {
    let gpu = gpu();
    let band = gpu.upload("band", values).unwrap();
    let halves = gpu.upload("halves", &vec![GUARD; values.len() + 1]).unwrap();
    let mut rec = Recording::new();
    let n = values.len() as u32;
    rec.pass(sh_half::Args { band: &band, halves: &halves }, sh_half::Push { n }, Grid::Threads(n));
    gpu.run(&rec).unwrap();
    let mut found = gpu.read(&halves).unwrap();
    assert_eq!(found.pop(), Some(GUARD), "the pair past the end was overwritten");
    found.into_iter().map(|[a, b]| [a & 0xffff, a >> 16, b & 0xffff, b >> 16]).collect()
}

#[test]
fn n25_halves_saturate_keep_zero_with_its_sign_and_tell_what_is_not_finite() {
    let found = halves(&[
        [65_504.0, 65_505.0, -65_505.0, 1e30],
        [0.0, -0.0, 1e-8, -1e-8],
        [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, -1e30],
    ]);
    assert_eq!(found[0].map(value), [65_504.0, 65_504.0, -65_504.0, 65_504.0]);
    assert_eq!(found[1][..2], [0, 0x8000]);
    assert!(found[1][2..].iter().all(|bits| value(*bits).abs() <= 2f64.powi(-24)));
    assert!(found[2][..3].iter().all(|bits| bits & 0x7c00 == 0x7c00) && value(found[2][3]) == -65_504.0);
}

#[test]
fn halves_are_within_one_of_their_steps_at_any_size() {
    let mut random = Random::new(4);
    for n in [1, 63, 64, 65, 300] {
        let values: Vec<[f32; 4]> = (0..n)
            .map(|_| random.vector::<4>(-1.0, 1.0).map(|x| x * random.uniform(-20.0, 10.0).exp() as f32))
            .collect();
        for (x, bits) in values.as_flattened().iter().zip(halves(&values).as_flattened()) {
            let (x, found) = (f64::from(*x), value(*bits));
            assert!((found - x).abs() <= x.abs() * 2f64.powi(-10) + 2f64.powi(-24), "{x} became {found}");
        }
    }
}
