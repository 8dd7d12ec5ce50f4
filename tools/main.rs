//! `ivv`: the command line. `verbs` has a file or folder per verb, `run` what they share, `ui` the terminal and exit codes.

mod run;
mod ui;
mod verbs;

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;
use ui::{fault, screen, trace};
use verbs::{
    bench, check, debug, devices, eval, export, inspect, prepare, profile, render, segments, serve, sound, synth, train,
};

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

#[derive(Subcommand)]
enum Verb {
    /// Lists Vulkan devices with their limits and features, and which one is chosen and why.
    Devices(devices::Args),
    /// Turns recordings into a capture folder: decodes video, undistorts, triangulates points, estimates flow.
    Prepare(prepare::Args),
    /// Lists all faults of a capture, and its contents.
    Check(check::Args),
    /// Shows the contents of a scene: Gaussians, SH degree, bytes, extent. Or writes the views of a capture as a cameras file.
    Inspect(inspect::Args),
    /// Renders views of a run or a scene into files named after them; or a video along a path or around the scene.
    Render(render::Args),
    /// Sound: finds speakers, and renders the sound along a path.
    Sound(sound::Args),
    /// Trains a scene on the images of a capture. Or only plans the training, lists the settings, or writes the first Gaussians.
    Train(train::Args),
    /// Trains a long clip in segments, on one machine or as jobs of many.
    Segments(segments::Args),
    /// Scores the test views of a run again, and writes its report.
    Eval(eval::Args),
    /// Compares settings by training the arms of a study on captures, or compares finished runs.
    Bench(bench::Args),
    /// Measures each pass of a step or a frame against the limits of the device; dumps and replays single kernels.
    Profile(profile::Args),
    /// Writes a scene in another format, or at one moment.
    Export(export::Args),
    /// Serves a scene or a run in training with the browser player.
    Serve(serve::Args),
    /// Writes a synthetic capture of a room with moving objects, with its ground truth.
    Synth(synth::Args),
    /// Commands for developers: gradients, the demo scene, completions, manual pages.
    #[command(hide = true)]
    Debug(debug::Args),
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
    let done = tracing::info_span!("ivv", ?arguments).in_scope(|| run(&cli));
    ExitCode::from(fault::exit(trace::end(trace, done), cli.json))
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    match &cli.verb {
        Verb::Devices(args) => devices::run(args, cli.json),
        Verb::Prepare(args) => prepare::run(args, cli.json),
        Verb::Check(args) => check::run(args, cli.json),
        Verb::Inspect(args) => inspect::run(args, cli.json),
        Verb::Render(args) => render::run(args, cli.json),
        Verb::Sound(args) => sound::run(args, cli.json),
        Verb::Train(args) => train::run(args, cli.json),
        Verb::Segments(args) => segments::run(args, cli.json),
        Verb::Eval(args) => eval::run(args, cli.json),
        Verb::Bench(args) => bench::run(args, cli.json),
        Verb::Profile(args) => profile::run(args, cli.json),
        Verb::Export(args) => export::run(args, cli.json),
        Verb::Serve(args) => serve::run(args, cli.json),
        Verb::Synth(args) => synth::run(args, cli.json),
        Verb::Debug(args) => debug::run(args, cli.json),
    }
}
