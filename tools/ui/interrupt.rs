//! Ctrl-C and SIGTERM.

use anyhow::Context;
use std::process::{Child, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What a verb returns when Ctrl-C or SIGTERM ended it; says what is left.
#[derive(Debug)]
pub struct Interrupted(pub &'static str);

impl Interrupted {
    /// What the program ends with then: 128 and the number of SIGINT.
    pub const EXIT_CODE: u8 = 130;
}

impl std::fmt::Display for Interrupted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "interrupted; {}", self.0)
    }
}

impl std::error::Error for Interrupted {}

/// Whether the verb has been asked to end.
#[derive(Clone)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Listens from now on; once in a process.
    pub fn listen() -> anyhow::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        let flag = asked.clone();
        ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("no handler for Ctrl-C")?;
        Ok(Stop(asked))
    }

    /// Whether it has.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Waits for another `ivv`, which is asked to end when this one is. Ctrl-C reaches both, but SIGTERM this one alone.
    pub fn wait_for(&self, child: &mut Child) -> std::io::Result<ExitStatus> {
        let mut is_told = false;
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status);
            }
            if self.is_asked() && !is_told {
                #[cfg(unix)]
                rustix::process::kill_process(rustix::process::Pid::from_child(child), rustix::process::Signal::TERM)?;
                is_told = true;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}
