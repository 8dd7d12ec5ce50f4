//! All output goes through one screen.

use super::{files, text, without_comments};

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
    // They panic where nobody reads. An example shows the library, and is short; tests have a reader.
    let may_print = |file: &String| file.starts_with("tools/examples/") || file.starts_with("tools/play/tests/");
    let of_ours = printers(&["tools", "engine"]).into_iter().filter(|file| !may_print(file));
    assert_eq!(of_ours.collect::<Vec<_>>(), Vec::<String>::new());
    assert!(printers(&["tests"]).len() > 3, "they are found where they are");
    let direct = |file: &String| text(file).contains("io::stdout()") || text(file).contains("io::stderr()");
    let sources = files("tools").into_iter().filter(|file| file.ends_with(".rs") && !may_print(file));
    let writers: Vec<String> = sources.filter(direct).collect();
    // The main of the player only asks whether standard error is a terminal.
    let known = "tools/gpu/main.rs tools/play/main.rs tools/play/screen.rs tools/ui/screen.rs tools/ui/stderr.rs";
    assert_eq!(writers.join(" "), known);
}

/// The lines of code below `folder` that cite a specification which no user has; comments of the code may.
fn citations(folder: &str, help: bool) -> Vec<String> {
    let cites = |line: &str| line.split("SPEC ").skip(1).any(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let told = |line: &&str| help || !line.trim_start().starts_with("//");
    let of = |file: String| {
        let source = text(&file);
        source.lines().filter(told).filter(|line| cites(line)).map(|line| format!("{file}: {line}")).collect::<Vec<_>>()
    };
    files(folder).into_iter().filter(|file| file.ends_with(".rs")).flat_map(of).collect()
}

#[test]
fn no_user_is_sent_to_a_specification_that_is_not_here() {
    // The help is made of the comments of the tools.
    assert_eq!([citations("tools", true), citations("engine", false)].concat(), Vec::<String>::new());
    assert!(!text("README.md").contains("SPEC"));
    assert!(!citations("engine", true).is_empty(), "they are found where they are");
}
