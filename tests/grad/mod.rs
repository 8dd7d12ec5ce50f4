//! Gradients of the device.

mod accumulation;
mod adjoint;
mod camera;
mod check;
mod flow;
mod golden;
