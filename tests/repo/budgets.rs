//! What compilers of GPUs make of the kernels, against what they made of them before.

use super::{root, text};
use crate::common::notes;
use crate::common::prelude::*;
use ivv_gpu_model::Budgets;

const TABLE: &str = "assets/gpu/budgets.tsv";

#[test]
#[ignore = "slow: compiles all kernels for each chip and width; tools/test.sh --budgets runs it"]
fn no_kernel_is_worse_than_its_budget() {
    let Some(folder) = std::env::var_os("IVV_BUDGETS") else {
        notes::skip("the statistics of offline drivers are not there; tools/test.sh --budgets makes them");
        return;
    };
    let now = Budgets::read_folder(Path::new(&folder)).unwrap();
    assert!(now.chips() > 5, "{} chips only", now.chips());
    if std::env::var_os("IVV_BLESS").is_some() {
        std::fs::write(root().join(TABLE), now.text()).unwrap();
    }
    let before = Budgets::parse(Path::new(TABLE), &text(TABLE)).unwrap();
    for (chip, [then, is]) in before.other_drivers(&now) {
        notes::skip(format!("{chip}: the budgets are of {then}, compiled was with {is}"));
    }
    let changes = before.compare(&now);
    changes.iter().for_each(|change| println!("{}", change.told));
    assert!(changes.iter().all(|change| !change.is_worse), "kernels got worse: see above");
    assert!(changes.is_empty(), "kernels got better or are new: IVV_BLESS=1 tools/test.sh --budgets keeps that");
    // A table that promises one register less must not be met.
    let tighter = now.text().replacen("\t96\t", "\t95\t", 1);
    let tighter = Budgets::parse(Path::new(TABLE), &tighter).unwrap();
    assert!(tighter.compare(&now).iter().any(|change| change.is_worse), "the comparison notices nothing");
}
