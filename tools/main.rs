//! `ivv`: the command line. One file per verb; exit codes are SPEC 10's.

mod ablate;
mod begin;
mod check;
mod demo;
mod device;
mod devices;
mod due;
mod eval;
mod export;
mod extremes;
mod files;
mod film;
mod init;
mod inspect;
mod interrupt;
mod kept;
mod offsets;
mod passes;
mod prepare;
mod profile;
mod progress;
mod render;
mod replay;
mod require;
mod settings;
mod sound;
mod synth;
mod totals;
mod trade;
mod train;
mod vjp;
#[cfg(feature = "shaders")]
mod watch;

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Immersive volumetric video: spatio-temporal 3D Gaussians, rendered in Vulkan compute.
#[derive(Parser)]
#[command(name = "ivv", version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    /// What is logged on standard error: error, warn, info, debug or trace.
    #[arg(long, global = true, default_value = "warn")]
    log_level: tracing::Level,
    /// Machine-readable output on standard output.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// Lists Vulkan devices with the limits and features that matter; says which one is picked and why.
    Devices(devices::Args),
    /// Makes a capture folder of recordings: decodes video, undistorts, triangulates points, estimates flow.
    Prepare(prepare::Args),
    /// Lists all faults of a capture at once, and what it holds.
    Check(check::Args),
    /// Says what a scene holds: counts by population, SH degree, bytes, extent.
    Inspect(inspect::Args),
    /// Renders views of a scene, one file per view and format, named after the view; or a video along a path, with sound.
    Render(render::Args),
    /// The sound field: where speakers are, and how they sound along a path.
    Sound(sound::Args),
    /// Writes the first Gaussians of a capture from the points of its frames.
    Init(init::Args),
    /// Fits Gaussians to the images of a capture.
    Train(train::Args),
    /// Scores the test views of a run again, from its folder alone, and writes its report.
    Eval(eval::Args),
    /// Trains a capture with and without each part of the method, and tables what each is worth.
    Ablate(ablate::Args),
    /// Runs the table of numerical extremes on a device, and reports row by row whether it holds.
    Extremes(extremes::Args),
    /// Measures the device, then every pass of a step or a frame against it; captures and replays single kernels.
    Profile(profile::Args),
    /// Measures what settings and presets cost and buy: speed, accuracy, bytes, over several seeds.
    Trade(trade::Args),
    /// Writes a scene in another format, or as it is at one time.
    Export(export::Args),
    /// Gradients of sum(cotangent * output) of a view, by parameter group.
    Vjp(vjp::Args),
    /// Writes the scene that the project ships in assets/demo.
    Demo(demo::Args),
    /// Writes a synthetic capture of a room with moving things, and everything that is true of it.
    Synth(synth::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    // The reader of SOFA files warns of good files; what is wrong with bad ones is in the error.
    let told = Targets::new().with_default(cli.log_level).with_target("sofar", LevelFilter::OFF);
    tracing_subscriber::registry()
        .with(tracing_subscriber::fmt::layer().with_writer(std::io::stderr))
        .with(told)
        .init();
    let done = match &cli.verb {
        Verb::Devices(args) => devices::run(args, cli.json),
        Verb::Prepare(args) => prepare::run(args, cli.json),
        Verb::Check(args) => check::run(args, cli.json),
        Verb::Inspect(args) => inspect::run(args, cli.json),
        Verb::Render(args) => render::run(args, cli.json),
        Verb::Sound(args) => sound::run(args, cli.json),
        Verb::Init(args) => init::run(args, cli.json),
        Verb::Train(args) => train::run(args, cli.json),
        Verb::Eval(args) => eval::run(args, cli.json),
        Verb::Ablate(args) => ablate::run(args, cli.json),
        Verb::Extremes(args) => extremes::run(args, cli.json),
        Verb::Profile(args) => profile::run(args, cli.json),
        Verb::Trade(args) => trade::run(args, cli.json),
        Verb::Export(args) => export::run(args, cli.json),
        Verb::Vjp(args) => vjp::run(args),
        Verb::Demo(args) => demo::run(args),
        Verb::Synth(args) => synth::run(args, cli.json),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ivv: {error:#}");
            ExitCode::from(exit_code(&error))
        }
    }
}

/// SPEC 10: the engine's own errors know theirs; an interruption is 130; anything else is the fault of what was asked.
fn exit_code(error: &anyhow::Error) -> u8 {
    if error.downcast_ref::<interrupt::Interrupted>().is_some() {
        return 130;
    }
    if error.downcast_ref::<check::Faulty>().is_some() {
        return 3;
    }
    if error.downcast_ref::<extremes::Failed>().is_some() {
        return 4;
    }
    error.downcast_ref::<ivv::Error>().map_or(2, ivv::Error::exit_code)
}
