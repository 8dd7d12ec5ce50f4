//! `ivv-gpu-model`: what compilers make of the kernels, and what a step would take on a card that is not here.

mod step;

use anyhow::Context;
use clap::{Parser, Subcommand};
use ivv::internals::gpu::{KernelInfo, generated, kernel_named};
use ivv::internals::vk::{Compiler, DeviceChoice};
use ivv_gpu_model::Statistics;
use std::io::Write;
use std::process::ExitCode;

/// GPUs that are not here: what their compilers make of the kernels, and what a step would take on them.
#[derive(Parser)]
#[command(name = "ivv-gpu-model", version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    /// The device: an index or part of a name from `ivv devices`.
    #[arg(long, global = true)]
    device: Option<String>,
    /// Writes results as JSON on standard output.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// Prints what the compiler of the device makes of kernels: registers, spills, instructions, waves. Runs nothing.
    Statistics(StatisticsArgs),
    /// Estimates what a step would take on cards. The device only holds the buffers of a recording; nothing runs on it.
    Estimate(step::Args),
}

#[derive(clap::Args)]
struct StatisticsArgs {
    /// The kernels; by default all.
    kernels: Vec<String>,
    /// The chip that waves are counted for, such as GA100, where the device's name does not tell it.
    #[arg(long)]
    chip: Option<String>,
    /// Lanes of the subgroups that kernels are compiled for, where the device takes several.
    #[arg(long, value_name = "LANES")]
    subgroup_size: Option<u32>,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = match &cli.verb {
        Verb::Statistics(args) => statistics(args, &cli),
        Verb::Estimate(args) => {
            step::run(args, &DeviceChoice { device: cli.device.clone(), ..DeviceChoice::default() }, cli.json)
        }
    };
    let Err(error) = done else { return ExitCode::SUCCESS };
    message(&format!("ivv-gpu-model: {error:#}"));
    ExitCode::from(error.downcast_ref().map_or(2, ivv::Error::exit_code))
}

/// Writes a line to standard error, which never ends the work where nobody reads it.
pub fn message(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

fn out(line: &str) -> anyhow::Result<()> {
    writeln!(std::io::stdout(), "{line}").context("standard output cannot be written")
}

fn named(name: &str) -> anyhow::Result<&'static KernelInfo> {
    kernel_named(name).with_context(|| format!("{name}: there is no such kernel (`ivv profile --list` lists all)"))
}

fn statistics(args: &StatisticsArgs, cli: &Cli) -> anyhow::Result<()> {
    let mut kernels = args.kernels.iter().map(|name| named(name)).collect::<anyhow::Result<Vec<_>>>()?;
    if kernels.is_empty() {
        kernels = generated::ALL.to_vec();
    }
    let choice =
        DeviceChoice { device: cli.device.clone(), subgroup_size: args.subgroup_size, ..DeviceChoice::default() };
    let statistics = Statistics::of(&Compiler::open(&choice)?, args.chip.as_deref(), &kernels)?;
    if cli.json { out(&serde_json::to_string_pretty(&statistics)?) } else { out(statistics.terminal().trim_end()) }
}
