//! `ivv profile --replay FILE --watch`: a kernel compiled again, by the build's script, whenever a shader changes.

use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::screen::{alert, say};
use anyhow::Context;
use ivv::internals::gpu::KernelInfo;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

const EVERY: Duration = Duration::from_millis(300);

/// Calls `show` with each version of `kernel` that compiles, until Ctrl-C. The errors of other versions are printed.
pub fn watch(
    kernel: &'static KernelInfo,
    mut show: impl FnMut(&'static KernelInfo) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let stop = Stop::listen()?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut seen, mut version) = (newest(root)?, 0);
    say!("watching {}; Ctrl-C ends it", root.join("shaders-glsl").display());
    while !stop.is_asked() {
        std::thread::sleep(EVERY);
        let now = newest(root)?;
        if now == seen {
            continue;
        }
        (seen, version) = (now, version + 1);
        match compile(root, kernel, version) {
            Ok(edited) => show(edited)?,
            Err(fault) => alert!("{fault:#}"),
        }
    }
    Err(Interrupted("stopped watching shaders").into())
}

fn newest(root: &Path) -> anyhow::Result<SystemTime> {
    let mut newest = SystemTime::UNIX_EPOCH;
    for folder in std::fs::read_dir(root.join("shaders-glsl")).context("shaders-glsl")? {
        let folder: PathBuf = folder?.path();
        for file in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let is_shader = file.path().extension().is_some_and(|ending| ending == "comp" || ending == "glsl");
            if is_shader {
                newest = newest.max(file.metadata()?.modified()?);
            }
        }
    }
    Ok(newest)
}

/// `kernel` from its present source. It stays in memory to the end of the process, as pipelines expect of a kernel.
fn compile(root: &Path, kernel: &'static KernelInfo, version: u32) -> anyhow::Result<&'static KernelInfo> {
    let spirv = std::env::temp_dir().join(format!("ivv-{}-{}.spv", kernel.name, std::process::id()));
    let output = Command::new(env!("IVV_SHADER_COMPILER"))
        .envs([("IVV_KERNEL", kernel.name.as_ref()), ("IVV_SPIRV", spirv.as_os_str())])
        .env("CARGO_MANIFEST_DIR", root)
        .output()
        .context(concat!(env!("IVV_SHADER_COMPILER"), ": build `ivv` again"))?;
    anyhow::ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr).trim_end());
    let bytes = std::fs::read(&spirv);
    let _ = std::fs::remove_file(&spirv);
    // The first lines are the build script's own.
    let printed = String::from_utf8_lossy(&output.stdout);
    anyhow::ensure!(
        printed.ends_with(&summary(kernel)),
        "{}: its bindings, push constants or workgroup have changed; build `ivv` again to use it",
        kernel.name
    );
    let name = format!("{} (edit {version})", kernel.name);
    Ok(Box::leak(Box::new(KernelInfo { name: name.leak(), spirv: bytes?.leak(), ..*kernel })))
}

/// The lines that the build script prints for a kernel.
fn summary(kernel: &KernelInfo) -> String {
    let KernelInfo { local, subgroups, push_bytes, .. } = kernel;
    let mut text = format!("local {local}\nsubgroups {subgroups}\npush {push_bytes}\n");
    for binding in kernel.bindings {
        let _ = writeln!(text, "binding {} {:?} {:?}", binding.name, binding.kind, binding.access);
    }
    text
}
