//! Messages on standard error, which never end the work where nobody reads them.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Writes a message; not with --quiet.
macro_rules! say {
    ($($part:tt)*) => { $crate::ui::screen::message(&format!($($part)*)) };
}

macro_rules! alert {
    ($($part:tt)*) => { $crate::ui::screen::warning(&format!($($part)*)) };
}

pub(crate) use {alert, say};

pub fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

pub fn message(text: &str) {
    if !IS_QUIET.load(Ordering::Relaxed) {
        warning(text);
    }
}

pub fn warning(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Takes all that is written, so that a full disk or a closed pipe ends nothing.
pub struct Log;

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let _ = std::io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

pub fn has_colours() -> bool {
    std::io::stderr().is_terminal()
}
