//! Kernels as other devices might run them: passes over their SPIR-V that a lane chooses by `IVV_TEST_REWRITE`.

mod agree;
mod edit;
mod numeric;

use ivv::gpu::Rewrite;

/// The change of this lane, none by default.
pub fn rewrite() -> Option<Rewrite> {
    let name = std::env::var("IVV_TEST_REWRITE").ok()?;
    match &*name {
        "numeric" => Some(numeric::REWRITE),
        _ => panic!("IVV_TEST_REWRITE: no change is called {name:?}"),
    }
}

/// Writes the rewritten kernels to `IVV_ADV_DUMP`.
#[test]
fn dump() {
    let folder = std::env::var("IVV_ADV_DUMP").unwrap();
    for row in ivv::gpu::table::KERNELS.iter() {
        let info = ivv::gpu::generated::ALL.iter().find(|k| k.name == row.name).unwrap();
        std::fs::write(format!("{folder}/{}.spv", row.name), numeric::rewritten(info)).unwrap();
    }
}
