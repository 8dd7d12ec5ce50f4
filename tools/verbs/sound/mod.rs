//! `ivv sound`: the sound field. One file per verb.

mod bench;
mod inspect_hrtf;
mod localize;
mod plot;
mod render;
mod synth;

/// Options of `ivv sound`.
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
    /// Writes a sound scene whose truth is known: a built-in one, or the ears' truth of a synthetic capture.
    Synth(synth::Args),
    /// Measures renderings against the truth: a scene of your own, or the built-in one with the paper's ablation and a table
    /// of speed and accuracy.
    Bench(bench::Args),
    /// Says what a set of head-related responses holds, from whom and under which licence.
    InspectHrtf(inspect_hrtf::Args),
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Localize(args) => localize::run(args, json),
        Verb::Render(args) => render::run(args, json),
        Verb::Synth(args) => synth::run(args, json),
        Verb::Bench(args) => bench::run(args, json),
        Verb::InspectHrtf(args) => inspect_hrtf::run(args, json),
    }
}
