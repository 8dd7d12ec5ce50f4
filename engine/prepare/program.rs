//! Programs that others wrote: run, and their failures told.

use std::ffi::OsStr;
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;

use crate::error::{Error, Result};

/// A program and what to install when it is missing.
#[derive(Clone, Copy)]
pub(super) struct Program {
    pub name: &'static str,
    pub install: &'static str,
}

pub(super) const FFMPEG: Program =
    Program { name: "ffmpeg", install: "install ffmpeg 5.1 or newer (Debian: apt-get install ffmpeg)" };
pub(super) const FFPROBE: Program = Program { name: "ffprobe", install: FFMPEG.install };
pub(super) const COLMAP: Program =
    Program { name: "colmap", install: "install COLMAP (Debian: apt-get install colmap), or give --triangulate none" };

/// A running program whose standard error is read.
pub(super) struct Running {
    pub child: Child,
    program: Program,
    said: Option<JoinHandle<String>>,
}

impl Program {
    /// Starts the program with its output piped; `about` is the file to blame.
    pub fn start<S: AsRef<OsStr>>(self, arguments: impl IntoIterator<Item = S>, about: &Path) -> Result<Running> {
        let mut command = Command::new(self.name);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|fault| {
            let reason = match fault.kind() {
                ErrorKind::NotFound => format!("needs the program {}, which is not installed", self.name),
                _ => format!("needs the program {}, which does not start: {fault}", self.name),
            };
            Error::data(about, "", reason, self.install)
        })?;
        let mut errors = child.stderr.take();
        let said = std::thread::spawn(move || {
            let mut said = Vec::new();
            // What cannot be read is not told.
            let _ = errors.as_mut().map(|errors| errors.read_to_end(&mut said));
            String::from_utf8_lossy(&said).into_owned()
        });
        Ok(Running { child, program: self, said: Some(said) })
    }

    /// Runs the program to its end and returns its output.
    pub fn run<S: AsRef<OsStr>>(self, arguments: impl IntoIterator<Item = S>, about: &Path) -> Result<Vec<u8>> {
        let (output, outcome) = self.attempt(arguments, about)?;
        outcome.map(|()| output)
    }

    /// As [`Program::run`]; of a program that ended badly the output comes too.
    pub fn attempt<S: AsRef<OsStr>>(
        self,
        arguments: impl IntoIterator<Item = S>,
        about: &Path,
    ) -> Result<(Vec<u8>, Result<()>)> {
        let mut running = self.start(arguments, about)?;
        let mut output = Vec::new();
        let read = running.child.stdout.take().map(|mut from| from.read_to_end(&mut output));
        let (status, said) = running.end(about)?;
        if let Some(Err(fault)) = read {
            return Err(Error::data(about, "", format!("{} cannot be heard: {fault}", self.name), "try again"));
        }
        if status.success() {
            return Ok((output, Ok(())));
        }
        // COLMAP tells some of its faults on standard output.
        let last = last_line(&said).or_else(|| last_line(&String::from_utf8_lossy(&output)));
        Ok((output, Err(self.failed(about, status, last))))
    }

    /// The error of a program that ended badly.
    pub fn failed(self, about: &Path, status: ExitStatus, last: Option<String>) -> Error {
        let last = last.map_or_else(String::new, |line| format!(": {line}"));
        let reason = format!("{} failed ({status}){last}", self.name);
        Error::data(about, "", reason, "check the file; what is done is kept, so run the command again to go on")
    }
}

impl Running {
    /// Waits for the end; what the program said on standard error comes with it.
    pub fn end(&mut self, about: &Path) -> Result<(ExitStatus, String)> {
        let status = self.child.wait().map_err(|fault| {
            Error::data(about, "", format!("{} cannot be waited for: {fault}", self.program.name), "try again")
        })?;
        let said = self.said.take().and_then(|said| said.join().ok()).unwrap_or_default();
        Ok((status, said))
    }
}

impl Drop for Running {
    /// A program that nobody listens to any more is ended.
    fn drop(&mut self) {
        if self.said.is_some() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The last line that says something; the trace of a crash does not.
pub(super) fn last_line(text: &str) -> Option<String> {
    let says = |line: &&str| !(line.is_empty() || line.starts_with('@') || line.starts_with("***"));
    let line = text.lines().rev().map(str::trim).find(says)?;
    Some(line.chars().take(300).collect())
}
