//! Gradients of the device.

mod golden;
