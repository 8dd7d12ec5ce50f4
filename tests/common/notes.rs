//! What a test run must tell beside "passed": which tests, or cases of them, did not run and why, and which shipped
//! measurements are out of date.
//!
//! libtest hides what a passing test prints. Each note is a line of a file, which `tools/test.sh` empties before its lanes
//! and prints after them.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::panic::Location;
use std::path::{Path, PathBuf};

/// The file of notes. Lines of three cells, with tabs between them: the kind, the test, the reason.
pub fn file() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("test-notes.tsv")
}

/// Notes that this test, or a case of it, does not run.
#[track_caller]
pub fn skip(reason: impl Display) {
    note(&file(), "skipped", &reason.to_string(), Location::caller());
}

/// Notes that a shipped measurement was made with other kernels or settings than there are.
#[track_caller]
pub fn stale(what: impl Display) {
    note(&file(), "stale", &what.to_string(), Location::caller());
}

fn note(file: &Path, kind: &str, reason: &str, at: &Location) {
    let line = line(kind, &test(at), reason);
    eprint!("{line}");
    append(file, &line);
}

/// The running test: libtest gives its name to the thread. On a thread without one it is the place in the source.
fn test(at: &Location) -> String {
    match std::thread::current().name() {
        Some(name) if name != "main" => name.to_owned(),
        _ => format!("{}:{}", at.file(), at.line()),
    }
}

fn line(kind: &str, test: &str, reason: &str) -> String {
    let cell = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    format!("{}\t{}\t{}\n", cell(kind), cell(test), cell(reason))
}

/// One write to a file opened for appending: lines of tests that run at once do not mix.
fn append(file: &Path, line: &str) {
    let mut file = OpenOptions::new().create(true).append(true).open(file).expect("the file of notes can be written");
    file.write_all(line.as_bytes()).expect("the file of notes can be written");
}

/// A path below the data beside the checkout, which is no part of it. Where it is absent, a skip is noted.
#[track_caller]
pub fn shared(path: &str) -> Option<PathBuf> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    if !full.exists() {
        skip(format!("../shared/{path} is absent"));
        return None;
    }
    Some(full)
}

/// Ends the test, with a note, where one of these programs is absent.
macro_rules! needs {
    ($($program:literal),*) => {
        if ![$($program),*].into_iter().all(|program| crate::common::notes::has_program(program)) {
            return;
        }
    };
}
pub(crate) use needs;

/// Whether a program is there; notes a skip where it is not.
#[track_caller]
pub fn has_program(program: &str) -> bool {
    let argument = match program {
        "colmap" => "help",
        "ffmpeg" => "-version",
        _ => "--version",
    };
    let mut command = std::process::Command::new(program);
    let found = command.arg(argument).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).status();
    if found.is_err() {
        skip(format!("{program} is not installed"));
    }
    found.is_ok()
}

#[test]
fn a_note_has_the_tests_name_and_its_reason_and_is_added_to_those_before() {
    let file = std::env::temp_dir().join(format!("ivv-note-{}", std::process::id()));
    note(&file, "skipped", "no such\nprogram", Location::caller());
    note(&file, "stale", "a table", Location::caller());
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    let cells: Vec<Vec<&str>> = text.lines().map(|line| line.split('\t').collect()).collect();
    assert_eq!(cells.len(), 2, "{text}");
    // With one thread libtest runs tests in its own, which has no test's name.
    let name = "a_note_has_the_tests_name_and_its_reason_and_is_added_to_those_before";
    let is_told = |test: &str| test.ends_with(name) || test.starts_with("tests/common/notes.rs:");
    assert_eq!((cells[0][0], cells[0][2], is_told(cells[0][1])), ("skipped", "no such program", true), "{text}");
    assert_eq!((cells[1][0], cells[1][2], is_told(cells[1][1])), ("stale", "a table", true), "{text}");
}

#[test]
fn lines_of_many_threads_stay_whole_and_a_reason_of_many_lines_is_one() {
    let file = std::env::temp_dir().join(format!("ivv-note-lines-{}", std::process::id()));
    let reason = format!("first\nsecond\t{}", "x".repeat(300));
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let (file, reason) = (&file, &reason);
            scope.spawn(move || {
                (0..50).for_each(|_| append(file, &line("skipped", &format!("test-{thread}"), reason)));
            });
        }
    });
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert_eq!(text.lines().count(), 400);
    let end = format!("\tfirst second {}", "x".repeat(300));
    for line in text.lines() {
        let test = line.strip_prefix("skipped\ttest-").and_then(|rest| rest.strip_suffix(&end));
        assert!(test.is_some_and(|n| n.len() == 1), "{line}");
    }
}
