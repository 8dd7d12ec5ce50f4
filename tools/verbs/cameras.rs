//! `ivv cameras`.

use crate::screen::out;
use crate::shown::is_run;
use crate::views::ViewArgs;
use ivv::scene::write_views;
use ivv::words::count;
use std::path::PathBuf;

/// Options of `ivv cameras`.
#[derive(clap::Args)]
pub struct Args {
    /// A capture, or the folder of a run of `ivv train`, whose capture is taken.
    #[arg(value_name = "CAPTURE|RUN")]
    source: PathBuf,
    /// The cameras file to write (JSON).
    #[arg(short, long)]
    output: PathBuf,
    /// The capture of the run, if it has moved.
    #[arg(long)]
    capture: Option<PathBuf>,
    #[command(flatten)]
    views: ViewArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let views = if is_run(&args.source) {
        args.views.of_run(&args.source, args.capture.as_deref(), None)?
    } else {
        let source = args.source.display();
        anyhow::ensure!(
            args.capture.is_none(),
            "--capture: expected a run, found {source}, which is none; leave it out"
        );
        args.views.of_capture(&args.source, None)?
    };
    write_views(&args.output, &views)?;
    if json {
        out!("{}", serde_json::json!({ "path": args.output.to_string_lossy(), "views": views.len() }));
    } else {
        out!("{}: {}", args.output.display(), count(views.len(), "view"));
    }
    Ok(())
}
