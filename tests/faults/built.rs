//! The layer, built for a test.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Writes the layer's manifest into `folder`, for `VK_LAYER_PATH`; its name is `VK_LAYER_IVV_faults`.
pub fn layer(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let manifest = serde_json::json!({ "file_format_version": "1.2.0", "layer": {
        "name": "VK_LAYER_IVV_faults", "type": "GLOBAL", "library_path": library(),
        "api_version": "1.3.0", "implementation_version": "1", "description": "Lets calls fail in tests"
    }});
    std::fs::write(folder.join("VkLayer_IVV_faults.json"), manifest.to_string()).unwrap();
}

/// The library, built now: cargo does not build examples for a test that is asked for by name.
fn library() -> PathBuf {
    static LAYER: OnceLock<PathBuf> = OnceLock::new();
    let build = || {
        // .../target/PROFILE/deps/it-HASH
        let profile = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().to_owned();
        let name = profile.file_name().unwrap().to_str().unwrap();
        let name = if name == "debug" { "dev" } else { name };
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--locked", "--offline", "--package", "ivv", "--example", "ivv_faults"]);
        cargo.args(["--profile", name]);
        cargo.current_dir(env!("CARGO_MANIFEST_DIR")).env("CARGO_TARGET_DIR", profile.parent().unwrap());
        assert!(cargo.status().unwrap().success(), "the layer cannot be built");
        let file = format!("{}ivv_faults{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
        profile.join("examples").join(file)
    };
    LAYER.get_or_init(build).clone()
}
