//! Who may use whom: the table of `engine/ARCHITECTURE.md` against every `crate::` path of the engine.

use super::{files, quoted, table, text, without_comments, words};
use crate::common::prelude::*;

const DOCUMENT: &str = "engine/ARCHITECTURE.md";

/// Parts of the engine, each with the paths below `crate` that it may use.
fn allowed() -> BTreeMap<String, Vec<String>> {
    let rows = table(&text(DOCUMENT), "arrows");
    let part = |cell: &str| quoted(cell).first().cloned().unwrap_or_else(|| panic!("a row without a part: {cell}"));
    let allowed: BTreeMap<_, _> = rows.iter().map(|row| (part(&row[0]), quoted(&row[1]))).collect();
    assert!(allowed.len() > 4, "{DOCUMENT} lists {} parts", allowed.len());
    allowed
}

/// The part that a file belongs to: the folder below `engine`, or the file's own stem.
fn part(file: &str) -> &str {
    let below = file.strip_prefix("engine/").unwrap();
    below.split_once('/').map_or(below, |(folder, _)| folder).trim_end_matches(".rs")
}

fn sources(folder: &str) -> Vec<String> {
    files(folder).into_iter().filter(|file| file.ends_with(".rs")).collect()
}

/// A file without comments, its paths as if the engine's rooms lay at the crate's root.
fn rooted(file: &str) -> String {
    without_comments(&text(file)).replace("internals::", "")
}

/// Every path below `crate` that `source` names, use-trees unfolded: `crate::a::{b, c::d}` gives `a::b` and `a::c::d`.
fn crate_paths(source: &str) -> Vec<String> {
    let mut found = Vec::new();
    for tail in source.split("crate::").skip(1) {
        unfold(tail, "", &mut found);
    }
    found
}

/// Reads one use-tree from the beginning of `text` and returns what follows it.
fn unfold<'a>(text: &'a str, prefix: &str, found: &mut Vec<String>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut rest) = text.strip_prefix('{') {
        loop {
            rest = unfold(rest, prefix, found).trim_start();
            match rest.strip_prefix(',') {
                Some(next) if !next.trim_start().starts_with('}') => rest = next,
                _ => return rest.split_once('}').map_or("", |(_, after)| after),
            }
        }
    }
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let (name, rest) = text.split_at(end);
    let path = if prefix.is_empty() { name.to_owned() } else { format!("{prefix}::{name}") };
    match rest.strip_prefix("::") {
        Some(next) if next.starts_with(|c: char| c.is_alphabetic() || c == '_' || c == '{') => {
            unfold(next, &path, found)
        }
        _ => {
            found.push(path);
            // `name as other`.
            let renamed = rest.trim_start().strip_prefix("as ");
            renamed.map_or(rest, |r| r.trim_start().trim_start_matches(|c: char| c.is_alphanumeric() || c == '_'))
        }
    }
}

/// What the crate's root re-exports, by name: `Error` -> `error::Error`.
fn root_names() -> BTreeMap<String, String> {
    let source = rooted("engine/lib.rs");
    let mut names = BTreeMap::new();
    for tail in source.split("\npub use ").skip(1) {
        let mut paths = Vec::new();
        unfold(tail, "", &mut paths);
        names.extend(paths.into_iter().map(|path| (path.rsplit("::").next().unwrap().to_owned(), path)));
    }
    assert!(names.contains_key("Error"));
    names
}

#[test]
fn use_trees_are_unfolded() {
    let source = "use crate::a::{self as x, b, c::{d, e},}; fn f() -> crate::g::H<u32> { crate::i::j() }";
    assert_eq!(crate_paths(source), ["a::self", "a::b", "a::c::d", "a::c::e", "g::H", "i::j"]);
    assert_eq!(crate_paths("use crate::{a, b::c};"), ["a", "b::c"]);
    assert_eq!(part("engine/stage/blend.rs"), "stage");
    assert_eq!(part("engine/error.rs"), "error");
}

#[test]
fn every_part_uses_what_architecture_md_lets_it_use_and_no_listed_arrow_is_idle() {
    let (allowed, root_names) = (allowed(), root_names());
    let mut faults = BTreeSet::new();
    let mut used = BTreeSet::new();
    let mut n_paths = 0;
    for file in sources("engine") {
        let part = part(&file);
        if part == "lib" {
            continue;
        }
        let Some(may) = allowed.get(part) else {
            faults.insert(format!("{file}: {DOCUMENT} has no row for `{part}`"));
            continue;
        };
        for path in crate_paths(&rooted(&file)) {
            n_paths += 1;
            let path = root_names.get(path.split("::").next().unwrap()).unwrap_or(&path);
            let reaches = |entry: &&String| path == *entry || path.starts_with(&format!("{entry}::"));
            match may.iter().find(reaches) {
                _ if reaches(&&part.to_owned()) => {}
                Some(entry) => {
                    used.insert((part.to_owned(), entry.clone()));
                }
                None => {
                    faults.insert(format!("{file}: `{part}` may not use `{path}`"));
                }
            }
        }
    }
    assert!(n_paths > 30, "only {n_paths} paths were found");
    let listed = allowed.iter().flat_map(|(part, may)| may.iter().map(|entry| (part.clone(), entry.clone())));
    faults.extend(
        listed.filter(|arrow| !used.contains(arrow)).map(|(part, entry)| format!("`{part}` does not use `{entry}`")),
    );
    assert_eq!(faults, BTreeSet::new(), "see the arrows in {DOCUMENT}");
}

#[test]
fn no_file_climbs_out_of_its_part_with_super() {
    for file in sources("engine").iter().filter(|file| !file.starts_with("engine/gpu/generated/")) {
        // Test modules at a file's end are one level deeper.
        let source = without_comments(&text(file));
        let source = source.split("#[cfg(test)]").next().unwrap();
        let is_top = file.matches('/').count() == 1 || file.ends_with("/mod.rs");
        let climb = if is_top { "super::" } else { "super::super::" };
        assert!(!source.contains(climb), "{file} has `{climb}`");
    }
}

/// The one exception: the test layer that lets Vulkan calls fail, which nothing ships.
const LAYER: &str = "tests/faults/layer.rs";

#[test]
fn vulkan_and_unsafe_code_stay_in_vk() {
    let mut owners = 0;
    for file in
        ["engine", "tools", "tests", "shaders-glsl"].into_iter().flat_map(sources).chain(["build.rs".to_owned()])
    {
        // This file has to name what it looks for, and a Vulkan layer is a C interface.
        if ["tests/repo/arrows.rs", LAYER].contains(&file.as_str()) {
            continue;
        }
        // A word of content security policies is no code.
        let source = without_comments(&text(&file)).replace("'unsafe-inline'", "");
        let speaks = words(&source).any(|word| word == "ash" || word == "unsafe");
        if file.starts_with("engine/vk/") {
            owners += usize::from(speaks);
        } else {
            assert!(!speaks, "{file} has `ash` or `unsafe`; only engine/vk and {LAYER} may");
        }
    }
    assert!(owners > 3, "only {owners} files of engine/vk speak Vulkan");
}
