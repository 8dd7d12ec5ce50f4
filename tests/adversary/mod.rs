//! Kernels as other devices might run them: passes over their SPIR-V that a lane chooses by `IVV_TEST_REWRITE`.

mod lanes;
mod module;
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

/// Writes what lanes make of each kernel, for looking at.
#[test]
fn dump() {
    for row in ivv::gpu::table::KERNELS.iter() {
        let Some(kernel) = ivv::gpu::kernel_named(&row.name) else { continue };
        for (width, rewrite) in [(32, lanes::LANES_32), (64, lanes::LANES_64)] {
            match std::panic::catch_unwind(|| (rewrite.spirv)(kernel)) {
                Ok(bytes) => std::fs::write(format!("/tmp/emu/{}_{width}.spv", row.name), bytes).unwrap(),
                Err(_) => println!("FAULT {} {width}", row.name),
            }
        }
    }
}
