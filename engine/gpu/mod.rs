//! The safe layer over [`crate::vk`]: typed buffers, kernels with generated bindings, and recordings of passes as data.

mod cost;
mod dispatch;
#[allow(missing_docs, reason = "the shaders' own comments are there, and no others")]
pub mod generated;
pub mod kernel;
mod record;
mod run;
mod staging;
/// The table of kernels, shared with the build.
#[path = "../../shaders-glsl/table.rs"]
pub mod table;

pub use dispatch::{Bound, Dispatch, kernel as kernel_named};
pub(crate) use kernel::PlaneSlices;
pub use kernel::{Buf, Kernel, KernelInfo, Slice};
pub use record::{Grid, Pass, Recording, Work};
pub use run::{COUNTS, Gpu, Options, PassTime, Rewrite, Running, StandIn};
pub(crate) use staging::Staging;
use std::collections::BTreeMap;

/// By kernel, the hash of its committed SPIR-V: what a measurement was made with. Kernels that only fill a window or probe the
/// device are left out.
pub fn spirv_hashes() -> BTreeMap<String, String> {
    let is_measured = |name: &str| {
        let of = |row: &&table::Spec| row.name == name;
        let row = table::KERNELS.iter().find(of);
        row.is_some_and(|row| !["screen/", "probe/"].iter().any(|folder| row.file.starts_with(folder)))
    };
    // A kernel, the hash of its sources, the hash of its SPIR-V.
    let cells = |line: &'static str| line.split_once(' ').zip(line.rsplit_once(' '));
    let lines = include_str!("../../shaders-glsl/spv/MANIFEST").lines().filter_map(cells);
    let hashes = lines.map(|((name, _), (_, spirv))| (name.to_owned(), spirv.to_owned()));
    hashes.filter(|(name, _)| is_measured(name)).collect()
}

pub fn shaders_hash() -> String {
    use sha2::{Digest, Sha256};
    let add = |hash: Sha256, (name, spirv): (String, String)| hash.chain_update(format!("{name} {spirv}\n"));
    let digest = spirv_hashes().into_iter().fold(Sha256::new(), add).finalize();
    digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}
