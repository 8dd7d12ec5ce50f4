//! Whole frames on the device.

mod clip;
mod golden;
mod invariants;
mod knobs;
mod large;
pub mod parts;
mod places;
