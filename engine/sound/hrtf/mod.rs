//! Head-related transfer functions: what a direction does to a sound on its way to the two ears.

mod measured;
mod sadie;
mod set;
mod sofa;
pub mod sphere;

pub use crate::sound::geometry::degrees;
pub use measured::{Measured, Meta};
pub use set::{Filter, HrtfSet, Lookup};
