//! What the repository promises about itself: who uses whom, the table of kernels, the documents, the barriers.

mod api;
mod arrows;
mod budgets;
mod docs;
mod extremes;
mod hazards;
mod kernels;
mod manual;
mod screen;
mod supply;

use crate::common::prelude::*;
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every file below `folder` (a path below the root), relative to the root and sorted; build output and git's own
/// folder left out.
fn files(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![root().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())).flatten() {
            let path = entry.path();
            let relative = below_root(&path);
            if ["target", "out", ".git"].contains(&relative.as_str()) {
                continue;
            }
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(relative);
            }
        }
    }
    assert!(!found.is_empty(), "{folder} is empty");
    found.sort();
    found
}

fn below_root(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().to_str().unwrap().replace('\\', "/")
}

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

fn exists(file: &str) -> bool {
    root().join(PathBuf::from(file)).exists()
}

/// `source` (Rust or GLSL) with each line cut at its `//`.
fn without_comments(source: &str) -> String {
    source.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

fn words(source: &str) -> impl Iterator<Item = &str> {
    source.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// The rows of the table between `<!-- NAME -->` and `<!-- end -->` of a document, without its two heading lines; each
/// row as its cells.
fn table(document: &str, name: &str) -> Vec<Vec<String>> {
    let rows = marked(document, name).1.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// A document in three: up to and with `<!-- NAME -->`, what is marked, and the rest from the next `<!-- end -->` on.
fn marked<'a>(document: &'a str, name: &str) -> (&'a str, &'a str, &'a str) {
    let begin = format!("<!-- {name} -->\n");
    let first = document.find(&begin).unwrap_or_else(|| panic!("no marker {name}")) + begin.len();
    let last = first + document[first..].find("<!-- end -->").unwrap_or_else(|| panic!("no end of {name}"));
    (&document[..first], &document[first..last], &document[last..])
}

fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}
