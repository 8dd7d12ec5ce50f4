//! `ivv sound`: the sound field. One file per verb.

mod localize;
mod render;
mod synth;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Finds where speakers are over time, from the keypoints that detectors of persons saw in every camera.
    Localize(localize::Args),
    /// Renders what a head hears along a path.
    Render(render::Args),
    /// Writes a path around the speaker of a synthetic capture, and what a head truly hears on it.
    Synth(synth::Args),
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Localize(args) => localize::run(args, json),
        Verb::Render(args) => render::run(args, json),
        Verb::Synth(args) => synth::run(args, json),
    }
}
