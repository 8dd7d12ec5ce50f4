//! Training runs in processes of their own, for what compares many.

use crate::run::files::{read_json, write_json};
use anyhow::Context;
use ivv::scene::capture::Capture;
use ivv::train::{CaptureSummary, Config, Run};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Trains on a capture in processes of their own, which leave nothing behind in this one.
pub struct Apart<'a> {
    /// The capture.
    pub capture: &'a Path,
    /// The result of [`held`].
    pub held: &'a [CaptureSummary; 2],
    /// As `ivv train` takes it.
    pub device: Option<&'a str>,
    /// True where other runs go on at the same time.
    pub is_beside: bool,
}

impl Apart<'_> {
    /// Trains with `config`, unless that has been done. The run goes to `folder`, its settings and its log to files beside it.
    pub fn train(&self, folder: &Path, config: &Config) -> anyhow::Result<()> {
        let Apart { capture, held, device, is_beside } = *self;
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
        let mut command = Command::new(program);
        if is_beside && std::env::var_os("LP_NUM_THREADS").is_none() {
            // Of lavapipe: several runs, each in its calling thread, are sooner done than one after the other on as many threads.
            command.env("LP_NUM_THREADS", "0");
        }
        let status = command
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

/// Refuses a number that is given twice: its second run would be counted as another observation.
pub fn distinct(of: &str, numbers: &[u64]) -> anyhow::Result<()> {
    let twice = numbers.iter().enumerate().find(|(at, number)| numbers[..*at].contains(number));
    twice.map_or(Ok(()), |(_, number)| Err(anyhow::anyhow!("{of}: {number} is named twice; give each number once")))
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
