//! Progress: one line that rewrites itself on a terminal, plain lines otherwise; always on standard error.

use std::io::{IsTerminal, Write};
use std::time::Instant;

/// Counts finished pieces of work.
pub struct Progress {
    what: &'static str,
    total: usize,
    done: usize,
    start: Instant,
    terminal: bool,
}

impl Progress {
    /// `total` pieces called `what`.
    pub fn new(what: &'static str, total: usize) -> Self {
        Progress { what, total, done: 0, start: Instant::now(), terminal: std::io::stderr().is_terminal() }
    }

    /// One more piece is done; `note` says something about it.
    pub fn step(&mut self, note: &str) {
        self.done += 1;
        let seconds = self.start.elapsed().as_secs_f64();
        let left = seconds / self.done as f64 * (self.total - self.done) as f64;
        let Progress { what, total, done, .. } = self;
        let line = format!("{what} {done}/{total}, {left:.0} s left: {note}");
        let mut out = std::io::stderr().lock();
        // A closed standard error must not end the work.
        let _ = if self.terminal {
            let end = if self.done == self.total { "\n" } else { "" };
            write!(out, "\r\x1b[2K{line}{end}")
        } else {
            writeln!(out, "{line}")
        };
        let _ = out.flush();
    }
}
