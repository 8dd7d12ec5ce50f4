//! What compilers of GPUs make of the kernels, against what they made of them before.

use super::{root, text};
use crate::common::notes;
use ivv::profile::{Budgets, Statistics};
use std::path::Path;

const TABLE: &str = "assets/gpu/budgets.tsv";

/// What `tools/gpu/statistics.sh` wrote into `folder`: a file for each chip, named `CHIP-LANES.json`.
fn compiled(folder: &Path) -> Vec<(String, Statistics)> {
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut found: Vec<(String, Statistics)> = files
        .filter(|file| file.extension().is_some_and(|ending| ending == "json"))
        .map(|file| {
            let chip = file.file_stem().unwrap().to_str().unwrap().replacen('-', "/", 1);
            let read = serde_json::from_slice(&std::fs::read(&file).unwrap());
            (chip, read.unwrap_or_else(|fault| panic!("{}: {fault}", file.display())))
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    found
}

#[test]
#[ignore = "slow: compiles all kernels for eleven chips; tools/test.sh --budgets runs it"]
fn no_kernel_is_worse_than_its_budget() {
    let Some(folder) = std::env::var_os("IVV_BUDGETS") else {
        notes::skip("the statistics of offline drivers are not there; tools/test.sh --budgets makes them");
        return;
    };
    let compiled = compiled(Path::new(&folder));
    assert!(compiled.len() > 5, "{} chips only", compiled.len());
    let now = Budgets::of(compiled.iter().map(|(chip, statistics)| (chip.as_str(), statistics)));
    if std::env::var_os("IVV_BLESS").is_some() {
        std::fs::write(root().join(TABLE), now.text()).unwrap();
    }
    let before = Budgets::parse(Path::new(TABLE), &text(TABLE)).unwrap();
    for (chip, [then, is]) in before.other_drivers(&now) {
        notes::skip(format!("{chip}: the budgets are of {then}, compiled was with {is}"));
    }
    let changes = before.compare(&now);
    changes.iter().for_each(|change| println!("{change}"));
    assert!(changes.iter().all(|change| !change.is_worse), "kernels got worse: see above");
    assert!(changes.is_empty(), "kernels got better or are new: IVV_BLESS=1 tools/test.sh --budgets keeps that");
    // A table that promises one register less must not be met.
    let tighter = now.text().replacen("\t96\t", "\t95\t", 1);
    let tighter = Budgets::parse(Path::new(TABLE), &tighter).unwrap();
    assert!(tighter.compare(&now).iter().any(|change| change.is_worse), "the comparison notices nothing");
}
