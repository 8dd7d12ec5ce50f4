//! Whole frames on the device.

mod golden;
mod invariants;
mod long_lists;
mod overflow;
