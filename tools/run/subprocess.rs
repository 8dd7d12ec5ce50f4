//! Trainings in processes of their own: all that they allocate ends with them.

use crate::run::files::{read_json, write_json};
use crate::ui::interrupt::Stop;
use anyhow::Context;
use ivv::internals::train::{CaptureSummary, Config, Run};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// `ivv train`, by the program that runs now.
pub fn train_command() -> anyhow::Result<Command> {
    let mut command = Command::new(std::env::current_exe().context("the path of this program is not known")?);
    command.arg("train");
    Ok(command)
}

/// Waits for another `ivv`, and passes a request to end on: Ctrl-C reaches both, but SIGTERM reaches only this one.
pub fn wait_for(child: &mut Child, stop: &Stop) -> std::io::Result<ExitStatus> {
    let mut is_signalled = false;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if stop.is_asked() && !is_signalled {
            #[cfg(unix)]
            rustix::process::kill_process(rustix::process::Pid::from_child(child), rustix::process::Signal::TERM)?;
            is_signalled = true;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A capture, and how processes train on it.
pub struct TrainingProcess<'a> {
    pub capture: &'a Path,
    /// The capture with its photographs and without: a finished run counts if it was trained on one of them.
    pub summaries: &'a [CaptureSummary; 2],
    pub device: Option<&'a str>,
    pub is_concurrent: bool,
}

impl TrainingProcess<'_> {
    /// Trains with `config`, unless that has been done. The run goes to `folder`, its settings and its log to files beside it.
    pub fn train(&self, folder: &Path, config: &Config) -> anyhow::Result<()> {
        let TrainingProcess { capture, summaries, device, is_concurrent } = *self;
        let settings = sibling(folder, ".json");
        let path = std::path::absolute(capture)?;
        let is_done = folder.join("eval.json").is_file()
            && read_json::<Config>(&settings, "remove it").is_ok_and(|before| before == *config)
            && Run::read(folder).is_ok_and(|run| run.capture == path && summaries.contains(&run.held));
        if is_done {
            return Ok(());
        }
        // If this run fails before it replaces them, scores of a run with other settings must not pass for its own.
        if let Err(fault) = std::fs::remove_file(folder.join("eval.json"))
            && fault.kind() != ErrorKind::NotFound
        {
            return Err(fault).with_context(|| format!("{}: earlier scores cannot be removed", folder.display()));
        }
        write_json(&settings, config)?;
        let log = sibling(folder, ".log");
        let remedy = "free space or choose another folder with -o";
        let log = std::fs::File::create(&log)
            .map_err(|e| ivv::Error::data(&log, "", format!("the log of a run cannot be made: {e}"), remedy))?;
        let mut command = train_command()?;
        if is_concurrent && std::env::var_os("LP_NUM_THREADS").is_none() {
            // Lavapipe: several runs with one thread each are faster than one run after the other with all threads.
            command.env("LP_NUM_THREADS", "0");
        }
        let status = command
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

/// The path of `folder` with `ending` behind its whole name: the name of a preset may have a dot.
fn sibling(folder: &Path, ending: &str) -> PathBuf {
    let mut path = folder.as_os_str().to_owned();
    path.push(ending);
    path.into()
}
