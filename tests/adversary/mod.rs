//! Kernels as other devices might run them: passes over their SPIR-V that a lane chooses by `IVV_TEST_REWRITE`.

mod lanes;
mod module;
mod operations;
mod uniform;

use ivv::gpu::Rewrite;

/// The change of this lane, none by default.
pub fn rewrite() -> Option<Rewrite> {
    let name = std::env::var("IVV_TEST_REWRITE").ok()?;
    match name.as_str() {
        "lanes32" => Some(lanes::LANES_32),
        "lanes64" => Some(lanes::LANES_64),
        _ => panic!("IVV_TEST_REWRITE: no change is called {name:?}"),
    }
}
