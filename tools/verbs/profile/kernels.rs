//! Kernels by name: `ivv profile --list`, and the message for a wrong name.

use crate::ui::screen::{out, print_json};
use ivv::internals::gpu::table::{KERNELS, kernel};
use ivv::internals::gpu::{KernelInfo, kernel_named};
use ivv::internals::words::nearest;

pub fn named(option: &str, name: &str) -> anyhow::Result<&'static KernelInfo> {
    let unknown = || anyhow::anyhow!("{option} {name}: there is no such kernel{}", like(name));
    kernel_named(name).ok_or_else(unknown)
}

/// The end of a message that suggests other names: the other kernels of the shader, or the nearest names.
pub fn like(name: &str) -> String {
    let shader = kernel(name).map(|spec| spec.file);
    let others = KERNELS.iter().filter(|spec| Some(spec.file) == shader && spec.name != name);
    let others: Vec<&str> = others.map(|spec| &*spec.name).collect();
    let near = nearest(name, KERNELS.iter().map(|spec| &*spec.name));
    let meant = match shader {
        Some(shader) if !others.is_empty() => format!("; others of {shader} are {}", others.join(", ")),
        None if !near.is_empty() => format!("; did you mean {}?", near.join(" or ")),
        _ => String::new(),
    };
    format!("{meant} (`ivv profile --list` lists all)")
}

pub fn list(json: bool) -> anyhow::Result<()> {
    let mut shaders: Vec<(&str, Vec<&str>)> = Vec::new();
    for spec in KERNELS.iter() {
        match shaders.iter_mut().find(|(file, _)| *file == spec.file) {
            Some((_, names)) => names.push(&spec.name),
            None => shaders.push((spec.file, vec![&spec.name])),
        }
    }
    if json {
        let line = |(file, names): &(&str, Vec<&str>)| serde_json::json!({ "shader": file, "kernels": names });
        return print_json(&shaders.iter().map(line).collect::<Vec<_>>());
    }
    for (file, names) in shaders {
        out!("{file}: {}", names.join(", "));
    }
    Ok(())
}
