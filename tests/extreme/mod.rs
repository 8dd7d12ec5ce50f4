//! Numerical extremes (research: numerics_reliability.md A.3): rows of one table, each of them some cases.
//!
//! Every case is rendered on the device and compared with the float64 truth; everything must be finite, the count of
//! bad Gaussians as expected, and the validation layer silent.

mod exposure;
mod places;
mod poison;
mod shapes;
mod slow;
mod symptoms;
mod table;
mod times;
mod worlds;
