//! `ivv compare`: finished runs side by side.

use crate::date::today;
use crate::files::{make_folder, read_json, write_json};
use crate::screen::out;
use ivv::files::write_atomic;
use ivv::study::{Entry, History, RunResult, RunTable};
use std::path::PathBuf;

/// Options of `ivv compare`.
#[derive(clap::Args)]
pub struct Args {
    /// Folders of runs that have ended and have test images. Runs that differ in their seeds alone share a row.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// A folder for compare.md, compare.json and compare.svg: scores against steps and against seconds.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// A JSON file to which these runs are added as a new measurement, made where it is absent. Beside it, with the ending
    /// `.svg`, the course of all measurements is drawn.
    #[arg(long)]
    history: Option<PathBuf>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let runs = args.runs.iter().map(|run| RunResult::read(run)).collect::<ivv::Result<Vec<_>>>()?;
    let table = RunTable::new(&runs);
    let text = table.markdown();
    let all = serde_json::json!({ "runs": runs, "groups": table.0 });
    if let Some(folder) = &args.output {
        make_folder(folder)?;
        write_json(&folder.join("compare.json"), &all)?;
        write_atomic(&folder.join("compare.md"), |to| to.write_all(text.as_bytes()))?;
        write_atomic(&folder.join("compare.svg"), |to| to.write_all(table.svg().as_bytes()))?;
    }
    if let Some(file) = &args.history {
        let mut history = match file.try_exists() {
            Ok(false) => History::default(),
            _ => read_json(file, "give a file that `ivv compare --history` wrote, or the name of a new one")?,
        };
        history.0.push(Entry { date: today(), runs });
        write_json(file, &history)?;
        write_atomic(&file.with_extension("svg"), |to| to.write_all(history.svg().as_bytes()))?;
    }
    if json {
        out!("{}", serde_json::to_string_pretty(&all)?);
    } else {
        out!("{}", text.trim_end());
    }
    Ok(())
}
