//! N25: coefficients of spherical harmonics as halves, and Adam's moments in 16 bits.

use super::fixtures::adam::{Scene, rates};
use super::random::{Random, scene};
use super::row::{Bench, Tally};
use crate::gpu::generated::sh_half;
use crate::gpu::{Grid, Recording};
use crate::stage::{StepSettings, adam_params, moment_word, moments_of};
use crate::twin::half_value as value;
use anyhow::{Result, ensure};
use std::num::FpCategory;

const GUARD: [u32; 2] = [0xdead_beef, 0x1234_5678];

/// The halves of `values` by the device, as bits.
fn halves(bench: &Bench, values: &[[f32; 4]]) -> Result<Vec<[u32; 4]>> {
    let gpu = bench.gpu();
    let band = gpu.upload("band", values)?;
    let halves = gpu.upload("halves", &vec![GUARD; values.len() + 1])?;
    let mut rec = Recording::new();
    let (size, unread) = (values.len() as u32, gpu.upload("live blocks", &[0u32; 4])?);
    let push = sh_half::Push { n: size.div_ceil(128), size, planes: 1, is_listed: 0 };
    let args = sh_half::Args { band: &band, halves: &halves, live: &unread, live_args: &unread };
    rec.pass(args, push, Grid::Groups(push.n));
    gpu.run(&rec)?;
    let mut found = gpu.read(&halves)?;
    ensure!(found.pop() == Some(GUARD), "the pair past the end was overwritten");
    Ok(found.into_iter().map(|[a, b]| [a & 0xffff, a >> 16, b & 0xffff, b >> 16]).collect())
}

pub(super) fn quantised(bench: &Bench, tally: &mut Tally) -> Result<()> {
    coefficients(bench, tally);
    moments(bench, tally)
}

fn coefficients(bench: &Bench, tally: &mut Tally) {
    tally.case("numbers beyond a half's range", |_| {
        let found = halves(bench, &[[65_504.0, 65_505.0, -65_505.0, 1e30], [-1e30, 0.0, 0.0, 0.0]])?;
        ensure!(found[0].map(value) == [65_504.0, 65_504.0, -65_504.0, 65_504.0], "{found:?}");
        ensure!(value(found[1][0]) == -65_504.0, "{found:?}");
        Ok(())
    });
    tally.case("zeros and what is near", |_| {
        let found = halves(bench, &[[0.0, -0.0, 1e-8, -1e-8]])?[0];
        ensure!(found[..2] == [0, 0x8000], "{found:?}");
        ensure!(found[2..].iter().all(|bits| value(*bits).abs() <= 2f64.powi(-24)), "{found:?}");
        Ok(())
    });
    tally.case("what is not finite", |_| {
        let found = halves(bench, &[[f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX]])?[0];
        ensure!(found[..3].iter().all(|bits| bits & 0x7c00 == 0x7c00), "{found:?} is finite");
        ensure!(value(found[3]) == 65_504.0, "{found:?}");
        Ok(())
    });
    let mut random = Random::new(4);
    for n in [1, 63, 64, 65, 300] {
        let values: Vec<[f32; 4]> = (0..n)
            .map(|_| random.vector::<4>(-1.0, 1.0).map(|x| x * random.uniform(-20.0, 10.0).exp() as f32))
            .collect();
        tally.case(format!("{n} vectors of numbers of all sizes"), |_| {
            for (x, bits) in values.as_flattened().iter().zip(halves(bench, &values)?.as_flattened()) {
                let (x, found) = (f64::from(*x), value(*bits));
                ensure!((found - x).abs() <= x.abs() * 2f64.powi(-10) + 2f64.powi(-24), "{x} became {found}");
            }
            Ok(())
        });
    }
}

/// Moments of 0 to infinity as a step without a gradient stores them.
fn moments(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let mut start = Scene { moment_bits: 16, ..Scene::new(&scene(3, 300, 0)) };
    let mut params = adam_params(&rates(), &StepSettings::default(), 3, 1);
    // They fade a little, or grow a little: the largest beyond what 16 bits hold.
    for factor in [1.0f32 - 1.0 / 2048.0, 1.0 + 1.0 / 512.0] {
        (params.beta1, params.beta2) = (factor, factor);
        for x in [0.0f32, 1e-45, 1e-38, 1e-8, 6e4, 65_504.0, 65_505.0, 1e38, f32::MAX, f32::INFINITY] {
            let largest = x.min(f32::MAX);
            start.first.rotation.fill([largest, -largest, 0.0, -0.0]);
            start.second.rotation.fill([x; 4]);
            tally.case(format!("moments of {x:e} times {factor}"), |tally| {
                let found = start.unseen_step(&bench.gpu(), &params)?;
                ensure!(
                    found.params.rotation.as_flattened().iter().all(|q| q.is_finite()),
                    "a parameter is not finite"
                );
                for k in 0..4 {
                    // As the device has them before the step.
                    let before = moments_of(moment_word(start.first.rotation[0][k], x));
                    for (of, before, mantissa) in [(&found.first, before[0], 7), (&found.second, before[1], 8)] {
                        let found: Vec<f32> = of.rotation.iter().map(|q| q[k]).collect();
                        compare(tally, &found, before * factor, mantissa)?;
                    }
                }
                Ok(())
            });
        }
    }
    Ok(())
}

/// Compares what `exact` was stored as, with so many bits of mantissa, and the mean of it.
fn compare(tally: &mut Tally, found: &[f32], exact: f32, mantissa: i32) -> Result<()> {
    let x = f64::from(exact);
    let largest = (2.0 - 2f64.powi(-mantissa)) * 2f64.powi(127);
    let fits = x.abs() <= largest;
    let bit = (x.abs().log2().floor() - f64::from(mantissa)).exp2();
    let is_right = |found: f32| match exact.classify() {
        FpCategory::Normal if fits => (f64::from(found) - x).abs() < bit,
        FpCategory::Normal => f64::from(found) == largest.copysign(x),
        // A device may flush them.
        FpCategory::Subnormal => found.abs() <= f32::MIN_POSITIVE,
        FpCategory::Zero | FpCategory::Infinite | FpCategory::Nan => found == exact,
    };
    let wrong = found.iter().find(|found| !is_right(**found));
    ensure!(wrong.is_none(), "{exact:e} became {wrong:?}");
    if exact.is_normal() && fits {
        let n = found.len() as f64;
        let mean = found.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
        // Five standard deviations of the mean, of at most half a bit each.
        tally.within(&format!("the mean of {exact:e} in last bits"), (mean - x).abs() / bit, 2.5 / n.sqrt())?;
    }
    Ok(())
}
