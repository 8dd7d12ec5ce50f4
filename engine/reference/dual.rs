//! Forward-mode derivatives: a value and its derivative along one direction.

use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::real::Real;

/// `value + tangent e` with `e^2 = 0`, in double precision. Compared by value.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dual {
    /// The number itself.
    pub value: f64,
    /// Its derivative along the direction in question.
    pub tangent: f64,
}

impl Dual {
    pub fn new(value: f64, tangent: f64) -> Self {
        Dual { value, tangent }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Dual::new(self.value + other.value, self.tangent + other.tangent)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Dual::new(self.value - other.value, self.tangent - other.tangent)
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Dual::new(self.value * other.value, self.tangent * other.value + self.value * other.tangent)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Dual::new(value, (self.tangent - value * other.tangent) / other.value)
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Dual::new(-self.value, -self.tangent)
    }
}

impl PartialEq for Dual {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialOrd for Dual {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl Real for Dual {
    fn from_f64(value: f64) -> Self {
        Dual::new(value, 0.0)
    }
    fn to_f64(self) -> f64 {
        self.value
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        Dual::new(value, value * self.tangent)
    }
    fn ln(self) -> Self {
        Dual::new(self.value.ln(), self.tangent / self.value)
    }
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Dual::new(value, 0.5 * self.tangent / value)
    }
}
