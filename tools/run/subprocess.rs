//! Trainings in processes of their own: all that they allocate ends with them.

use crate::ui::interrupt::Stop;
use anyhow::Context;
use std::process::{Child, Command, ExitStatus};
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
