//! GPUs that are not here: what their compilers make of the kernels, budgets for that, and what a step would take on a card.
//! Nothing of it runs on a device.

#![allow(missing_docs, reason = "its users are the tests of this workspace")]

mod budget;
mod estimate;
mod loops;
mod statistics;
mod waves;

pub use budget::{Budgets, Drift};
pub use estimate::{Estimate, Part, side_by_side};
pub use statistics::{Static, Statistics};
pub use waves::Chip;
