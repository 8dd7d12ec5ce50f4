//! Kernels as other devices might run them: passes over their SPIR-V that a lane chooses by `IVV_TEST_REWRITE`.

mod agree;
mod bounds;
mod edit;
mod lanes;
mod module;
mod numeric;
mod order;
mod replaced;
mod uniform;

use crate::common::prelude::*;
pub(crate) use numeric::needs_roundings;
pub use numeric::{rounds_otherwise, slack};

/// The change of this lane, none by default.
pub fn rewrite() -> Option<Rewrite> {
    let name = std::env::var("IVV_TEST_REWRITE").ok()?;
    match &*name {
        "lanes32" => Some(lanes::LANES_32),
        "lanes64" => Some(lanes::LANES_64),
        "numeric" => Some(numeric::REWRITE),
        "order" => Some(order::REWRITE),
        "replaced" => Some(replaced::REWRITE),
        "bounds" => Some(bounds::REWRITE),
        _ => panic!("IVV_TEST_REWRITE: no change is called {name:?}"),
    }
}

pub fn counts() -> bool {
    std::env::var("IVV_TEST_REWRITE").is_ok_and(|name| name == "bounds")
}

pub fn reversed() -> bool {
    std::env::var("IVV_TEST_REWRITE").is_ok_and(|name| name == "order")
}
