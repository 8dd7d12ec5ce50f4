//! One step of Adam (SPEC 6) on one number, and its moments in 16 bits.

use super::real::Real;

/// Decay of the mean of the gradients: what f32 holds of 0.9, since the device decays by that.
const BETA1: f64 = 0.9f32 as f64;
/// Decay of the mean of their squares, what f32 holds of 0.999.
const BETA2: f64 = 0.999f32 as f64;
/// Keeps a step finite where no gradient has been.
const EPS: f64 = 1e-15;

/// A parameter with Adam's moments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adam<R> {
    pub parameter: R,
    /// Mean of the gradients.
    pub first: R,
    /// Mean of their squares.
    pub second: R,
}

impl<R: Real> Adam<R> {
    /// Step number `step` (from 1) along `gradient` at learning rate `rate`, with the bias corrections of that step. A
    /// gradient that is not finite changes nothing; rate 0 moves the moments alone.
    pub fn step(self, gradient: R, rate: f64, step: u64) -> Self {
        if !gradient.is_finite() {
            return self;
        }
        let mean = |beta: f64, old: R, new: R| R::from_f64(beta) * old + R::from_f64(1.0 - beta) * new;
        let correction = |beta: f64| R::from_f64(1.0 - beta.powf(step as f64));
        let first = mean(BETA1, self.first, gradient);
        let second = mean(BETA2, self.second, gradient * gradient);
        let root = (second / correction(BETA2)).sqrt() + R::from_f64(EPS);
        let moved = self.parameter - R::from_f64(rate) * (first / correction(BETA1)) / root;
        Adam { parameter: if rate == 0.0 { self.parameter } else { moved }, first, second }
    }
}

/// The factor on the learning rate of the position of a Gaussian whose longest standard deviation is `longest`: `longest / size`,
/// from a quarter to 16; 1 where `size` is 0.
pub fn position_pace(longest: f64, size: f64) -> f64 {
    if size > 0.0 { (longest / size).clamp(0.25, 16.0) } else { 1.0 }
}

/// The part that 16 bits hold of a moment `x`, with `mantissa` bits of mantissa (7 of a first moment, 8 of a second) and the exponents of
/// a float, when `draw` of 0 to 1 is drawn for it: the next such number above or below, whose mean over the draws is `x`. Finite
/// as long as `x` is.
pub fn rounded_moment(x: f64, mantissa: i32, draw: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    // Below the normal floats the distance stays.
    let bit = 2f64.powi((x.abs().log2().floor() as i32).max(-126) - mantissa);
    let largest = (2.0 - 2f64.powi(-mantissa)) * 2f64.powi(127);
    ((x.abs() / bit + draw).floor() * bit).min(largest).copysign(x)
}
