//! All that `ivv` writes: results on standard output; messages, logs and progress on standard error. Output that cannot be written
//! never stops the work; messages are lost then, and lost results are an error at the end.

use crate::ui::status_line;
use crate::ui::stderr::{self, put, put_progress};
use ivv::internals::report::Table;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Writes results on standard output.
macro_rules! out {
    ($($part:tt)*) => { $crate::ui::screen::result(&format!($($part)*)) };
}

/// Writes a message on standard error; not with --quiet.
macro_rules! say {
    ($($part:tt)*) => { $crate::ui::screen::message(&format!($($part)*)) };
}

/// Writes a warning or an error on standard error.
macro_rules! alert {
    ($($part:tt)*) => { $crate::ui::screen::warning(&format!($($part)*)) };
}

pub(crate) use {alert, out, say};

const CLEAR: &str = "\r\x1b[2K";

struct Screen {
    is_quiet: bool,
    /// The bar in the last line of the terminal.
    bar: Option<String>,
    has_results: bool,
    fault: Option<io::Error>,
}

static SCREEN: Mutex<Screen> = Mutex::new(Screen { is_quiet: false, bar: None, has_results: false, fault: None });

fn screen() -> MutexGuard<'static, Screen> {
    SCREEN.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Screen {
    /// Hides the bar while `write` runs.
    fn above_the_bar<T>(&mut self, write: impl FnOnce(&mut Self) -> T) -> T {
        if self.bar.is_some() {
            put(CLEAR.to_owned());
        }
        let written = write(self);
        if let Some(bar) = &self.bar {
            put(bar.clone());
        }
        written
    }
}

pub fn be_quiet() {
    screen().is_quiet = true;
}

pub fn has_messages() -> bool {
    !screen().is_quiet
}

pub fn result(text: &str) {
    let mut screen = screen();
    screen.has_results = true;
    if screen.fault.is_some() {
        return;
    }
    let written = screen.above_the_bar(|_| {
        // Standard output and error may be the same terminal.
        stderr::finish();
        let mut to = io::stdout().lock();
        writeln!(to, "{text}").and_then(|()| to.flush())
    });
    screen.fault = written.err();
}

pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    result(&serde_json::to_string_pretty(value)?);
    Ok(())
}

/// Prints `value` as one line of JSON, or `text` for people.
pub fn answer(json: bool, value: &serde_json::Value, text: impl std::fmt::Display) {
    if json { result(&value.to_string()) } else { result(&text.to_string()) }
}

/// Prints a table whose first column is text.
pub fn print_table(heads: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    result(Table::new(heads, rows).plain().trim_end());
}

pub fn has_results() -> bool {
    screen().has_results
}

/// A line that --quiet leaves out.
pub fn message(text: &str) {
    if has_messages() {
        warning(text);
    }
}

/// A line that --quiet does not leave out.
pub fn warning(text: &str) {
    screen().above_the_bar(|_| put(format!("{text}\n")));
}

/// A line of progress where no terminal rewrites it. It may be dropped, since a later one follows.
pub fn passing_line(text: &str) {
    if has_messages() {
        put_progress(format!("{text}\n"));
    }
}

/// On a terminal: a bar and a line of progress, which the next one replaces.
pub fn bar(done: u64, total: u64, text: &str) {
    let mut screen = screen();
    if screen.is_quiet {
        return;
    }
    let columns = terminal_size::terminal_size_of(io::stderr()).map_or(80, |(width, _)| usize::from(width.0));
    let bar = status_line::fit(done, total, text, columns);
    put_progress(format!("{CLEAR}{bar}"));
    screen.bar = Some(bar);
}

/// Ends the line of the bar, and keeps it.
pub fn leave_bar() {
    if screen().bar.take().is_some() {
        put("\n".to_owned());
    }
}

/// True if standard error is a terminal that can rewrite a line.
pub fn is_terminal() -> bool {
    static IS_TERMINAL: OnceLock<bool> = OnceLock::new();
    *IS_TERMINAL
        .get_or_init(|| io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb"))
}

/// True if standard error is coloured: on a terminal, without NO_COLOR (<https://no-color.org>).
pub fn has_colours() -> bool {
    is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|no| no.is_empty())
}

/// Ends the output. A closed pipe is no error.
pub fn finish() -> ivv::Result<()> {
    leave_bar();
    stderr::finish();
    let fault = screen().fault.take().filter(|fault| fault.kind() != ErrorKind::BrokenPipe);
    fault.map_or(Ok(()), |fault| {
        let reason = format!("cannot be written: {fault}");
        Err(ivv::Error::data(Path::new("standard output"), "", reason, "free space there or send it elsewhere"))
    })
}

/// The writer of logs. It never fails.
pub struct Log;

impl Write for Log {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        screen().above_the_bar(|_| put(String::from_utf8_lossy(text).into_owned()));
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
