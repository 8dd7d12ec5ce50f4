// Ties the committed SPIR-V to its sources: `spv/MANIFEST` holds, for each kernel, a hash of everything it is made from
// and a hash of the result. Std only: the default build runs it.

use super::table::{KERNELS, Spec};
use std::collections::BTreeMap;
use std::path::Path;

/// The compiler, on which the hashes depend beside the sources.
pub const COMPILER: &str = "shaderc 0.10.1 vulkan1.2 spirv1.3 -O";

/// FNV-1a, 64 bit.
pub fn hash(parts: &[&[u8]]) -> u64 {
    let mut h = 0xcbf2_9ce4_8422_2325u64;
    for part in parts {
        for byte in part.iter().chain(&[0xff]) {
            h = (h ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    h
}

/// A kernel's source with everything it includes, by path below `shaders-glsl`.
pub fn closure(root: &Path, file: &str, into: &mut BTreeMap<String, String>) -> Result<(), String> {
    if into.contains_key(file) {
        return Ok(());
    }
    let path = root.join("shaders-glsl").join(file);
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let includes: Vec<String> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("#include \"")?.strip_suffix('"'))
        .map(|name| format!("include/{name}"))
        .collect();
    into.insert(file.to_owned(), text);
    includes.iter().try_for_each(|include| closure(root, include, into))
}

/// Hash of everything that decides a kernel's SPIR-V.
pub fn source_key(root: &Path, spec: &Spec) -> Result<u64, String> {
    let mut files = BTreeMap::new();
    closure(root, spec.file, &mut files)?;
    let defines = format!("{:?}", spec.defines);
    let mut parts = vec![COMPILER.as_bytes(), spec.name.as_bytes(), defines.as_bytes()];
    parts.extend(files.iter().flat_map(|(name, text)| [name.as_bytes(), text.as_bytes()]));
    Ok(hash(&parts))
}

pub fn line(name: &str, key: u64, spirv: &[u8]) -> String {
    format!("{name} {key:016x} {:016x}\n", hash(&[spirv]))
}

/// Compares the manifest with the tree; returns the faults.
#[cfg_attr(feature = "shaders", expect(dead_code, reason = "with the compiler at hand the result itself is compared"))]
pub fn verify(root: &Path) -> Vec<String> {
    let spv = root.join("shaders-glsl/spv");
    let manifest = std::fs::read_to_string(spv.join("MANIFEST")).unwrap_or_default();
    let mut expected = String::new();
    let mut faults = Vec::new();
    for spec in KERNELS.iter() {
        match (source_key(root, spec), std::fs::read(spv.join(format!("{}.spv", spec.name)))) {
            (Ok(key), Ok(spirv)) => {
                let line = line(&spec.name, key, &spirv);
                if !manifest.lines().any(|l| l == line.trim_end()) {
                    faults.push(format!("{}: its SPIR-V is older than its source", spec.name));
                }
                expected.push_str(&line);
            }
            (Err(e), _) => faults.push(e),
            (_, Err(_)) => faults.push(format!("{}: it has no committed SPIR-V", spec.name)),
        }
    }
    if faults.is_empty() && manifest != expected {
        faults.push("shaders-glsl/spv/MANIFEST names other kernels than the table".to_owned());
    }
    faults
}
