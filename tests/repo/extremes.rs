//! The list of mutants and the shipped reports against the table of numerical extremes.

use super::{files, text};
use ivv::extremes::ROWS;
use std::collections::BTreeSet;
use std::process::Command;

/// The mutants of `tools/mutants.sh`: name, file, sed expression, the row or the tests that must notice.
fn mutants() -> Vec<[String; 4]> {
    let script = text("tools/mutants.sh");
    let (_, list) = script.split_once("mutants='\n").unwrap();
    let (list, _) = list.split_once("\n'\n").unwrap();
    let mutant = |line: &str| {
        let (name, rest) = line.split_once('|').unwrap();
        let (file, rest) = rest.split_once('|').unwrap();
        let (expression, noticed_by) = rest.rsplit_once('|').unwrap();
        [name, file, expression, noticed_by].map(str::to_owned)
    };
    list.lines().map(mutant).collect()
}

#[test]
fn every_row_has_a_mutant_and_every_mutant_changes_its_file() {
    let mutants = mutants();
    for [name, file, expression, _] in &mutants {
        let path = super::root().join(file);
        let changed = Command::new("sed").arg(expression).arg(&path).output().unwrap();
        assert!(changed.status.success(), "{name}: {}", String::from_utf8_lossy(&changed.stderr));
        assert!(!changed.stdout.is_empty() && changed.stdout != text(file).into_bytes(), "{name} changes nothing");
        // The script splits at every bar.
        assert!(!expression.contains('|'), "{name}: a bar in the expression");
    }
    let noticed_by: BTreeSet<&str> = mutants.iter().map(|[.., noticed_by]| noticed_by.as_str()).collect();
    // The list itself is no fault.
    let rows = ROWS.iter().map(|row| row.name).filter(|name| *name != "n30");
    let without: Vec<&str> = rows.filter(|row| !noticed_by.contains(row)).collect();
    assert_eq!(without, Vec::<&str>::new(), "rows without a mutant");
    for row in [1, 2, 10, 27, 36, 42] {
        let begin = format!("row {row}, ");
        assert!(mutants.iter().any(|[name, ..]| name.starts_with(&begin)), "row {row} of `ivv extremes` has no mutant");
    }
}

#[test]
fn the_shipped_reports_are_of_this_table_and_no_row_failed() {
    let reports: Vec<String> = files("assets/extremes").into_iter().filter(|file| file.ends_with(".md")).collect();
    let mut lanes = BTreeSet::new();
    for file in &reports {
        let report = text(file);
        let of = |begin: &str| report.lines().find_map(|line| line.strip_prefix(begin)).unwrap_or_default();
        let driver = of("- device: ").split_whitespace().next().unwrap_or_default();
        let lane = of("- subgroups: ").split_whitespace().next().unwrap_or_default();
        lanes.insert(format!("{driver} {lane}"));
        for row in ROWS {
            // A bar would end a cell.
            assert!(![row.what, row.expected, row.bound].concat().contains('|'), "{}", row.name);
            let begin = format!("| {} | {} | {} | {} | ", row.name, row.what, row.expected, row.bound);
            let rest = report.lines().find_map(|line| line.strip_prefix(&begin));
            let rest = rest.unwrap_or_else(|| panic!("{file} has not this {}: `ivv extremes -o {file}`", row.name));
            let passed = rest.ends_with("| passed |") && !rest.starts_with("0 ");
            assert!(passed || rest == "0 | - | not run |", "{file}: {} {rest}", row.name);
        }
    }
    assert_eq!(lanes, BTreeSet::from(["SwiftShader 4", "llvmpipe 16", "llvmpipe 4", "llvmpipe 8"].map(str::to_owned)));
}
