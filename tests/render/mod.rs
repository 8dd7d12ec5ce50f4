//! Whole frames on the device.

mod golden;
mod invariants;
mod large;
