//! Whole frames on the device.

mod golden;
