//! The list of mutants and the shipped reports against the table of numerical extremes.

use super::{files, text};
use crate::common::prelude::*;
use crate::extreme::ELSEWHERE;
use ivv_conformance::ROWS;

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
    // What runs elsewhere is this list.
    let is_elsewhere = |row: &str| ELSEWHERE.iter().any(|(name, _)| *name == row);
    let rows = ROWS.iter().map(|row| row.name).filter(|name| !is_elsewhere(name));
    let without: Vec<&str> = rows.filter(|row| !noticed_by.contains(row)).collect();
    assert_eq!(without, Vec::<&str>::new(), "rows without a mutant");
    for row in [1, 2, 10, 27, 36, 42] {
        let begin = format!("row {row}, ");
        assert!(
            mutants.iter().any(|[name, ..]| name.starts_with(&begin)),
            "row {row} of `ivv-conformance` has no mutant"
        );
    }
}

/// What a shipped report may leave out besides [`ELSEWHERE`]: cases of a row whose others ran. They take minutes on a CPU, and
/// the long tests run them.
const LEFT_OUT: [(&str, &str); 2] =
    [("n18", "5312 x 2988 and 5568 x 4176: minutes on a CPU"), ("n27", "a drift of a million steps: minutes on a CPU")];

/// What is wrong with a shipped report: rows that are missing, failed or did not run though they should, and cases left out
/// that need not be.
fn faults_of(report: &str) -> Vec<String> {
    let mut faults = Vec::new();
    let (mut n_passed, mut n_cases) = (0, 0);
    for row in ROWS {
        let begin = format!("| {} | {} | {} | {} | ", row.name, row.what, row.expected, row.bound);
        let Some(rest) = report.lines().find_map(|line| line.strip_prefix(&begin)) else {
            faults.push(format!("{}: the report has it not, or in other words", row.name));
            continue;
        };
        let cases: u64 = rest.split(' ').next().and_then(|n| n.parse().ok()).unwrap_or(0);
        n_cases += cases;
        if ELSEWHERE.iter().any(|(name, _)| *name == row.name) {
            if rest != "0 | - | not run |" {
                faults.push(format!("{}: a report cannot run it, and this one says: {rest}", row.name));
            }
            continue;
        }
        n_passed += 1;
        if !rest.ends_with("| passed |") || cases == 0 {
            faults.push(format!("{}: it should have passed, and says: {rest}", row.name));
        }
    }
    for line in report.lines().filter(|line| line.contains(": not run: ")) {
        let (name, reason) = line.trim_start_matches("- ").split_once(": not run: ").expect("a name and a reason");
        let may = LEFT_OUT.iter().any(|(row, cases)| *row == name && reason.starts_with(cases));
        if !may && !ELSEWHERE.iter().any(|(row, _)| *row == name) {
            faults.push(format!("{name}: it leaves out {reason}"));
        }
    }
    let total = format!("**{n_passed} rows passed, 0 failed, {} did not run; {n_cases} cases**", ELSEWHERE.len());
    if !report.contains(&total) {
        faults.push(format!("its sum is not {total}"));
    }
    faults
}

#[test]
fn the_shipped_reports_are_of_this_table_and_every_row_ran_and_passed() {
    let reports: Vec<String> = files("assets/extremes").into_iter().filter(|file| file.ends_with(".md")).collect();
    let mut lanes = BTreeSet::new();
    for file in &reports {
        let report = text(file);
        let of = |begin: &str| report.lines().find_map(|line| line.strip_prefix(begin)).unwrap_or_default();
        let driver = of("- device: ").split_whitespace().next().unwrap_or_default();
        let lane = of("- subgroups: ").split_whitespace().next().unwrap_or_default();
        lanes.insert(format!("{driver} {lane}"));
        let faults = faults_of(&report);
        assert!(
            faults.is_empty(),
            "{file}: {faults:#?}\nmake it anew with: cargo run --release -p ivv-conformance -- --validation -o {file}"
        );
    }
    assert_eq!(lanes, BTreeSet::from(["SwiftShader 4", "llvmpipe 16", "llvmpipe 4", "llvmpipe 8"].map(str::to_owned)));
    // A bar would end a cell.
    for row in ROWS {
        assert!(![row.what, row.expected, row.bound].concat().contains('|'), "{}", row.name);
    }
}

#[test]
fn a_report_whose_rows_did_not_run_or_leave_out_cases_has_faults() {
    let report = text("assets/extremes/lavapipe-8.md");
    let row = ROWS.iter().find(|row| row.name == "n07").unwrap();
    let begin = format!("| {} | {} | {} | {} | ", row.name, row.what, row.expected, row.bound);
    let line = report.lines().find(|line| line.starts_with(&begin)).unwrap();
    let with = |rest: &str| faults_of(&report.replace(line, &format!("{begin}{rest}")));
    assert!(with("0 | - | not run |").iter().any(|fault| fault.starts_with("n07: ")));
    assert!(with("0 | - | passed |").iter().any(|fault| fault.starts_with("n07: ")));
    assert!(with("3 | - | FAILED |").iter().any(|fault| fault.starts_with("n07: ")));
    assert!(faults_of(&report.replace(line, "")).iter().any(|fault| fault.starts_with("n07: ")));
    let more = format!("{report}- n07: not run: the device is small\n");
    assert_eq!(faults_of(&more), ["n07: it leaves out the device is small"]);
    let n30 = report.lines().find(|line| line.starts_with("| n30 |")).unwrap();
    let claimed = report.replace(n30, &n30.replace("0 | - | not run |", "9 | - | passed |"));
    assert!(faults_of(&claimed).iter().any(|fault| fault.starts_with("n30: ")));
    // None ran, which once was no fault.
    let none: Vec<String> = report
        .lines()
        .map(|line| match ROWS.iter().find(|row| line.starts_with(&format!("| {} | ", row.name))) {
            Some(row) => {
                format!("| {} | {} | {} | {} | 0 | - | not run |", row.name, row.what, row.expected, row.bound)
            }
            None => line.to_owned(),
        })
        .collect();
    assert!(faults_of(&none.join("\n")).len() >= ROWS.len() - ELSEWHERE.len());
}
