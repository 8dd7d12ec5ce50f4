//! Parts of a training step on the device, each with its truth: for rows, and for the tests of kernels.

pub mod adam;
pub mod clocks;
pub mod grids;
pub mod lpips;
pub mod photometric;
pub mod priors;
