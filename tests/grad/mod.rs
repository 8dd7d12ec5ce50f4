//! Gradients of the device.

mod accumulation;
mod adjoint;
mod camera;
mod check;
mod chunks;
mod flow;
mod golden;

use crate::common::references::Tested;

pub const TESTED: &[&[Tested]] = &[accumulation::TESTED, adjoint::TESTED, camera::TESTED, chunks::TESTED];
