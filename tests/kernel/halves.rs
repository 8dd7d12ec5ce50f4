//! Coefficients of spherical harmonics as halves, against the value of a half. Extreme numbers: row N25 of `engine/extremes`.

use crate::common::device::gpu;
use crate::common::random::Random;
use crate::common::twins::tested;
use ivv::gpu::generated::sh_half;
use ivv::gpu::{Grid, Recording};
use ivv::twin::half_value;

tested! {
    "project/sh_half.comp" by half_value in coefficients_become_one_of_the_two_halves_beside_them;
}

#[test]
fn coefficients_become_one_of_the_two_halves_beside_them() {
    let gpu = gpu();
    let mut random = Random::new(3);
    for n in [1, 63, 64, 65, 300] {
        let values: Vec<[f32; 4]> =
            (0..n).map(|_| random.vector::<4>(-1.0, 1.0).map(|x| x * random.uniform(-9.0, 9.0).exp() as f32)).collect();
        let band = gpu.upload("band", &values).unwrap();
        let halves = gpu.alloc::<[u32; 2]>("halves", values.len()).unwrap();
        let mut rec = Recording::new();
        let push = sh_half::Push { n: n as u32 };
        rec.pass(sh_half::Args { band: &band, halves: &halves }, push, Grid::Threads(n as u32));
        gpu.run(&rec).unwrap();
        let found = gpu.read(&halves).unwrap();
        let bits = found.iter().flat_map(|pair| pair.map(|word| [word & 0xffff, word >> 16])).flatten();
        for (x, bits) in values.as_flattened().iter().zip(bits) {
            let (x, half) = (f64::from(*x), half_value(bits));
            // Which of the two is the driver's choice.
            let step = half_value((bits & 0x7fff) + 1) - half_value(bits & 0x7fff);
            assert!((half - x).abs() < step, "{x} became {half}, and {step} is to the next");
        }
    }
}
