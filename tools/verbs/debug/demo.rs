//! `ivv debug demo`.

use crate::ui::screen::out;
use ivv::internals::formats::write_ply;
use ivv::internals::scene::{demo, write_views};
use ivv::internals::words::count;
use serde_json::json;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// The folder to write scene.ply and cameras.json to.
    #[arg(short, long)]
    output: PathBuf,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    crate::run::files::make_folder(&args.output)?;
    let (splats, views) = demo();
    write_ply(&args.output.join("scene.ply"), &splats)?;
    write_views(&args.output.join("cameras.json"), &views)?;
    if json {
        let path = args.output.to_string_lossy();
        out!("{}", json!({ "path": path, "gaussians": splats.len(), "views": views.len() }));
        return Ok(());
    }
    out!("{}: {}, {}", args.output.display(), count(splats.len(), "Gaussian"), count(views.len(), "view"));
    Ok(())
}
