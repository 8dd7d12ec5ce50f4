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

const GUARD: [u32; 2] = [0xdead_beef, 0x1234_5678];

#[test]
fn coefficients_become_one_of_the_two_halves_beside_them() {
    let gpu = gpu();
    let mut random = Random::new(3);
    for (size, planes, listed) in [(1, 1, false), (127, 3, false), (384, 3, true), (129, 1, true), (2000, 6, true)] {
        let values: Vec<[f32; 4]> = (0..size)
            .map(|_| random.vector::<4>(-1.0, 1.0).map(|x| x * random.uniform(-9.0, 9.0).exp() as f32))
            .collect();
        let n_blocks = (size as u32).div_ceil(128 * planes);
        // Every second block from behind, or all.
        let list: Vec<u32> = (0..n_blocks).rev().step_by(2).collect();
        let live_args = [list.len() as u32, 1, 1, list.len() as u32];
        let band = gpu.upload("band", &values).unwrap();
        let halves = gpu.upload("halves", &vec![GUARD; size]).unwrap();
        let (live, live_args) = (gpu.upload("live", &list).unwrap(), gpu.upload("live args", &live_args).unwrap());
        let mut rec = Recording::new();
        let push = sh_half::Push { n: n_blocks, size: size as u32, planes, is_listed: u32::from(listed) };
        let grid = if listed { Grid::Indirect(live_args.slice()) } else { Grid::Groups(n_blocks) };
        rec.pass(sh_half::Args { band: &band, halves: &halves, live: &live, live_args: &live_args }, push, grid);
        gpu.run(&rec).unwrap();
        for (at, (values, found)) in values.iter().zip(gpu.read(&halves).unwrap()).enumerate() {
            if listed && !list.contains(&(at as u32 / (128 * planes))) {
                assert_eq!(found, GUARD, "{at} of {size} is in no block of the list");
                continue;
            }
            let bits = found.iter().flat_map(|word| [word & 0xffff, word >> 16]);
            for (x, bits) in values.iter().zip(bits) {
                let (x, half) = (f64::from(*x), half_value(bits));
                // Which of the two is the driver's choice.
                let step = half_value((bits & 0x7fff) + 1) - half_value(bits & 0x7fff);
                assert!((half - x).abs() < step, "{x} became {half}, and {step} is to the next");
            }
        }
    }
}
