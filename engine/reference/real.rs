//! The numbers that the reference's formulas are written over.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number: `f32`, `f64` or [`super::Dual`]. Comparisons, `min` and `max` look at the value only, so a dual
/// number takes the branch that its value takes.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant nearest to `value`.
    fn from_f64(value: f64) -> Self;
    /// The value, without a derivative.
    fn to_f64(self) -> f64;
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn sqrt(self) -> Self;

    /// The greater value; `self` when they are equal or either is not a number, so that a clamp keeps its argument's NaN.
    fn max(self, other: Self) -> Self {
        if self < other { other } else { self }
    }

    /// The lesser value; `self` when they are equal or either is not a number.
    fn min(self, other: Self) -> Self {
        if self > other { other } else { self }
    }

    fn abs(self) -> Self {
        if self.to_f64() < 0.0 { -self } else { self }
    }

    /// True if the value is neither infinite nor NaN.
    fn is_finite(self) -> bool {
        self.to_f64().is_finite()
    }

    fn zero() -> Self {
        Self::from_f64(0.0)
    }

    fn one() -> Self {
        Self::from_f64(1.0)
    }
}

impl Real for f32 {
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn exp(self) -> Self {
        f32::exp(self)
    }
    fn ln(self) -> Self {
        f32::ln(self)
    }
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
}

impl Real for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn ln(self) -> Self {
        f64::ln(self)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}
