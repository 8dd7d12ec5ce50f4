//! Training runs in processes of their own, for what compares many.

use crate::files::{read_json, write_json};
use anyhow::Context;
use ivv::scene::capture::Capture;
use ivv::train::{CaptureSummary, Config, Run};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Trains on `capture`, which has one of [`held`], with `config` in a process of its own, which leaves nothing behind in this one; unless
/// that has been done. The run goes to `folder`, its settings and its log to files beside it.
pub fn train_apart(
    (capture, held): (&Path, &[CaptureSummary; 2]),
    folder: &Path,
    config: &Config,
    device: Option<&str>,
) -> anyhow::Result<()> {
    let settings = beside(folder, ".json");
    let path = std::path::absolute(capture)?;
    let is_done = folder.join("eval.json").is_file()
        && read_json::<Config>(&settings, "remove it").is_ok_and(|before| before == *config)
        && Run::read(folder).is_ok_and(|run| run.capture == path && held.contains(&run.held));
    if is_done {
        return Ok(());
    }
    // Scores of a run with other settings must not be taken for those of this one, should it fail before it replaces them.
    if let Err(fault) = std::fs::remove_file(folder.join("eval.json"))
        && fault.kind() != ErrorKind::NotFound
    {
        return Err(fault).with_context(|| format!("{}: earlier scores cannot be removed", folder.display()));
    }
    write_json(&settings, config)?;
    let log = beside(folder, ".log");
    let remedy = "free space or choose another folder with -o";
    let log = std::fs::File::create(&log)
        .map_err(|e| ivv::Error::data(&log, "", format!("the log of a run cannot be made: {e}"), remedy))?;
    let program = std::env::current_exe().context("the path of this program is not known")?;
    let status = Command::new(program)
        .arg("train")
        .arg(capture)
        .args(["--overwrite", "--eval-every", "0", "-o"])
        .arg(folder)
        .arg("--config")
        .arg(&settings)
        .args(device.iter().flat_map(|device| ["--device", device]))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(log)
        .status()
        .context("`ivv train` cannot be started")?;
    anyhow::ensure!(status.success(), "{}: the run ended with {status}; see its .log", folder.display());
    Ok(())
}

/// The file beside a run's folder that has its whole name before `end`: the name of a preset may have a dot.
fn beside(folder: &Path, end: &str) -> PathBuf {
    let mut path = folder.as_os_str().to_owned();
    path.push(end);
    path.into()
}

/// What runs on `capture` may hold: with its photographs, or without.
pub fn held(capture: &Capture) -> [CaptureSummary; 2] {
    [CaptureSummary::new(capture), CaptureSummary::new(&capture.clone().without_photos())]
}

/// Refuses a seed that is given twice: its second run would be counted as another observation.
pub fn distinct(seeds: &[u64]) -> anyhow::Result<()> {
    let twice = seeds.iter().enumerate().find(|(at, seed)| seeds[..*at].contains(seed));
    twice.map_or(Ok(()), |(_, seed)| Err(anyhow::anyhow!("--seeds names {seed} twice; give each seed once")))
}

/// The captures by the names of their folders, after which their runs are named too.
pub fn named(captures: &[PathBuf]) -> anyhow::Result<Vec<(String, &Path)>> {
    let mut all: Vec<(String, &Path)> = Vec::new();
    for capture in captures {
        let path = std::path::absolute(capture)?;
        let name = path.file_name().map_or("capture".into(), |name| name.to_string_lossy()).into_owned();
        anyhow::ensure!(
            all.iter().all(|(other, _)| *other != name),
            "{}: two captures are called {name}; their runs would go to one folder; rename one",
            capture.display()
        );
        all.push((name, capture));
    }
    Ok(all)
}
