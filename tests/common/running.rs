//! A command that a test watches while it runs.

use ivv::internals::train::Checkpoint;
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// How long the slowest machine may need for the first checkpoints of a run.
const PATIENCE: Duration = Duration::from_secs(300);
/// How long one that is asked to end may take.
const GRACE: Duration = Duration::from_secs(20);
const POLL: Duration = Duration::from_millis(10);

/// A process that ends with the test, however that ends.
pub struct Running(pub Child);

impl Running {
    pub fn start(command: &mut Command) -> Self {
        Running(command.spawn().unwrap())
    }

    /// Waits until the run has written its checkpoint of `step`, or a later one, to `folder`: a run keeps the newest alone, so a
    /// quick one may have removed that of `step` between two looks.
    #[track_caller]
    pub fn wait_for_checkpoint(&mut self, folder: &Path, step: u64) {
        let begun = Instant::now();
        while Checkpoint::newest_step(folder).unwrap().is_none_or(|newest| newest < step) {
            assert!(self.0.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(begun.elapsed() < PATIENCE, "no checkpoint of step {step} in {}", folder.display());
            std::thread::sleep(POLL);
        }
    }

    #[cfg(unix)]
    pub fn signal(&self, signal: rustix::process::Signal) {
        rustix::process::kill_process(rustix::process::Pid::from_child(&self.0), signal).unwrap();
    }

    pub fn code(&mut self) -> Option<i32> {
        self.0.wait().unwrap().code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Asked first: killed, `ivv segments run` would leave the training that it waits for.
        #[cfg(unix)]
        if matches!(self.0.try_wait(), Ok(None)) {
            let pid = rustix::process::Pid::from_child(&self.0);
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
            let begun = Instant::now();
            while begun.elapsed() < GRACE && matches!(self.0.try_wait(), Ok(None)) {
                std::thread::sleep(POLL);
            }
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[cfg(unix)]
fn a_checkpoint_that_is_gone_for_newer_ones_is_not_waited_for_and_the_process_ends_with_the_test() {
    let folder = std::env::temp_dir().join(format!("ivv-running-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(Checkpoint::file(&folder, 9), "").unwrap();
    let mut running = Running::start(Command::new("sleep").arg("600"));
    running.wait_for_checkpoint(&folder, 3);
    std::fs::remove_dir_all(&folder).unwrap();
    let pid = rustix::process::Pid::from_child(&running.0);
    drop(running);
    assert!(rustix::process::test_kill_process(pid).is_err(), "it is still there");
}
