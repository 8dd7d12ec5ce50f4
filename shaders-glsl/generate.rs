// Compiles every kernel of the table twice (optimised for the driver, plain for reflection), reads the second with naga,
// and writes the committed SPIR-V and `engine/gpu/generated/`.

#[path = "source.rs"]
mod source;

use super::manifest::{closure, line, source_key};
use super::table::{FAMILIES, Family, KERNELS, Spec};
use naga::{AddressSpace, ArraySize, Module, ScalarKind, StorageAccess, TypeInner, VectorSize};
use source::{Comments, constants_of, purpose};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const GENERATED: &str = "engine/gpu/generated";
/// The buffers of numbers in the layout of the parameters, which bindings take together.
const PLANES: [&str; 6] = ["geometry", "sh0", "motion", "sh1", "sh2", "sh3"];

/// Without `bless` the tree is only compared; returns the faults.
pub fn run(root: &Path, bless: bool) -> Vec<String> {
    let mut faults = Vec::new();
    let mut outputs: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let mut manifest = String::new();
    let mut structs = BTreeMap::new();
    // By folder of the shaders.
    let mut modules: BTreeMap<&str, String> = BTreeMap::new();
    let (mut interfaces, mut pushes) = (BTreeMap::new(), BTreeMap::new());
    for spec in KERNELS.iter() {
        match build(root, spec, &mut structs) {
            Ok(kernel) => {
                manifest += &line(&spec.name, kernel.key, &kernel.spirv);
                // The first of a shader's variants with this interface; the others share it.
                let Reflected { push, interface, info, .. } = &kernel.reflected;
                let key = (spec.file, push.clone(), interface.clone(), info.clone());
                let first = *interfaces.entry(key).or_insert(&*spec.name);
                // Likewise, the kernels of a shader share push constants whose fields are the same.
                let pushed = *pushes.entry((spec.file, push.clone())).or_insert(&*spec.name);
                let folder = spec.file.split('/').next().unwrap_or_default();
                *modules.entry(folder).or_default() += &kernel.reflected.module(&spec.name, first, pushed);
                outputs.insert(format!("shaders-glsl/spv/{}.spv", spec.name), kernel.spirv);
            }
            Err(fault) => faults.push(format!("{}: {fault}", spec.name)),
        }
    }
    if !faults.is_empty() {
        return faults;
    }
    outputs.insert("shaders-glsl/spv/MANIFEST".to_owned(), manifest.into_bytes());
    for family in FAMILIES.iter().filter(|family| !family.axes.is_empty()) {
        let folder = family.file.split('/').next().unwrap_or_default();
        *modules.entry(folder).or_default() += &picker(family);
    }
    match constants(root) {
        Ok(text) => outputs.insert(format!("{GENERATED}/constants.rs"), text.into_bytes()),
        Err(fault) => return vec![fault],
    };
    for (folder, kernels) in &modules {
        outputs.insert(format!("{GENERATED}/{folder}.rs"), bindings(folder, kernels).into_bytes());
    }
    outputs.insert(format!("{GENERATED}/mod.rs"), index(&structs, &modules).into_bytes());
    for (file, bytes) in &outputs {
        if std::fs::read(root.join(file)).is_ok_and(|old| old == *bytes) {
            continue;
        }
        if !bless {
            faults.push(format!("{file} is not what its sources give"));
        } else if let Err(e) = std::fs::write(root.join(file), bytes) {
            faults.push(format!("{file}: {e}"));
        }
    }
    let committed = std::fs::read_dir(root.join("shaders-glsl/spv")).into_iter().flatten().flatten();
    for entry in committed {
        let file = format!("shaders-glsl/spv/{}", entry.file_name().to_string_lossy());
        if outputs.contains_key(&file) {
            continue;
        }
        if !bless {
            faults.push(format!("{file} belongs to no kernel"));
        } else if let Err(e) = std::fs::remove_file(root.join(&file)) {
            faults.push(format!("{file}: {e}"));
        }
    }
    faults
}

/// Compiles one kernel into `output` and prints what the device needs to know of it; ends the process with the fault if
/// there is one.
pub fn one(root: &Path, name: &str, output: &Path) {
    let built = KERNELS.iter().find(|spec| spec.name == name).ok_or_else(|| format!("no kernel `{name}`"));
    let built = built.and_then(|spec| build(root, spec, &mut BTreeMap::new()));
    let written = built.and_then(|kernel| {
        std::fs::write(output, &kernel.spirv).map_err(|e| format!("{}: {e}", output.display()))?;
        Ok(kernel.reflected.summary)
    });
    match written {
        Ok(summary) => print!("{summary}"),
        Err(fault) => {
            eprintln!("{name}: {fault}");
            std::process::exit(1);
        }
    }
}

struct Kernel {
    key: u64,
    spirv: Vec<u8>,
    reflected: Reflected,
}

struct Reflected {
    purpose: String,
    push: String,
    interface: String,
    /// Their slices, in order.
    slices: String,
    /// The fields of its `KernelInfo` but for the name and the SPIR-V.
    info: String,
    summary: String,
}

impl Reflected {
    /// The Rust module of kernel `name`, which has the interface of `first` and the push constants of `pushed`.
    fn module(&self, name: &str, first: &str, pushed: &str) -> String {
        let Reflected { purpose, push, interface, slices, info, .. } = self;
        if name != first {
            return format!("crate::gpu::kernel::variant!({name} of {first});\n");
        }
        let push = if name == pushed { push.clone() } else { format!("pub use super::{pushed}::Push;\n") };
        format!(
            "\n/// {purpose}\npub mod {name} {{\nuse crate::gpu::kernel::*;\n{push}{interface}\
             impl Kernel for Args<'_> {{\ntype Push = Push;\nconst INFO: &'static KernelInfo = INFO;\n\
             fn slices(&self) -> Vec<Slice> {{\nvec![\n{slices}]\n}}\n}}\n\
             pub const INFO: &KernelInfo = &KernelInfo {{\n\
             name: \"{name}\", push_bytes: size_of::<Push>() as u32,\n\
             spirv: include_bytes!(\"../../../shaders-glsl/spv/{name}.spv\"),\n{info}}};\n}}\n"
        )
    }
}

fn build(root: &Path, spec: &Spec, structs: &mut BTreeMap<String, String>) -> Result<Kernel, String> {
    let key = source_key(root, spec)?;
    let spirv = compile(root, spec, shaderc::OptimizationLevel::Performance)?;
    let plain = compile(root, spec, shaderc::OptimizationLevel::Zero)?;
    // naga panics on a few constructs instead of refusing them.
    let parsed = std::panic::catch_unwind(|| naga::front::spv::parse_u8_slice(&plain, &Default::default()))
        .map_err(|_| "naga panicked; see the dialect in shaders-glsl/README.md".to_owned())?;
    let module = parsed.map_err(|e| format!("naga cannot read it: {e}"))?;
    let mut sources = BTreeMap::new();
    closure(root, spec.file, &mut sources)?;
    let purpose = purpose(&sources[spec.file]).ok_or("its header has no `Purpose` line")?;
    let mut comments = Comments::default();
    sources.values().for_each(|text| comments.read(text));
    let reflected = reflect(purpose, &module, uses_subgroups(&spirv), &comments, structs)?;
    Ok(Kernel { key, spirv, reflected })
}

fn compile(root: &Path, spec: &Spec, level: shaderc::OptimizationLevel) -> Result<Vec<u8>, String> {
    let compiler = shaderc::Compiler::new().map_err(|e| e.to_string())?;
    let mut options = shaderc::CompileOptions::new().map_err(|e| e.to_string())?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_3);
    options.set_optimization_level(level);
    options.set_warnings_as_errors();
    for (name, value) in &spec.defines {
        options.add_macro_definition(name, Some(value));
    }
    let include = root.join("shaders-glsl/include");
    options.set_include_callback(move |name, _, _, _| {
        let path = include.join(name);
        let content = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: format!("include/{name}"), content })
    });
    let path = root.join("shaders-glsl").join(spec.file);
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let compiled = compiler
        .compile_into_spirv(&text, shaderc::ShaderKind::Compute, spec.file, "main", Some(&options))
        .map_err(|e| e.to_string())?;
    Ok(compiled.as_binary_u8().to_vec())
}

/// True if the module declares one of the GroupNonUniform capabilities (61 to 68).
fn uses_subgroups(spirv: &[u8]) -> bool {
    const OP_CAPABILITY: u32 = 17;
    let words: Vec<u32> = spirv.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect();
    let mut at = 5;
    while at + 1 < words.len() && words[at] & 0xffff == OP_CAPABILITY {
        if (61..=68).contains(&words[at + 1]) {
            return true;
        }
        at += (words[at] >> 16) as usize;
    }
    false
}

/// The Rust type of a GLSL type, and its size in bytes.
fn rust_type(
    module: &Module,
    handle: naga::Handle<naga::Type>,
    comments: &Comments,
    structs: &mut BTreeMap<String, String>,
) -> Result<(String, u32), String> {
    let scalar = |s: naga::Scalar| match (s.kind, s.width) {
        (ScalarKind::Float, 4) => Ok("f32"),
        (ScalarKind::Uint, 4) => Ok("u32"),
        (ScalarKind::Uint, 8) => Ok("u64"),
        (ScalarKind::Sint, 4) => Ok("i32"),
        other => Err(format!("scalar {other:?} has no Rust type here")),
    };
    match &module.types[handle].inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => Ok((scalar(*s)?.to_owned(), u32::from(s.width))),
        TypeInner::Vector { size: VectorSize::Tri, .. } => Err("vec3 in a buffer: use vec4 or scalars".to_owned()),
        TypeInner::Vector { size, scalar: s } => Ok((format!("[{}; {}]", scalar(*s)?, *size as u32), 4 * *size as u32)),
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => {
            let (element, bytes) = rust_type(module, *base, comments, structs)?;
            Ok((format!("[{element}; {n}]"), bytes * n.get()))
        }
        TypeInner::Struct { .. } => {
            let (name, text, bytes) = rust_struct(module, handle, comments, structs)?;
            if let Some(old) = structs.insert(name.clone(), text.clone())
                && old != text
            {
                return Err(format!("struct {name} differs between kernels"));
            }
            Ok((name, bytes))
        }
        other => Err(format!("type {other:?} has no Rust type here")),
    }
}

/// A `repr(C)` struct, whose offsets are the shader's since neither has padding: its name, its text, its size.
fn rust_struct(
    module: &Module,
    handle: naga::Handle<naga::Type>,
    comments: &Comments,
    structs: &mut BTreeMap<String, String>,
) -> Result<(String, String, u32), String> {
    let ty = &module.types[handle];
    let TypeInner::Struct { members, .. } = &ty.inner else { return Err("not a struct".to_owned()) };
    let name = ty.name.clone().ok_or("a struct without a name")?;
    let mut fields = String::new();
    let mut end = 0;
    for member in members {
        let field = member.name.as_deref().ok_or("a member without a name")?;
        let (kind, bytes) = rust_type(module, member.ty, comments, structs)?;
        let kind = qualified(kind);
        if member.offset != end {
            return Err(format!("{name}.{field} is padded: reorder the members"));
        }
        writeln!(fields, "{}pub {field}: {kind},", comments.doc(&name, field)).ok();
        end = member.offset + bytes;
    }
    let text = format!(
        "{}#[repr(C)]\n#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]\n\
         pub struct {name} {{\n{fields}}}\nconst _: () = assert!(size_of::<{name}>() == {end});\n",
        comments.doc(&name, "")
    );
    Ok((name, text, end))
}

fn reflect(
    purpose: String,
    module: &Module,
    subgroups: bool,
    comments: &Comments,
    structs: &mut BTreeMap<String, String>,
) -> Result<Reflected, String> {
    let entry = module.entry_points.first().ok_or("no entry point")?;
    let [local, 1, 1] = entry.workgroup_size else { return Err("workgroups are one-dimensional here".to_owned()) };
    let mut push = None;
    let mut bindings = BTreeMap::new();
    for (_, global) in module.global_variables.iter() {
        let ty = &module.types[global.ty];
        match global.space {
            AddressSpace::Immediate => push = Some(global.ty),
            AddressSpace::Storage { .. } | AddressSpace::Uniform => {
                let at = global.binding.ok_or("a buffer without a binding")?;
                if at.group != 0 {
                    return Err("only set 0 is used".to_owned());
                }
                let block = ty.name.clone().ok_or("a block without a name")?;
                let TypeInner::Struct { members, .. } = &ty.inner else { return Err("not a block".to_owned()) };
                let [member] = &members[..] else { return Err(format!("{block} has not one member")) };
                let element = match &module.types[member.ty].inner {
                    TypeInner::Array { base, size: ArraySize::Dynamic, .. } => *base,
                    _ => member.ty,
                };
                let (kind, access) = match global.space {
                    AddressSpace::Storage { access } if access == StorageAccess::LOAD => ("Storage", "Read"),
                    AddressSpace::Storage { access } if access == StorageAccess::STORE => ("Storage", "Write"),
                    AddressSpace::Storage { .. } => ("Storage", "ReadWrite"),
                    _ => ("Uniform", "Read"),
                };
                let element = rust_type(module, element, comments, structs)?.0;
                bindings.insert(at.binding, (snake(&block), kind, access, element));
            }
            _ => {}
        }
    }
    if !bindings.keys().copied().eq(0..bindings.len() as u32) {
        return Err("its bindings have gaps".to_owned());
    }
    let (push_text, push_bytes) = match push {
        Some(handle) => rust_struct(module, handle, comments, structs).map(|(_, text, bytes)| (text, bytes))?,
        None => ("pub type Push = ();\n".to_owned(), 0),
    };
    let mut summary = format!("local {local}\nsubgroups {subgroups}\npush {push_bytes}\n");
    let (mut fields, mut list, mut infos, mut floats) = (Vec::new(), String::new(), String::new(), 0u32);
    let names: Vec<&str> = bindings.values().map(|(name, ..)| &**name).collect();
    for (at, (name, kind, access, element)) in &bindings {
        floats |= u32::from(element.contains("f32")) << at;
        writeln!(summary, "binding {name} {kind} {access}").ok();
        let element = qualified(element.clone());
        if let Some((together, plane)) = plane_of(name, &names) {
            let field = format!("pub {together}: PlaneSlices,");
            if !fields.contains(&field) {
                fields.push(field);
            }
            writeln!(list, "self.{together}.{plane}.clone(),").ok();
        } else {
            fields.push(format!("{}pub {name}: &'a Buf<{element}>,", comments.doc("", name)));
            writeln!(list, "self.{name}.slice(),").ok();
        }
        writeln!(
            infos,
            "        BindingInfo {{ name: \"{name}\", kind: BindingKind::{kind}, access: Access::{access} }},"
        )
        .ok();
    }
    Ok(Reflected {
        purpose,
        push: push_text,
        interface: format!("pub struct Args<'a> {{\n{}}}\n", fields.join("\n")),
        slices: list,
        info: format!("local: {local}, subgroups: {subgroups}, floats: {floats:#x},\nbindings: &[\n{infos}],\n"),
        summary,
    })
}

/// A Rust type with the path of a struct that kernels share.
fn qualified(kind: String) -> String {
    if kind.starts_with(char::is_uppercase) { format!("crate::gpu::generated::{kind}") } else { kind }
}

/// The field that takes a kernel's buffer together with others, and its place there: where the kernel binds the planes of all bands.
fn plane_of(name: &str, names: &[&str]) -> Option<(String, &'static str)> {
    let (prefix, plane) = PLANES.iter().find_map(|plane| Some((name.strip_suffix(plane)?, *plane)))?;
    let all = names.contains(&&*format!("{prefix}sh1"));
    let together = if prefix.is_empty() { "params" } else { prefix.trim_end_matches('_') };
    all.then(|| (together.to_owned(), plane))
}

fn snake(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

fn bindings(folder: &str, kernels: &str) -> String {
    formatted(format!(
        "//! Bindings of the kernels in `shaders-glsl/{folder}`, generated by `IVV_BLESS=1 cargo build --features shaders`.\n\
         {kernels}"
    ))
}

/// The function that picks a kernel of a family.
fn picker(family: &Family) -> String {
    let is_switch = |axis: usize| family.axes[axis].values.len() == 2;
    let parameters: Vec<String> = (0..family.axes.len())
        .map(|axis| format!("{}: {}", family.axes[axis].name, if is_switch(axis) { "bool" } else { "usize" }))
        .collect();
    let names: Vec<&str> = family.axes.iter().map(|axis| axis.name).collect();
    // Of an index that is too large, the last.
    let pattern = |(axis, value): (usize, &usize)| match is_switch(axis) {
        true => (*value == 1).to_string(),
        false if *value + 1 == family.axes[axis].values.len() => "_".to_owned(),
        false => value.to_string(),
    };
    let mut arms: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for [choice, kernel] in family.choices() {
        let pattern: Vec<String> = choice.iter().enumerate().map(pattern).collect();
        let pattern = pattern.join(", ");
        let pattern = if choice.len() == 1 { pattern } else { format!("({pattern})") };
        arms.entry(family.kernel_name(&kernel)).or_default().push(pattern);
    }
    // What an index that is too large takes stands last.
    let mut arms: Vec<(String, String)> = arms.into_iter().map(|(name, of)| (of.join(" | "), name)).collect();
    arms.sort_by_key(|(of, _)| of.contains('_'));
    let arms: String = arms.iter().map(|(of, name)| format!("{of} => {name}::INFO,\n")).collect();
    let (file, name, parameters, names) = (family.file, family.name(), parameters.join(", "), names.join(", "));
    let names = if family.axes.len() == 1 { names } else { format!("({names})") };
    format!(
        "\n/// The kernel of `{file}` for these choices.\npub fn {name}({parameters}) -> &'static \
         crate::gpu::KernelInfo {{\nmatch {names} {{\n{arms}}}\n}}\n"
    )
}

/// The numbers of the shaders, a module for each file: scalar constants at its top level that are the same in all its kernels.
fn constants(root: &Path) -> Result<String, String> {
    let mut files = Vec::new();
    let shaders = root.join("shaders-glsl");
    let list = |folder: &Path| {
        let entries = std::fs::read_dir(folder).map_err(|e| e.to_string())?;
        Ok::<_, String>(entries.flatten().map(|entry| entry.path()))
    };
    for folder in list(&shaders)?.filter(|path| path.is_dir()) {
        let is_shader = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "glsl" || ending == "comp");
        files.extend(list(&folder)?.filter(is_shader));
    }
    files.sort_by_key(|path| path.file_stem().map(|stem| stem.to_owned()));
    let mut modules = String::new();
    for path in files {
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let found = constants_of(&text);
        if !found.is_empty() {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let below = path.strip_prefix(&shaders).unwrap_or(&path).to_string_lossy().into_owned();
            write!(modules, "\n/// Of `{below}`.\npub mod {stem} {{\n{found}}}\n").ok();
        }
    }
    let text = format!(
        "//! Numbers that the shaders and Rust share, generated by `IVV_BLESS=1 cargo build --features shaders`: a module for each \
         file of\n//! `shaders-glsl` with its constants.\n#![expect(clippy::approx_constant, clippy::excessive_precision, reason = \"digits as the shaders have them\")]\n{modules}"
    );
    Ok(formatted(text))
}

/// The structs that kernels share, and a list of all kernels.
fn index(structs: &BTreeMap<String, String>, modules: &BTreeMap<&str, String>) -> String {
    let structs: String = structs.values().map(|s| format!("{s}\n")).collect();
    let folders: String = modules.keys().map(|folder| format!("mod {folder};\n")).collect();
    let uses: String = modules.keys().map(|folder| format!("pub use {folder}::*;\n")).collect();
    let all: String = KERNELS.iter().map(|spec| format!("{}::INFO,\n", spec.name)).collect();
    let text = format!(
        "//! Bindings of the kernels, generated from the shaders by `IVV_BLESS=1 cargo build --features shaders`: here the structs\n\
         //! that kernels share, then a file for each folder of `shaders-glsl` with a module for each kernel: its buffers by name\n\
         //! (`Args`), its push constants (`Push`), and what the device needs to know (`INFO`). Variants of a shader with the same\n\
         //! buffers as its first are a line each; a function named after the shader picks one.\n\n\
         pub mod constants;\n{folders}\nuse bytemuck::{{Pod, Zeroable}};\n\n{uses}\n{structs}\
         /// Every kernel, in the order of the table.\npub const ALL: &[&super::KernelInfo] = &[\n{all}];\n"
    );
    formatted(text)
}

/// As rustfmt has it, where that is installed.
fn formatted(text: String) -> String {
    let format = || {
        let mut child = Command::new("rustfmt")
            .args(["--edition", "2024", "--config", "max_width=120,use_small_heuristics=Max"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .ok()?;
        child.stdin.take()?.write_all(text.as_bytes()).ok()?;
        let output = child.wait_with_output().ok()?;
        output.status.success().then(|| String::from_utf8(output.stdout).ok()).flatten()
    };
    format().unwrap_or(text)
}
