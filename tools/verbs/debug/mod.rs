//! `ivv debug`: verbs for developers and packagers.

mod vjp;

use crate::Cli;
use crate::run::files::make_folder;
use crate::ui::screen::{answer, out};
use clap::{Command, CommandFactory};
use ivv::internals::files::write_atomic;
use ivv::internals::formats::write_ply;
use ivv::internals::scene::{demo, write_views};
use ivv::internals::words::count;
use serde_json::json;
use std::path::{Path, PathBuf};

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
    Demo {
        /// The folder to write scene.ply and cameras.json to.
        #[arg(short, long)]
        output: PathBuf,
    },
    /// Writes the completions of a shell on standard output.
    Completions {
        /// The shell to write for.
        shell: clap_complete::Shell,
    },
    /// Writes manual pages.
    Man {
        /// The folder for the pages, such as ~/.local/share/man/man1.
        #[arg(short, long)]
        output: PathBuf,
    },
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Vjp(args) => vjp::run(args, json),
        Verb::Demo { output } => write_demo(output, json),
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "ivv", &mut script);
            out!("{}", String::from_utf8_lossy(&script).trim_end());
            Ok(())
        }
        Verb::Man { output } => man(output, json),
    }
}

fn write_demo(output: &Path, json: bool) -> anyhow::Result<()> {
    make_folder(output)?;
    let (splats, views) = demo();
    write_ply(&output.join("scene.ply"), &splats)?;
    write_views(&output.join("cameras.json"), &views)?;
    let (n, n_views) = (splats.len(), views.len());
    let text = format!("{}: {}, {}", output.display(), count(n, "Gaussian"), count(n_views, "view"));
    answer(json, &json!({ "path": output.to_string_lossy(), "gaussians": n, "views": n_views }), text);
    Ok(())
}

/// Writes a page for `ivv` and one for each of its commands.
fn man(output: &Path, json: bool) -> anyhow::Result<()> {
    make_folder(output)?;
    let mut command = Cli::command();
    command.build();
    let mut pages = Vec::new();
    write_pages(&command, output, &mut pages)?;
    answer(json, &serde_json::to_value(&pages)?, format_args!("{}: {}", output.display(), count(pages.len(), "page")));
    Ok(())
}

fn write_pages(command: &Command, folder: &Path, pages: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let file = folder.join(format!("{name}.1"));
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    write_atomic(&file, |to| to.write_all(&page))?;
    pages.push(file);
    // Clap adds `help`, which says nothing that the other pages do not.
    let mut own = command.get_subcommands().filter(|inner| inner.get_name() != "help");
    own.try_for_each(|inner| write_pages(inner, folder, pages))
}
