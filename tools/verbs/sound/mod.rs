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
    /// Tracks speakers over time, from the keypoints of person detectors in every camera.
    Localize(localize::Args),
    /// Renders the sound at a head along a path.
    Render(render::Args),
    /// Writes a sound scene with ground truth: a built-in one, or that of a synthetic capture.
    Synth(synth::Args),
    /// Measures renderings against ground truth: of your own scene, or of the built-in one with the paper's ablation and a table of
    /// speed and accuracy.
    Bench(bench::Args),
    /// Shows the contents, source and licence of a set of head-related responses.
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
