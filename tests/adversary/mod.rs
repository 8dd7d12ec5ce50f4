//! Kernels as other devices might run them: passes over their SPIR-V that a lane chooses by `IVV_TEST_REWRITE`.

use ivv::gpu::Rewrite;

/// The change of this lane, none by default.
pub fn rewrite() -> Option<Rewrite> {
    let name = std::env::var("IVV_TEST_REWRITE").ok()?;
    panic!("IVV_TEST_REWRITE: no change is called {name:?}")
}
