//! The safe layer over [`crate::vk`]: typed buffers, kernels with generated bindings, and recordings of passes as data.

mod cost;
mod dispatch;
pub mod generated;
pub mod kernel;
mod record;
mod run;
/// The table of kernels, shared with the build.
#[path = "../../shaders-glsl/table.rs"]
pub mod table;
#[cfg(feature = "play")]
mod window;

pub use dispatch::{Bound, Dispatch, kernel as kernel_named};
pub use kernel::{Buf, Kernel, KernelInfo, Slice};
pub use record::{Grid, Pass, Recording, Work};
pub use run::{Gpu, Options, PassTime, Running};
#[cfg(feature = "play")]
pub use window::Window;

/// A hash of all kernels as they are committed, 16 digits: what a measurement was made with. Those that only fill a window are
/// in none.
pub fn shaders_hash() -> String {
    use sha2::{Digest, Sha256};
    let is_shown = |line: &&str| {
        table::KERNELS.iter().any(|row| row.file.starts_with("screen/") && line.starts_with(&format!("{} ", row.name)))
    };
    let lines = include_str!("../../shaders-glsl/spv/MANIFEST").split_inclusive('\n').filter(|line| !is_shown(line));
    let digest = lines.fold(Sha256::new(), |hash, line| hash.chain_update(line)).finalize();
    digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}
