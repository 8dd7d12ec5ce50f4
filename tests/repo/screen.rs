//! All output goes through one screen.

use super::{files, text, without_comments};

/// The files below `folders` whose code prints by itself.
fn printers(folders: &[&str]) -> Vec<String> {
    let sources = folders.iter().flat_map(|folder| files(folder)).filter(|file| file.ends_with(".rs"));
    let prints = |file: &String| {
        let source = without_comments(&text(file));
        ["println!", "eprintln!", "print!", "eprint!", "dbg!"]
            .iter()
            .any(|name| source.match_indices(name).any(|(at, _)| !source[..at].ends_with(char::is_alphanumeric)))
    };
    sources.filter(prints).collect()
}

#[test]
fn nothing_prints_past_the_screen() {
    // They panic where nobody reads.
    assert_eq!(printers(&["tools", "engine"]), Vec::<String>::new());
    assert!(printers(&["tests"]).len() > 3, "they are found where they are");
    let direct = |file: &String| text(file).contains("io::stdout()") || text(file).contains("io::stderr()");
    let writers: Vec<String> = files("tools").into_iter().filter(|file| file.ends_with(".rs")).filter(direct).collect();
    assert_eq!(writers, ["tools/screen.rs"]);
}
