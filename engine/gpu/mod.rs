//! The safe layer over [`crate::vk`]: typed buffers, kernels with generated bindings, and recordings of passes as data.

pub mod generated;
pub mod kernel;
mod record;
mod run;
/// The table of kernels, shared with the build.
#[path = "../../shaders-glsl/table.rs"]
pub mod table;

pub use kernel::{Buf, Kernel, KernelInfo, Slice};
pub use record::{Grid, Pass, Recording, Work};
pub use run::{Gpu, Options, PassTime, Running};

/// Tells these kernels from those before a change: the first 16 digits of the SHA-256 of the list of their hashes.
pub fn shader_hash() -> String {
    use sha2::{Digest, Sha256};
    let digest = Sha256::digest(include_bytes!("../../shaders-glsl/spv/MANIFEST"));
    digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}
