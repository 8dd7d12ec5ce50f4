//! What compilers of GPUs make of the kernels, against what they made of them before.

use super::{root, text};
use crate::common::notes;
use ivv_gpu_model::Budgets;
use std::path::Path;

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
    changes.iter().for_each(|change| println!("{change}"));
    assert!(changes.iter().all(|change| !change.is_worse), "kernels got worse: see above");
    assert!(changes.is_empty(), "kernels got better or are new: IVV_BLESS=1 tools/test.sh --budgets keeps that");
    // A table that promises one register less must not be met.
    let tighter = now.text().replacen("\t96\t", "\t95\t", 1);
    let tighter = Budgets::parse(Path::new(TABLE), &tighter).unwrap();
    assert!(tighter.compare(&now).iter().any(|change| change.is_worse), "the comparison notices nothing");
}

/// Kernels of the table that miss the goal of waves at the width chosen, or keep memory of a lane's own.
fn crowded(table: &str) -> std::collections::BTreeSet<String> {
    let rows =
        table.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| line.split('\t').collect::<Vec<_>>());
    rows.filter_map(|row| {
        let [kernel, chip, _, spills, scratch, waves, ..] = row[..] else { panic!("a row of another shape: {row:?}") };
        let goal = match chip {
            "GA100/32" | "GA102/32" | "TU102/32" => 16.0,
            "vega10/64" => 6.0,
            _ if chip.ends_with("/32") => 8.0,
            // RDNA runs them with 32 lanes.
            _ => return None,
        };
        let is_kept = [spills, scratch].iter().any(|n| !matches!(*n, "0" | "-"));
        (is_kept || waves.parse::<f64>().unwrap() < goal).then(|| kernel.to_owned())
    })
    .collect()
}

#[test]
fn kernels_with_few_waves_are_explained() {
    let document = text("assets/gpu/README.md");
    let (_, section) = document.split_once("\n## Where waves are few\n").expect("the section");
    let (section, _) = section.split_once("\n## ").expect("a section behind it");
    // The first cell of a row: names, in which a star stands for any letters.
    let cells = section.lines().filter_map(|line| line.strip_prefix("| `")?.split(" | ").next());
    let patterns: Vec<&str> = cells.flat_map(|cell| cell.split(", ")).map(|name| name.trim_matches('`')).collect();
    let is_of = |kernel: &str, pattern: &str| match pattern.split_once('*') {
        None => kernel == pattern,
        Some((first, last)) => kernel.strip_prefix(first).is_some_and(|rest| rest.ends_with(last)),
    };
    let crowded = crowded(&text(TABLE));
    let unexplained: Vec<&String> =
        crowded.iter().filter(|kernel| !patterns.iter().any(|p| is_of(kernel, p))).collect();
    assert!(unexplained.is_empty(), "few waves, and assets/gpu/README.md does not say why: {unexplained:?}");
    let idle: Vec<&&str> = patterns.iter().filter(|p| !crowded.iter().any(|kernel| is_of(kernel, p))).collect();
    assert!(idle.is_empty() && patterns.len() > 10, "assets/gpu/README.md explains what is as it should be: {idle:?}");
}
