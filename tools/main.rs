//! `ivv`: the command line. `verbs` has a file or folder per verb, `run` what they share, `ui` the terminal and exit codes.

mod run;
mod ui;
mod verbs;

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;
use ui::{fault, screen, trace};
use verbs::Verb;

/// Immersive volumetric video: spatio-temporal 3D Gaussians, rendered in Vulkan compute.
#[derive(Parser)]
#[command(name = "ivv", version)]
#[command(after_help = "`ivv debug --help` lists commands for developers: gradients, completions, manual pages.")]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    /// Least severity of the log on standard error: error, warn, info, debug or trace.
    #[arg(long, global = true, default_value = "warn")]
    log_level: tracing::Level,
    /// Writes a trace of the command to FILE, for ui.perfetto.dev; with --log-level trace with every pass of the device.
    #[arg(long, global = true, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Writes results and errors as JSON on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Hides messages and progress: standard error has only warnings and errors.
    #[arg(short, long, global = true)]
    quiet: bool,
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return ExitCode::from(fault::usage(&error)),
    };
    if cli.quiet {
        screen::be_quiet();
    }
    // The reader of SOFA files warns of good files, and errors name the faults of bad ones.
    let severity = Targets::new().with_default(cli.log_level).with_target("sofar", LevelFilter::OFF);
    let log = tracing_subscriber::fmt::layer()
        .with_writer(|| screen::Log)
        .with_ansi(screen::has_colours())
        .log_internal_errors(false)
        .with_filter(severity);
    let (spans, trace) = match cli.trace.as_deref().map(|file| trace::begin(file, cli.log_level)).transpose() {
        Ok(begun) => begun.unzip(),
        Err(error) => return ExitCode::from(fault::exit(Err(error.into()), cli.json)),
    };
    tracing_subscriber::registry().with(log).with(spans).init();
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let done = tracing::info_span!("ivv", ?arguments).in_scope(|| cli.verb.run(cli.json));
    ExitCode::from(fault::exit(trace::end(trace, done), cli.json))
}
