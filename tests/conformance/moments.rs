//! N25: Adam's moments in 16 bits.

use super::fixtures::adam::{Scene, rates};
use super::prelude::*;
use ivv::internals::stage::{StepSettings, adam_params, moment_word, moments_of};
use std::num::FpCategory;

/// Moments of 0 to infinity as a step without a gradient stores them.
pub(super) fn moments(bench: &Bench, tally: &mut Tally) -> Result<()> {
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
