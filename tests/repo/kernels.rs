//! The table of kernels against the shaders, the references and the committed SPIR-V, and the rules of the dialect.

use super::{files, text, without_comments, words};
use crate::common::prelude::*;
use crate::common::references::Tested;
use ivv::internals::gpu::spirv_hashes;
use ivv::internals::gpu::table::Spec;
use rspirv::spirv::Capability;

fn shaders() -> BTreeSet<String> {
    let below = |file: String| file.strip_prefix("shaders-glsl/").map(str::to_owned);
    files("shaders-glsl").into_iter().filter_map(below).filter(|file| file.ends_with(".comp")).collect()
}

fn source(shader: &str) -> String {
    text(&format!("shaders-glsl/{shader}"))
}

fn all_code() -> Vec<(String, String)> {
    let is_glsl = |file: &String| file.ends_with(".comp") || file.ends_with(".glsl");
    let code: Vec<_> = files("shaders-glsl")
        .into_iter()
        .filter(is_glsl)
        .map(|file| (file.clone(), without_comments(&text(&file))))
        .collect();
    assert!(code.len() > 20, "only {} files of GLSL", code.len());
    code
}

/// What follows `keyword` up to the closing brace, for each occurrence at a word's beginning.
fn bodies<'a>(code: &'a str, keyword: &str) -> Vec<&'a str> {
    let at_word = |at: &usize| !code[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let starts = code.match_indices(keyword).map(|(at, _)| at).filter(at_word);
    starts.filter_map(|at| code[at..].split_once('}').map(|(body, _)| body)).collect()
}

/// The workgroup's size, which must be a literal.
fn local_size(code: &str) -> Option<u32> {
    let (_, rest) = code.split_once("layout(local_size_x = ")?;
    rest.split_once(") in;")?.0.parse().ok()
}

#[test]
fn the_shaders_and_the_table_name_each_other() {
    let named: BTreeSet<String> = KERNELS.iter().map(|row| row.file.to_owned()).collect();
    assert!(named.len() > 10);
    assert_eq!(named, shaders());
}

#[test]
fn kernel_names_are_unique_and_begin_with_their_shaders_stem() {
    let names: BTreeSet<&str> = KERNELS.iter().map(|row| &*row.name).collect();
    assert_eq!(names.len(), KERNELS.len());
    for row in KERNELS.iter() {
        let stem = row.file.rsplit('/').next().unwrap().trim_end_matches(".comp");
        let variant = row.name.strip_prefix(stem).unwrap_or_else(|| panic!("{} of {}", row.name, row.file));
        assert!(variant.is_empty() || variant.starts_with('_'), "{} of {}", row.name, row.file);
    }
}

#[test]
fn the_committed_spirv_is_that_of_the_table_and_no_other() {
    let mut expected: BTreeSet<String> =
        KERNELS.iter().map(|row| format!("shaders-glsl/spv/{}.spv", row.name)).collect();
    expected.insert("shaders-glsl/spv/MANIFEST".to_owned());
    assert_eq!(files("shaders-glsl/spv").into_iter().collect::<BTreeSet<_>>(), expected);
    let manifest = text("shaders-glsl/spv/MANIFEST");
    let listed: Vec<&str> = manifest.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(listed, KERNELS.iter().map(|row| &*row.name).collect::<Vec<_>>());
}

#[test]
fn every_shader_opens_with_licence_purpose_equation_grid_and_numerics() {
    for shader in shaders() {
        let source = source(&shader);
        let (header, _) = source.split_once("#version 460").unwrap_or_else(|| panic!("{shader}: no #version 460"));
        assert!(header.lines().all(|line| line.starts_with("//")), "{shader}: its header holds more than comments");
        let mut lines = header.lines();
        assert_eq!(lines.next(), Some("// SPDX-License-Identifier: MIT OR Apache-2.0"), "{shader}");
        for field in ["// Purpose   ", "// Equation  ", "// Grid      ", "// Numerics  "] {
            assert!(lines.any(|line| line.starts_with(field)), "{shader}: no `{field}` in its place");
        }
    }
}

/// Kernels without a reference, and why.
const WITHOUT_REFERENCE: [(&str, &str); 2] = [
    ("probe_copy", "it computes nothing: kernel::probe reads every copied row"),
    ("probe_dispatch", "it counts dispatches: kernel::probe reads the count"),
];

/// A test's file without its list of references, and the fixtures of `tests/conformance` that run its cases.
fn of_test(file: &str) -> String {
    let own = text(file);
    let (before, rest) = own.split_once("tested! {").unwrap_or_else(|| panic!("{file}: no list of references"));
    let mut all = [before, rest.split_once("\n}\n").unwrap().1].concat();
    for fixture in own.split("ivv_conformance::fixtures::").skip(1).filter_map(|rest| words(rest).next()) {
        all += &text(&format!("tests/conformance/fixtures/{fixture}.rs"));
    }
    if own.contains("check_adjoint") || own.contains("adjoint::group_error") {
        all += &text("tests/conformance/adjoint.rs");
    }
    without_comments(&all)
}

#[test]
fn every_kernel_has_a_reference_and_a_test_that_compares_them() {
    let tested: Vec<&Tested> = [crate::kernel::TESTED, crate::grad::TESTED].concat().into_iter().flatten().collect();
    for row in KERNELS.iter() {
        if WITHOUT_REFERENCE.iter().any(|(name, _)| *name == row.name) {
            assert_eq!(row.reference(), "", "{}: it has a reference after all", row.name);
            continue;
        }
        let (module, name) =
            row.reference().split_once("::").unwrap_or_else(|| panic!("{}: reference {}", row.name, row.reference()));
        let references = text(&format!("engine/reference/{module}.rs"));
        let is_there = ["pub fn ", "pub struct "].iter().any(|kind| {
            let after = references.split(&format!("{kind}{name}")).nth(1);
            after.is_some_and(|rest| rest.starts_with(['(', '<', ' ']))
        });
        assert!(is_there, "{}: engine/reference/{module}.rs has no {name}", row.name);
        let is_tested = tested.iter().any(|test| (test.shader, test.reference) == (row.file, name));
        assert!(is_tested, "{}: no test says `\"{}\" by {name} in TEST;` in a tested! list", row.name, row.file);
    }
    for Tested { shader, reference, test, file } in tested {
        let is_of_a_row = |row: &Spec| row.file == *shader && row.reference().ends_with(&format!("::{reference}"));
        assert!(KERNELS.iter().any(is_of_a_row), "{file}: `\"{shader}\" by {reference}` is of no kernel");
        // It runs: an ignored test would have another line between.
        assert!(
            text(file).contains(&format!("#[test]\nfn {test}() {{\n")),
            "{file}: {test} is no test that always runs"
        );
        assert!(
            words(&of_test(file)).any(|word| word == *reference),
            "{file}: {test} is to compare with {reference}, unnamed there"
        );
    }
}

#[test]
fn no_shader_orders_memory_but_by_barrier() {
    // lavapipe turns each into a point where a workgroup waits: subgroups that meet different numbers of them lose work.
    for (file, code) in all_code() {
        let bad = words(&code).find(|word| word.starts_with("memoryBarrier") || *word == "groupMemoryBarrier");
        assert_eq!(bad, None, "{file}");
    }
}

#[test]
fn no_push_constant_or_uniform_alone_decides_a_branch_or_a_loop() {
    // lavapipe would compile the kernel again at every dispatch: see unfolded.glsl.
    let is_bare = |side: &str| {
        let mut atoms =
            side.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).filter(|atom| !atom.is_empty());
        let is_literal = |atom: &str| atom.starts_with(|c: char| c.is_ascii_digit() || c.is_ascii_uppercase());
        atoms.all(|atom| is_literal(atom) || ["pc.", "view.", "adam."].iter().any(|block| atom.starts_with(block)))
    };
    let mut n_conditions = 0;
    for (file, code) in all_code() {
        for keyword in ["if (", "while (", "for ("] {
            for (at, _) in code.match_indices(keyword) {
                let text = &code[at + keyword.len()..];
                let mut depth = 1;
                let end = text.find(|c: char| {
                    depth += i32::from(c == '(') - i32::from(c == ')');
                    depth == 0
                });
                let condition = &text[..end.unwrap_or(text.len())];
                let is_loop = keyword == "for (";
                let condition = if is_loop { condition.split(';').nth(1).unwrap_or("") } else { condition };
                for part in condition.split("&&").flat_map(|part| part.split("||")) {
                    n_conditions += 1;
                    // Of a comparison with a counter from a constant, the bound is what would be folded.
                    let counts = is_loop || part.contains("++");
                    let bound = if counts { part.split(['<', '>']).next_back().unwrap_or(part) } else { part };
                    let names_one = ["pc.", "view.", "adam."].iter().any(|block| bound.contains(block));
                    let from_lane = is_loop && !text.starts_with("uint k = 0u") && !text.starts_with("uint p = 0u");
                    assert!(!names_one || from_lane || !is_bare(bound), "{file}: {part}");
                }
            }
        }
    }
    assert!(n_conditions > 150, "only {n_conditions} conditions were found");
}

#[test]
fn no_buffer_holds_a_vector_of_three() {
    // std430 pads it to four and Rust does not.
    let mut n_blocks = 0;
    for (file, code) in all_code() {
        let shared = file.ends_with("include/types.glsl");
        let keywords = if shared { &["struct "][..] } else { &["buffer ", "uniform "] };
        for body in keywords.iter().flat_map(|keyword| bodies(&code, keyword)) {
            n_blocks += 1;
            let bad = words(body).find(|word| ["vec3", "ivec3", "uvec3", "bvec3", "mat3"].contains(word));
            assert_eq!(bad, None, "{file}: {body}");
        }
    }
    assert!(n_blocks > 60, "only {n_blocks} blocks and structs were found");
}

#[test]
fn workgroups_are_literal_and_hold_whole_subgroups_of_4_to_64() {
    let mut with_subgroups = 0;
    for shader in shaders() {
        let code = without_comments(&source(&shader));
        let local = local_size(&code).unwrap_or_else(|| panic!("{shader}: local_size_x is not a literal"));
        if code.contains("GL_KHR_shader_subgroup") {
            with_subgroups += 1;
            // At most 32 subgroups of 4: the size of the shared arrays that hold one number for each. Or 8 of 32, which is the least
            // where the engine picks these.
            let most = if shader == "sort/sort_exchange.comp" { 256 } else { 128 };
            assert!(local <= most && local.is_multiple_of(64), "{shader}: {local} threads");
        }
    }
    assert!(with_subgroups > 5);
}

#[test]
fn no_shader_has_more_than_24_bindings() {
    for shader in shaders() {
        let own = source(&shader);
        let included = own.split("#include \"").skip(1).filter_map(|rest| rest.split('"').next());
        let includes: String = included.map(|name| text(&format!("shaders-glsl/include/{name}"))).collect();
        let code = without_comments(&(own.clone() + &includes));
        // Variants of a shader declare their own: the highest place counts.
        let places =
            code.split("binding = ").skip(1).map(|rest| rest.split(')').next().unwrap().parse::<usize>().unwrap());
        let n_bindings = places.max().map_or(0, |last| last + 1);
        assert!((1..=24).contains(&n_bindings), "{shader}: {n_bindings} bindings");
    }
}

/// Capabilities that not every device has; kernels with `ACCUMULATE` of 2 may declare them.
const OPTIONAL: [Capability; 2] = [Capability::Int64, Capability::Int64Atomics];

#[test]
fn only_the_variants_for_devices_that_have_them_use_64_bit_integers() {
    let is_common = |capability: &Capability| {
        let name = format!("{capability:?}");
        name == "Shader" || name.starts_with("GroupNonUniform")
    };
    let mut n_optional = 0;
    for row in KERNELS.iter() {
        let spirv = std::fs::read(super::root().join(format!("shaders-glsl/spv/{}.spv", row.name))).unwrap();
        let module = rspirv::dr::load_bytes(spirv).unwrap();
        for capability in module.capabilities.iter().map(|i| i.operands[0].unwrap_capability()) {
            let is_optional = OPTIONAL.contains(&capability);
            let is_allowed = if is_optional { row.value("ACCUMULATE") == 2 } else { is_common(&capability) };
            assert!(is_allowed, "{}: {capability:?}", row.name);
            n_optional += usize::from(is_optional);
        }
    }
    assert!(n_optional >= 8, "only {n_optional} declarations of optional capabilities");
}

#[test]
fn spirv_val_finds_no_fault() {
    needs!("spirv-val");
    for row in KERNELS.iter() {
        let file = super::root().join(format!("shaders-glsl/spv/{}.spv", row.name));
        let output = Command::new("spirv-val").args(["--target-env", "vulkan1.2"]).arg(&file).output().unwrap();
        assert!(output.status.success(), "{}: {}", row.name, String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn the_hash_of_the_kernels_is_of_what_runs_and_of_no_source() {
    let hashes = spirv_hashes();
    assert!(hashes.len() > 100 && !hashes.contains_key("show") && !hashes.contains_key("probe_copy"));
    let manifest = text("shaders-glsl/spv/MANIFEST");
    for (name, spirv) in &hashes {
        assert!(manifest.lines().any(|line| line.starts_with(&format!("{name} ")) && line.ends_with(spirv)), "{name}");
    }
    // A line is a kernel, its source's hash and its SPIR-V's.
    let sources: Vec<&str> = manifest.lines().filter_map(|line| line.split(' ').nth(1)).collect();
    assert!(hashes.values().all(|hash| hash.len() == 16 && !sources.contains(&hash.as_str())));
}
