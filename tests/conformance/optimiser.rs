//! N24: gradients of any size, rates of 0, late steps.

use super::fixtures::adam::{Scene, Step, cotangents, gradients, half_seen, numbers, rates};
use super::prelude::*;
use ivv::internals::reference::{Adam, batch_gradient, batch_sum};
use ivv::internals::stage::Rates;
use std::collections::BTreeSet;

pub(super) fn gradients_of_any_size(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let start = Scene::new(&scene(3, 20, 0));
    let mut steps = |name: String, start: &Scene, d_color: &[[f32; 3]], number: u64| {
        tally.case(name, |tally| {
            let step = Step::dense(number);
            let gradient = gradients(&bench.gpu(), &start.params, &view(), d_color)?;
            let (found, n_bad) = start.step(&bench.gpu(), &view(), d_color, &step)?;
            ensure!(n_bad == 0, "{n_bad} bad gradients");
            compare(tally, start, &found, &gradient, &step)
        });
    };
    for size in [0.0f32, 1e-45, 1e-38, 1e-20, 1e-10, 1.0, 1e10, 1e19, 1e30] {
        steps(format!("gradients of about {size:e}, step 1"), &start, &cotangents(&view(), 1, size), 1);
    }
    // An epoch of the paper's captures is 300 frames of 40 cameras.
    let warm = half_seen(6, 0);
    for number in [1, 2, 300 * 40, 30 * 300 * 40] {
        steps(format!("step {number}"), &warm, &cotangents(&view(), 5, 1e-3), number);
    }
    let none = Rates { sh: [0.0; 4], ..Rates::default() };
    for size in [0.0f32, 1e-3, 1e19] {
        tally.case(format!("a rate of 0, gradients of about {size:e}"), |_| {
            let step = Step { rates: none, ..Step::dense(3) };
            let (found, _) = warm.step(&bench.gpu(), &view(), &cotangents(&view(), 5, size), &step)?;
            ensure!(found.params == warm.params, "a parameter moved");
            Ok(())
        });
    }
    tally.case("a tau below its floor", |_| {
        let floor = -0.5f32;
        let step = Step { lowest_t_scale: floor.into(), ..Step::dense(1) };
        let (found, _) = start.step(&bench.gpu(), &view(), &cotangents(&view(), 1, 1e-3), &step)?;
        let both = || start.params.motion.iter().zip(&found.params.motion);
        let is_held = both().all(|(a, b)| b.t_scale >= floor || a.t_scale == b.t_scale);
        let n_lifted = both().filter(|(a, b)| a.t_scale < floor && b.t_scale == floor).count();
        ensure!(is_held && n_lifted > 2, "{n_lifted} were lifted: {:?}", found.params.motion);
        Ok(())
    });
    tally.case("a cotangent that is not finite", |_| poisoned(bench));
    for size in [0.0f32, 1e-45, 1e-38, 1e-20, 1e-10, 1e-5, 1.0, 1e10, 1e30] {
        tally.case(format!("sums of gradients of about {size:e}"), |tally| summed(bench, tally, &start, size));
    }
    Ok(())
}

fn compare(tally: &mut Tally, start: &Scene, found: &Scene, gradient: &Splats, step: &Step) -> Result<()> {
    let gradient = numbers(gradient, &start.params.scale, &step.rates);
    for ((reference, found), (g, rate, name, i)) in
        start.references().into_iter().zip(found.references()).zip(&gradient)
    {
        let exact = reference.step(f64::from(*g), *rate, step.number);
        // Squares beyond f32 give no step; those below it are lost, and with them the measure of the step. The first
        // step's correction undoes the factor of the second moment.
        let square = f64::from(*g).powi(2);
        let all = [found.parameter, found.first, found.second];
        ensure!(found.parameter.is_finite() && !all.iter().any(|x| x.is_nan()), "{name} of {i} with {g:e}: {found:?}");
        if square > 1.001 * f64::from(f32::MAX) || *g == 0.0 && reference.first == 0.0 {
            ensure!(found.parameter == reference.parameter, "{name} of {i} moved with {g:e}");
        } else if (square > 1e-34 || reference.second > 1e-30) && square < 0.999 * f64::from(f32::MAX) {
            let way = (exact.parameter - reference.parameter).abs().max(*rate);
            let off = past_last_bit(&reference, &found, &exact) / way;
            tally.within(&format!("the step of {name} of {i} with {g:e}"), off, 1e-6)?;
        }
    }
    Ok(())
}

/// The error of a step, past the last bit of the parameter.
fn past_last_bit(before: &Adam<f64>, found: &Adam<f64>, exact: &Adam<f64>) -> f64 {
    let last_bit = 1.2e-7 * exact.parameter.abs().max(before.parameter.abs());
    ((found.parameter - exact.parameter).abs() - last_bit).max(0.0)
}

/// A step along the sum of the gradients of two images. They are kept to 2^-50 and held within 16.
fn summed(bench: &Bench, tally: &mut Tally, start: &Scene, size: f32) -> Result<()> {
    let (view, step) = (view(), Step::dense(1));
    let images = [1, 2].map(|seed| cotangents(&view, seed, size));
    let of = |d_color: &[[f32; 3]]| {
        let found = gradients(&bench.gpu(), &start.params, &view, d_color)?;
        anyhow::Ok(numbers(&found, &start.params.scale, &step.rates))
    };
    let (first, second) = (of(&images[0])?, of(&images[1])?);
    let both = images.each_ref().map(|d_color| (&view, d_color.as_slice()));
    let (found, n_bad) = start.batch_step(&bench.gpu(), &both, &step)?;
    ensure!(n_bad == 0, "{n_bad} bad gradients");
    for ((reference, found), (a, b)) in
        start.references().into_iter().zip(found.references()).zip(first.iter().zip(&second))
    {
        let (g, rate) = (batch_gradient(batch_sum(&[a.0, b.0])), a.1);
        let exact = reference.step(g, rate, step.number);
        ensure!(found.parameter.is_finite() && found.first.is_finite(), "{} of {}: {found:?}", a.2, a.3);
        let off = past_last_bit(&reference, &found, &exact) / rate.max(1e-9);
        tally.within(&format!("the step of {} of {} with {g:e}", a.2, a.3), off, 1e-6)?;
    }
    Ok(())
}

/// A gradient that is not finite moves nothing of its Gaussian, and is counted.
fn poisoned(bench: &Bench) -> Result<()> {
    let (view, start, step) = (view(), half_seen(4, 1), Step::dense(3));
    let mut d_color = cotangents(&view, 2, 1e-3);
    let (good, _) = start.step(&bench.gpu(), &view, &d_color, &step)?;
    // One pixel, so that only those over it are hurt.
    d_color[(28 * view.intrinsics.width + 40) as usize] = [f32::NAN, 0.0, 0.0];
    let (found, n_bad) = start.step(&bench.gpu(), &view, &d_color, &step)?;
    ensure!(n_bad > 0 && (n_bad as usize) < start.params.len() / 2, "{n_bad} bad gradients");
    let mut hurt = BTreeSet::new();
    let [before, good, found] = [&start.params, &good.params, &found.params].map(|s| numbers(s, &s.scale, &rates()));
    for ((before, good), found) in before.iter().zip(&good).zip(&found) {
        let is_kept = found.0.to_bits() == before.0.to_bits();
        let is_one = is_kept || found.0.to_bits() == good.0.to_bits();
        ensure!(found.0.is_finite() && is_one, "{} of {} is {}", before.2, before.3, found.0);
        if is_kept && good.0.to_bits() != before.0.to_bits() {
            hurt.insert(before.3);
        }
    }
    ensure!(hurt.len() == n_bad as usize, "{} kept, {n_bad} counted", hurt.len());
    Ok(())
}
