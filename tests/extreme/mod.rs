//! Numerical extremes: a test for each row of `ivv_conformance`, where the cases are.

use crate::adversary::rounds_otherwise;
use crate::common::device::bench;
use crate::common::prelude::*;
use ivv_conformance::ROWS;

/// Rows that no test runs, and why.
pub const ELSEWHERE: &[(&str, &str)] =
    &[("n30", "it rebuilds the engine: the lane \"mutations\" of tools/test.sh --slow")];

/// What must be in a row's faults where each kernel has roundings of its own, so that they are no faults, and why.
const ROUNDED: &[(&str, &str, &str)] = &[
    ("n03", "away from the band is", "M d of a needle is a small difference of large products"),
    ("n07", "the gradient at opacity", "round Gaussians have no gradient of rotation, and what is left is noise"),
    ("n07", "forward and backward: added: ", "alpha within a bit of alpha_min: each kernel decides by its own exp2"),
    ("n08", "the gradient of opacity is off by", "transmittance is divided 2,300 times, each time 2 units off"),
    ("n12", ": other bits", "two kernels"),
];

/// Runs a row; its faults are the test's, and so is that no case ran. Cases that are left out are noted as skips.
fn run(name: &str, slow: bool) {
    let row = ROWS.iter().find(|row| row.name == name).expect("a row of that name");
    let tally = bench(slow, |bench| row.run(bench));
    tally.not_run.iter().for_each(|what| skip(format!("{name}: {what}")));
    let is_fault = |fault: &&str| {
        let mut excuses = ROUNDED.iter().filter(|(row, part, _)| *row == name && fault.contains(part));
        !excuses.any(|(row, _, why)| rounds_otherwise(&format!("{row}: {why}")))
    };
    let faults = tally.faults.iter().map(String::as_str).filter(is_fault).collect::<Vec<_>>().join("\n");
    assert!(tally.cases > 0 && faults.is_empty(), "{}: {} cases\n{faults}", row.what, tally.cases);
    assert!(!slow || tally.not_run.is_empty(), "{name}: the long test leaves out {:?}", tally.not_run);
}

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
