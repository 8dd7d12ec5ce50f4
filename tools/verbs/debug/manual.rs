//! `ivv debug completions` and `ivv debug man`.

use crate::Cli;
use crate::run::files::make_folder;
use crate::ui::screen::out;
use clap::{Command, CommandFactory};
use ivv::internals::files::write_atomic;
use ivv::internals::words::count;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct CompletionArgs {
    /// The shell to write for.
    shell: clap_complete::Shell,
}

#[derive(clap::Args)]
pub struct ManArgs {
    /// The folder for the pages, such as ~/.local/share/man/man1.
    #[arg(short, long)]
    output: PathBuf,
}

pub fn completions(args: &CompletionArgs) {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "ivv", &mut script);
    out!("{}", String::from_utf8_lossy(&script).trim_end());
}

pub fn man(args: &ManArgs, json: bool) -> anyhow::Result<()> {
    make_folder(&args.output)?;
    let mut command = Cli::command();
    command.build();
    let mut pages = Vec::new();
    write_pages(&command, &args.output, &mut pages)?;
    if json {
        out!("{}", serde_json::to_string(&pages)?);
    } else {
        out!("{}: {}", args.output.display(), count(pages.len(), "page"));
    }
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
