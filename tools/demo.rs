//! `ivv demo`.

use ivv::scene::{demo, write_ply, write_views};
use std::path::PathBuf;

/// Options of `ivv demo`.
#[derive(clap::Args)]
pub struct Args {
    /// The folder to write scene.ply and cameras.json to.
    #[arg(short, long)]
    output: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.output).map_err(|e| {
        ivv::Error::data(&args.output, "", format!("cannot be made: {e}"), "choose another folder with -o")
    })?;
    let (splats, views) = demo();
    write_ply(&args.output.join("scene.ply"), &splats)?;
    write_views(&args.output.join("cameras.json"), &views)?;
    println!("{}: {} Gaussians, {} views", args.output.display(), splats.len(), views.len());
    Ok(())
}
