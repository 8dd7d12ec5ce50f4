//! Numerical extremes: a test for each row of `ivv::extremes`, where the cases are.

use crate::common::device::bench;
use ivv::extremes::{ROWS, Verdict};

/// Runs a row; its faults are the test's.
fn run(name: &str) {
    let row = ROWS.iter().find(|row| row.name == name).expect("a row of that name");
    let tally = bench(|bench| row.run(bench));
    tally.not_run.iter().for_each(|reason| eprintln!("skipped: {reason}"));
    let faults = tally.faults.join("\n");
    assert!(tally.verdict() != Verdict::Failed, "{}: {} cases\n{faults}", row.what, tally.cases);
}

/// A test for each row.
macro_rules! rows {
    ($($name:ident)*) => {
        const TESTED: &[&str] = &[$(stringify!($name)),*];

        $(
            #[test]
            fn $name() {
                run(stringify!($name));
            }
        )*
    };
}

rows! {
    n01 n02 n03 n04 n05 n06 n07 n08 n09 n10 n11 n12 n13 n14 n15 n16 n17 n18 n19 n20 n21 n22 n23 n24 n25 n26 n27 n28 n29 n30
}

#[test]
fn every_row_has_a_test() {
    let rows: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
    assert_eq!(rows, TESTED);
}
