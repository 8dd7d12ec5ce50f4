//! `--trace`: the spans of a command as a file in Chrome's trace format.

use crate::ui::screen::alert;
use ivv::Error;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use tracing::Level;
use tracing_chrome::{ChromeLayerBuilder, FlushGuard};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;

/// The end of a list.
const END: &[u8] = b"\n]";
/// Separates two entries; no entry contains it.
const BETWEEN: &[u8] = b",\n";

pub struct Trace {
    path: PathBuf,
    guard: FlushGuard,
    fault: Fault,
}

/// The first fault of writing.
type Fault = Arc<Mutex<Option<io::Error>>>;

pub type Spans<S> = Box<dyn Layer<S> + Send + Sync>;

/// Begins the file `path`: the phases of the command and of each step, and at [`Level::TRACE`] each pass of the device.
pub fn begin<S>(path: &Path, log_level: Level) -> ivv::Result<(Spans<S>, Trace)>
where
    S: tracing::Subscriber + for<'span> tracing_subscriber::registry::LookupSpan<'span> + Send + Sync,
{
    let file = File::create(path).map_err(|e| cannot_write(path, &e))?;
    let fault = Fault::default();
    let writer = ListWriter { file, end: 0, rest: Vec::new(), fault: fault.clone() };
    let (layer, guard) = ChromeLayerBuilder::new().writer(writer).include_args(true).include_locations(false).build();
    // Spans of libraries would hide ours.
    let spans = Targets::new().with_target("ivv", log_level.max(Level::DEBUG));
    Ok((Box::new(layer.with_filter(spans)), Trace { path: path.to_owned(), guard, fault }))
}

/// Completes the file of a command that ended with `done`, and returns the first error of both.
pub fn end(trace: Option<Trace>, done: anyhow::Result<()>) -> anyhow::Result<()> {
    let Some(Trace { path, guard, fault }) = trace else { return done };
    drop(guard);
    let fault = fault.lock().unwrap_or_else(PoisonError::into_inner).take().map(|fault| cannot_write(&path, &fault));
    match (done, fault) {
        (Ok(()), Some(fault)) => Err(fault.into()),
        (Err(error), Some(fault)) => {
            alert!("ivv: {fault}");
            Err(error)
        }
        (done, None) => done,
    }
}

fn cannot_write(path: &Path, fault: &io::Error) -> Error {
    Error::data(path, "", format!("the trace cannot be written: {fault}"), "free space or choose another file")
}

/// Keeps the file a complete list at any time, because a command may be killed. An error ends the trace and nothing else.
struct ListWriter {
    file: File,
    /// Where the last whole entry ends.
    end: u64,
    /// The bytes after it: the beginning of an entry.
    rest: Vec<u8>,
    fault: Fault,
}

impl ListWriter {
    /// Writes the first `n` bytes of the rest, then `tail`, which the next write replaces.
    fn put(&mut self, n: usize, tail: &[u8]) {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        if fault.is_some() {
            return;
        }
        let text = [&self.rest[..n], tail].concat();
        let written = self.file.seek(SeekFrom::Start(self.end)).and_then(|_| self.file.write_all(&text));
        *fault = written.err();
        self.end += n as u64;
        self.rest.drain(..n);
    }
}

impl Write for ListWriter {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        self.rest.extend_from_slice(text);
        let last = self.rest.windows(BETWEEN.len()).rposition(|two| two == BETWEEN);
        if let Some(n @ 1..) = last {
            self.put(n, END);
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.rest.ends_with(END) {
            self.put(self.rest.len(), &[]);
        }
        Ok(())
    }
}
