//! Kernels out of a folder in the place of the committed ones: `tools/mutants.sh` compiles a fault and runs the tests on it, which
//! were built once.

use crate::common::prelude::*;
pub const REWRITE: Rewrite = Rewrite { subgroup_size: None, spirv };

/// `IVV_TEST_KERNELS/NAME.spv`, or the committed SPIR-V where there is no such file.
fn spirv(kernel: &KernelInfo) -> Vec<u8> {
    let folder =
        std::env::var_os("IVV_TEST_KERNELS").expect("IVV_TEST_KERNELS names the folder of the replaced kernels");
    match std::fs::read(PathBuf::from(folder).join(format!("{}.spv", kernel.name))) {
        Ok(spirv) => spirv,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => kernel.spirv.to_vec(),
        Err(e) => panic!("{}: {e}", kernel.name),
    }
}
