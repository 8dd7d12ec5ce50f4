//! `ivv profile --replay` and `--disassemble`: single kernels.

use crate::ui::screen::{out, print_json, print_table};
use crate::verbs::profile::kernels;
use ivv::internals::gpu::{Gpu, KernelInfo};
use ivv::internals::profile::{Replay, Replayed, read_dispatch};
use ivv::internals::words::count;
use rspirv::binary::Disassemble;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct ReplayArgs {
    /// Runs a dumped dispatch repeatedly.
    #[arg(long, conflicts_with_all = ["subject", "dump", "capture", "cameras", "list"])]
    pub replay: Option<PathBuf>,
    /// Kernels to run beside the dumped one, separated by commas: variants of its shader.
    #[arg(long, value_delimiter = ',', requires = "replay")]
    variant: Vec<String>,
    /// Runs of each kernel.
    #[arg(short, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    n: u32,
    /// Recompiles the kernel whenever a shader changes, and runs it beside the dumped one.
    #[cfg(feature = "shaders")]
    #[arg(long, requires = "replay")]
    watch: bool,
}

pub fn run(args: &ReplayArgs, file: &Path, gpu: &Gpu, json: bool) -> anyhow::Result<()> {
    let (dispatch, dumped) = read_dispatch(file)?;
    let mut variants = vec![dumped];
    for name in &args.variant {
        let kernel = kernels::named("--variant", name)?;
        if variants.iter().all(|other| other.name != kernel.name) {
            variants.push(kernel);
        }
    }
    let replay = Replay::new(gpu, &dispatch)?;
    let show = |kernels: &[&'static KernelInfo]| -> anyhow::Result<()> {
        let lines = replay.run(kernels, args.n as usize)?;
        if json {
            print_json(&lines)?;
        } else {
            print(&lines, args.n);
        }
        Ok(())
    };
    show(&variants)?;
    #[cfg(feature = "shaders")]
    if args.watch {
        crate::verbs::profile::shader_watch::watch(dumped, |edited| show(&[dumped, edited]))?;
    }
    Ok(())
}

fn print(lines: &[Replayed], n: u32) {
    let row = |line: &Replayed| {
        let Replayed { kernel, median_ns, mad_ns, ratio, from_first, from_dumped } = line;
        let times = [median_ns, mad_ns].map(|ns| format!("{:.4}", ns / 1e6));
        let off = [from_first.max_abs, from_first.max_rel, from_dumped.max_rel].map(|off| format!("{off:.3e}"));
        let words = [ratio.to_string(), from_first.words.to_string()];
        [vec![kernel.to_string()], times.to_vec(), words.to_vec(), off.to_vec()].concat()
    };
    let runs = format!("{} each, in turns", count(n, "run"));
    let heads = ["median, ms", "MAD, ms", "ratio (95 %)", "words off", "max abs", "max rel", "of dumped"];
    print_table(&[&[runs.as_str()][..], &heads].concat(), lines.iter().map(row));
}

pub fn disassemble(name: &str, json: bool) -> anyhow::Result<()> {
    let kernel = kernels::named("--disassemble", name)?;
    let module = rspirv::dr::load_bytes(kernel.spirv).map_err(|e| anyhow::anyhow!("{name}: {e}"))?;
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for instruction in module.all_inst_iter() {
        *counts.entry(instruction.class.opname).or_default() += 1;
    }
    if json {
        return print_json(&counts);
    }
    out!("{}", module.disassemble());
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    out!("; {} instructions of {}, {} bytes", counts.iter().map(|c| c.1).sum::<usize>(), name, kernel.spirv.len());
    for (name, n) in counts {
        out!("; {n:>6} Op{name}");
    }
    Ok(())
}
