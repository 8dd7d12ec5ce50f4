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

#[test]
fn the_public_api_stays_small() {
    let names = exported(&text("engine/lib.rs"));
    assert!(names.contains_key("Renderer") && names.contains_key("Session"), "{names:?}");
    let sources = files("engine").into_iter().filter(|file| file.ends_with(".rs") && !file.contains("/generated/"));
    let of_file = |file: String| {
        let room = file.trim_start_matches("engine/").split(['/', '.']).next().unwrap_or_default().to_owned();
        methods(&text(&file), &room, &names)
    };
    let methods: Vec<String> = sources.flat_map(of_file).collect();
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
