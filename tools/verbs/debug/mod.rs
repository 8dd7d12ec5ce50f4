//! `ivv debug`: verbs for developers and packagers, one per file; `manual` has two.

mod demo;
mod manual;
mod vjp;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Gradients of sum(cotangent * output) of a view, by parameter group.
    Vjp(vjp::Args),
    /// Writes the scene that the project ships in assets/demo.
    Demo(demo::Args),
    /// Writes the completions of a shell on standard output.
    Completions(manual::CompletionArgs),
    /// Writes manual pages.
    Man(manual::ManArgs),
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Vjp(args) => vjp::run(args, json),
        Verb::Demo(args) => demo::run(args, json),
        Verb::Completions(args) => {
            manual::completions(args);
            Ok(())
        }
        Verb::Man(args) => manual::man(args, json),
    }
}
