//! Numerical extremes: a test for each row of `ivv::extremes`, where the cases are.

use crate::common::device::bench;
use crate::common::notes::skip;
use ivv::extremes::{ROWS, Verdict};

/// Rows that no test runs, and why.
pub const ELSEWHERE: &[(&str, &str)] =
    &[("n30", "it rebuilds the engine: the lane \"mutations\" of tools/test.sh --slow")];

/// Runs a row; its faults are the test's, and so is that no case ran. Cases that are left out are noted as skips.
fn run(name: &str, slow: bool) {
    let row = ROWS.iter().find(|row| row.name == name).expect("a row of that name");
    let tally = bench(slow, |bench| row.run(bench));
    tally.not_run.iter().for_each(|what| skip(format!("{name}: {what}")));
    let faults = tally.faults.join("\n");
    assert!(tally.verdict() == Verdict::Passed, "{}: {} cases\n{faults}", row.what, tally.cases);
    assert!(!slow || tally.not_run.is_empty(), "{name}: the long test leaves out {:?}", tally.not_run);
}

/// A test for each row.
macro_rules! rows {
    ($($name:ident)*) => {
        const TESTED: &[&str] = &[$(stringify!($name)),*];

        $(
            #[test]
            fn $name() {
                run(stringify!($name), false);
            }
        )*
    };
}

rows! {
    n01 n02 n03 n04 n05 n06 n07 n08 n09 n10 n11 n12 n13 n14 n15 n16 n17 n18 n19 n20 n21 n22 n23 n24 n25 n26 n27 n28 n29
}

#[test]
#[ignore = "slow: pictures of 5312 x 2988 and 5568 x 4176"]
fn n18_with_its_long_cases() {
    run("n18", true);
}

#[test]
#[ignore = "slow: a million steps"]
fn n27_with_its_long_cases() {
    run("n27", true);
}

#[test]
fn every_row_has_a_test_or_runs_elsewhere() {
    let rows: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
    let elsewhere = ELSEWHERE.iter().map(|(row, _)| *row);
    assert_eq!(rows, TESTED.iter().copied().chain(elsewhere).collect::<Vec<_>>());
    assert!(ELSEWHERE.iter().all(|(_, why)| !why.is_empty()));
}
