//! Files and functions that can be read at once.

use super::{files, text};

const LONGEST_FILE: usize = 500;
const LONGEST_FUNCTION: usize = 80;

/// Functions longer than allowed, as `name (lines)`. A function ends at the brace that is indented as it is.
fn long_functions(source: &str) -> Vec<String> {
    let lines: Vec<&str> = source.lines().collect();
    let mut long = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let before = code.split("fn ").next().unwrap_or("");
        // Visibilities too, as `pub(in crate::gpu)`, and `extern "C"`.
        let is_prefix = |word: &str| word.chars().all(|c| c.is_ascii_lowercase() || "(:_)\"C".contains(c));
        if !code.contains("fn ") || code.starts_with("//") || !before.split_whitespace().all(is_prefix) {
            continue;
        }
        let end = format!("{}}}", &line[..line.len() - code.len()]);
        let n = lines[first..].iter().position(|line| *line == end).map_or(1, |at| at + 1);
        if n > LONGEST_FUNCTION && !code.ends_with('}') && !code.ends_with(';') {
            let name = code[before.len()..].trim_start_matches("fn ").split(['(', '<']).next().unwrap_or("");
            long.push(format!("{name} ({n} lines)"));
        }
    }
    long
}

#[test]
fn no_file_and_no_function_is_too_long_to_be_read_at_once() {
    let mut long = Vec::new();
    let mut n_files = 0;
    for file in ["engine", "tools", "tests", "shaders-glsl"].into_iter().flat_map(files) {
        if !file.ends_with(".rs") || file.contains("/generated/") {
            continue;
        }
        let source = text(&file);
        let n = source.lines().count();
        if n > LONGEST_FILE {
            long.push(format!("{file} ({n} lines)"));
        }
        long.extend(long_functions(&source).into_iter().map(|function| format!("{file}: {function}")));
        n_files += 1;
    }
    assert!(n_files > 300, "only {n_files} files were looked at");
    assert!(long.is_empty(), "longer than {LONGEST_FILE} lines a file or {LONGEST_FUNCTION} a function: {long:#?}");
}

#[test]
fn a_long_function_is_found() {
    for before in ["", "pub(super) ", "pub(in crate::gpu) ", "pub extern \"C\" "] {
        let body = |n: usize| "        z();\n".repeat(n);
        let long = |n: usize| format!("impl X {{\n    {before}fn y() {{\n{}    }}\n}}\n", body(n));
        assert_eq!(long_functions(&long(LONGEST_FUNCTION - 1)), ["y (81 lines)"], "{before}");
        assert!(long_functions(&long(LONGEST_FUNCTION - 2)).is_empty(), "{before}");
    }
}
