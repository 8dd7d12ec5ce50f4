//! `ivv sound`: the sound field. One file per verb.

mod localize;

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
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Localize(args) => localize::run(args, json),
    }
}
