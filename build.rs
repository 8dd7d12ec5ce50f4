//! Default build: proves that the committed SPIR-V belongs to the shaders' sources, with std alone.
//! `--features shaders`: recompiles all of it and proves that nothing changes; `IVV_BLESS=1` writes the result instead.

#[cfg(feature = "shaders")]
#[path = "shaders-glsl/generate.rs"]
mod generate;
#[path = "shaders-glsl/manifest.rs"]
mod manifest;
#[path = "shaders-glsl/table.rs"]
#[expect(dead_code, reason = "the build reads names, files and definitions; the engine reads the rest")]
mod table;

use std::path::Path;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=shaders-glsl");
    println!("cargo::rerun-if-env-changed=IVV_BLESS");
    // At run time: a path baked in would be that of the checkout which compiled this script.
    let root = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default();
    let root = Path::new(&root);
    // `ivv profile --watch` runs this script again for a single kernel: it has the compiler, `ivv` has not.
    #[cfg(feature = "shaders")]
    {
        if let (Ok(kernel), Some(output)) = (std::env::var("IVV_KERNEL"), std::env::var_os("IVV_SPIRV")) {
            return generate::one(root, &kernel, Path::new(&output));
        }
        if let Ok(this) = std::env::current_exe() {
            println!("cargo::rustc-env=IVV_SHADER_COMPILER={}", this.display());
        }
    }
    #[cfg(feature = "shaders")]
    let faults = generate::run(root, std::env::var_os("IVV_BLESS").is_some());
    #[cfg(not(feature = "shaders"))]
    let faults = manifest::verify(root);
    for fault in &faults {
        println!("cargo::error={fault}");
    }
    if !faults.is_empty() {
        println!("cargo::error=mend it with: IVV_BLESS=1 cargo build --features shaders");
    }
}
