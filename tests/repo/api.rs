//! The size of the public API: names that engine/lib.rs exports, and methods of those types.

use super::{files, text};
use crate::common::prelude::*;

const MOST: usize = 250;

/// Names that `source` exports, outside `internals`, and the room of the engine that each is from.
fn exported(source: &str) -> BTreeMap<String, String> {
    let mut names = BTreeMap::new();
    for tail in source.split("pub use ").skip(1) {
        let Some((tree, _)) = tail.split_once(';') else { continue };
        let path = tree.trim_start_matches("crate::").trim_start_matches("internals::");
        let room = path.split("::").next().unwrap_or_default().to_owned();
        let (before, list) = path.split_once('{').unwrap_or((path, ""));
        let list = if list.is_empty() { before.rsplit("::").next().unwrap_or_default() } else { list };
        for name in list.trim_end().trim_end_matches('}').split(',') {
            let name = name.split(" as ").next().unwrap_or_default().rsplit("::").next().unwrap_or_default().trim();
            if !name.is_empty() {
                names.insert(name.to_owned(), room.clone());
            }
        }
    }
    names
}

/// Methods and constants of the types `names` that `source`, a file of `room`, documents.
fn methods(source: &str, room: &str, names: &BTreeMap<String, String>) -> Vec<String> {
    let mut found = Vec::new();
    let (mut of, mut is_hidden) = (None, false);
    for line in source.lines() {
        let code = line.trim_start();
        if let Some(head) = line.strip_prefix("impl").filter(|head| head.ends_with('{') && !head.contains(" for ")) {
            let head = head.split_once("> ").filter(|_| head.starts_with('<')).map_or(head, |(_, name)| name).trim();
            let name = head.split(['<', ' ']).next().unwrap_or_default();
            of = names.get(name).filter(|own| *own == room && !is_hidden).map(|_| name.to_owned());
        } else if line.starts_with('}') {
            of = None;
        } else if let Some(of) = &of
            && ["pub fn ", "pub const "].iter().any(|start| code.starts_with(start))
            && !is_hidden
        {
            found.push(format!("{of}: {code}"));
        }
        is_hidden = code == "#[doc(hidden)]";
    }
    found
}

/// Types `names` that `source`, a file of `room`, defines, with their fields, variants and methods, that have no comment.
fn undocumented(source: &str, room: &str, names: &BTreeMap<String, String>) -> Vec<String> {
    let is_shown = |name: &str| names.get(name).is_some_and(|own| own == room);
    let name_of =
        |head: &str| head.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default().to_owned();
    let mut found = Vec::new();
    let (mut has_comment, mut is_hidden) = (false, false);
    // The type that is open, and how the lines of its items begin.
    let mut of: Option<(String, &str)> = None;
    for line in source.lines() {
        let code = line.trim_start();
        has_comment |= code.starts_with("///");
        is_hidden |= code == "#[doc(hidden)]";
        if code.starts_with("///") || code.starts_with("#[") {
            continue;
        }
        let begins = [("pub struct ", "pub "), ("pub enum ", ""), ("impl ", "pub ")];
        if let Some((head, item)) = begins.iter().find_map(|(begin, item)| Some((line.strip_prefix(begin)?, *item))) {
            let name = name_of(head);
            let is_ours = is_shown(&name) && !is_hidden && !head.contains(" for ");
            if is_ours && !line.starts_with("impl ") && !has_comment {
                found.push(name.clone());
            }
            of = Some((name, item)).filter(|_| is_ours && line.ends_with('{'));
        } else if line.starts_with('}') {
            of = None;
        } else if let (Some((name, item)), Some(code)) = (&of, line.strip_prefix("    "))
            && (code.starts_with("pub ") || item.is_empty())
            && code.starts_with(|c: char| c.is_alphabetic())
            && !(has_comment || is_hidden)
        {
            found.push(format!("{name}: {code}"));
        }
        (has_comment, is_hidden) = (false, false);
    }
    found
}

/// The room of a file of the engine.
fn room(file: &str) -> String {
    file.trim_start_matches("engine/").split(['/', '.']).next().unwrap_or_default().to_owned()
}

fn sources() -> Vec<String> {
    let is_ours = |file: &String| file.ends_with(".rs") && !file.contains("/generated/");
    files("engine").into_iter().filter(is_ours).collect()
}

/// `missing_docs` does not see what the hidden `internals` define.
#[test]
fn all_of_the_public_api_has_comments() {
    let names = exported(&text("engine/lib.rs"));
    let found = sources().into_iter().flat_map(|file| undocumented(&text(&file), &room(&file), &names));
    assert_eq!(found.collect::<Vec<_>>(), Vec::<String>::new());
    let names = [("C".to_owned(), "a".to_owned())].into();
    let source = "/// C.\n#[derive(Clone)]\npub struct C {\n    pub a: u8,\n    /// B.\n    pub b: u8,\n    c: u8,\n}\n\
                  impl C {\n    #[doc(hidden)]\n    pub fn d() {}\n    pub fn e() {\n        pub_e();\n    }\n}\n";
    assert_eq!(undocumented(source, "a", &names), ["C: pub a: u8,", "C: pub fn e() {"]);
    assert_eq!(undocumented("pub enum C {\n    /// F.\n    F,\n    G,\n}\n", "a", &names), ["C", "C: G,"]);
}

#[test]
fn the_public_api_stays_small() {
    let names = exported(&text("engine/lib.rs"));
    assert!(names.contains_key("Renderer") && names.contains_key("Session"), "{names:?}");
    let methods: Vec<String> =
        sources().into_iter().flat_map(|file| methods(&text(&file), &room(&file), &names)).collect();
    let n = names.len() + methods.len();
    assert!(methods.len() > 50 && n <= MOST, "{n} public items, at most {MOST}:\n{names:?}\n{}", methods.join("\n"));
}

#[test]
fn exported_names_and_shown_methods_are_counted() {
    let names = exported("pub use internals::a::b::{C, D as E};\nmod f {\n    pub use crate::internals::g::h;\n}");
    let expected = [("C", "a"), ("D", "a"), ("h", "g")].map(|(name, room)| (name.to_owned(), room.to_owned()));
    assert_eq!(names, expected.into());
    let source = "impl<T> C<T> {\n    pub fn a() {}\n    #[doc(hidden)]\n    pub fn b() {}\n    fn c() {}\n}\nimpl X for C {\n    pub fn d() {}\n}\n\
                  #[doc(hidden)]\nimpl C {\n    pub fn e() {}\n}\n";
    assert_eq!(methods(source, "a", &names), ["C: pub fn a() {}"]);
    assert!(methods(source, "g", &names).is_empty());
}
