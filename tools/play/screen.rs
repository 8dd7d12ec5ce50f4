//! Messages on standard error, which never end the work where nobody reads them.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Writes a message; not with --quiet.
macro_rules! say {
    ($($part:tt)*) => { $crate::ui::screen::message(&format!($($part)*)) };
}

/// Writes a warning or an error.
macro_rules! alert {
    ($($part:tt)*) => { $crate::ui::screen::warning(&format!($($part)*)) };
}

pub(crate) use {alert, say};

/// Leaves out messages from now on.
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
