//! Budgets: what the compilers of chips made of the kernels when it was last looked at, and what has changed since.

use super::statistics::{Statistics, gpu_runs};
use ivv::internals::files::{cannot_read, read_file};
use ivv::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// Numbers of a kernel, in the order of the table's columns.
const NUMBERS: [&str; 6] = ["registers", "spills", "scratch", "waves", "instructions", "latency"];
const WAVES: usize = 3;
const INSTRUCTIONS: usize = 4;

/// Kernel x chip. A chip is written `navi31/32`: with the lanes of its subgroups.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Budgets {
    drivers: BTreeMap<String, String>,
    /// By kernel and chip; `None` where the driver does not tell.
    rows: BTreeMap<(String, String), [Option<f64>; NUMBERS.len()]>,
}

/// A number that is not what it was, or a kernel that has come or gone.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    pub told: String,
    /// True if it got worse: fewer waves, more of anything else, or a kernel that is gone.
    pub is_worse: bool,
}

fn cell(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

impl Budgets {
    /// Of what was compiled, by chip. Kernels that no GPU runs are left out.
    pub fn of<'a>(compiled: impl IntoIterator<Item = (&'a str, &'a Statistics)>) -> Self {
        let mut budgets = Budgets::default();
        for (chip, statistics) in compiled {
            budgets.drivers.insert(chip.to_owned(), statistics.driver.clone());
            for one in statistics.kernels.iter().filter(|one| gpu_runs(&one.kernel, one.subgroup)) {
                let whole = [one.registers, one.spills, one.scratch_bytes, None, one.instructions, one.latency];
                let mut numbers = whole.map(|value| value.map(|value| value as f64));
                numbers[WAVES] = one.waves;
                budgets.rows.insert((one.kernel.clone(), chip.to_owned()), numbers);
            }
        }
        budgets
    }

    /// `file` is for messages.
    pub fn parse(file: &Path, text: &str) -> Result<Self> {
        let mut budgets = Budgets::default();
        for (line, number) in text.lines().zip(1..) {
            let fault = |why: &str| {
                Error::data(file, format!("line {number}"), why, "make it anew: IVV_BLESS=1 tools/test.sh --budgets")
            };
            let cells: Vec<&str> = line.split('\t').collect();
            match cells.as_slice() {
                ["# driver", chip, driver] => drop(budgets.drivers.insert((*chip).to_owned(), (*driver).to_owned())),
                ["kernel", ..] => {}
                [kernel, chip, rest @ ..] if rest.len() == NUMBERS.len() => {
                    let mut numbers = [None; NUMBERS.len()];
                    for (number, cell) in numbers.iter_mut().zip(rest) {
                        if *cell != "-" {
                            *number = Some(cell.parse().map_err(|_| fault("a cell is neither a number nor -"))?);
                        }
                    }
                    budgets.rows.insert(((*kernel).to_owned(), (*chip).to_owned()), numbers);
                }
                _ => return Err(fault("there are not as many cells as columns")),
            }
        }
        Ok(budgets)
    }

    /// Reads the folder that `tools/gpu/statistics.sh` wrote: a file `CHIP-LANES.json` for each chip.
    pub fn read_folder(folder: &Path) -> Result<Self> {
        let fault = |path: &Path, reason: String| {
            Error::data(path, "", reason, "give a folder that tools/gpu/statistics.sh wrote")
        };
        let listed = std::fs::read_dir(folder).map_err(|e| fault(folder, format!("cannot be listed: {e}")))?;
        let mut compiled = Vec::new();
        for path in
            listed.flatten().map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|e| e == "json"))
        {
            let chip = path.file_stem().unwrap_or_default().to_string_lossy().replacen('-', "/", 1);
            let bytes = read_file(&path).map_err(|e| cannot_read(&path, &e))?;
            let read = serde_json::from_slice::<Statistics>(&bytes);
            compiled.push((chip, read.map_err(|e| fault(&path, format!("expected statistics: {e}")))?));
        }
        if compiled.is_empty() {
            return Err(fault(folder, "holds no statistics".to_owned()));
        }
        Ok(Budgets::of(compiled.iter().map(|(chip, statistics)| (chip.as_str(), statistics))))
    }

    pub fn chips(&self) -> usize {
        self.drivers.len()
    }

    pub fn driver(&self, chip: &str) -> Option<&str> {
        self.drivers.get(chip).map(String::as_str)
    }

    pub fn instructions(&self, kernel: &str, chip: &str) -> Option<f64> {
        *self.rows.get(&(kernel.to_owned(), chip.to_owned()))?.get(INSTRUCTIONS)?
    }

    /// The table, tab separated, behind a line for each chip's driver.
    pub fn text(&self) -> String {
        let driver = |(chip, driver): (&String, &String)| format!("# driver\t{chip}\t{driver}\n");
        let mut text: String = self.drivers.iter().map(driver).collect();
        text += &format!("kernel\tchip\t{}\n", NUMBERS.join("\t"));
        for ((kernel, chip), numbers) in &self.rows {
            text += &format!("{kernel}\t{chip}\t{}\n", numbers.map(cell).join("\t"));
        }
        text
    }

    /// Chips of this table that another driver compiled for in `now`: their numbers cannot be compared. Each with both drivers.
    pub fn other_drivers<'a>(&'a self, now: &'a Budgets) -> Vec<(&'a str, [&'a str; 2])> {
        let other = |(chip, driver): (&'a String, &'a String)| {
            let found = now.drivers.get(chip)?;
            (found != driver).then_some((chip.as_str(), [driver.as_str(), found.as_str()]))
        };
        self.drivers.iter().filter_map(other).collect()
    }

    /// The differences of chips whose driver is the same in both.
    pub fn compare(&self, now: &Budgets) -> Vec<Drift> {
        let same = |chip: &String| match (self.drivers.get(chip), now.drivers.get(chip)) {
            (Some(before), Some(now)) => before == now,
            // A chip that the table lacks is new; one that was not compiled for tells nothing.
            (before, _) => before.is_none(),
        };
        let mut changes = Vec::new();
        let mut add = |told: String, is_worse: bool| changes.push(Drift { told, is_worse });
        for (of, before) in self.rows.iter().filter(|(of, _)| same(&of.1)) {
            let (kernel, chip) = of;
            let Some(numbers) = now.rows.get(of) else {
                add(format!("{kernel} on {chip} is no longer compiled"), true);
                continue;
            };
            for (at, name) in NUMBERS.into_iter().enumerate().filter(|(at, _)| before[*at] != numbers[*at]) {
                let is_worse = match (before[at], numbers[at]) {
                    (Some(before), Some(now)) => (now > before) != (at == WAVES),
                    (before, _) => before.is_some(),
                };
                let judged = if is_worse { "worse" } else { "better" };
                let values = format!("{} -> {}", cell(before[at]), cell(numbers[at]));
                add(format!("{kernel} on {chip}: {name} {values}, {judged}"), is_worse);
            }
        }
        let is_new = |of: &&(String, String)| same(&of.1) && !self.rows.contains_key(of);
        now.rows.keys().filter(is_new).for_each(|(kernel, chip)| add(format!("{kernel} on {chip} is new"), false));
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "# driver\tnavi31/32\tradv 25\nkernel\tchip\tregisters\tspills\tscratch\twaves\tinstructions\tlatency\n\
                         blend_fwd_p4\tnavi31/32\t96\t0\t0\t16\t714\t9631\ncull_static\tnavi31/32\t24\t0\t0\t16\t90\t-\n";

    fn table(text: &str) -> Budgets {
        Budgets::parse(Path::new("budgets.tsv"), text).unwrap()
    }

    #[test]
    fn a_table_is_read_as_it_is_written() {
        assert_eq!(table(TABLE).text(), TABLE);
        for (bad, told) in [("a\tb\t1\n", "cells"), ("a\tb\t1\t2\t3\t4\t5\tx\n", "number")] {
            let error = Budgets::parse(Path::new("budgets.tsv"), bad).unwrap_err();
            assert!(error.to_string().contains("line 1") && error.to_string().contains(told), "{error}");
        }
    }

    #[test]
    fn fewer_waves_and_more_of_all_else_are_worse() {
        let told = |from: &str, to: &str| {
            let changes = table(TABLE).compare(&table(&TABLE.replace(from, to)));
            changes.into_iter().map(|change| change.told).collect::<Vec<_>>().join("; ")
        };
        assert_eq!(told("96", "96"), "");
        assert_eq!(told("\t96\t", "\t97\t"), "blend_fwd_p4 on navi31/32: registers 96 -> 97, worse");
        assert_eq!(told("\t16\t714", "\t12\t714"), "blend_fwd_p4 on navi31/32: waves 16 -> 12, worse");
        assert_eq!(told("\t9631", "\t9000"), "blend_fwd_p4 on navi31/32: latency 9631 -> 9000, better");
        assert_eq!(told("\t90\t-", "\t90\t7"), "cull_static on navi31/32: latency - -> 7, better");
        assert_eq!(
            told("cull_static", "cull_dynamic"),
            "cull_static on navi31/32 is no longer compiled; cull_dynamic on navi31/32 is new"
        );
    }

    #[test]
    fn another_driver_is_told_and_not_compared() {
        let (before, now) = (table(TABLE), table(&TABLE.replace("radv 25", "radv 26").replace("96", "99")));
        assert_eq!(before.compare(&now), []);
        assert_eq!(before.other_drivers(&now), [("navi31/32", ["radv 25", "radv 26"])]);
        // A chip that the table lacks.
        assert_eq!(Budgets::default().compare(&now).len(), 2);
        // A chip that was not compiled for.
        assert_eq!(before.compare(&Budgets::default()), []);
    }
}
