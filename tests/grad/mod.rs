//! Gradients of the device.

mod adjoint;
mod check;
mod extreme;
mod golden;
