//! Programs that others wrote: run, and their failures told.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};

/// A program that sleeps for so long never wakes: the threads of COLMAP 3.8 at times wait for each other when all is done.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often such a program is run. What it had done it finds, and does not do again.
const ATTEMPTS: usize = 3;

#[derive(Clone, Copy)]
pub(super) struct Program {
    name: &'static str,
    install: &'static str,
    failure: &'static str,
}

pub(super) const FFMPEG: Program = Program {
    name: "ffmpeg",
    install: "install ffmpeg 5.1 or newer (Debian: apt-get install ffmpeg)",
    failure: "copy the file again, or give one that ffmpeg plays",
};
pub(super) const FFPROBE: Program = Program { name: "ffprobe", ..FFMPEG };
pub(super) const COLMAP: Program = Program {
    name: "colmap",
    install: "install COLMAP (Debian: apt-get install colmap), or give --triangulate none",
    failure: "the program failed, not a file: what is done is kept, so run the command once more; if it fails again, give fewer \
              --threads (each takes memory), or install another version of COLMAP",
};
pub(super) const PYTHON: Program =
    Program { name: "python3", install: "install Python (Debian: apt-get install python3)", failure: "try again" };

type OutputReader = JoinHandle<std::io::Result<Vec<u8>>>;

pub(super) struct Running {
    pub child: Child,
    program: Program,
    said: Option<OutputReader>,
}

impl Program {
    /// Looks for the program on the path, before anything is planned that needs it.
    pub fn require(self, about: &Path) -> Result<()> {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let name = format!("{}{}", self.name, std::env::consts::EXE_SUFFIX);
        if std::env::split_paths(&folders).any(|folder| folder.join(&name).is_file()) {
            Ok(())
        } else {
            Err(self.missing(about))
        }
    }

    fn missing(self, about: &Path) -> Error {
        Error::data(about, "", format!("needs the program {}, which is not installed", self.name), self.install)
    }

    /// Starts the program with its output piped, and gives the lines of its standard error as it writes them; `about` is the file to
    /// blame.
    pub fn start<S: AsRef<OsStr>>(
        self,
        arguments: impl IntoIterator<Item = S>,
        about: &Path,
    ) -> Result<(Running, Receiver<String>)> {
        let mut command = Command::new(self.name);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|fault| match fault.kind() {
            ErrorKind::NotFound => self.missing(about),
            _ => {
                let reason = format!("needs the program {}, which does not start: {fault}", self.name);
                Error::data(about, "", reason, self.install)
            }
        })?;
        let (to, lines) = mpsc::channel();
        let said = child.stderr.take().map(|pipe| listen(pipe, to));
        Ok((Running { child, program: self, said }, lines))
    }

    pub fn run<S: AsRef<OsStr>>(self, arguments: impl IntoIterator<Item = S> + Clone, about: &Path) -> Result<Vec<u8>> {
        let (output, outcome) = self.attempt(arguments, about, &mut |_| {})?;
        outcome.map(|()| output)
    }

    /// As [`Program::run`]; of a program that ended badly the output comes too. `hear` is given each line of it while the program runs.
    pub fn attempt<S: AsRef<OsStr>>(
        self,
        arguments: impl IntoIterator<Item = S> + Clone,
        about: &Path,
        hear: &mut dyn FnMut(&str),
    ) -> Result<(Vec<u8>, Result<()>)> {
        let _running = tracing::debug_span!("program", name = %self.name).entered();
        for _ in 0..ATTEMPTS {
            let (mut running, _) = self.start(arguments.clone(), about)?;
            let (to, lines) = mpsc::channel();
            let output = running.child.stdout.take().map(|pipe| listen(pipe, to));
            if !running.is_done(about, &mut || lines.try_iter().for_each(|line: String| hear(&line)))? {
                continue;
            }
            lines.iter().for_each(|line| hear(&line));
            let output = output.and_then(|output| output.join().ok()).unwrap_or(Ok(Vec::new()));
            let (status, said) = running.end(about)?;
            let output = output.map_err(|fault| {
                Error::data(about, "", format!("{} cannot be heard: {fault}", self.name), "try again")
            })?;
            if status.success() {
                return Ok((output, Ok(())));
            }
            // COLMAP tells some of its faults on standard output.
            let last = last_line(&said).or_else(|| last_line(&String::from_utf8_lossy(&output)));
            let last = last.map_or_else(String::new, |line| format!(": {line}"));
            let reason = format!("{} failed ({status}){last}", self.name);
            return Ok((output, Err(Error::data(about, "", reason, self.failure))));
        }
        let reason = format!("{} slept for {} s, {ATTEMPTS} times", self.name, PATIENCE.as_secs());
        Err(Error::data(about, "", reason, "what is done is kept, so run the command again to go on"))
    }
}

impl Running {
    /// Waits for the end; what the program said on standard error comes with it.
    pub fn end(&mut self, about: &Path) -> Result<(ExitStatus, String)> {
        let status = self.child.wait().map_err(|fault| self.lost(about, &fault))?;
        // What cannot be read is not told.
        let said = self.said.take().and_then(|said| said.join().ok()?.ok()).unwrap_or_default();
        Ok((status, String::from_utf8_lossy(&said).into_owned()))
    }

    /// Waits for the end, calling `meanwhile`, or until the program has slept for longer than it may.
    fn is_done(&mut self, about: &Path, meanwhile: &mut dyn FnMut()) -> Result<bool> {
        let (mut pause, mut computed, mut since) = (Duration::from_millis(1), None, Instant::now());
        loop {
            if self.child.try_wait().map_err(|fault| self.lost(about, &fault))?.is_some() {
                return Ok(true);
            }
            meanwhile();
            let now = ticks_of_sleeper(self.child.id());
            if now.is_none() || now != computed {
                (computed, since) = (now, Instant::now());
            } else if since.elapsed() > PATIENCE {
                return Ok(false);
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(Duration::from_millis(50));
        }
    }

    fn lost(&self, about: &Path, fault: &std::io::Error) -> Error {
        Error::data(about, "", format!("{} cannot be waited for: {fault}", self.program.name), "try again")
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

fn listen(pipe: impl Read + Send + 'static, to: mpsc::Sender<String>) -> OutputReader {
    std::thread::spawn(move || {
        let (mut heard, mut pipe) = (Vec::new(), BufReader::new(pipe));
        loop {
            let start = heard.len();
            if pipe.read_until(b'\n', &mut heard)? == 0 {
                return Ok(heard);
            }
            // Nobody may listen any more.
            let _ = to.send(String::from_utf8_lossy(&heard[start..]).trim().to_owned());
        }
    })
}

/// Clock ticks that all threads of a sleeping process have computed; nothing while it works, or without `/proc`.
fn ticks_of_sleeper(id: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // After the name, which is in brackets and may hold anything: the state, and ten fields later the two times.
    let (_, fields) = stat.rsplit_once(") ")?;
    let mut fields = fields.split(' ');
    let sleeps = fields.next()? == "S";
    let times = fields.skip(10).take(2).map(|ticks| ticks.parse::<u64>().ok());
    times.sum::<Option<u64>>().filter(|_| sleeps)
}

/// The last line that says something; the trace of a crash does not.
pub(super) fn last_line(text: &str) -> Option<String> {
    let says = |line: &&str| !(line.is_empty() || line.starts_with('@') || line.starts_with("***"));
    let line = text.lines().rev().map(str::trim).find(says)?;
    Some(line.chars().take(300).collect())
}
