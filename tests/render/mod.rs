//! Whole frames on the device.

mod golden;
mod invariants;
mod knobs;
mod large;
