//! Whole frames on the device.

mod golden;
mod invariants;
mod large;
mod long_lists;
mod overflow;
