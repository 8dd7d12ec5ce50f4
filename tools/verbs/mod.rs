//! The verbs of the command line, one file or folder each.

mod bench;
mod check;
mod debug;
mod devices;
mod eval;
mod export;
mod inspect;
mod prepare;
mod profile;
mod render;
mod segments;
mod serve;
mod sound;
mod synth;
mod train;

use clap::Subcommand;

#[derive(Subcommand)]
pub enum Verb {
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

impl Verb {
    pub fn run(&self, json: bool) -> anyhow::Result<()> {
        match self {
            Verb::Devices(args) => devices::run(args, json),
            Verb::Prepare(args) => prepare::run(args, json),
            Verb::Check(args) => check::run(args, json),
            Verb::Inspect(args) => inspect::run(args, json),
            Verb::Render(args) => render::run(args, json),
            Verb::Sound(args) => sound::run(args, json),
            Verb::Train(args) => train::run(args, json),
            Verb::Segments(args) => segments::run(args, json),
            Verb::Eval(args) => eval::run(args, json),
            Verb::Bench(args) => bench::run(args, json),
            Verb::Profile(args) => profile::run(args, json),
            Verb::Export(args) => export::run(args, json),
            Verb::Serve(args) => serve::run(args, json),
            Verb::Synth(args) => synth::run(args, json),
            Verb::Debug(args) => debug::run(args, json),
        }
    }
}
